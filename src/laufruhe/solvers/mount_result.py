"""From decided mounts to a result, judged by the exact model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from laufruhe.problem.evaluation import Evaluation, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Certificate
from laufruhe.solvers.result import DecisionValue, LimitValue, ObjectiveValue, Result, Status, infeasible

Array = NDArray[np.float64]

FEASIBLE = 1e-6
ACTIVE = 1e-5


def objective_of(problem: Problem, initial: Evaluation, final: Evaluation) -> ObjectiveValue | None:
    """The objective of the design and of the one given; None where nothing is minimised."""
    if problem.objective_unit is None:
        return None
    value = objective_value(problem, final)
    given = value if final is initial else objective_value(problem, initial)
    return ObjectiveValue.of(problem, value, given)


def mount_decisions(
    problem: Problem, values: Sequence[float], gradient: Array | None = None
) -> tuple[DecisionValue, ...]:
    """Decisions about the mounts; the gradient, where known, prices their bounds."""
    out = []
    for k, (decision, value) in enumerate(zip(problem.mount_decisions, values, strict=True)):
        reach = ACTIVE * (decision.upper - decision.lower)
        at_bound = value <= decision.lower + reach or value >= decision.upper - reach
        price = abs(float(gradient[k])) if gradient is not None and at_bound else 0.0
        out.append(
            DecisionValue(decision.name, value, decision.unit, decision.lower, decision.upper, decision.start_number,
                          at_bound, price)
        )  # fmt: skip
    return tuple(out)


def mount_limits(
    problem: Problem, evaluation: Evaluation, prices: Sequence[float] | None = None
) -> tuple[LimitValue, ...]:
    """How a design stands to the limits on mounts and modes (E15)."""
    out = []
    prices = [0.0] * len(problem.mount_limits) if prices is None else prices
    for limit, price in zip(problem.mount_limits, prices, strict=True):
        found = evaluation.standing(limit)
        active = found.excess >= -ACTIVE
        price = price if active else 0.0
        out.append(LimitValue(limit.name, found.value, found.edge, limit.measure.unit, active, price, found.side))
    return tuple(out)


def mount_result(
    problem: Problem,
    initial: Evaluation,
    final: Evaluation,
    certificate: Certificate,
    values: Sequence[float],
    gradient: Array | None,
    prices: Sequence[float],
    optimal: bool,
) -> Result:
    """A result whose decisions are about mounts alone."""
    met = final.excess(problem.mount_limits) <= FEASIBLE
    status = Status.FAILED if not met else Status.OPTIMAL if optimal else Status.FEASIBLE
    return Result(
        problem=problem,
        status=status,
        objective=objective_of(problem, initial, final),
        certificate=certificate,
        decisions=mount_decisions(problem, values, gradient),
        limits=mount_limits(problem, final, prices),
        initial=initial,
        final=final,
        message="" if met else "the design found breaks a limit by more than the solver's tolerance",
    )


def infeasible_mounts(
    problem: Problem, initial: Evaluation, conflict: tuple[str, ...], timing: dict[str, float]
) -> Result:
    """No design exists: which limits cannot be met together."""
    return infeasible(problem, initial, mount_limits(problem, initial), conflict, timing)
