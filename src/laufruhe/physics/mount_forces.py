"""Mount forces of an engine far above the resonances of its mounts (M1-M3)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import UncarriedLoadError
from laufruhe.machine import Mount
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.rigid_body import WRENCH, point_motion

FREE_STRETCH = 1e-10
UNCARRIED_SHARE = 1e-9


@dataclass(frozen=True, eq=False)
class RigidMounting:
    """Linear map from the wrench on the block to the forces on the mounts.

    Attributes
    ----------
    maps
        Shape (mounts, 3, 6): force of the engine on each mount [N] per wrench (C7).
    free
        Shape (k, 6), orthonormal in scaled wrenches: what no mount carries.
    arm
        Length that makes moments comparable with forces [m].
    """

    maps: Array
    free: Array
    arm: float

    def forces(self, wrench: Spectrum, speed: float = 0.0) -> Spectrum:  # noqa: ARG002
        """Return the mount forces by order, shape (n, mounts, 3) [N]; equal at every speed."""
        self.check_carried(wrench)
        return wrench.mapped(self._forces_of)

    def _forces_of(self, loads: NDArray[Any]) -> NDArray[Any]:
        # memory holds mount by mount, as norms read their rows
        return np.asarray((loads @ self._columns).swapaxes(0, 1))

    @cached_property
    def _columns(self) -> Array:
        return np.ascontiguousarray(self.maps.swapaxes(1, 2))

    def check_carried(self, wrench: Spectrum) -> None:
        """Refuse a wrench along a direction that no mount carries."""
        if not self.free[:, wrench.components].any():
            return
        along = wrench.coefficients @ (self.free / _scales(self.arm)).T
        if not along.any():
            return
        size = float(np.abs(wrench.coefficients / _scales(self.arm)).max(initial=0.0))
        uncarried = np.abs(along @ self.free)
        if size > 0.0 and uncarried.max(initial=0.0) > UNCARRIED_SHARE * size:
            order, component = np.unravel_index(int(np.argmax(uncarried)), uncarried.shape)
            raise UncarriedLoadError(
                f"order {float(wrench.orders[order]):g} drives the engine along {WRENCH[component]}, which no mount "
                "carries; give a mount stiffness in that direction or a second place"
            )


@lru_cache(maxsize=256)
def rigid_mounting(mounts: tuple[Mount, ...]) -> RigidMounting:
    """Return the mounting F_i = K_i G_i (sum_j G_j^T K_j G_j)^+ w, by singular values (M1, M2)."""
    positions = np.array([mount.position for mount in mounts])
    arm = float(np.linalg.norm(positions, axis=1).max(initial=0.0)) or 1.0
    scales = _scales(arm)
    # displacements of the mount points per scaled motion (translation, arm * rotation)
    geometry = np.array([point_motion(NUMBERS, position) for position in positions]) / scales
    # K = L^T L, and A = L G instead of A^T A: half the digits that stiffness ratios cost are kept
    places, springs = zip(*every_spring(mounts), strict=True)
    largest = max(max(spring.at_rest) for spring in springs)
    roots = np.array([np.sqrt(np.divide(m.at_rest, largest))[:, None] * np.array(m.orientation) for m in springs])
    stretches = np.einsum("mab,mbj->maj", roots, geometry[list(places)])
    left, values, right = np.linalg.svd(stretches.reshape(-1, 6), full_matrices=True)
    rank = int(np.sum(values > FREE_STRETCH * values[0]))
    shares = (left[:, :rank] / values[:rank]).reshape(len(springs), 3, rank)
    maps = np.zeros((len(mounts), 3, 6))
    np.add.at(maps, list(places), np.einsum("mba,mbr,rk->mak", roots, shares, right[:rank]) / scales)
    maps.setflags(write=False)
    return RigidMounting(maps, right[rank:], arm)


def _scales(arm: float) -> Array:
    return np.array([1.0, 1.0, 1.0, arm, arm, arm])


@dataclass(frozen=True)
class CycleMeasures:
    """Mean, maximum and rms over the cycle of a force's magnitude [N] (M4; Hasselgruber, Figs. 10-28)."""

    mean: float
    max: float
    rms: float

    def times(self, factor: float) -> CycleMeasures:
        """Return the measures in another unit."""
        return CycleMeasures(factor * self.mean, factor * self.max, factor * self.rms)
