"""How an engine is run up from rest, and shut down again."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Run:
    """From rest to a speed and back, at a constant rate each way.

    Attributes
    ----------
    speed
        At the end of the run-up [rad/s].
    up, down
        Time of run-up and of shut-down [s].
    point
        Name of the operating point whose gas drives the engine meanwhile; the slowest where it is empty.
    """

    speed: float
    up: float
    down: float
    point: str = ""
