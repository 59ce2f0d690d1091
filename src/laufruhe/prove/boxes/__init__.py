"""What no leads, sizes, flywheels and crankshafts in a box do better than."""
