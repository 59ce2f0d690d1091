"""Lower bounds over boxes of leads, sizes, flywheels and crankshafts."""
