"""Unbalances decided by second-order cone programs."""
