"""Solve for decisions without a convex program by branch and bound: positions, phase leads, sizes."""
