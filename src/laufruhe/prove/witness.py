"""Bounds around a known design: whoever bounds is also asked about a thin part that holds the best design.

A bound that is right is nowhere over the objective of a design that exists. So each bounder states a part around a
design and bounds it raw, and what it says is compared with the objective. Parts of a division that hold the design are
compared too, and so is what a certificate says of all designs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.witness import check_bound, is_over

D = TypeVar("D", contravariant=True)
P = TypeVar("P")

THIN = 1e-6
"""Share of each side by which a part around a design reaches to either side."""


@dataclass(frozen=True, eq=False)
class Known:
    """A design that keeps all limits, the witness of bounds.

    Attributes
    ----------
    place
        Open numbers, in the coordinates of the bounds.
    value
        Objective [SI].
    read
        Objective with what its samples may have missed and what counts as zero, where it takes time to tell.
    """

    place: Array
    value: float
    read: Callable[[], float] | None = None

    @cached_property
    def maximum(self) -> float:
        """Return the value, read finely where `read` is given, that no bound of a part with the design exceeds."""
        return self.value if self.read is None else self.read()

    def check(self, what: str, bound: float) -> None:
        """Report a bound that lies over the design."""
        if is_over(bound, self.value) and is_over(bound, self.maximum):
            check_bound(what, bound, self.maximum)


class Bounder(Protocol[D, P]):
    """Whoever bounds parts of what is open."""

    @property
    def what(self) -> str:
        """Name of the parts that are bounded."""

    def around(self, design: D) -> P | None:
        """Return a thin part that holds a design; None where it cannot be stated."""

    def bound(self, part: P) -> float:
        """Return what no design of a part goes under, raw: infinite where it says that none is allowed."""


def check_around(bounder: Bounder[D, P], design: D, known: Known) -> bool:
    """Return whether a bounder can state a part around a known design; report a bound of it that is over the design."""
    part = bounder.around(design)
    if part is None:
        return False
    known.check(f"{bounder.what}, around the known design", bounder.bound(part))
    return True


def thin(place: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return a thin box around a place, inside bounds."""
    reach = THIN * (upper - lower)
    return np.clip(place - reach, lower, upper), np.clip(place + reach, lower, upper)
