"""Static load case: weight, torque, a bump."""

from __future__ import annotations

from dataclasses import dataclass

from laufruhe.machine.mount import Vector3


@dataclass(frozen=True)
class LoadCase:
    """Forces and moments on the block; travel counts from where it stands without them (E55).

    Attributes
    ----------
    times_weight
        The weight of the block so many times along x, y and z (C2).
    force, place
        A force [N], and where it acts [m].
    moment
        [N m].
    """

    name: str
    times_weight: Vector3 = (0.0, 0.0, 0.0)
    force: Vector3 = (0.0, 0.0, 0.0)
    place: Vector3 = (0.0, 0.0, 0.0)
    moment: Vector3 = (0.0, 0.0, 0.0)
