"""Degree of irregularity beside throws that leave the even steps, by the work stored at even speed (S39, T11).

Work adds up over the cylinders as all loads do, so the smooth program and boxes know it. One problem with work in
place of the degree proposes designs, another bounds them. The exact model finds the degree itself.
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
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.throws.irregularity_bound import StoredWorkBound


def with_problem(phasing: Phasing, change: Callable[[Problem], Problem]) -> Phasing:
    """Return the phasing with another problem for every crank."""
    return replace(phasing, realise=lambda candidate: change(phasing.realise(candidate)))


def proposing(problem: Problem) -> Problem:
    """Put work in place of the degree of irregularity, worth what it is worth in the design as given."""
    if not _has_degree(problem):
        return problem
    initial, bounds = evaluate(problem), _bounds(problem)

    def degree(measure: Measure, name: str) -> float:
        value = initial.value(replace(measure, points=(name,)))
        # a crank that would stop has the degree of its work
        return value if math.isfinite(value) else bounds[name].degree(_stored(initial, name))

    def slope(measure: Measure, name: str) -> float:
        return degree(measure, name) / (_stored(initial, name) or 1.0)

    return _exchange(problem, degree, slope, lambda m, name, maximum: maximum / (slope(m, name) or 1.0))


def bounding(problem: Problem, value: float) -> Callable[[Problem], Problem]:
    """Return how to put work in place of the degree so that no design better than a value is worth more.

    Work is worth a straight line under the degree that it leaves at least (T11), up to the work that a design
    which is better than the value may store.
    """
    if not _has_degree(problem):
        return lambda problem: problem
    bounds, initial = _bounds(problem), evaluate(problem)
    # the degree has all orders of the pistons
    is_exact = problem.fidelity.kinematics == "exact" and problem.fidelity.orders is None
    alone = [
        evaluate(problem, replace(problem.engine, slider_cranks=(part,), rotors=()))
        for part in problem.engine.slider_cranks
    ]
    slopes: dict[tuple[Measure, str], float] = {}
    for term in problem.objective:
        for name in _points(problem, term.measure) if term.measure.channel.depends_on_torque else ():
            maximum = sum(_stored(one, name) for one in alone)
            if value < math.inf and term.weight > 0.0:
                maximum = min(maximum, bounds[name].work(value / term.weight))
            slopes[term.measure, name] = bounds[name].degree(maximum) / maximum if maximum > 0.0 and is_exact else 0.0
    return lambda other: _exchange(
        other,
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
    """Put work in place of every degree: of a term a share of the work at one point, of a limit the work at each.

    Parameters
    ----------
    size
        Size of a measure at an operating point: that of the largest stands for the term.
    slope
        Degree that counts as one joule of work at a point.
    maximum
        Work at a point that a limit on a degree allows.
    """
    terms: list[Term] = []
    limits: list[Limit] = []
    for term in problem.objective:
        measure = term.measure
        if measure.channel.depends_on_torque:
            sizes = {name: size(measure, name) for name in _points(problem, measure)}
            name = max(sizes, key=sizes.__getitem__)
            term = Term(_work(name), term.weight * slope(measure, name))
        terms.append(term)
    for limit in problem.limits:
        measure = limit.measure
        if not measure.channel.depends_on_torque:
            limits.append(limit)
            continue
        limits += [
            Limit(limit.name, _work(name), maximum(measure, name, limit.maximum)) for name in _points(problem, measure)
        ]
    return replace(problem, objective=tuple(terms), limits=tuple(limits))


def _has_degree(problem: Problem) -> bool:
    return any(measure.channel.depends_on_torque for measure in problem.measures)


def _work(name: str) -> Measure:
    return Measure(STORED_WORK, NORMS["peak to peak"], points=(name,))


def _stored(evaluation: Evaluation, name: str) -> float:
    return evaluation.value(_work(name))


def _points(problem: Problem, measure: Measure) -> Sequence[str]:
    return [point.name for point in problem.points if measure.includes_point(point)]


def _bounds(problem: Problem) -> dict[str, StoredWorkBound]:
    inertia = turning_inertia(problem.engine, problem.fidelity)
    total = math.inf if inertia is None else inertia
    return {p.name: StoredWorkBound.from_engine(problem.engine, p, problem.fidelity, total) for p in problem.points}
