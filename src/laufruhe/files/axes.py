"""Axes of a vehicle or test bed in which mounts and block of a problem file are given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

import numpy as np

from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused
from laufruhe.files.fields import Table
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.rigid_body import turned_axes, turns_of

_NAMES = ("+x", "-x", "+y", "-y", "+z", "-z")
# cosine of the angle between crank and up that rounded directions may have
_SQUARE = 1e-3
Direction: TypeAlias = Annotated[
    f.Three[f.Factor] | Literal["+x", "-x", "+y", "-y", "+z", "-z"],
    f.OrWord(f.Three[f.Factor], "[0, -1, 0]", words=_NAMES),
]


class AxesTable(Table):
    """Axes of a file that are not those of the engine: where the engine points in them, and where it stands."""

    crank: Direction = f.required("Direction of the crank from the flywheel to the front, as an axis or a vector.")
    up: Direction = f.required("Direction of the engine's z axis, as an axis or a vector.")
    origin: f.Three[f.Length] | None = f.optional(
        "Position of the engine's origin: on the crank, midway between the first and the last cylinder."
    )


@dataclass(frozen=True)
class Axes:
    """Axes of a file.

    Attributes
    ----------
    rows
        Axes of the engine (C2) in the axes of the file, shape (3, 3).
    origin
        Position of the engine's origin in the axes of the file [m].
    """

    rows: Array
    origin: Array

    @property
    def are_own(self) -> bool:
        """True if the axes are parallel to those of the engine."""
        return bool(np.array_equal(self.rows, np.eye(3)))

    def place(self, position: Sequence[float]) -> list[float]:
        """Return a position in the axes of the engine [m]."""
        return [float(number) for number in self.rows @ (np.asarray(position) - self.origin)]

    def tensor(self, tensor: Array) -> Array:
        """Return a tensor in the axes of the engine, shape (3, 3)."""
        return self.rows @ tensor @ self.rows.T

    def turned(self, angles: Sequence[float]) -> list[float]:
        """Return the angles of a turned mount in the axes of the engine [rad] (E2)."""
        rows = np.array(turned_axes(NUMBERS, list(angles))) @ self.rows.T
        # a mirror image has the same stiffness with all its axes reversed
        rows *= np.sign(np.linalg.det(rows))
        return list(turns_of(rows))


ENGINE_AXES = Axes(np.eye(3), np.zeros(3))
"""Axes of the engine itself (C2)."""


def axes_of(table: AxesTable | None, where: str, is_mirrored: bool) -> Axes:
    """Return the axes of a table of the file; with `is_mirrored`, y of the engine points to the right."""
    if table is None:
        return ENGINE_AXES
    crank, up = (_vector(getattr(table, key), f"{where}.{key}") for key in ("crank", "up"))
    if abs(float(crank @ up)) > _SQUARE:
        angle = math.degrees(math.acos(float(np.clip(crank @ up, -1.0, 1.0))))
        rule = f"lies at {angle:.4g} deg to the crank"
        raise Refused(f"{where}.up", table.up, rule, "give a direction across the crank, at 90 deg")
    up = up - (up @ crank) * crank
    up /= np.linalg.norm(up)
    left = np.cross(up, crank)
    return Axes(np.array([crank, -left if is_mirrored else left, up]), np.array(table.origin or [0.0, 0.0, 0.0]))


def _vector(direction: str | Sequence[float], where: str) -> Array:
    if isinstance(direction, str):
        unit: Array = np.eye(3)["xyz".index(direction[1])]
        return unit if direction[0] == "+" else -unit
    length = float(np.linalg.norm(direction))
    if length == 0.0:
        raise Refused(where, list(direction), "has no direction", 'write for example "+x" or [0, -1, 0]')
    vector: Array = np.asarray(direction) / length
    return vector
