"""How an engine is run up from rest, and shut down again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

from laufruhe.machine.extra import Extra


@dataclass(frozen=True)
class Run(Extra):
    """Run from rest to a speed and back, at a constant rate each way.

    Attributes
    ----------
    speed
        Speed at the end of the run-up [rad/s].
    up, down
        Time of run-up and of shut-down [s].
    point
        Name of the operating point whose gas drives the engine meanwhile; the slowest where it is empty.
    """

    name: ClassVar[str] = "run-up"
    speed: float
    up: float
    down: float
    point: str = ""

    def scaled(self, _: float, __: float) -> Self:
        """Return the same: speeds and times have no size."""
        return self
