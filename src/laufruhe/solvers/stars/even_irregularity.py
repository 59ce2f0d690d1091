"""Solve for even crank stars if the problem also measures the degree of irregularity, which is equal for all (S35)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import ProofStrength, make_certificate
from laufruhe.solvers.accuracy import objective_error
from laufruhe.solvers.conclusion import quote_names, violated_limits, with_constant_limits
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.ranking import ranked_star, ranking_result
from laufruhe.solvers.stars.star_results import no_star, solve_fixed, with_star
from laufruhe.solvers.values import ObjectiveValue

_EQUAL_STARS = "all even stars have the same degree of irregularity"


def flywheel_measures(problem: Problem) -> list[Measure]:
    """Return measures of the flywheel and of its degree of irregularity."""
    return [measure for measure in problem.measures if measure.channel.is_flywheel]


def solve_alike_stars(problem: Problem, phasing: Phasing, solve: Callable[[Problem], Result]) -> Result:
    """Choose among even crank stars without the flywheel's measures, which are equal for all of them (S35).

    All even stars of equal cylinders have the same dead centres, and so the same torque. `solve` solves the problem
    without measures of the flywheel.
    """
    initial = evaluate(problem)
    wheel = [limit for limit in problem.limits if limit.measure.channel.is_flywheel]
    violated = violated_limits(wheel, initial)
    if violated:
        reason = (
            f"no crank star keeps {quote_names(violated)}: the degree of irregularity is equal for all even stars; "
            "increase the flywheel's inertia"
        )
        return no_star(problem, reason, conflict=violated)
    limits = tuple(limit for limit in problem.limits if limit not in wheel)
    terms = tuple(term for term in problem.objective if not term.measure.channel.is_flywheel)
    limit_terms = [Term(limit.measure) for limit in limits if not limit.measure.channel.is_number]
    if not terms and not limit_terms:
        return _any_star(problem, phasing)
    # without other terms, any design within the limits is optimal
    load_terms = terms or tuple(limit_terms[:1])

    def without_wheel(star_problem: Problem) -> Problem:
        load_limits = tuple(x for x in star_problem.limits if not x.measure.channel.is_flywheel)
        return star_problem.changed(objective=load_terms, limits=load_limits)

    inner = replace(phasing, problem_of=lambda candidate: without_wheel(phasing.problem_of(candidate)))
    result = solve(replace(without_wheel(problem), phasing=inner))
    result = with_constant_limits(
        replace(result, problem=result.problem.changed(objective=problem.objective)), problem.limits
    )
    result = replace(result, problem=replace(result.problem, phasing=phasing))
    if result.objective is None or result.certificate is None:
        return result
    # part of the objective that is equal for all stars
    wheel_terms = [term for term in problem.objective if term.measure.channel.is_flywheel]
    wheel_value = sum((term.weight * result.final.value(term.measure) for term in wheel_terms), 0.0)
    value, proof = objective_value(problem, result.final), result.certificate
    bound = wheel_value + (proof.lower_bound if terms else 0.0)
    zero_level = numerical_zero(problem, result.final.engine)
    details = result.phasing
    if details is not None and terms:
        ranking = (
            replace(s, value=s.value + wheel_value, lower_bound=s.lower_bound + wheel_value) for s in details.ranking
        )
        details = replace(details, ranking=tuple(ranking))
    method = f"{proof.method}; {_EQUAL_STARS}"
    return replace(
        result,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, initial)),
        certificate=make_certificate(
            value, bound, zero_level, problem.tolerance, ProofStrength.EXACT, proof.kkt_residual, method
        ),
        phasing=details,
        error=partial(objective_error, result.problem, result.final),
    )


def _any_star(problem: Problem, phasing: Phasing) -> Result:
    """Return the result of the first crank star, because all evenly firing crank stars have the same objective."""
    families, reason = families_of(phasing)
    if not families:
        return no_star(problem, f"no crank star exists: {reason}")
    family = families[0]
    candidate = family.candidate(phasing, family.first)
    result = solve_fixed(replace(phasing.problem_of(candidate), phasing=None))
    value = objective_value(result.problem, result.final)
    proof = make_certificate(
        value, value, numerical_zero(problem), problem.tolerance, ProofStrength.EXACT, 0.0, _EQUAL_STARS
    )
    ranking = [ranked_star(phasing, candidate, family.first, value, value, True)]
    details = ranking_result(phasing, candidate, ranking, sum(x.size for x in families), 1, _EQUAL_STARS)
    return with_star(problem, phasing, result, candidate, proof, details)
