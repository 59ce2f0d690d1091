"""Engines as they are built: masses and unbalances somewhere within their tolerances, evaluated by the exact model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Engine, Role, Rotor
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import MEAN_MOUNT_FORCE
from laufruhe.problem.problem import Problem
from laufruhe.studies.tolerance import Tolerances

Array = NDArray[np.float64]


def built(engine: Engine, tolerances: Tolerances, random: np.random.Generator) -> Engine:
    """One engine out of many: masses even over their tolerance, unbalances even over their disc.

    Balancing planes stand from the first throw to the last, what is centred on the crank at
    the last: the end where power is taken off (C3).
    """
    front, rear = (pick(part.x for part in engine.slider_cranks) for pick in (max, min))
    planes = [float(x) for x in np.linspace(front, rear, tolerances.planes)]
    places = [*planes, *(rear for _ in tolerances.aligned_masses)]
    most = np.array(tolerances.unbalances)
    shares, turns = np.sqrt(random.uniform(0.0, 1.0, len(most))), random.uniform(0.0, 1.0, len(most))
    unbalances = most * shares * np.exp(2j * np.pi * turns)
    more = random.uniform(-1.0, 1.0, len(engine.slider_cranks)) * tolerances.reciprocating_mass
    pistons = tuple(
        replace(part, reciprocating_mass=max(part.reciprocating_mass + float(change), 0.0))
        for part, change in zip(engine.slider_cranks, more, strict=True)
    )
    left = tuple(
        Rotor(f"left unbalance {k + 1}", x, complex(u), role=Role.THROW)
        for k, (x, u) in enumerate(zip(places, unbalances, strict=True))
    )
    return replace(engine, slider_cranks=pistons, rotors=(*engine.rotors, *left))


def mean_mount_forces(problem: Problem, tolerances: Tolerances, builds: int, seed: int) -> tuple[float, Array]:
    """Mean mount force [N] of the engine as drawn, and of each of many as built."""
    random = np.random.default_rng(seed)
    drawn = evaluate(problem).value(MEAN_MOUNT_FORCE)
    engines = (built(problem.engine, tolerances, random) for _ in range(builds))
    return drawn, np.array([evaluate(problem, engine).value(MEAN_MOUNT_FORCE) for engine in engines])
