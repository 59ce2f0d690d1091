"""Mean reduced inertia of pistons and rods, and the inertia that turns beside them (V1, V14)."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from laufruhe.machine import Engine, SliderCrank
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.mechanism import reduced

_STEPS = 1024


def reduced_inertia(part: SliderCrank) -> float:
    """Return the mean inertia of piston, rod and pin mass reduced to the crank [kg m2] (V1; textbook 2.9).

    With a long rod half the reciprocating mass at the crank radius.
    """
    return _reduced_inertia(replace(part, name="", x=0.0, throw=part.bank, firing_angle=0.0))


@lru_cache(maxsize=256)
def _reduced_inertia(part: SliderCrank) -> float:
    inertia, _ = reduced(part.motion(np, 2.0 * math.pi * np.arange(_STEPS) / _STEPS))
    return part.rotating_mass * part.crank_radius**2 + float(np.mean(inertia * np.ones(_STEPS)))


def turning_inertia(engine: Engine, fidelity: Fidelity) -> float | None:
    """Return the inertia beside pistons and rods [kg m2]: of uneven speed, flywheel or extension; else None.

    None where none of these is told.
    """
    if fidelity.is_uneven:
        return fidelity.crank_inertia
    if engine.flywheel is not None:
        return engine.flywheel.inertia
    told = (extra.turning_inertia(engine.slider_cranks) for extra in engine.extras)
    return next((inertia for inertia in told if inertia is not None), None)
