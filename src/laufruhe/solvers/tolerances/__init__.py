"""Designs for engines as they are built."""
