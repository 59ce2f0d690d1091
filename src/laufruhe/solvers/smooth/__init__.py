"""Smooth nonlinear programs and the local searches that use them."""
