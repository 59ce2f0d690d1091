"""Physics of the engine: kinematics, gas, shaking loads, mount forces, metrics."""
