"""From decisions to loads: one protocol, affine and smooth views."""
