"""Motion of points, wrenches and springs of a rigid body (M1, E1, E2).

The kernels take the maths namespace of `numerics.namespaces`: one formula for numbers
and for symbols.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from laufruhe.numerics.namespaces import Maths


def point_motion(lib: Maths, arm: Sequence[Any]) -> Any:
    """Return the motion of a point per motion (u, theta) of the body, u + theta x arm, shape (3, 6) (M1, E1)."""
    x, y, z = arm
    return lib.matrix([[1.0, 0.0, 0.0, 0.0, z, -y], [0.0, 1.0, 0.0, -z, 0.0, x], [0.0, 0.0, 1.0, y, -x, 0.0]])


def moved_wrench(lib: Maths, place: Sequence[Any]) -> Any:
    """Return the map of a wrench from the origin to a place, M - place x F, shape (6, 6) (E1)."""
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
    """Return the axes of C2 turned about x, then y, then z, as rows, shape (3, 3) (E2)."""
    (cx, sx), (cy, sy), (cz, sz) = ((lib.cos(a), lib.sin(a)) for a in angles)
    return lib.matrix(
        [
            [cz * cy, sz * cy, -sy],
            [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx],
            [cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx],
        ]
    )


def along_axes(lib: Maths, axes: Any, values: Sequence[Any]) -> Any:
    """Return A' diag(values) A: stiffness or damping along own axes, in the axes of C2, shape (3, 3) (E2)."""
    a, b, c = values
    return axes.T @ lib.matrix([[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]) @ axes


def carried(motion: Any, spring: Any) -> Any:
    """Return G' K G of one mount, shape (6, 6) (E3)."""
    return motion.T @ spring @ motion
