"""Degree of irregularity beside open stars and firing orders (S35, T10)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine.firing import firing_turns
from laufruhe.numerics.arrays import Array
from laufruhe.physics.reduced_inertia import turning_inertia
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Reach, certified
from laufruhe.prove.throws.swing import SwingBound
from laufruhe.solvers.accuracy import error_of
from laufruhe.solvers.conclusion import broken_limits, quoted, with_limits
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.conclusion import no_star, with_star
from laufruhe.solvers.stars.design import solve_fixed
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.ranking import ranked_star, ranking_result
from laufruhe.solvers.values import ObjectiveValue

_AT_ONCE = 512


def of_wheel(problem: Problem) -> list[Measure]:
    """What is asked of the flywheel, and of how evenly it turns."""
    return [measure for measure in problem.measures if measure.channel.is_flywheel]


def solve_told_alike(problem: Problem, phasing: Phasing, solve: Callable[[Problem], Result]) -> Result:
    """Open throws of even firing: cylinders alike on the same dead centres turn every crank as evenly (S35)."""
    given = evaluate(problem)
    wheel = [limit for limit in problem.limits if limit.measure.channel.is_flywheel]
    broken = broken_limits(wheel, given)
    if broken:
        names = quoted(broken)
        why = f"no star keeps {names}: all that fire evenly turn the crank as evenly; give it more inertia"
        return no_star(problem, why, conflict=broken)
    limits = tuple(limit for limit in problem.limits if limit not in wheel)
    terms: tuple[Term, ...] = tuple(term for term in problem.objective if not term.measure.channel.is_flywheel)
    held = [Term(limit.measure) for limit in limits if not limit.measure.channel.is_number]
    if not terms and not held:
        return _any_star(problem, phasing)
    # where nothing else is minimised, what keeps the limits is as good as any other
    own = terms or tuple(held[:1])

    def stripped(whole: Problem) -> Problem:
        return whole.changed(objective=own, limits=tuple(x for x in whole.limits if not x.measure.channel.is_flywheel))

    inner = replace(phasing, realise=lambda candidate: stripped(phasing.realise(candidate)))
    found = solve(replace(stripped(problem), phasing=inner))
    return _whole(problem, phasing, found, given, bool(terms))


def _any_star(problem: Problem, phasing: Phasing) -> Result:
    """One of the stars where nothing tells them apart."""
    families, why = families_of(phasing)
    if not families:
        return no_star(problem, f"no star exists: {why}")
    family = families[0]
    candidate = family.candidate(phasing, family.first)
    result = solve_fixed(replace(phasing.realise(candidate), phasing=None))
    value = objective_value(result.problem, result.final)
    method = "every star that fires evenly turns the crank as evenly"
    proof = certified(value, value, numerical_zero(problem), problem.tolerance, Reach.WHOLE, 0.0, method)
    ranking = [ranked_star(phasing, candidate, family.first, value, value, True)]
    details = ranking_result(phasing, candidate, ranking, sum(each.size for each in families), 1, method)
    return with_star(problem, phasing, result, candidate, proof, details)


def _whole(problem: Problem, phasing: Phasing, found: Result, given: Evaluation, has_terms: bool) -> Result:
    """The result with what all stars share."""
    found = with_limits(replace(found, problem=found.problem.changed(objective=problem.objective)), problem.limits)
    found = replace(found, problem=replace(found.problem, phasing=phasing))
    if found.objective is None or found.certificate is None:
        return found
    terms = [term for term in problem.objective if term.measure.channel.is_flywheel]
    shared = sum((term.weight * found.final.value(term.measure) for term in terms), 0.0)
    value, proof = objective_value(problem, found.final), found.certificate
    bound = shared + (proof.lower_bound if has_terms else 0.0)
    nothing = numerical_zero(problem, found.final.engine)
    method = f"{proof.method}; every star that fires evenly turns the crank as evenly"
    details = found.phasing
    if details is not None and has_terms:
        ranking = (replace(s, value=s.value + shared, lower_bound=s.lower_bound + shared) for s in details.ranking)
        details = replace(details, ranking=tuple(ranking))
    return replace(
        found,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, given)),
        certificate=certified(value, bound, nothing, problem.tolerance, Reach.WHOLE, proof.kkt_residual, method),
        phasing=details,
        error=partial(error_of, found.problem, found.final),
    )


def floors(problem: Problem, phasing: Phasing, designs: Sequence[Candidate]) -> tuple[Array, NDArray[np.bool_]]:
    """Of firing orders of given throws what the objective is at least, and which break a limit for certain (T10)."""
    least, broken = np.zeros(len(designs)), np.zeros(len(designs), dtype=bool)
    terms = [(t.weight, t.measure) for t in problem.objective if t.measure.channel.of_torque]
    limits = [limit for limit in problem.limits if limit.measure.channel.of_torque]
    if not designs or not (terms or limits):
        return least, broken
    fires = _firings(phasing, designs)
    for weight, measure in terms:
        least += weight * _degrees(problem, measure, fires)
    for limit in limits:
        broken |= _degrees(problem, limit.measure, fires) > limit.maximum
    return least, broken


def _firings(phasing: Phasing, designs: Sequence[Candidate]) -> Array:
    """Turns at which every cylinder fires, shape (designs, cylinders)."""
    out = np.zeros((len(designs), phasing.cylinders))
    for row, candidate in zip(out, designs, strict=True):
        order = candidate.firing_order or ()
        for number, turn in zip(
            order, firing_turns(phasing.layout_of(candidate), candidate.throws, order), strict=True
        ):
            row[number - 1] = turn
    return out


def _degrees(problem: Problem, measure: Measure, fires: Array) -> Array:
    """What one order says, the most of all operating points that count."""
    inertia, least = turning_inertia(problem.engine, problem.fidelity), np.zeros(len(fires))
    if inertia is None or not math.isfinite(inertia):
        return least
    for point in problem.points:
        if measure.points is None or point.name in measure.points:
            bound = SwingBound.of(problem.engine, point, problem.fidelity, inertia)
            if bound is not None and bound.work.shape[0] == fires.shape[1]:
                parts = [bound.least(fires[k : k + _AT_ONCE]) for k in range(0, len(fires), _AT_ONCE)]
                least = np.maximum(least, np.concatenate(parts))
    return least
