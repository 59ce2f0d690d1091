"""A design as given on a resonance that nothing damps, with mounts open: it has no finite loads, others have."""

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

# of the way between the bounds of what is open: places that no two resonances share
_PLACES = (0.5, 0.38, 0.71, 0.17, 0.93)


def evaluate_start(problem: Problem) -> Evaluation:
    """The design that a search of mounts starts from; it alone may stand on a resonance that nothing damps.

    Raises
    ------
    ModelError
        As `evaluate`; where no mount is open on a resonance as well, for there is no way off it.
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
    """The problem with its mounts as given, or elsewhere within their bounds where these stand on a resonance.

    Raises
    ------
    ResonanceError
        If every place tried stands on one: what is open does not move it.
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
