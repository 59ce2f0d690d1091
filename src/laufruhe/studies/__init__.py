"""Sweeps and comparisons described by study files."""
