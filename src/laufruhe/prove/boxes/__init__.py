"""Lower bounds over boxes of lead angles, sizes of the running gear, flywheels and crankshafts."""
