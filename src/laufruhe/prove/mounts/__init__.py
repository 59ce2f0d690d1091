"""Lower bounds of designs on open mounts by boxes of stiffness."""
