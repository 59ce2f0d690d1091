"""What the engine does: kinematics, gas, shaking loads, mount forces, metrics."""
