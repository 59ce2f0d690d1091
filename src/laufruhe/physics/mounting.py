"""What holds an engine: a linear map from the wrench on its block to the forces on its mounts."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ElasticMounting, elastic_mounting
from laufruhe.physics.mount_forces import RigidMounting, rigid_mounting


class Mounting(Protocol):
    """Rigid or elastic; linear in the wrench at every speed."""

    def forces(self, wrench: Spectrum, speed: float) -> Spectrum:
        """Forces of the engine on its mounts, shape (n, mounts, 3) [N] (C7)."""


def mounting_of(engine: Engine) -> RigidMounting | ElasticMounting | None:
    """The mounting of an engine: elastic where its block is described, else rigid; None without mounts."""
    if not engine.mounts:
        return None
    return rigid_mounting(engine.mounts) if engine.block is None else elastic_mounting(engine.block, engine.mounts)


def travel_of(mounting: Mounting | None, wrench: Spectrum, speed: float) -> Spectrum | None:
    """Displacement at every mount, shape (n, mounts, 3) [m]; None where mounts do not give way."""
    return mounting.travel(wrench, speed) if isinstance(mounting, ElasticMounting) else None


def mount_maps(mounting: RigidMounting | ElasticMounting, order: float, speed: float) -> NDArray[np.complex128]:
    """Mount forces per wrench at one order and speed, shape (mounts, 3, 6)."""
    if isinstance(mounting, RigidMounting):
        return mounting.maps.astype(complex)
    omegas = np.full(6, order * speed)
    forces = mounting.mount_forces(omegas, mounting.responses(omegas, np.eye(6, dtype=complex)))
    return np.asarray(np.moveaxis(forces, 0, 2))
