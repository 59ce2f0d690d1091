"""What no stars and no throws do better than."""
