"""Problems with open mounts whose design as given is on an undamped resonance; other mounts have finite loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ResonanceError
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.problem import Problem

# fractions between the bounds, irregular so that not all lie on resonances
_PLACES = (0.5, 0.38, 0.71, 0.17, 0.93)


def evaluate_start(problem: Problem) -> Evaluation:
    """Return the evaluation of the design as given, with infinite loads where it is on an undamped resonance.

    Raises
    ------
    ModelError
        If `evaluate` raises it, or if the design is on a resonance and no mounts are open.
    """
    try:
        return evaluate(problem)
    except ResonanceError:
        if not problem.mount_decisions:
            raise
    engine, mounting = problem.engine, mounting_in(problem.engine)
    loads, description = [], ""
    for point in problem.points:
        wrench = shaking_loads(engine, point, problem.fidelity)
        resonant, text = mounting.resonant(wrench, point.speed)
        description = description or text
        off_resonance = Spectrum(wrench.base, np.where(resonant[:, None], 0.0, wrench.coefficients))
        signals = [answer(off_resonance, point.speed) for answer in (mounting.forces, mounting.travel)]
        forces, travel = (
            Spectrum(s.base, np.where(resonant[:, None, None], np.inf, s.coefficients)) for s in signals
        )  # fmt: skip
        loads.append(PointLoads(point, wrench, forces, travel, engine, problem.fidelity))
    return Evaluation(engine, problem.fidelity, tuple(loads), problem.fidelity.samples, description)


def off_resonance(problem: Problem) -> Problem:
    """Return the problem with initial mounts that are not on a resonance, moved within their bounds if necessary.

    Raises
    ------
    ResonanceError
        If all mounts that were tried are in resonance.
    """
    if not evaluate_start(problem).resonance:
        return problem
    decisions = problem.mount_decisions
    for place in _PLACES:
        values = [d.lower + place * (d.upper - d.lower) for d in decisions]
        candidate = replace(problem, engine=problem.design(values, decisions))
        try:
            evaluate(candidate)
        except ResonanceError as error:
            last = error
        else:
            return candidate
    raise last
