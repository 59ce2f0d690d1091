"""Engine mounts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]
UPRIGHT: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Mount:
    """A spring between engine and ground.

    Attributes
    ----------
    name
        Unique in an engine.
    position
        (x, y, z) [m] (C2).
    stiffness
        Along its own three axes [N/m]; a rigid mounting uses only the ratios, and
        zero marks a direction that the mount does not carry.
    orientation
        Rows are the mount's own axes in the axes of C2.
    """

    name: str
    position: Vector3
    stiffness: Vector3 = (0.0, 1.0, 1.0)
    orientation: Matrix3 = UPRIGHT

    @property
    def stiffness_matrix(self) -> NDArray[np.float64]:
        """3 x 3 stiffness in the axes of C2."""
        axes = np.array(self.orientation)
        return np.asarray(axes.T @ np.diag(self.stiffness) @ axes)
