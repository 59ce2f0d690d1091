"""Replace the degree of irregularity by the work stored at constant speed, for open throws (S39, T11).

Work is a sum over the cylinders like all loads, so the smooth program and the boxes of throws can model it. One
replacement serves local searches, another one lower bounds. The exact model computes the degree itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from laufruhe.numerics.norms import NORMS
from laufruhe.physics.torque import turning_inertia
from laufruhe.problem.channels import STORED_WORK
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Problem
from laufruhe.prove.throws.irregularity_bound import IrregularityBound


def with_work_for_search(problem: Problem) -> Problem:
    """Return the problem with stored work in place of degrees of irregularity, for a local search.

    Weights keep the value of each degree in the initial design.
    """
    if not _has_degree(problem):
        return problem
    initial, bounds = evaluate(problem), _bounds(problem)

    def degree(measure: Measure, name: str) -> float:
        value = initial.value(replace(measure, points=(name,)))
        # if the crank would stop, use the degree that its work implies
        return value if math.isfinite(value) else bounds[name].degree(_stored(initial, name))

    def slope(measure: Measure, name: str) -> float:
        return degree(measure, name) / (_stored(initial, name) or 1.0)

    return _exchange(problem, degree, slope, lambda m, name, maximum: maximum / (slope(m, name) or 1.0))


def work_for_bounds(problem: Problem, value: float) -> Callable[[Problem], Problem]:
    """Return a function that replaces degrees of irregularity in a problem by stored work, for lower bounds.

    The replacement is linear in the work and never raises the objective. It is a lower bound of the degree (T11) for
    all designs better than `value`, the objective of the best design [SI].
    """
    if not _has_degree(problem):
        return lambda problem: problem
    bounds, initial = _bounds(problem), evaluate(problem)
    # the bound of the degree needs all orders of the pistons
    is_exact = problem.fidelity.kinematics == "exact" and problem.fidelity.orders is None
    alone = replace(problem.engine, rotors=(), load_torque=None)
    evaluations = [evaluate(problem, replace(alone, slider_cranks=(part,))) for part in problem.engine.slider_cranks]
    if problem.engine.load_torque is not None:
        load = replace(alone, slider_cranks=(), load_torque=problem.engine.load_torque)
        evaluations.append(evaluate(problem, load))
    slopes: dict[tuple[Measure, str], float] = {}
    for term in problem.objective:
        for name in _points(problem, term.measure) if term.measure.channel.depends_on_torque else ():
            maximum = sum(_stored(evaluation, name) for evaluation in evaluations)
            if value < math.inf and term.weight > 0.0:
                maximum = min(maximum, bounds[name].work(value / term.weight))
            slopes[term.measure, name] = bounds[name].degree(maximum) / maximum if maximum > 0.0 and is_exact else 0.0
    return lambda crank_problem: _exchange(
        crank_problem,
        lambda measure, name: slopes[measure, name] * _stored(initial, name),
        lambda measure, name: slopes[measure, name],
        lambda _, name, maximum: bounds[name].work(maximum),
    )


def _exchange(
    problem: Problem,
    size: Callable[[Measure, str], float],
    slope: Callable[[Measure, str], float],
    maximum: Callable[[Measure, str, float], float],
) -> Problem:
    """Return the problem with stored work in place of every degree of irregularity.

    An objective term counts the work at one operating point, a limit that at every point.

    Parameters
    ----------
    size
        Size of a measure at an operating point; the point with the largest size represents the term.
    slope
        Degree of irregularity per work at a point [1/J].
    maximum
        Largest work at a point for a limit on the degree [J].
    """
    terms: list[Term] = []
    limits: list[Limit] = []
    for term in problem.objective:
        measure = term.measure
        if measure.channel.depends_on_torque:
            name = max(_points(problem, measure), key=lambda name, measure=measure: size(measure, name))  # type: ignore[misc]
            term = Term(_work(name), term.weight * slope(measure, name))
        terms.append(term)
    for limit in problem.limits:
        measure = limit.measure
        if measure.channel.depends_on_torque:
            points = _points(problem, measure)
            limits += [Limit(limit.name, _work(name), maximum(measure, name, limit.maximum)) for name in points]
        else:
            limits.append(limit)
    return replace(problem, objective=tuple(terms), limits=tuple(limits))


def _has_degree(problem: Problem) -> bool:
    return any(measure.channel.depends_on_torque for measure in problem.measures)


def _work(name: str) -> Measure:
    return Measure(STORED_WORK, NORMS["peak to peak"], points=(name,))


def _stored(evaluation: Evaluation, name: str) -> float:
    return evaluation.value(_work(name))


def _points(problem: Problem, measure: Measure) -> Sequence[str]:
    return [point.name for point in problem.points if measure.includes_point(point)]


def _bounds(problem: Problem) -> dict[str, IrregularityBound]:
    inertia = turning_inertia(problem.engine, problem.fidelity)
    total = math.inf if inertia is None else inertia
    return {p.name: IrregularityBound.from_engine(problem.engine, p, problem.fidelity, total) for p in problem.points}
