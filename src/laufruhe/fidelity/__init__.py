"""Automatic choice of fidelity, its explanation, and error bounds of cheaper models."""
