"""Lower bounds of objectives, and certificates of designs; solvers are in `laufruhe.solvers`."""
