"""Laufruhe."""
