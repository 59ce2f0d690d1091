"""What is not convex, divided into boxes: places, leads, flywheel, crankshaft, sizes."""
