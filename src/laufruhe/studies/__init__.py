"""Sweeps and comparisons: many designs, one labelled table."""
