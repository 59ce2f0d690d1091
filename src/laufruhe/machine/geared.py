"""Inertia on shafts other than the crank."""

from __future__ import annotations

from dataclasses import dataclass

from laufruhe.errors import ModelError


@dataclass(frozen=True)
class GearedInertia:
    """A second crank, or a flywheel of its own, geared to the crank.

    Attributes
    ----------
    ratio
        Speed over crank speed; negative runs against the crank (C3).
    share
        Of the inertia of all that turns, reduced to the crank: n^2 J_n over the sum of all (L8).
    """

    name: str
    ratio: float
    share: float

    def __post_init__(self) -> None:
        if self.ratio == 0.0:
            raise ModelError(f"geared inertia '{self.name}' has ratio 0: what stands still takes no part")
        if not 0.0 <= self.share <= 1.0:
            raise ModelError(f"geared inertia '{self.name}' has a share of {self.share:g}; it lies between 0 and 1")
