"""Branch and bound over boxes with a design from each box (P9), and with optimal unbalances for each design."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from laufruhe.errors import counted
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Side
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import BoundedParts, BranchAndBound, FathomedPart, OpenNode
from laufruhe.prove.certificate import ProofStrength, gap_of
from laufruhe.prove.witness import Witness
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

# share of the tolerance at which the gap counts as closed
GAP_SAFETY = 0.99
SHARE = 0.25
"""Share of the problem's tolerance that the cone program of a box may use."""


@dataclass(frozen=True, eq=False)
class SearchPart:
    """A part of the ranges of the open numbers, with a lower bound of the objective in it [SI].

    A part is exact if splitting it cannot improve its bound by more than the tolerance.
    """

    bound: float
    is_exact: bool


B = TypeVar("B", bound=SearchPart)
D = TypeVar("D")


class BoxSearch(BranchAndBound[B], Generic[B, D]):
    """Branch and bound that stores the best design of all boxes, `best`; a subclass states boxes and designs."""

    best: D | None
    _zero_level: float
    _tolerance: float

    def parts(self, box: B, value: float) -> Iterator[tuple[B | FathomedPart, D | None]]:
        """Yield parts that together make up a box, each with a design in it, or None.

        A part is a box, or the proof that no design in it has an objective below a level. The objective of the
        incumbent is `value` [SI].
        """
        raise NotImplementedError

    def rank(self, _: D) -> tuple[bool, float]:
        """Return the sort key of a design: False and its objective [SI], or True if it violates a limit."""
        raise NotImplementedError

    def witness_of(self, _: D) -> Witness | None:
        """Return a design as a witness of bounds, or None if it violates limits."""
        raise NotImplementedError

    def around(self, _: D) -> B | FathomedPart | None:
        """Return a thin box around a design, with its bound; None if the method builds none."""
        raise NotImplementedError

    def is_fathomed(self, node: OpenNode[B]) -> bool:
        """Return True if the gap between a box and the incumbent is closed."""
        gap = gap_of(self.value, node.bound, self._zero_level)
        # the bound of an exact box differs from its best design by no more than the tolerance of its program
        return gap <= GAP_SAFETY * self._tolerance or (gap < math.inf and node.part.is_exact)

    def branch(self, nodes: Sequence[OpenNode[B]]) -> BoundedParts[B]:
        """Yield the parts of a box with their bounds."""
        ((bound, _, box),) = nodes
        for part, design in self.parts(box, self.value):
            if design is not None and (self.best is None or self.rank(design) < self.rank(self.best)):
                self._take(design)
            yield part if isinstance(part, FathomedPart) else (part.bound, part)
            if is_time_over():
                # the remaining parts have at least the bound of the box
                yield bound, box
                return

    def _take(self, best: D | None) -> None:
        is_infeasible, value = (True, math.inf) if best is None else self.rank(best)
        self.best, self.value = best, math.inf if is_infeasible else value
        self.witness = None if best is None else self.witness_of(best)

    def search(
        self, root: B, best: D | None, zero_level: float, tolerance: float, maximum: int
    ) -> tuple[D | None, float, int]:
        """Search for the best design by dividing boxes until the lowest bound closes the gap to it.

        Parameters
        ----------
        root, best
            Box of all open numbers, and the first incumbent; None without one.
        zero_level, tolerance
            Objective that counts as zero [SI], and relative gap at which the search ends.
        maximum
            Largest number of boxes.

        Returns
        -------
        The best design, the lower bound of all designs (infinite if none is feasible), and the number of boxes.
        """
        self._take(best)
        self._zero_level, self._tolerance = zero_level, tolerance
        bound = self.divide((root.bound, root), maximum)
        if self.witness is not None and self.best is not None:
            thin = self.around(self.best)
            if thin is not None:
                self.witness.check_near(self.what, thin.level if isinstance(thin, FathomedPart) else thin.bound)
        return self.best, bound, self.node_count


@dataclass(frozen=True, eq=False)
class RebalancedDesign:
    """A design, and the result of the problem that determined its unbalances; None if no unbalance is open."""

    design: Design
    result: Result | None = None


@dataclass(frozen=True, eq=False)
class BoundedBox(SearchPart):
    """A box with bounds of its open numbers, shape (n,) each."""

    lower: Array
    upper: Array


S = TypeVar("S", bound=BoundedBox)


class RebalancedSearch(BoxSearch[S, RebalancedDesign]):
    """Boxes of decisions that are not affine, with designs whose unbalances are optimal."""

    conflict: tuple[str, ...] = ()
    """Names of limits that boxes without a feasible design violate."""
    angles = 0
    """Smallest number of samples per cycle of the first cone program."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def rank(self, design: RebalancedDesign) -> tuple[bool, float]:
        """Return the sort key of a design."""
        return design.design.rank

    def witness_of(self, design: RebalancedDesign) -> Witness | None:
        """Return a design as a witness (a value that no lower bound may exceed); None if it violates limits."""
        return witness_of(design.design, self.place(design))

    def place(self, design: RebalancedDesign) -> Array:
        """Return the values of the decisions that boxes bound, shape (n,)."""
        pairs = zip(self.problem.decisions, design.design.values, strict=True)
        return np.array([float(value.real) for decision, value in pairs if not decision.is_affine])

    def contains_witness(self, box: S) -> bool:
        """Return True if the best design lies in a box."""
        numbers = box.lower if self.best is None else self.place(self.best)
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
