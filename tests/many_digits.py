"""Order coefficients in 50 digits, the reference of the closed forms at the extremes."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from laufruhe.physics.order_coefficients import orders_needed

DIGITS = 50


@lru_cache(maxsize=32)
def acceleration_orders(rod_ratio: float, offset_ratio: float, highest: int) -> NDArray[np.complex128]:
    """Return the coefficients of s''/r by the trapezoidal rule on K6 in 50 digits, rounded once at the end.

    The rule is exact but for orders above the number of steps, which fall geometrically.
    """
    import mpmath

    steps = 2 * (highest + orders_needed(rod_ratio, offset_ratio)) + 64
    with mpmath.workdps(DIGITS):
        lam, eps = mpmath.mpf(rod_ratio), mpmath.mpf(offset_ratio)
        turn = [mpmath.expjpi(mpmath.mpf(2 * k) / steps) for k in range(steps)]
        values = []
        for point in turn:
            cosine, sine = point.real, point.imag
            tilt = lam * sine - eps
            rod = mpmath.sqrt((1 - tilt) * (1 + tilt))
            values.append(-cosine + sine * tilt / rod - lam * cosine**2 / rod**3)
        sums = [
            mpmath.fsum(v * mpmath.conj(turn[h * k % steps]) for k, v in enumerate(values)) * 2 / steps
            for h in range(highest + 1)
        ]
        out = np.array([complex(s) for s in sums])
    out[0] /= 2.0
    return out
