"""Torque that the driven machine takes over the crank angle (T12)."""

from __future__ import annotations

from dataclasses import dataclass, field

from laufruhe.errors import ModelError


@dataclass(frozen=True)
class LoadTorque:
    """Torque of the driven machine, reduced to the crank.

    Attributes
    ----------
    angles
        Ascending crank angles of one period [rad]; the end may repeat the beginning.
    torques
        Torque at these angles [N m], positive if it takes power.
    periods
        Number of periods in a cycle.
    recording
        Sentences about how the file was read.
    """

    angles: tuple[float, ...]
    torques: tuple[float, ...]
    periods: int = 1
    recording: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if len(self.angles) != len(self.torques) or len(self.angles) < 4:
            raise ModelError("a load torque needs four angles at least, and one torque for each; add points")
