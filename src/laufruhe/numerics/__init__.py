"""Numerics without engines: exact angles, spectra, norms, maths namespaces, executors."""
