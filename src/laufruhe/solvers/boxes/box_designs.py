"""Branch and bound over decisions that are not affine, with optimal unbalances for fixed values of these."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from laufruhe.errors import counted
from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Side
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import FathomedPart
from laufruhe.prove.certificate import ProofStrength
from laufruhe.prove.witness import Witness
from laufruhe.solvers.boxes.search import BoxSearch
from laufruhe.solvers.conclusion import (
    Design,
    ProofData,
    build_result,
    evaluate_design,
    infeasible_result,
    unbalance_values,
    witness_of,
)
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.prices import Price
from laufruhe.solvers.result import Result, Status

SHARE = 0.25
"""Share of the problem's tolerance that the cone program of a box may use."""


@dataclass(frozen=True, eq=False)
class RebalancedDesign:
    """A design, and the result of the problem that determined its unbalances; None if no unbalance is open."""

    design: Design
    result: Result | None = None

    @property
    def value(self) -> float:
        """Objective; infinite if a limit is violated."""
        return math.inf if self.design.rank[0] else self.design.value

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key: feasible designs first, then by objective."""
        return self.design.rank


@dataclass(frozen=True, eq=False)
class BoundedBox:
    """A box with bounds of its open numbers, shape (n,) each, and a lower bound of the objective in it [SI].

    A box is exact if splitting it cannot improve its bound by more than the tolerance.
    """

    lower: Array
    upper: Array
    bound: float
    is_exact: bool


S = TypeVar("S", bound=BoundedBox)


class RebalancedSearch(BoxSearch[S, RebalancedDesign]):
    """Boxes of decisions that are not affine, with designs whose unbalances are optimal."""

    conflict: tuple[str, ...] = ()
    """Names of limits that boxes without a feasible design violate."""
    angles = 0
    """Smallest number of samples per cycle of the first cone program."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def witness_of(self, design: RebalancedDesign) -> Witness | None:
        """Return a design as a witness (a value that no lower bound may exceed); None if it violates limits."""
        return witness_of(design.design, self.place(design))

    def place(self, design: RebalancedDesign) -> Array:
        """Return the values of the decisions that boxes bound, shape (n,)."""
        pairs = zip(self.problem.decisions, design.design.values, strict=True)
        return np.array([float(value.real) for decision, value in pairs if not decision.is_affine])

    def contains_witness(self, box: S) -> bool:
        """Return True if the best design lies in a box."""
        numbers = self.place(self.best)
        return bool(np.all(box.lower <= numbers) and np.all(numbers <= box.upper))

    def prices(self, _: Design) -> dict[Side, Price]:
        """Return shadow prices of limits that the problem of the unbalances leaves out."""
        return {}

    def add_conflict(self, conflict: Sequence[str]) -> None:
        """Add names of limits that a box without a feasible design violates."""
        names = {*self.conflict, *conflict}
        self.conflict = tuple(limit.name for limit in self.problem.limits if limit.name in names)

    def solve(
        self, root: S | FathomedPart, first: RebalancedDesign | None, maximum: int, numbers: str, method: str
    ) -> Result:
        """Return the best design and its certificate, from branch and bound over at most `maximum` boxes.

        `root` is the box of all open numbers with its bound, and `first` is the first incumbent.
        `numbers` and `method` are the names of the open numbers and of the bounding method, for reports.
        """
        started, problem = time.perf_counter(), self.problem
        initial, best, bound, boxes = evaluate(problem), first, math.inf, 1
        if not isinstance(root, FathomedPart) and first is not None:
            self.what = f"boxes of {numbers}"
            best, bound, boxes = self.search(root, first, numerical_zero(problem), problem.tolerance, maximum)
        timing = {"solve": time.perf_counter() - started}
        if best is None or (math.isinf(bound) and best.design.rank[0]):
            return infeasible_result(problem, initial, self.conflict, timing)
        balance, design = best.result, best.design
        proof = ProofData(
            bound=0.0 if design.rank[0] else bound,
            strength=ProofStrength.EXACT,
            kkt_residual=balance.certificate.kkt_residual if balance and balance.certificate else math.inf,
            method=f"{method} {counted(boxes, 'box')} of {numbers}",
            prices=(balance.prices if balance else {}) | self.prices(design),
        )
        return build_result(design, replace(initial, samples=design.evaluation.samples), proof, timing)


def rebalance(problem: Problem, balance: Problem, fixed_values: dict[str, Value], angles: int = 0) -> RebalancedDesign:
    """Return the design with optimal unbalances, for fixed values of all other decisions.

    If no design is feasible, the unbalances keep their start values, and the design violates limits.

    Parameters
    ----------
    balance
        Problem with the unbalances as its only decisions.
    fixed_values
        Values of the other decisions by name [SI].
    angles
        Smallest number of samples per cycle of the first cone program.
    """
    result, samples = None, None
    values: dict[str, Value] = {decision.name: decision.start for decision in problem.decisions} | fixed_values
    if balance.decisions:
        balance = replace(balance, tolerance=SHARE * problem.tolerance)
        result = solve_unbalances(balance, angles=angles)
        if result.status is not Status.INFEASIBLE:
            unbalances = unbalance_values(balance, result)
            values |= dict(zip((decision.name for decision in balance.decisions), unbalances, strict=True))
        samples = result.final.samples
    return RebalancedDesign(evaluate_design(problem, list(values.values()), samples), result)
