"""Designs of single crank stars, and conversion of the best star's result into the result of the search."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cached_property

from laufruhe.problem.evaluation import evaluate, objective_value, with_fine_sampling
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, evaluate_only
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.ranking import PhasingResult
from laufruhe.solvers.values import DecisionValue, ObjectiveValue


@dataclass(frozen=True, eq=False)
class StarDesign:
    """A crank star and firing order, with the result of its problem.

    Attributes
    ----------
    candidate
        Throws, firing order, geometry and shafts.
    steps
        Steps of the throws if it fires evenly, else None.
    kkt_residual
        KKT residual of the program that moved its throws.
    has_moved_throws
        True if the throws moved from those of the start.
    """

    candidate: Candidate
    result: Result
    steps: tuple[int, ...] | None = None
    kkt_residual: float = 0.0
    has_moved_throws: bool = False

    @cached_property
    def is_feasible(self) -> bool:
        """True if the crank star has a design that keeps its limits."""
        return (
            self.result.status.has_design and self.result.final.violation(self.result.problem.limits) <= FEASIBILITY_TOL
        )

    @property
    def is_infeasible(self) -> bool:
        """True if no design of this crank star keeps the limits, with fine sampling (P7)."""
        result = self.result
        if not result.status.has_design:
            return result.status is Status.INFEASIBLE
        return with_fine_sampling(result.final).violation(result.problem.limits) > FEASIBILITY_TOL

    @property
    def value(self) -> float:
        """Objective by the exact model [SI]; infinite without a feasible design."""
        return math.inf if self.result.objective is None or not self.is_feasible else self.result.objective.value

    @property
    def bound(self) -> float:
        """Lower bound of the objective over all designs of this crank star [SI]."""
        return self.result.certificate.lower_bound if self.result.certificate else self.value


def solve_fixed(problem: Problem) -> Result:
    """Solve a problem with fixed phasing for its unbalances, or evaluate it if it has no decisions."""
    return solve_unbalances(problem) if problem.decisions else evaluate_only(problem)


def with_star(
    problem: Problem, phasing: Phasing, best: Result, candidate: Candidate, certificate: Certificate | None,
    details: PhasingResult,
) -> Result:  # fmt: skip
    """Return the result of the search over crank stars, from the result of the best star alone.

    Parameters
    ----------
    problem, phasing
        The problem with open phasing, and its phasing.
    best, candidate
        Result of the best star, and its throws, firing order, geometry and shafts.
    certificate, details
        Certificate of the search, None without a design; and its ranking.
    """
    is_proven = certificate is not None and certificate.kind is Proof.GLOBAL
    status = best.status
    if status.has_design:
        status = Status.OPTIMAL if is_proven else Status.FEASIBLE
    initial = replace(evaluate(problem), samples=best.final.samples)
    value = best.objective.value if best.objective else objective_value(problem, best.final)
    return replace(
        best,
        problem=replace(best.problem, phasing=phasing),
        status=status,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, initial)),
        certificate=certificate,
        decisions=(*phase_decisions(problem, phasing, candidate), *best.decisions),
        initial=initial,
        phasing=details,
    )


def phase_decisions(problem: Problem, phasing: Phasing, candidate: Candidate) -> tuple[DecisionValue, ...]:
    """Return the open throws, bank angle, split pin and shafts of a design as decision values for the result."""
    parts, layout = problem.engine.slider_cranks, phasing.layout_of(candidate)
    decisions = []
    if phasing.throws is None:
        firsts = [layout.pins.index(pin) for pin in set(layout.pins)]
        start_angles = [parts[first].throw - layout.pin_offsets[first] for first in firsts]
        for k, (angle, start) in enumerate(zip(candidate.throws, start_angles, strict=True)):
            low, high = phasing.throw_bounds[k] if phasing.throw_bounds else (0.0, math.tau)
            decisions.append(DecisionValue(f"throw {k + 1}", angle, "rad", low, high, start % math.tau, False))
    # bank and split pin angle of the initial engine
    bank = split = 0.0
    for left, right in itertools.permutations(range(len(layout.sides)), 2):
        if layout.side(left) > layout.side(right):
            bank = (parts[left].bank - parts[right].bank) % math.tau
            if layout.pins[left] == layout.pins[right]:
                split = math.remainder(parts[right].throw - parts[left].throw, math.tau)
    for name, bounds, value, initial in (
        ("bank angle", phasing.bank, candidate.bank_angle, bank),
        ("split pin angle", phasing.split, candidate.split_pin, split),
    ):
        if bounds is not None and value is not None and bounds[0] < bounds[1]:
            at_bound = min(value - bounds[0], bounds[1] - value) <= 1e-9
            decisions.append(DecisionValue(name, value, "rad", *bounds, initial, at_bound))
    decisions += [
        DecisionValue(f"{name} built", float(name not in candidate.left_out), "", 0.0, 1.0, 1.0, False)
        for names in phasing.shafts.optional
        for name in names
    ]
    return tuple(decisions)


def no_star(
    problem: Problem, reason: str, status: Status = Status.INFEASIBLE, conflict: tuple[str, ...] = ()
) -> Result:
    """Return a result without a design, with the reason in words and the limits that contradict each other."""
    evaluation = evaluate(problem)
    return Result(
        problem=problem, status=status, initial=evaluation, final=evaluation, message=reason, conflict=conflict
    )
