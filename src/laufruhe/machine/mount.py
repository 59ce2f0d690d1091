"""Engine mounts."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError

Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]
UPRIGHT: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Mount:
    """A spring between engine and ground.

    Attributes
    ----------
    position
        (x, y, z) [m] (C2).
    stiffness
        Along its own three axes [N/m]; a rigid mounting uses only the ratios, and
        zero marks a direction that the mount does not carry.
    orientation
        Rows are the mount's own axes in the axes of C2.
    loss_factor
        Hysteretic: K becomes K (1 + i eta); damping work over work of deformation
        over 2 pi (eq. 40).
    damping
        Viscous, along its own three axes [N s/m].
    stop_gap
        Travel along each own axis at which a bump stop is met [m]; time domain only.
    stop_stiffness
        Added beyond the gap [N/m].
    """

    name: str
    position: Vector3
    stiffness: Vector3 = (0.0, 1.0, 1.0)
    orientation: Matrix3 = UPRIGHT
    loss_factor: float = 0.0
    damping: Vector3 = (0.0, 0.0, 0.0)
    stop_gap: float = math.inf
    stop_stiffness: float = 0.0

    def __post_init__(self) -> None:
        for what, value in (("stiffness", min(self.stiffness)), ("damping", min(self.damping)),
                            ("loss factor", self.loss_factor), ("stop stiffness", self.stop_stiffness)):  # fmt: skip
            if not value >= 0.0:
                raise ModelError(f"mount '{self.name}' has a negative {what}, {value:g}; give zero or more")
        if not self.stop_gap > 0.0:
            raise ModelError(f"mount '{self.name}' has a stop gap of {self.stop_gap:g} m; it must be positive")

    @property
    def stiffness_matrix(self) -> NDArray[np.float64]:
        """3 x 3 stiffness in the axes of C2 (E2)."""
        return self._in_c2(self.stiffness)

    @property
    def damping_matrix(self) -> NDArray[np.float64]:
        """3 x 3 viscous damping in the axes of C2 (E2)."""
        return self._in_c2(self.damping)

    def _in_c2(self, diagonal: Vector3) -> NDArray[np.float64]:
        axes = np.array(self.orientation)
        return np.asarray(axes.T @ np.diag(diagonal) @ axes)
