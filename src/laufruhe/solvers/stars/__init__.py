"""Solve for crank stars, firing orders and balancer shafts, with all other decisions at their optimum."""
