"""Engine mounts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine.dynamic import Dynamic
from laufruhe.numerics.arrays import Array

Vector3 = tuple[float, float, float]
Matrix3 = tuple[Vector3, Vector3, Vector3]
UPRIGHT: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Mount:
    """A spring between engine and ground, or several springs that are joined at one point.

    Attributes
    ----------
    position
        Position (x, y, z) [m] (C2).
    stiffness
        Stiffness along its own three axes [N/m], zero along an axis that carries nothing. A rigid mounting uses the
        ratios alone.
    orientation
        Matrix whose rows are the mount's own axes in the axes of C2.
    loss_factor
        Hysteretic loss factor eta: K becomes K (1 + i eta); damping work over work of deformation over 2 pi (eq. 40).
    damping
        Viscous damping along its own three axes [N s/m].
    lag
        Further viscous damping over stiffness, along each axis [s] (E48).
    dynamic
        Further springs along its own axes, whose stiffness depends on frequency (E50, E51).
    joined
        Further springs at the same place; the sum of all forces there is one mount force (E49).
    stop_gap
        Travel along each own axis at which a bump stop is met [m]; time domain only.
    stop_stiffness
        Stiffness that the bump stop adds beyond the gap [N/m].
    """

    name: str
    position: Vector3
    stiffness: Vector3 = (0.0, 1.0, 1.0)
    orientation: Matrix3 = UPRIGHT
    loss_factor: float = 0.0
    damping: Vector3 = (0.0, 0.0, 0.0)
    stop_gap: float = math.inf
    stop_stiffness: float = 0.0
    lag: float = 0.0
    joined: tuple[Mount, ...] = ()
    dynamic: tuple[Dynamic, ...] = ()
    powers: ClassVar = {"position": (0, 1)}

    def __post_init__(self) -> None:
        for what, value in (("stiffness", min(self.stiffness)), ("damping", min(self.damping)),
                            ("loss factor", self.loss_factor), ("stop stiffness", self.stop_stiffness),
                            ("damping per stiffness", self.lag)):  # fmt: skip
            if not value >= 0.0:
                raise ModelError(f"mount '{self.name}' has a negative {what}, {value:g}; give zero or more")
        if not self.stop_gap > 0.0:
            raise ModelError(f"mount '{self.name}' has a stop gap of {self.stop_gap:g} m; it must be positive")

    @property
    def springs(self) -> tuple[Mount, ...]:
        """Springs of the mount, each as a mount without joined springs."""
        return (replace(self, joined=()), *self.joined) if self.joined else (self,)

    @property
    def at_rest(self) -> Vector3:
        """Static stiffness along its own three axes, frequency-dependent springs included (E50) [N/m]."""
        if not self.dynamic:
            return self.stiffness
        x, y, z = (k + sum(law.static for law in self.dynamic if law.axis == a) for a, k in enumerate(self.stiffness))
        return x, y, z

    @property
    def depends_on_frequency(self) -> bool:
        """True if the stiffness of a spring of the mount depends on frequency."""
        return any(spring.dynamic for spring in self.springs)

    def mapped(self, change: Callable[[Mount], Mount]) -> Mount:
        """Return the mount with a change of every spring."""
        changed = change(replace(self, joined=())) if self.joined else change(self)
        return replace(changed, joined=tuple(map(change, self.joined))) if self.joined else changed

    @property
    def stiffness_matrix(self) -> Array:
        """Stiffness matrix at rest, shape (3, 3), in the axes of C2 (E2)."""
        return self._in_c2(lambda spring: spring.at_rest)

    @property
    def loss_matrix(self) -> Array:
        """Matrix of stiffness times loss factor, shape (3, 3), in the axes of C2 (E2)."""
        return self._in_c2(lambda spring: tuple(spring.loss_factor * k for k in spring.stiffness))

    @property
    def damping_matrix(self) -> Array:
        """Matrix of viscous damping, shape (3, 3), in the axes of C2 (E2, E48)."""
        return self._in_c2(
            lambda spring: tuple(c + spring.lag * k for c, k in zip(spring.damping, spring.stiffness, strict=True))
        )

    def _in_c2(self, diagonal: Callable[[Mount], Sequence[float]]) -> Array:
        total = np.zeros((3, 3))
        for spring in self.springs:
            axes = np.array(spring.orientation)
            total += axes.T @ np.diag(diagonal(spring)) @ axes
        return total


def every_spring(mounts: Sequence[Mount]) -> list[tuple[int, Mount]]:
    """Return all springs in the order of the mounts, each with the index of its mount."""
    return [(place, spring) for place, mount in enumerate(mounts) for spring in mount.springs]
