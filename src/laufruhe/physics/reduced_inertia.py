"""What pistons and rods reduce to the crank on the mean, and the inertia of what turns beside them (V1, V14)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from laufruhe.machine import Engine, SliderCrank, Torsion
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.mechanism import reduced

_STEPS = 1024


def reduced_inertia(part: SliderCrank) -> float:
    """Mean over a turn of what piston and rod reduce to the crank, and the mass at its pin [kg m2] (V1; textbook 2.9).

    With a long rod half the reciprocating mass at the crank radius.
    """
    return _reduced_inertia(replace(part, name="", x=0.0, throw=part.bank, firing_angle=0.0))


@lru_cache(maxsize=256)
def _reduced_inertia(part: SliderCrank) -> float:
    inertia, _ = reduced(part.motion(np, 2.0 * math.pi * np.arange(_STEPS) / _STEPS))
    return part.rotating_mass * part.crank_radius**2 + float(np.mean(inertia * np.ones(_STEPS)))


def turned_by(chain: Torsion, before: Sequence[SliderCrank], after: Sequence[SliderCrank]) -> Torsion:
    """The chain with other pistons and rods in place of those that its discs have (V1)."""
    more = {a.name: reduced_inertia(b) - reduced_inertia(a) for a, b in zip(before, after, strict=True)}
    discs = (replace(d, inertia=d.inertia + sum(more[name] for name in d.cylinders)) for d in chain.discs)
    return replace(chain, discs=tuple(discs))


def turning_inertia(engine: Engine, fidelity: Fidelity) -> float | None:
    """Inertia beside pistons and rods [kg m2], of an uneven speed, the flywheel, or the discs of the crankshaft.

    None where none of these is told.
    """
    if fidelity.is_uneven:
        return fidelity.crank_inertia
    if engine.flywheel is not None:
        return engine.flywheel.inertia
    return None if engine.torsion is None else inertia_of_discs(engine.torsion, engine.slider_cranks)


def inertia_of_discs(chain: Torsion, parts: Sequence[SliderCrank]) -> float:
    """Of all discs without pistons and rods [kg m2] (V14); rings of absorbers slip, and are not counted."""
    swinging = sum(reduced_inertia(part) - part.rotating_mass * part.crank_radius**2 for part in parts)
    return sum(disc.inertia for disc in chain.discs) - swinging
