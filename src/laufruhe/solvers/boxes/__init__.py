"""Search of open numbers without a convex program over boxes, which extensions share."""
