"""Check bounds against a known design: no lower bound of a set of designs exceeds the objective of a design in it.

Every method bounds a thin set of designs around a known design, without any correction. The bound is compared with the
objective of that design. The bounds of all sets in a search that contain the design are compared too, and so is every
certificate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.witness import check_bound, is_over

THIN = 1e-6
"""Distance from a design to either end of a thin box around it, as a share of each side of the root box."""


@dataclass(frozen=True, eq=False)
class Witness:
    """Known feasible design whose objective no bound may exceed.

    Attributes
    ----------
    place
        Open numbers of the design, in the coordinates of the boxes that are bounded, shape (n,).
    value
        Objective at the samples of the problem [SI].
    evaluate_upper
        Function that returns `upper_value`, evaluated on demand because it is slow; None if that is `value`.
    """

    place: Array
    value: float
    evaluate_upper: Callable[[], float] | None = None

    @cached_property
    def upper_value(self) -> float:
        """Objective with its sampling error and numerical zero added, which no valid bound exceeds [SI]."""
        return self.value if self.evaluate_upper is None else self.evaluate_upper()

    def check(self, what: str, bound: float) -> None:
        """Report a bound [SI] that exceeds the objective of the design; `what` names the bound."""
        if is_over(bound, self.value) and is_over(bound, self.upper_value):
            check_bound(what, bound, self.upper_value)

    def check_near(self, what: str, bound: float) -> None:
        """Report a bound [SI] of a thin box around the design that exceeds its objective; `what` names the boxes."""
        self.check(f"{what}, around the known design", bound)


def thin_box(place: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Return the ends of a thin box around open numbers `place`, inside the box from `lower` to `upper`, shape (n,)."""
    margin = THIN * (upper - lower)
    return np.clip(place - margin, lower, upper), np.clip(place + margin, lower, upper)
