"""Lower bounds of the objective over crank stars and throw angles."""
