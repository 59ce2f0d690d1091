"""Mounting of an engine: linear map from the wrench on its block to its mount forces."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ElasticMounting, elastic_mounting
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.mount_forces import RigidMounting, rigid_mounting
from laufruhe.physics.steady_state import TimeMounting

Mounting: TypeAlias = RigidMounting | ElasticMounting | TimeMounting
"""Mounting of an engine; linear in the wrench in the frequency domain."""


def mounting_of(engine: Engine, fidelity: Fidelity = EXACT) -> Mounting | None:
    """Return the mounting of an engine: elastic if its block is given, else rigid; None without mounts."""
    if not engine.mounts:
        return None
    if engine.block is None or fidelity.mounts == "rigid":
        return rigid_mounting(engine.mounts)
    mounting = elastic_mounting(engine.block, engine.mounts, fidelity.modes)
    return TimeMounting(mounting, fidelity.samples) if fidelity.mounts == "time" else mounting


def travel_of(engine: Engine, mounting: Mounting | None, wrench: Spectrum, speed: float) -> Spectrum | None:
    """Return the displacement at every mount, shape (n, mounts, 3) [m]; None without elastic mounts.

    Elastic mounts that are taken for rigid do not travel.
    """
    if mounting is None or engine.block is None:
        return None
    if isinstance(mounting, ElasticMounting | TimeMounting):
        return mounting.travel(wrench, speed)
    return Spectrum(wrench.base, np.zeros((1, len(engine.mounts), 3), dtype=complex))


NO_MAP = "mounts in the time domain are evaluated, not solved for; leave fidelity.mounts out and solve again"
