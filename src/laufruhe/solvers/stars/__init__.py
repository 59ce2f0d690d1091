"""Stars, firing orders and shafts, with everything else at its own optimum."""
