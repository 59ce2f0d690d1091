"""Replace the degree of irregularity by the work stored at constant speed, in searches for open throws (S39).

Work is a sum over the cylinders like all loads, so the smooth program can model it. The exact model computes the degree
itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from laufruhe.numerics.norms import NORMS
from laufruhe.physics.torque import turning_inertia
from laufruhe.problem.channels import STORED_WORK
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Problem


def has_degree(problem: Problem) -> bool:
    """Return True if the objective or a limit is a degree of irregularity."""
    return any(measure.channel.depends_on_torque for measure in problem.measures)


def with_work(problem: Problem) -> Problem:
    """Return the problem with stored work in place of degrees of irregularity, for a local search.

    Weights keep the value of each degree in the initial design. An objective term counts the work at the operating
    point with the largest degree, a limit that at every point.
    """
    if not has_degree(problem):
        return problem
    initial, inertia = evaluate(problem), turning_inertia(problem.engine, problem.fidelity)
    speeds = {point.name: point.speed for point in problem.points}

    def degree(measure: Measure, name: str) -> float:
        value = initial.value(replace(measure, points=(name,)))
        # if the crank would stop, use the degree of a heavy flywheel with this work
        heavy = 0.0 if inertia is None else initial.value(_work(name)) / (inertia * speeds[name] ** 2)
        return value if math.isfinite(value) else heavy

    def slope(measure: Measure, name: str) -> float:
        return degree(measure, name) / (initial.value(_work(name)) or 1.0)

    terms: list[Term] = []
    limits: list[Limit] = []
    for term in problem.objective:
        if term.measure.channel.depends_on_torque:
            _, name = max((degree(term.measure, name), name) for name in _points(problem, term.measure))
            term = Term(_work(name), term.weight * slope(term.measure, name))
        terms.append(term)
    for limit in problem.limits:
        names = _points(problem, limit.measure) if limit.measure.channel.depends_on_torque else ()
        maxima = [limit.maximum / (slope(limit.measure, name) or 1.0) for name in names]
        works = [Limit(limit.name, _work(name), maximum) for name, maximum in zip(names, maxima, strict=True)]
        limits += works or [limit]
    return replace(problem, objective=tuple(terms), limits=tuple(limits))


def _work(name: str) -> Measure:
    return Measure(STORED_WORK, NORMS["peak to peak"], points=(name,))


def _points(problem: Problem, measure: Measure) -> Sequence[str]:
    return [point.name for point in problem.points if measure.includes_point(point)]
