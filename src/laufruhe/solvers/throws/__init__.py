"""Throws that leave the even steps."""
