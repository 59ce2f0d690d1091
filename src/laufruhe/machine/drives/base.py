"""Base class of drives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from laufruhe.machine.layouts.base import Key
from laufruhe.machine.layouts.build import Mechanism
from laufruhe.machine.stroke import radius_for_stroke


@dataclass(frozen=True)
class Sizes:
    """Lengths of [engine], in SI.

    Attributes
    ----------
    rod_length, rod_ratio
        One of them, of a drive that has a rod.
    own
        The drive's own keys, None where left out.
    """

    stroke: float
    offset: float
    rod_length: float | None
    rod_ratio: float | None
    own: Mapping[str, Any]


class DriveKind(ABC):
    """Way in which a crank drives a piston rod or a ram; a new one is a file and a line in `DRIVES`.

    Attributes
    ----------
    keys
        Of [engine], beside those of every drive.
    has_rod
        Whether a connecting rod swings between crank pin and piston.
    """

    name: ClassVar[str]
    keys: ClassVar[tuple[Key, ...]] = ()
    has_rod: ClassVar[bool] = True

    def radius(self, sizes: Sizes) -> float:
        """Return the crank radius that makes the stroke [m].

        Raises
        ------
        ModelError
            If none does.
        """
        return radius_for_stroke(
            sizes.stroke, sizes.offset, rod_length=sizes.rod_length, rod_ratio=sizes.rod_ratio or 0.0
        )

    @abstractmethod
    def mechanism(self, plain: Mechanism, sizes: Sizes) -> Mechanism:
        """Return the mechanism of every cylinder from the numbers that all drives share."""
