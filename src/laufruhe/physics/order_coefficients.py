"""Order coefficients of the slider-crank in closed form (K7-K10).

With q_k chosen so that 1 -+ k sin alpha = (1 + q^2 -+ 2 q sin alpha) / (1 + q^2), the
cosine of the rod's angle is the modulus of an analytic function of E = e^{i alpha},

    cos psi = K |(1 + i q1 E)(1 - i q2 E)|,  K^2 = (1 - eps^2) / ((1 + q1^2)(1 + q2^2)),

so any power of it has the order coefficients of a product of two power series whose
terms obey a three-term recurrence (K8). No order is approximated: a coefficient is a
sum of terms that fall by q1 q2 from one to the next.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import ComplexArray

_TAIL = 1e-18
_QUARTERS = np.array([1.0, 1j, -1.0, -1j])
"""Powers of i."""
MAX_ORDER = 20_000


def _poles(rod_ratio: float, offset_ratio: float) -> tuple[float, float, float]:
    """(q1, q2, q1 - q2) of K7, the difference without loss of digits."""
    k1, k2 = rod_ratio / (1.0 + offset_ratio), rod_ratio / (1.0 - offset_ratio)
    c1 = _complement(rod_ratio, offset_ratio)
    c2 = _complement(rod_ratio, -offset_ratio)
    q1, q2 = k1 / (1.0 + c1), k2 / (1.0 + c2)
    gap = -2.0 * offset_ratio * rod_ratio / ((1.0 - offset_ratio) * (1.0 + offset_ratio))
    both = k1 * c2 + k2 * c1
    sine_gap = gap * (k1 + k2) / both if both > 0.0 else 0.0
    cosine_gap = c1 * c2 + k1 * k2
    # tan x - tan y = sin(x - y) / (cos x cos y) at half the angles of sines k1, k2
    half_gap = sine_gap / math.sqrt(2.0 * (1.0 + cosine_gap))
    difference = half_gap * math.sqrt((1.0 + q1 * q1) * (1.0 + q2 * q2))
    return q1, q2, difference


def _complement(rod_ratio: float, offset_ratio: float) -> float:
    low = math.fsum((1.0, offset_ratio, -rod_ratio))
    high = math.fsum((1.0, offset_ratio, rod_ratio))
    return math.sqrt(low * high) / (1.0 + offset_ratio)


@lru_cache(maxsize=1024)
def orders_needed(rod_ratio: float, offset_ratio: float = 0.0) -> int:
    """Return the order beyond which every coefficient is under 1e-18 of the first, times its order squared."""
    q1, q2, _ = _poles(rod_ratio, offset_ratio)
    ratio = max(q1, q2)
    if ratio <= 0.0:
        return 2
    order = 4
    while order < MAX_ORDER and 2.0 * math.log(order) + order * math.log(ratio) > math.log(_TAIL):
        order = math.ceil(order * 1.1) + 1
    if order >= MAX_ORDER:
        raise ModelError(f"lambda (1 + |e|/r) = {rod_ratio + abs(offset_ratio):.9g} is too close to 1 to be resolved")
    return order


@lru_cache(maxsize=256)
def cos_psi_power_orders(power: float, rod_ratio: float, offset_ratio: float, highest: int) -> ComplexArray:
    """Return the coefficients c_h of (cos psi)^power = sum_h c_h e^{i h alpha}, h = -highest ... highest (K9)."""
    q1, q2, difference = _poles(rod_ratio, offset_ratio)
    scale = ((1.0 - offset_ratio) * (1.0 + offset_ratio) / ((1.0 + q1 * q1) * (1.0 + q2 * q2))) ** (power / 2.0)
    tail = orders_needed(rod_ratio, offset_ratio)
    # K8: coefficients of ((1 + q1 D)(1 - q2 D))^(power / 2), D = i E; they are real
    half, square, before, last = power / 2.0, -q1 * q2, 0.0, 1.0
    terms = [last]
    for j in range(highest + tail):
        before, last = last, (difference * (half - j) * last + square * (2.0 * half + 1.0 - j) * before) / (j + 1)
        terms.append(last)
    series = np.array(terms)
    upper = np.correlate(series, series[: tail + 1], "valid") * scale * _QUARTERS[np.arange(highest + 1) % 4]
    return _fixed(np.concatenate([upper[:0:-1].conj(), upper]))


def _fixed(coefficients: ComplexArray) -> ComplexArray:
    coefficients.setflags(write=False)
    return coefficients


def piston_acceleration_orders(rod_ratio: float, offset_ratio: float = 0.0, highest: int | None = None) -> ComplexArray:
    """Return the coefficients of s''/r in the local crank angle, shape (highest + 1,) (C8, K10).

    c_1 = -1 - ..., c_2 = -(lambda + lambda^3/4 + ...). As many orders are taken as matter if `highest` is left out.
    """
    needed = orders_needed(rod_ratio, offset_ratio)
    highest = needed if highest is None else highest
    return _acceleration_orders(rod_ratio, offset_ratio, highest + needed)[: highest + 1]


@lru_cache(maxsize=256)
def _acceleration_orders(rod_ratio: float, offset_ratio: float, highest: int) -> ComplexArray:
    # roll moments need more orders than forces, and both share these
    h = np.arange(highest + 1)
    out = np.zeros(highest + 1, dtype=complex)
    if rod_ratio > 0.0:
        rod = cos_psi_power_orders(1.0, rod_ratio, offset_ratio, highest)[highest:]
        out = -(h**2) * (2.0 / rod_ratio) * rod
    if highest >= 1:
        out[1] -= 1.0
    return _fixed(out)


def _two_sided(one_sided: ComplexArray) -> ComplexArray:
    half = one_sided / 2.0
    return np.concatenate([half[:0:-1].conj(), [one_sided[0].real], half[1:]])


def _one_sided(two_sided: ComplexArray, highest: int) -> ComplexArray:
    middle = len(two_sided) // 2
    out = 2.0 * two_sided[middle : middle + highest + 1]
    out[0] /= 2.0
    return _fixed(out)


@lru_cache(maxsize=256)
def inertia_roll_orders(rod_ratio: float, offset_ratio: float, ratio: float, highest: int) -> ComplexArray:
    """Return the coefficients of -s''/r (n s'/r + e/r), for a crank of ratio n (L3).

    Times m r^2 (n w)^2 it is the roll moment of the reciprocating mass.
    """
    count = highest + orders_needed(rod_ratio, offset_ratio)
    acceleration = _acceleration_orders(rod_ratio, offset_ratio, count)
    arm = ratio * _two_sided(acceleration / (1j * np.maximum(np.arange(count + 1), 1)))
    if rod_ratio > 0.0:
        arm[count] += offset_ratio / rod_ratio
    return _one_sided(-np.convolve(_two_sided(acceleration), arm, mode="same"), highest)


@lru_cache(maxsize=256)
def rod_roll_orders(rod_ratio: float, offset_ratio: float, ratio: float, highest: int) -> ComplexArray:
    """Return the coefficients of -psi'' (1 + n psi'), for a crank of ratio n (L4).

    Times dTheta (n w)^2 it is the roll moment of the rod's inertia deficit.
    """
    count = highest + orders_needed(rod_ratio, offset_ratio)
    inverse = cos_psi_power_orders(-1.0, rod_ratio, offset_ratio, count + 1)
    rate = rod_ratio * 0.5 * (inverse[2:] + inverse[:-2])
    h = np.arange(-count, count + 1)
    swing = ratio * rate
    swing[count] += 1.0
    return _one_sided(-np.convolve(1j * h * rate, swing, mode="same"), highest)
