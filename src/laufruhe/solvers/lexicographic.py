"""Objectives in order of rank: each is least among the designs that are best by those before it (P12).

Every rank is a problem of its own, decided by whatever method suits it, in which those before it are limits:

    f_j(x) <= v_j (1 + e_j),   j < k                                                              (P12)

with v_j the value found and e_j the share that may be given up for what follows, no less than a solver needs. What
cancels is limited to nothing. The design that is best in this order keeps all these limits, so what bounds a rank
under them bounds it for that design.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from laufruhe.numerics.budget import passed
from laufruhe.problem.evaluation import Evaluation, objective_value, with_fine_sampling
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import PROOF_RANK, Certificate, Proof
from laufruhe.solvers.accuracy import largest_error
from laufruhe.solvers.cones.equal_designs import equal_designs
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import DecisionRange, ObjectiveValue, RankValue

Solve = Callable[[Problem], Result]
CLOSE, SAMPLED = 1e-9, 1e-5
"""Share by which objectives before another may be exceeded at least; of what is known at sampled angles alone."""
WIDER = (0.0, 10.0 * SAMPLED)
"""Shares by which they may be exceeded further, where a solver finds no design."""


def solve_in_order(problem: Problem, solve: Solve) -> Result:
    """Decide by the first objective, then by each of the others what is left open by those before it."""
    alone = problem.changed(ranks=())
    stages: list[Result] = []
    held: list[Limit] = []
    equal: list[tuple[DecisionRange, ...]] = []
    for rank in problem.ranks:
        found = _found(alone.changed(objective=rank.terms), problem.limits, held, solve)
        if not found.status.has_design or found.objective is None:
            if not stages:
                return found
            break
        stages.append(found)
        limit = Limit(
            rank.terms[0].measure.name,
            rank.terms[0].measure,
            _edge(found, max(rank.within, _least_room(rank.terms[0].measure))),
        )
        held.append(limit)
        equal.append(equal_designs(found, limit) if len(rank.terms) == 1 else ())
    return _together(problem, stages, held, equal)


def _edge(found: Result, within: float) -> float:
    # bound on this objective for later ones; zero if it cancels
    value = found.objective.value if found.objective else math.inf
    weight = found.problem.objective[0].weight
    if value <= numerical_zero(found.problem, found.final.engine):
        return 0.0
    return value / weight * (1.0 + within)


def _found(stage: Problem, limits: tuple[Limit, ...], held: list[Limit], solve: Solve) -> Result:
    # limits on earlier objectives widen until the solver finds a design
    for more in WIDER:
        held[:] = [replace(limit, maximum=limit.maximum * (1.0 + more)) for limit in held]
        found = solve(stage.changed(limits=(*limits, *held)))
        if found.status.has_design or not held:
            break
    return found


def _least_room(measure: Measure) -> float:
    return SAMPLED if measure.is_load and not measure.norm.is_euclidean else CLOSE


def _together(
    problem: Problem, stages: list[Result], held: list[Limit], equal: list[tuple[DecisionRange, ...]]
) -> Result:
    """The design of the last rank, and what was proven of each."""
    last = stages[-1]
    count = len(problem.limits)
    # each stage had its own angles: what its design is worth to the others is read at many (P7)
    final = with_fine_sampling(last.final)
    ranks = tuple(
        _rank(stage, final, limit, last, k, count, designs)
        for k, (stage, limit, designs) in enumerate(zip(stages, held, equal, strict=True))
    )
    message = last.message
    if len(stages) < len(problem.ranks):
        name = problem.ranks[len(stages)].terms[0].measure.name
        # the last design keeps all limits of this one
        why = "was not decided: time was over" if passed() else "found no design under the limits of those before it"
        message = f"objective {len(stages) + 1}, {name}, {why}"
    weakest = min((rank.proof for rank in ranks), key=PROOF_RANK)
    whole = not message and all(stage.status is Status.OPTIMAL for stage in stages)
    first = stages[0]
    shown = last.problem.changed(objective=problem.objective, ranks=problem.ranks, limits=problem.limits)
    # a price is of the objective of its own rank, and the report's are of the first
    return replace(
        last,
        problem=shown,
        status=Status.OPTIMAL if whole and weakest is Proof.GLOBAL else Status.FEASIBLE,
        objective=ObjectiveValue.of(problem, ranks[0].final, first.objective.initial if first.objective else math.nan),
        certificate=_certificate(first, ranks, weakest),
        decisions=tuple(
            replace(d, shadow_price=math.nan if d.at_bound else 0.0, tightening_price=None) for d in last.decisions
        ),
        limits=tuple(
            replace(x, shadow_price=math.nan if x.active else 0.0, tightening_price=None) for x in last.limits[:count]
        ),
        initial=replace(first.initial, samples=last.final.samples),
        message=message,
        error=partial(largest_error, stages),
        timing=_summed(stages),
        ranks=ranks,
    )


def _rank(
    stage: Result, final: Evaluation, limit: Limit, last: Result, k: int, count: int, designs: tuple[DecisionRange, ...]
) -> RankValue:
    """Return the rank of one objective: its own optimum, and its value at the final design."""
    assert stage.objective is not None
    certificate = stage.certificate
    is_last = stage is last
    return RankValue(
        name=stage.objective.name,
        unit=stage.objective.unit,
        initial=stage.objective.initial,
        minimum=stage.objective.value,
        lower_bound=certificate.lower_bound if certificate else 0.0,
        gap=certificate.gap if certificate else math.inf,
        proof=certificate.kind if certificate else Proof.NONE,
        final=stage.objective.value if is_last else objective_value(stage.problem, final),
        limit=None if is_last else limit.maximum,
        price=math.nan if is_last else last.limits[count + k].shadow_price,
        designs=designs,
    )


def _certificate(first: Result, ranks: tuple[RankValue, ...], weakest: Proof) -> Certificate | None:
    # P12
    own = first.certificate
    if own is None:
        return None
    method = f"{own.method}; then {len(ranks) - 1} more in order"
    return replace(own, kind=weakest, gap=max(rank.gap for rank in ranks), method=method)


def _summed(stages: list[Result]) -> dict[str, float]:
    total: dict[str, float] = {}
    for stage in stages:
        for name, took in stage.timing.items():
            total[name] = total.get(name, 0.0) + took
    return total
