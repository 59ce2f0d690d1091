"""Designs as given on an undamped resonance, with open mounts: other mounts have finite loads."""

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

# fractions of the way between bounds: irregular, so that not all lie on resonances
_PLACES = (0.5, 0.38, 0.71, 0.17, 0.93)


def evaluate_start(problem: Problem) -> Evaluation:
    """Evaluate the start of a search of mounts, which may have an undamped resonance.

    Raises
    ------
    ModelError
        As `evaluate`, and on a resonance without open mounts.
    """
    try:
        return evaluate(problem)
    except ResonanceError:
        if not problem.mount_decisions:
            raise
    engine, mounting = problem.engine, mounting_in(problem.engine)
    loads, words = [], ""
    for point in problem.points:
        wrench = shaking_loads(engine, point, problem.fidelity)
        struck, why = mounting.resonant(wrench, point.speed)
        words = words or why
        answered = Spectrum(wrench.base, np.where(struck[:, None], 0.0, wrench.coefficients))
        signals = [answer(answered, point.speed) for answer in (mounting.forces, mounting.travel)]
        forces, travel = (
            Spectrum(s.base, np.where(struck[:, None, None], np.inf, s.coefficients)) for s in signals
        )  # fmt: skip
        loads.append(PointLoads(point, wrench, forces, travel))
    return Evaluation(engine, problem.fidelity, tuple(loads), problem.fidelity.samples, words)


def off_resonance(problem: Problem) -> Problem:
    """Return the problem with its mounts as given, or elsewhere within their bounds if these are in resonance.

    Raises
    ------
    ResonanceError
        If all tried mounts are in resonance.
    """
    if not evaluate_start(problem).resonance:
        return problem
    decisions = problem.mount_decisions
    for place in _PLACES:
        values = [d.lower + place * (d.upper - d.lower) for d in decisions]
        moved = replace(problem, engine=problem.design(values, decisions))
        try:
            evaluate(moved)
        except ResonanceError as error:
            last = error
        else:
            return moved
    raise last
