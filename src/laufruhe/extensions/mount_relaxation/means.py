"""A mean over operating points as a sum of roots of heads, odd multiples of their orders taken off (E54, E58)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.mount_relaxation.bound import Goal
from laufruhe.extensions.mount_relaxation.high_orders import AtMost, constant
from laufruhe.extensions.mount_relaxation.orders import COSINE, Head
from laufruhe.numerics.arrays import Array

# averages over two samples that are tried
SHIFTS = 24


@dataclass(frozen=True, eq=False)
class Mean:
    """The mean is not under prices' roots + along' s + constant, nor under `floor`.

    Attributes
    ----------
    prices
        Of the roots, in their units.
    least, top
        Ends of the roots, in their units.
    """

    prices: Array
    along: Array
    constant: float
    floor: float
    least: Array
    top: Array

    def goal(self, size: float, most: float, root: int | None = None) -> Goal:
        """Designs with a mean that is not over a number, in a unit."""
        return Goal(self.along / size, (most - self.constant) / size, root)


@dataclass(frozen=True, eq=False)
class _Shown:
    """A norm is not under ratio root - taken, nor ratio root - most, for any of these."""

    ratio: float
    taken: AtMost
    most: float

    def worth(self, root: float) -> float:
        """What it shows of the best design."""
        return self.ratio * root - self.taken.near


def mean_of(heads: Sequence[Head], felt: Sequence[Sequence[AtMost]], least: Array, most: float, numbers: int) -> Mean:
    """Of designs with a mean that is not over a number, with roots that are not under these.

    Parameters
    ----------
    felt
        Of every head what is felt of its multiples at most.
    """
    shares, units = (np.array([getattr(head, name) for head in heads]) for name in ("share", "unit"))
    shown = [_shown(head, own, numbers) for head, own in zip(heads, felt, strict=True)]
    norms = np.array([
        max([0.0, *(each.ratio * root - each.most for each in own)])
        for own, root in zip(shown, least, strict=True)
    ])  # fmt: skip
    floor = float(shares @ norms)
    left = (most - floor) / shares + norms
    top = np.array([
        min((norm + each.most) / each.ratio for each in own) for own, norm in zip(shown, left, strict=True)
    ])  # fmt: skip
    # what shows most of the best design
    chosen = [max(own, key=lambda each: each.worth(unit)) for own, unit in zip(shown, units, strict=True)]
    ratios = np.array([each.ratio for each in chosen])
    along = -sum((share * each.taken.slopes for share, each in zip(shares, chosen, strict=True)), np.zeros(numbers))
    given = -float(sum(share * each.taken.constant for share, each in zip(shares, chosen, strict=True)))
    return Mean(shares * units * ratios, along, given, floor, least / units, np.maximum(top, least) / units)


def _shown(head: Head, felt: Sequence[AtMost], numbers: int) -> list[_Shown]:
    """By averages over two samples apart, by the plain order, and by its cosine."""
    none = np.zeros(numbers)
    if not felt:
        return [_Shown(1.0, constant(head.loss, none), head.loss)]
    found = [_Shown(COSINE / head.factor, constant(0.0, none), 0.0)]
    for shift in sorted({round(k * head.phases / 4 / SHIFTS) for k in range(SHIFTS)}):
        ratio, weights = head.shifted(shift)
        parts = [each.told.times(weight) for each, weight in zip(felt, weights, strict=True)]
        most = sum(w * each.largest for each, w in zip(felt, weights, strict=True))
        found.append(_Shown(ratio, sum(parts, AtMost(0.0, none, 0.0)), most))
    return found
