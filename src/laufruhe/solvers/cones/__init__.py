"""Solve for unbalances by second-order cone programs."""
