"""Minimise several objectives in lexicographic order (P12).

Rank k is a problem of its own, in which the objectives of earlier ranks are limits:

    f_j(x) <= v_j (1 + e_j),   j < k                                                              (P12)

with v_j the optimum of rank j and e_j the share of it that later ranks may use, no less than the accuracy of the
solver. An objective that is numerically zero has the limit zero. The lexicographic optimum keeps all these limits, so
the lower bound of each rank under them holds for it.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

from laufruhe.extensions.objectives_in_order.equal_designs import equal_designs
from laufruhe.numerics.budget import is_time_over
from laufruhe.problem.evaluation import objective_value, with_fine_sampling
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import PROOF_RANK, Proof
from laufruhe.solvers.accuracy import largest_error
from laufruhe.solvers.conclusion import is_sampled
from laufruhe.solvers.decomposition import solve_decomposed
from laufruhe.solvers.methods import Decide, Reduction, method_of, refuse, solve_separable
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import DecisionRange, ObjectiveValue, RankValue

CLOSE, SAMPLED = 1e-9, 1e-5
"""Smallest relative slack of limits on earlier objectives: of exact measures, and of measures from samples."""
WIDER = (0.0, 10.0 * SAMPLED)
"""Further relative slacks, tried in turn until the solver finds a design."""


def solve_lexicographic(problem: Problem, solve: Decide) -> Result:
    """Return the result of several objectives in order of priority.

    Each is minimised with limits on the objectives before it.
    """
    single = problem.changed(ranks=())
    stages: list[Result] = []
    rank_limits: list[Limit] = []
    equal_by_rank: list[tuple[DecisionRange, ...]] = []
    for rank in problem.ranks:
        # relax the limits on earlier objectives until the solver finds a design
        for slack in WIDER:
            rank_limits = [replace(limit, maximum=limit.maximum * (1.0 + slack)) for limit in rank_limits]
            result = solve(single.changed(objective=rank.terms, limits=(*problem.limits, *rank_limits)))
            if result.status.has_design or not rank_limits:
                break
        if not result.status.has_design or result.objective is None:
            if not stages:
                return result
            break
        stages.append(result)
        measure, value = rank.terms[0].measure, result.objective.value
        slack = max(rank.within, SAMPLED if is_sampled(measure) else CLOSE)
        is_zero = value <= numerical_zero(result.problem, result.final.engine)
        maximum = 0.0 if is_zero else value / result.problem.objective[0].weight * (1.0 + slack)
        limit = Limit(measure.name, measure, maximum)
        rank_limits.append(limit)
        equal_by_rank.append(equal_designs(result, limit) if len(rank.terms) == 1 else ())
    return _joint_result(problem, stages, rank_limits, equal_by_rank)


def _joint_result(
    problem: Problem, stages: list[Result], rank_limits: list[Limit], equal_by_rank: list[tuple[DecisionRange, ...]]
) -> Result:
    """Return the design of the last rank, with the proof of every rank."""
    first, last = stages[0], stages[-1]
    count = len(problem.limits)
    # ranks may have different samples, so the final design is evaluated at fine sampling (P7)
    final = with_fine_sampling(last.final)
    ranks = []
    for k, (stage, limit, designs) in enumerate(zip(stages, rank_limits, equal_by_rank, strict=True)):
        objective, certificate, is_last = stage.objective, stage.certificate, stage is last
        assert objective is not None
        rank = RankValue(
            name=objective.name,
            unit=objective.unit,
            initial=objective.initial,
            minimum=objective.value,
            lower_bound=certificate.lower_bound if certificate else 0.0,
            gap=certificate.gap if certificate else math.inf,
            proof=certificate.kind if certificate else Proof.NONE,
            final=objective.value if is_last else objective_value(stage.problem, final),
            limit=None if is_last else limit.maximum,
            price=math.nan if is_last else last.limits[count + k].shadow_price,
            designs=designs,
        )
        ranks.append(rank)
    message = last.message
    if len(stages) < len(problem.ranks):
        name = problem.ranks[len(stages)].terms[0].measure.name
        # the last design meets all limits of the missing rank
        reason = (
            "was not minimised: the time limit was reached"
            if is_time_over()
            else "has no design under the limits of the objectives before it"
        )
        message = f"objective {len(stages) + 1}, {name}, {reason}"
    weakest = min((rank.proof for rank in ranks), key=PROOF_RANK)
    is_complete = not message and all(stage.status is Status.OPTIMAL for stage in stages)
    certificate = first.certificate
    if certificate is not None:
        method = f"{certificate.method}; then {len(ranks) - 1} further objectives in order"
        certificate = replace(certificate, kind=weakest, gap=max(rank.gap for rank in ranks), method=method)
    problem_of_result = last.problem.changed(objective=problem.objective, ranks=problem.ranks, limits=problem.limits)
    # shadow prices of the last rank are not those of the first, which the report shows
    return replace(
        last,
        problem=problem_of_result,
        status=Status.OPTIMAL if is_complete and weakest is Proof.GLOBAL else Status.FEASIBLE,
        objective=ObjectiveValue.of(problem, ranks[0].final, first.objective.initial if first.objective else math.nan),
        certificate=certificate,
        decisions=tuple(d.without_price() for d in last.decisions),
        limits=tuple(
            replace(x, shadow_price=math.nan if x.active else 0.0, tightening_price=None) for x in last.limits[:count]
        ),
        initial=replace(first.initial, samples=last.final.samples),
        message=message,
        error=partial(largest_error, stages),
        timing={name: sum(stage.timing.get(name, 0.0) for stage in stages) for x in stages for name in x.timing},
        ranks=tuple(ranks),
    )


def _solve(problem: Problem, decide: Decide, _: Decide) -> Result:
    is_divided = method_of(problem).solver is solve_separable
    solve_rank = partial(solve_decomposed, solve=decide, ranks=problem.ranks) if is_divided else decide
    return solve_lexicographic(problem, solve_rank)


def _refuse(problem: Problem) -> None:
    for rank in problem.ranks:
        refuse(problem.changed(ranks=(), objective=rank.terms), problem.ranks)


ORDER = Reduction("objectives in order", lambda problem: bool(problem.ranks), _solve, _refuse, "constant limits")
