"""Angles as exact fractions of a turn, so that sums that cancel over a crank star are exactly zero.

Crank throws, banks and firing intervals are rational fractions of a turn, and so are their products with orders. Their
sines and cosines come from one table that is symmetric to the last bit. A sum over a star then cancels exactly, or to
a rounding error that is set to zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

MAX_DENOMINATOR = 20_000
SAME_TURN = 1e-9
_EPS = float(np.finfo(float).eps)

Turn: TypeAlias = Fraction | float


@lru_cache(maxsize=4096)
def as_turn(angle: float) -> Turn:
    """Return an angle [rad] in turns, exact if it is a rounded rational.

    A float within four rounding errors of a fraction with a denominator of at most 20 000 becomes this fraction; any
    other stays a float.
    """
    turn = angle / math.tau
    nearest = Fraction(turn).limit_denominator(MAX_DENOMINATOR)
    return nearest if abs(float(nearest) - turn) <= 4 * _EPS * max(abs(turn), 1.0) else turn


def reduced_turn(turn: Turn, period: int) -> Turn:
    """Return an angle in turns reduced to 0 ... period; a rounding error below the period is zero."""
    remainder = turn % period
    return remainder if period - remainder > SAME_TURN else Fraction(0)


@lru_cache(maxsize=4096)
def direction(angle: float) -> Turn:
    """Return an angle [rad] in turns, reduced to one turn: equal for equal directions."""
    return reduced_turn(as_turn(angle), 1)


def angle_of(turn: Turn) -> float:
    """Return turns in radians."""
    return math.tau * float(turn)


# typed, because a float equals a fraction whose sine has other last digits
@lru_cache(maxsize=4096, typed=True)
def cis(turn: Turn) -> complex:
    """Return e^{2 pi i turn}, with every symmetry of the circle exact to the last bit.

    For a Fraction the value is exact at multiples of 1/8 and 1/12 turn, and symmetric about axes and diagonals.
    """
    if not isinstance(turn, Fraction):
        return complex(math.cos(math.tau * turn), math.sin(math.tau * turn))
    eighths, remainder = divmod(turn % 1, Fraction(1, 8))
    odd = eighths % 2 == 1
    small = Fraction(1, 8) - remainder if odd else remainder
    cosine, sine = _first_octant(small)
    if odd:
        cosine, sine = sine, cosine
    quadrant = int(eighths) // 2
    return (complex(cosine, sine), complex(-sine, cosine), complex(-cosine, -sine), complex(sine, -cosine))[quadrant]


def _first_octant(turn: Fraction) -> tuple[float, float]:
    if turn == 0:
        return 1.0, 0.0
    if turn == Fraction(1, 12):
        return math.sqrt(3.0) / 2.0, 0.5
    if turn == Fraction(1, 8):
        return math.sqrt(0.5), math.sqrt(0.5)
    return math.cos(math.tau * float(turn)), math.sin(math.tau * float(turn))


@lru_cache(maxsize=256)
def _roots(denominator: int) -> NDArray[np.complex128]:
    # `cis` of the turns 0, 1 / denominator, 2 / denominator ...
    table = np.array([cis.__wrapped__(Fraction(k, denominator)) for k in range(denominator)])
    table.setflags(write=False)
    return table


def phasors(turns: Sequence[Turn], multiples: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Return e^{2 pi i m t} for each multiple m of the base order and angle t in turns, shape (multiples, turns).

    Exact fractions give table values, floats plain exponentials.
    """
    waves = np.empty((len(multiples), len(turns)), dtype=complex)
    for column, turn in enumerate(turns):
        if isinstance(turn, Fraction) and turn.denominator <= MAX_DENOMINATOR:
            index = (multiples * (turn.numerator % turn.denominator)) % turn.denominator
            waves[:, column] = _roots(turn.denominator)[index]
        else:
            waves[:, column] = np.exp(2j * np.pi * ((multiples * float(turn)) % 1.0))
    return waves


def star_sum(
    weights: NDArray[np.float64], turns: Sequence[Turn], multiples: NDArray[np.int64]
) -> NDArray[np.complex128]:
    """Return the sums over a crank star sum_k w_k e^{2 pi i m t_k}, shape (multiples, c), with exact zeros.

    m are multiples of the base order. The n members k of the star have weights w in c components, shape (n, c), and
    angles t in turns. Real and imaginary parts below the rounding error of their sum, (n + 2) eps sum |w|, are zero.
    """
    waves = phasors(turns, multiples)
    return _flushed((waves @ weights).view(float), _rounding(len(weights)) * np.abs(weights).sum(axis=0).repeat(2))


def star_orders(weights: NDArray[np.float64], turns: tuple[Turn, ...], count: int) -> NDArray[np.complex128]:
    """Return the sums of `star_sum` for the multiples 0 ... count - 1, shape (count, c)."""
    return star_sum(weights, turns, np.arange(count))


def cancelling_sums(values: NDArray[np.complex128], indices: tuple[int, ...]) -> NDArray[np.complex128]:
    """Return the sums of those values, shape (n, c), that have equal indices, shape (largest index + 1, c).

    Sums below their rounding error are zero.
    """
    # products with matrices of zeros and ones take less time than loops
    members = (np.arange(max(indices) + 1)[:, None] == np.array(indices)).astype(float)
    parts = values.view(float)
    sizes = members @ np.abs(parts).reshape(len(parts), -1, 2).sum(axis=2)
    return _flushed(members @ parts, _rounding(len(indices)) * sizes.repeat(2, axis=1))


def _rounding(count: int) -> float:
    return (count + 2) * _EPS


def _flushed(sums: NDArray[np.float64], minimum: NDArray[np.float64]) -> NDArray[np.complex128]:
    sums[np.abs(sums) <= minimum] = 0.0
    return sums.view(complex)
