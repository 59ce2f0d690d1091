"""Lower bounds over crank stars and throws."""
