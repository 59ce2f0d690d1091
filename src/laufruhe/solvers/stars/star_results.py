"""Designs with one star each, and the result of the best star as that of the search."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cached_property

from laufruhe.problem.evaluation import evaluate, objective_value, with_fine_sampling
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.solvers.conclusion import KEPT, state
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.ranking import PhasingResult
from laufruhe.solvers.values import DecisionValue, ObjectiveValue


@dataclass(frozen=True, eq=False)
class StarDesign:
    """A star and firing order, everything else decided.

    Attributes
    ----------
    result
        Result of the problem with this star.
    steps
        Steps of the throws where it fires evenly.
    kkt_residual
        Residual of the program that moved its throws.
    moved
        Whether the throws left the star that they were started from.
    """

    candidate: Candidate
    result: Result
    steps: tuple[int, ...] | None = None
    kkt_residual: float = 0.0
    moved: bool = False

    @cached_property
    def is_met(self) -> bool:
        """True if it is a design within its limits."""
        return self.result.status.has_design and self.result.final.violation(self.result.problem.limits) <= KEPT

    @property
    def is_excluded(self) -> bool:
        """True if no design of this star keeps the limits: a mean at few angles may be more than it is (P7)."""
        result = self.result
        if not result.status.has_design:
            return result.status is Status.INFEASIBLE
        return with_fine_sampling(result.final).violation(result.problem.limits) > KEPT

    @property
    def value(self) -> float:
        """Objective by the exact model [SI]; infinite where there is none."""
        return math.inf if self.result.objective is None or not self.is_met else self.result.objective.value

    @property
    def bound(self) -> float:
        """Lower bound over all designs of this star [SI]."""
        return self.result.certificate.lower_bound if self.result.certificate else self.value


def solve_fixed(problem: Problem) -> Result:
    """Solve a problem with nothing of its phasing open, its unbalances at their optimum."""
    return solve_unbalances(problem) if problem.decisions else state(problem)


def with_star(
    problem: Problem, phasing: Phasing, best: Result, candidate: Candidate, certificate: Certificate | None,
    details: PhasingResult,
) -> Result:  # fmt: skip
    """Turn the best star's result into the result of the search.

    Parameters
    ----------
    problem
        The problem with its phasing open.
    best
        Result of the star, nothing of the phasing open.
    """
    given = evaluate(problem)
    is_proven = certificate is not None and certificate.kind is Proof.GLOBAL
    status = best.status
    if status.has_design:
        status = Status.OPTIMAL if is_proven else Status.FEASIBLE
    initial = replace(given, samples=best.final.samples)
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
    """Return throws, banks and shafts as entries of the result."""
    parts, layout = problem.engine.slider_cranks, phasing.layout_of(candidate)
    out = []
    if phasing.throws is None:
        firsts = [layout.pins.index(pin) for pin in set(layout.pins)]
        before = [parts[first].throw - layout.pin_offsets[first] for first in firsts]
        for k, (angle, was) in enumerate(zip(candidate.throws, before, strict=True)):
            low, high = phasing.throw_bounds[k] if phasing.throw_bounds else (0.0, math.tau)
            out.append(DecisionValue(f"throw {k + 1}", angle, "rad", low, high, was % math.tau, False))
    # angles as the engine has them
    bank = split = 0.0
    for left, right in itertools.permutations(range(len(layout.sides)), 2):
        if layout.side(left) > layout.side(right):
            bank = (parts[left].bank - parts[right].bank) % math.tau
            if layout.pins[left] == layout.pins[right]:
                split = math.remainder(parts[right].throw - parts[left].throw, math.tau)
    for name, bounds, value, given in (
        ("bank angle", phasing.bank, candidate.bank_angle, bank),
        ("split pin angle", phasing.split, candidate.split_pin, split),
    ):
        if bounds is not None and value is not None and bounds[0] < bounds[1]:
            at_bound = min(value - bounds[0], bounds[1] - value) <= 1e-9
            out.append(DecisionValue(name, value, "rad", *bounds, given, at_bound))
    out += [
        DecisionValue(f"{name} built", float(name not in candidate.left_out), "", 0.0, 1.0, 1.0, False)
        for names in phasing.shafts.optional
        for name in names
    ]
    return tuple(out)


def no_star(problem: Problem, why: str, status: Status = Status.INFEASIBLE, conflict: tuple[str, ...] = ()) -> Result:
    """Return the result without any star, and why there is none."""
    given = evaluate(problem)
    return Result(problem=problem, status=status, initial=given, final=given, message=why, conflict=conflict)
