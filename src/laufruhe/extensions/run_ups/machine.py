"""Definition of run-up and shut-down of an engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from laufruhe.machine.extra import Extra


@dataclass(frozen=True)
class Run(Extra):
    """Run from rest to a speed [rad/s] and back, at constant acceleration each way.

    Attributes
    ----------
    up, down
        Time of run-up and of shut-down [s].
    point
        Name of the operating point whose gas drives the run; "" for the slowest.
    """

    name: ClassVar[str] = "run-up"
    speed: float
    up: float
    down: float
    point: str = ""
