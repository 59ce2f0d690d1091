"""Degree of irregularity beside throws that leave the even steps, by the work that is stored at even speed (S39, T11).

Work adds up over the cylinders as all loads do, so that the smooth program and boxes know it. One problem with work in
place of the degree proposes designs, another bounds them; the exact model finds the degree itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from laufruhe.numerics.norms import NORMS
from laufruhe.physics.reduced_inertia import turning_inertia
from laufruhe.problem.channels import STORED_WORK
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.throws.swing import StoredBound

Rated = Callable[[Measure, str], float]
"""Work that counts as one of a measure at an operating point [J]."""


@dataclass(frozen=True)
class _Exchange:
    """What stands in place of a degree: of a term a share of the work at one point, of a limit the work at each."""

    point_of: Callable[[Measure], str]
    slope: Rated
    most: Callable[[Measure, str, float], float]

    def made(self, problem: Problem) -> Problem:
        """The problem with work in place of every degree."""
        terms = [self._term(term) if turns(term.measure) else term for term in problem.objective]
        limits = [
            own
            for limit in problem.limits
            for own in (self._limits(limit, problem) if turns(limit.measure) else [limit])
        ]
        return replace(problem, objective=tuple(terms), limits=tuple(limits))

    def _term(self, term: Term) -> Term:
        name = self.point_of(term.measure)
        return Term(_work(name), term.weight * self.slope(term.measure, name))

    def _limits(self, limit: Limit, problem: Problem) -> list[Limit]:
        named = [point.name for point in problem.points if limit.measure.counts_point(point)]
        return [Limit(limit.name, _work(name), self.most(limit.measure, name, limit.maximum)) for name in named]


def turns(measure: Measure) -> bool:
    """Whether it is of how evenly the crank turns."""
    return measure.channel.of_torque


def of_other(phasing: Phasing, other: Callable[[Problem], Problem]) -> Phasing:
    """What is open, of another problem in place of its own."""
    return replace(phasing, realise=lambda candidate: other(phasing.realise(candidate)))


def with_work(problem: Problem) -> Problem:
    """Work in place of the degree of irregularity, worth what it is worth in the design as given."""
    if not any(map(turns, problem.measures)):
        return problem
    given = evaluate(problem)

    bounds = _bounds(problem)

    def degree(measure: Measure, name: str) -> float:
        found = given.value(replace(measure, points=(name,)))
        # of a crank that would stop it is what its work says
        return found if math.isfinite(found) else bounds[name].degree(_stored(given, name))

    def slope(measure: Measure, name: str) -> float:
        return degree(measure, name) / (_stored(given, name) or 1.0)

    def heaviest(measure: Measure) -> str:
        return max(_points(problem, measure), key=lambda name: degree(measure, name))

    return _Exchange(heaviest, slope, lambda m, name, most: most / (slope(m, name) or 1.0)).made(problem)


def bounding(problem: Problem, value: float) -> Callable[[Problem], Problem]:
    """Problems that have no more than one with a degree of irregularity has, where that is less than a value.

    Work has no more than a straight line under the degree that it leaves at least (T11), up to the work that a design
    which is better than the value may store.
    """
    if not any(map(turns, problem.measures)):
        return lambda own: own
    bounds, given = _bounds(problem), evaluate(problem)
    # the degree knows all orders of the pistons
    is_known = problem.fidelity.kinematics == "exact" and problem.fidelity.orders is None
    alone = [
        evaluate(problem, replace(problem.engine, slider_cranks=(part,), rotors=()))
        for part in problem.engine.slider_cranks
    ]
    slopes: dict[tuple[Measure, str], float] = {}
    for term in problem.objective:
        for name in _points(problem, term.measure) if turns(term.measure) else ():
            most = sum(_stored(one, name) for one in alone)
            if value < math.inf and term.weight > 0.0:
                most = min(most, bounds[name].work(value / term.weight))
            slopes[term.measure, name] = bounds[name].degree(most) / most if most > 0.0 and is_known else 0.0

    def heaviest(measure: Measure) -> str:
        return max(_points(problem, measure), key=lambda name: slopes[measure, name] * _stored(given, name))

    exchange = _Exchange(heaviest, lambda m, name: slopes[m, name], lambda _, name, most: bounds[name].work(most))
    return exchange.made


def _work(name: str) -> Measure:
    return Measure(STORED_WORK, NORMS["peak to peak"], points=(name,))


def _stored(evaluation: Evaluation, name: str) -> float:
    return evaluation.value(_work(name))


def _points(problem: Problem, measure: Measure) -> Sequence[str]:
    return [point.name for point in problem.points if measure.counts_point(point)]


def _bounds(problem: Problem) -> dict[str, StoredBound]:
    inertia = turning_inertia(problem.engine, problem.fidelity)
    whole = math.inf if inertia is None else inertia
    return {p.name: StoredBound.of(problem.engine, p, problem.fidelity, whole) for p in problem.points}
