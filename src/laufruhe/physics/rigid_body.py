"""Motion of points, wrenches (Fx, Fy, Fz, Mx, My, Mz) and springs of a rigid body (M1, E1, E2, C2).

The kernels take the maths namespace of `numerics.namespaces`: one formula for numbers
and for symbols.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Shaft
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import Maths


def point_motion(lib: Maths, arm: Sequence[Any]) -> Any:
    """Return the motion of a point per motion (u, theta) of the body, u + theta x arm, shape (3, 6) (M1, E1)."""
    x, y, z = arm
    return lib.matrix([[1.0, 0.0, 0.0, 0.0, z, -y], [0.0, 1.0, 0.0, -z, 0.0, x], [0.0, 0.0, 1.0, y, -x, 0.0]])


def moved_wrench(lib: Maths, place: Sequence[Any]) -> Any:
    """Return the matrix that moves the reference of a wrench from the origin to `place`, shape (6, 6) (E1)."""
    x, y, z = place
    return lib.matrix(
        [
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, z, -y, 1.0, 0.0, 0.0],
            [-z, 0.0, x, 0.0, 1.0, 0.0],
            [y, -x, 0.0, 0.0, 0.0, 1.0],
        ]
    )


def turned_axes(lib: Maths, angles: Sequence[Any]) -> Any:
    """Return the axes of a turned mount as rows, shape (3, 3): those of C2 turned about x, then y, then z (E2)."""
    (cx, sx), (cy, sy), (cz, sz) = ((lib.cos(a), lib.sin(a)) for a in angles)
    return lib.matrix(
        [
            [cz * cy, sz * cy, -sy],
            [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx],
            [cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx],
        ]
    )


def turns_of(axes: Array) -> tuple[float, float, float]:
    """Return the turns about x, then y, then z that give these axes as rows [rad]: the inverse of `turned_axes`."""
    about_x = math.atan2(axes[1, 2], axes[2, 2])
    # the second axis with the turn about x undone lies in the plane of x and y
    second = math.cos(about_x) * axes[1] - math.sin(about_x) * axes[2]
    about_y = math.atan2(-axes[0, 2], math.hypot(axes[0, 0], axes[0, 1]))
    return about_x, about_y, math.atan2(-second[0], second[1])


def along_axes(lib: Maths, axes: Any, values: Sequence[Any]) -> Any:
    """Return A' diag(values) A: stiffness or damping along own axes, in the axes of C2, shape (3, 3) (E2)."""
    a, b, c = values
    return axes.T @ lib.matrix([[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]) @ axes


def carried(motion: Any, spring: Any) -> Any:
    """Return G' K G of one mount, shape (6, 6) (E3)."""
    return motion.T @ spring @ motion


WRENCH = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
ROLL = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])


def plane_wrench(lateral: Any, vertical: Any, x: float, shaft: Shaft) -> NDArray[Any]:
    """Return the wrench of a force in the plane at x through a shaft's axis, shape (6, ...) of forces (...) (C2)."""
    return np.array(plane_parts(lateral, vertical, x, shaft))


def plane_parts(lateral: Any, vertical: Any, x: float, shaft: Shaft) -> tuple[Any, Any, Any, Any, Any, Any]:
    """Return the six parts of that wrench."""
    roll = shaft.y * vertical - shaft.z * lateral
    return lateral - lateral, lateral, vertical, roll, -x * vertical, x * lateral


def turning_parts(lateral: Any, vertical: Any) -> tuple[Any, Any]:
    """Return the parts of z + i y that turn with the crank, as e^{i h phi}, and against it, as e^{-i h phi} (C4)."""
    return 0.5 * (vertical + 1j * lateral), 0.5 * np.conj(vertical - 1j * lateral)
