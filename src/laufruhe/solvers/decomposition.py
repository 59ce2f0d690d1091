"""Solve decisions of kinds that stand alone, such as discs of the crankshaft, and all others as separate problems.

At constant speed each measure depends on one of these problems alone. So the sum of the optima is the
optimum, and the sum of the lower bounds is a lower bound. An objective of an order of priority may leave
a problem out; another objective of that order decides it, and adds nothing to the sum.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial

from laufruhe.errors import ModelError
from laufruhe.numerics.witness import check_bound
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure, PriorityLevel, Term
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import PROOF_RANK, Certificate, Proof, unproven_certificate
from laufruhe.solvers.accuracy import largest_error
from laufruhe.solvers.conclusion import infeasible_result
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import ObjectiveValue

Solve = Callable[[Problem], Result]
Kinds = frozenset[Kind]


def _groups(problem: Problem) -> list[Kinds]:
    # the last group affects all measures
    kinds = frozenset(decision.kind for decision in problem.decisions)
    alone = sorted(kind for kind in kinds if kind.is_alone)
    return [*(frozenset({kind}) for kind in alone), kinds.difference(alone)]


def _groups_of(measure: Measure, problem: Problem) -> list[Kinds]:
    return [group for group in _groups(problem) if group and depends(measure.channel, group, problem)]


def is_separable(problem: Problem) -> bool:
    """Return True if numbers of kinds that stand alone are open with others, and each measure depends on one group."""
    is_divided = sum(map(bool, _groups(problem))) > 1
    return is_divided and all(len(_groups_of(measure, problem)) <= 1 for measure in problem.measures)


def _terms_of(group: Kinds, terms: Iterable[Term], problem: Problem) -> tuple[Term, ...]:
    # measures that depend on no group belong to the last one
    last = _groups(problem)[-1:]
    return tuple(term for term in terms if group in (_groups_of(term.measure, problem) or last))


def refuse_unused(problem: Problem, ranks: Sequence[PriorityLevel]) -> None:
    """Raise an error for a group of decisions on which no objective depends.

    Raises
    ------
    ModelError
        If neither the objective nor one of `ranks` depends on a group.
    """
    terms = [*problem.objective, *(term for rank in ranks for term in rank.terms)]
    for group in _groups(problem):
        names = [decision.name.split(".")[0] for decision in problem.decisions if decision.kind in group]
        if names and not _terms_of(group, terms, problem):
            raise ModelError(
                f"{names[0]} is open, but no objective term depends on this number; add such a term, or fix the number"
            )


def solve_decomposed(problem: Problem, solve: Solve, ranks: Sequence[PriorityLevel] = ()) -> Result:
    """Solve each group of decisions by its own method, and return one joint result.

    A group that the objective leaves out is decided by the first of `ranks` that depends on it.
    """
    refuse_unused(problem, ranks)
    groups = _groups(problem)
    objectives = [problem.objective, *(rank.terms for rank in ranks)]
    parts = {
        group: problem.changed(
            decisions=tuple(d for d in problem.decisions if d.kind in group),
            objective=next(filter(None, (_terms_of(group, terms, problem) for terms in objectives)), ()),
            limits=tuple(x for x in problem.limits if group in (_groups_of(x.measure, problem) or groups[-1:])),
        )
        for group in groups
    }
    unused = {group for group in groups if not _terms_of(group, problem.objective, problem)}
    by_group = {group: solve(part) for group, part in parts.items() if part.decisions or part.objective or part.limits}
    for group in unused.intersection(by_group):
        # the objective does not change with these limits
        free = tuple(replace(x, shadow_price=0.0, tightening_price=None) for x in by_group[group].limits)
        by_group[group] = replace(by_group[group], limits=free)
    results = list(by_group.values())
    summands = [result for group, result in by_group.items() if group not in unused]
    for result in results:
        if result.status is Status.INFEASIBLE:
            return infeasible_result(problem, evaluate_start(problem), result.conflict, result.timing)
    engine = by_group[groups[-1]].final.engine if groups[-1] in by_group else problem.engine
    for group, result in by_group.items():
        for extra in result.final.engine.extras:
            if any(kind.name == extra.name for kind in group):
                engine = engine.with_extra(extra)
    limits = {
        limit: entry for result in results for limit, entry in zip(result.problem.limits, result.limits, strict=True)
    }
    decisions = {entry.name: entry for result in results for entry in result.decisions}
    value, initial = (sum(getattr(r.objective, key) for r in summands if r.objective) for key in ("value", "initial"))
    proven = all(r.certificate is None or r.certificate.kind is Proof.GLOBAL for r in summands)
    status = Status.OPTIMAL if proven else Status.FEASIBLE
    return Result(
        problem=problem,
        status=Status.FAILED if any(r.status is Status.FAILED for r in results) else status,
        objective=ObjectiveValue.of(problem, value, initial),
        certificate=_joint_certificate(summands, value),
        decisions=tuple(decisions.values()),
        limits=tuple(limits[limit] for limit in problem.limits),
        initial=evaluate_start(problem),
        final=evaluate(problem, engine, results[-1].final.samples),
        message="; ".join(r.message for r in results if r.message),
        error=partial(largest_error, results),
        timing={key: took for r in results for key, took in r.timing.items()},
    )


def _joint_certificate(results: list[Result], value: float) -> Certificate:
    """Return the certificate of an objective that is a sum over independent parts of the problem.

    Their lower bounds add up. The value of a part without decisions is its own bound.
    """
    pairs = [(r.certificate, r.objective.value if r.objective else 0.0) for r in results]
    bound = sum(objective if certificate is None else certificate.lower_bound for certificate, objective in pairs)
    certificates = [certificate for certificate, _ in pairs if certificate is not None]
    kind = min((certificate.kind for certificate in certificates), key=PROOF_RANK)
    residual = max(certificate.kkt_residual for certificate in certificates)
    method = "; and ".join(certificate.method for certificate in certificates)
    if not check_bound(method, bound, value, sum(numerical_zero(r.problem, r.final.engine) for r in results)):
        return unproven_certificate(value, residual, method)
    gap = (value - bound) / value if value > 0.0 else 0.0
    # a part may be numerically zero although the sum is not
    gap = gap if any(certificate.gap for certificate in certificates) else 0.0
    return Certificate(kind, bound, gap, residual, method)
