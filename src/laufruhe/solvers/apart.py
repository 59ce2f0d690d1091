"""A flywheel decided beside all else: at an even speed neither feels the other, so sums of their optima are optimal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from laufruhe.errors import ModelError
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.solvers.conclusion import none_within
from laufruhe.solvers.result import ObjectiveValue, Result, Status

Solve = Callable[[Problem], Result]
# the weakest of two counts
_STRENGTH = (Proof.NONE, Proof.LOCAL, Proof.WITHIN_GAP, Proof.GLOBAL)


def solve_apart(problem: Problem, solve: Solve) -> Result:
    """The flywheel and the rest, each by its own method.

    Raises
    ------
    ModelError
        If nothing of the flywheel is minimised.
    """
    wheel, rest = _part(problem, True), _part(problem, False)
    if not wheel.objective:
        raise ModelError("flywheel is open and nothing of it is minimised; add a term such as flywheel inertia")
    found = [solve(part) for part in (wheel, rest) if part.decisions or part.objective or part.limits]
    for result in found:
        if result.status is Status.INFEASIBLE:
            return none_within(problem, evaluate_start(problem), result.conflict, result.timing)
    engine = replace(found[-1].final.engine, flywheel=found[0].final.engine.flywheel)
    limits = {
        limit: shown for result in found for limit, shown in zip(result.problem.limits, result.limits, strict=True)
    }
    values = {value.name: value for result in found for value in result.decisions}
    value, given = (sum(getattr(r.objective, key) for r in found if r.objective) for key in ("value", "initial"))
    return Result(
        problem=problem,
        status=next((r.status for r in found if r.status is Status.FAILED), _status(found)),
        objective=ObjectiveValue.of(problem, value, given),
        certificate=_together(found, value),
        decisions=tuple(values.values()),
        limits=tuple(limits[limit] for limit in problem.limits),
        initial=evaluate_start(problem),
        final=evaluate(problem, engine, found[-1].final.samples),
        message="; ".join(r.message for r in found if r.message),
        error_estimate=max(r.error_estimate for r in found),
        timing={key: took for r in found for key, took in r.timing.items()},
    )


def _part(problem: Problem, is_wheel: bool) -> Problem:
    """What is open, wanted and forbidden of the flywheel, or of all else."""
    own = problem.flywheel_decisions
    return problem.changed(
        decisions=tuple(d for d in problem.decisions if (d in own) is is_wheel),
        objective=tuple(term for term in problem.objective if term.measure.channel.is_flywheel is is_wheel),
        limits=tuple(limit for limit in problem.limits if limit.measure.channel.is_flywheel is is_wheel),
    )


def _status(found: list[Result]) -> Status:
    proven = (r.certificate is None or r.certificate.kind is Proof.GLOBAL for r in found)
    return Status.OPTIMAL if all(proven) else Status.FEASIBLE


def _together(found: list[Result], value: float) -> Certificate:
    """Bounds add up; a part without anything open is its own."""
    shown = [(r.certificate, r.objective.value if r.objective else 0.0) for r in found]
    bound = sum(own if certificate is None else certificate.lower_bound for certificate, own in shown)
    told = [certificate for certificate, _ in shown if certificate is not None]
    kind = min((certificate.kind for certificate in told), key=_STRENGTH.index)
    gap = (value - bound) / value if value > 0.0 else 0.0
    # what cancels in a part counts as zero there
    gap = gap if any(certificate.gap for certificate in told) else 0.0
    residual = max(certificate.kkt_residual for certificate in told)
    return Certificate(kind, bound, gap, residual, "; beside it ".join(certificate.method for certificate in told))
