"""What a channel is asked, and of what."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from laufruhe.machine import Engine
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.loads import PointLoads


class Asked(Protocol):
    """How a measure narrows its channel."""

    @property
    def points(self) -> tuple[str, ...] | None:
        """Operating points that count."""

    @property
    def orders(self) -> tuple[float, ...] | None:
        """Orders that count."""

    @property
    def motions(self) -> tuple[str, ...] | None:
        """Motions that are to have a mode of their own."""

    @property
    def rotors(self) -> tuple[str, ...] | None:
        """Rotors, or shafts, that count."""

    @property
    def cases(self) -> tuple[str, ...] | None:
        """Load cases that count."""

    @property
    def direction_weights(self) -> tuple[float, float, float] | None:
        """Factors on the components of what is measured at places."""

    def places(self, names: Sequence[str]) -> list[int]:
        """Of the places that count among all of these names."""

    @property
    def frequency(self) -> tuple[float, float]:
        """Least and largest wanted about the torque-roll axis [Hz]."""

    @property
    def wanted(self) -> float:
        """Share of a motion that is enough."""


class Answered(Protocol):
    """A design and its loads."""

    @property
    def engine(self) -> Engine:
        """The design."""

    @property
    def loads(self) -> tuple[PointLoads, ...]:
        """Per operating point."""

    @property
    def fidelity(self) -> Fidelity:
        """What of the physics is kept."""
