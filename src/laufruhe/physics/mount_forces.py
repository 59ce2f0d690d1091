"""Forces on the mounts of an engine that its mounting holds far below resonance (M1-M3)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import UncarriedLoadError
from laufruhe.machine import Mount
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.composed import Mapped
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.rigid_body import point_motion
from laufruhe.physics.wrench import WRENCH

FREE_STRETCH = 1e-10
UNCARRIED_SHARE = 1e-9


@dataclass(frozen=True, eq=False)
class RigidMounting:
    """The linear map from the wrench on the block to the forces on the mounts.

    Attributes
    ----------
    maps
        Shape (mounts, 3, 6): force of the engine on each mount [N] per wrench (C7).
    free
        Shape (k, 6), orthonormal in scaled wrenches: what no mount carries.
    arm
        Length that makes moments comparable with forces [m].
    """

    maps: NDArray[np.float64]
    free: NDArray[np.float64]
    arm: float

    def forces(self, wrench: Spectrum, speed: float = 0.0) -> Spectrum:  # noqa: ARG002
        """Mount forces by order, shape (n, mounts, 3) [N]; the same at every speed.

        Raises
        ------
        UncarriedLoadError
            If the wrench drives a direction that no mount carries.
        """
        self.check_carried(wrench)
        return Mapped(wrench, self._carried)

    def _carried(self, loads: NDArray[Any]) -> NDArray[Any]:
        """Forces of real or complex loads (n, 6), shape (n, mounts, 3)."""
        if loads.dtype.kind == "c":
            # of real numbers alone the product takes half the time
            forces = (np.ascontiguousarray(loads).view(float) @ self._parts).view(complex)
            return np.asarray(forces.reshape(-1, len(self.maps), 3))
        # in memory mount by mount, as norms take their rows
        return np.asarray((loads @ self._each).swapaxes(0, 1))

    @cached_property
    def _each(self) -> NDArray[np.float64]:
        """The map to each mount, shape (mounts, 6, 3)."""
        return np.ascontiguousarray(self.maps.swapaxes(1, 2))

    @cached_property
    def _parts(self) -> NDArray[np.float64]:
        """The map from real and imaginary parts to real and imaginary parts, shape (12, 6 mounts)."""
        return np.asarray(np.kron(self.maps.reshape(-1, 6).T, np.eye(2)), dtype=float)

    @cached_property
    def _leak(self) -> NDArray[np.float64]:
        """From real and imaginary parts to those of what is along the free directions, scaled, shape (12, 2 k)."""
        return np.asarray(np.kron((self.free / _scales(self.arm)).T, np.eye(2)), dtype=float)

    def check_carried(self, wrench: Spectrum) -> None:
        """Refuse a wrench that some direction lets through."""
        if not len(self.free) or all(part.once("carried", self, self._is_carried) for part in wrench.parts):
            return
        loads = wrench.coefficients
        scaled = loads / _scales(self.arm)
        size = float(np.abs(scaled).max(initial=0.0))
        uncarried = np.abs((scaled @ self.free.T) @ self.free)
        if size > 0.0 and uncarried.max(initial=0.0) > UNCARRIED_SHARE * size:
            order, component = np.unravel_index(int(np.argmax(uncarried)), uncarried.shape)
            raise UncarriedLoadError(
                f"order {float(wrench.orders[order]):g} drives the engine along {WRENCH[component]}, which no mount "
                "carries; give a mount stiffness in that direction or a second place"
            )

    def _is_carried(self, part: Spectrum) -> bool:
        """Whether a part of a wrench has next to nothing along what is free, as most have."""
        parts = np.ascontiguousarray(part.coefficients).view(float)
        # squares of real and imaginary parts tell
        along = parts @ self._leak
        square = float(np.vdot(along, along))
        if square == 0.0:
            return not np.count_nonzero(along)
        whole = float(np.vdot(parts, parts)) * (UNCARRIED_SHARE / max(self.arm, 1.0)) ** 2 / max(parts.size, 1)
        return bool(self._leak.shape[1] * square <= whole < math.inf)


def rigid_mounting(mounts: Sequence[Mount]) -> RigidMounting:
    """F_i = K_i G_i (sum_j G_j^T K_j G_j)^+ w, by singular values (M1, M2).

    Directions that no mount carries are left to `check_carried`; the scene may not
    drive them.
    """
    return _rigid_mounting(tuple(mounts))


@lru_cache(maxsize=256)
def _rigid_mounting(mounts: tuple[Mount, ...]) -> RigidMounting:
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


def _scales(arm: float) -> NDArray[np.float64]:
    return np.array([1.0, 1.0, 1.0, arm, arm, arm])
