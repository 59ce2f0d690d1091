"""Choice of rows by branch and bound over subsets of lists of parts.

A subset is bounded by the problem of its file, in which every number that varies is open. A combination is solved as
the problem of a file with its numbers. The bound of the choice is the least of all combinations that were solved, and
of all subsets that were not divided further.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from laufruhe.errors import InputError, ModelError, SolverError, counted
from laufruhe.extensions.parts_lists.lists import (
    Choices,
    Column,
    Combination,
    Outcome,
    PartsList,
    Subset,
    Tables,
    lists_of,
    refused_row,
    with_rows,
)
from laufruhe.files.complaints import errors_in_file
from laufruhe.files.reader import load_tables
from laufruhe.numerics.witness import check_bound, is_over
from laufruhe.problem.decision import Decision
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.measure import Limit
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import BoundedParts, BranchAndBound, FathomedPart, OpenNode
from laufruhe.prove.certificate import USELESS_GAP, Proof, ProofStrength, make_certificate
from laufruhe.solvers import methods
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, failed_result, infeasible_result
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import ObjectiveValue
from laufruhe.solvers.walk import check_by_walk

MAX_NODES = 200_000
"""Largest number of subsets and combinations."""
SMALL, LARGE = 4, 200
"""Largest subset whose combinations are solved one by one: usually, and where only its bound is hard to compute."""
BOXES = 64
"""Largest number of boxes for the bound of a subset."""
_UNSOLVED = (InputError, ModelError, SolverError)
_CHANGED = "a choice from lists of parts needs the problem of a file, and code has changed this one; change the file"


def refuse(problem: Problem) -> None:
    """Raise an error for a choice that is not supported, or for a row with which no engine can be built."""
    if problem.phasing is not None:
        raise ModelError("[[choices]] needs a crank with given throws, and throws are open; fix them")
    if len(problem.extras) > 1:
        words = " and ".join(extra.words for extra in problem.extras if not isinstance(extra, Choices))
        raise ModelError(f"[[choices]] is not supported together with {words}; remove one of the two")
    if not problem.objective:
        raise ModelError("[[choices]] has no objective to minimise; add [objective]")
    tables, lists = _read(problem)
    for k, parts in enumerate(lists):
        for row in range(len(parts.sheet.rows)):
            subset = tuple((row if j == k else 0,) for j in range(len(lists)))
            try:
                drawing = _loaded(problem, with_rows(tables, lists, subset))
            except InputError as error:
                with errors_in_file(error.source):
                    raise refused_row(lists, k, row, error.complaints[0]) from None
    methods.refuse(drawing)


def _read(problem: Problem) -> tuple[Tables, tuple[PartsList, ...]]:
    """Return the tables of the file without [[choices]], and the lists; raise `ModelError` for a changed problem."""
    choices = problem.extra(Choices)
    if choices is None or problem.origin is None:
        raise ModelError(_CHANGED)
    tables = {key: value for key, value in problem.origin.tables.items() if key != "choices"}
    drawing = load_tables(tables, problem.origin.path)
    if any(
        getattr(drawing, k) != getattr(problem, k) for k in ("objective", "limits", "points", "fidelity", "decisions")
    ):
        raise ModelError(_CHANGED)
    with errors_in_file(problem.origin.path):
        return tables, lists_of(choices, tables)


def _loaded(problem: Problem, tables: Tables) -> Problem:
    assert problem.origin is not None
    drawing = load_tables(tables, problem.origin.path)
    return replace(drawing, search=problem.search, tolerance=problem.tolerance)


def solve_choices(problem: Problem, decide: methods.Decide, max_nodes: int = MAX_NODES) -> Result:
    """Return the design with the best rows; `decide` solves problems without lists, `max_nodes` ends the search."""
    started, spent = time.perf_counter(), time.thread_time()
    initial, search = evaluate_start(problem.drawing), _Search(problem, decide)
    bound = search.run(max_nodes)
    timing, best = {"solve": time.perf_counter() - started}, search.best
    if best is None and bound < math.inf:
        failed = failed_result(problem, initial, [limit.name for limit in problem.limits], timing)
        return replace(failed, message="; ".join(filter(None, (failed.message, search.faults_message))))
    if best is None:
        text = f"no design exists: each of {counted(search.whole, 'combination')} of rows violates a limit"
        return replace(infeasible_result(problem, initial, (), timing), message=text)
    checked = check_by_walk(best.problem, best, time.thread_time() - spent)
    if checked is not best:
        # the walk refutes a bound
        best, bound = checked, 0.0
    assert best.objective is not None
    value, best_bound = best.objective.value, _bound_of(best)
    is_exact = search.is_exact and bound > (1.0 - USELESS_GAP) * value
    certificate = make_certificate(
        value, bound, numerical_zero(problem, best.final.engine), problem.tolerance,
        ProofStrength.EXACT if is_exact else ProofStrength.RELAXED,
        best.certificate.kkt_residual if best.certificate is not None else 0.0, search.method,
        # the bound of the best combination is above its value by errors of sampling at most
        max(best_bound - value, 0.0),
    )  # fmt: skip
    extras = tuple(replace(extra, outcome=search.outcome) for extra in problem.extras if isinstance(extra, Choices))
    return replace(
        best, problem=replace(best.problem, extras=extras), initial=initial, timing=timing, certificate=certificate,
        status=Status.OPTIMAL if certificate.kind is Proof.GLOBAL else Status.FEASIBLE,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, initial)),
        message="; ".join(filter(None, (best.message, search.faults_message))),
    )  # fmt: skip


class _Search(BranchAndBound[Subset]):
    """Branch and bound over subsets of rows."""

    what = "combinations of rows"

    def __init__(self, problem: Problem, decide: methods.Decide) -> None:
        self.problem, self.decide = problem, decide
        self.tables, self.lists = _read(problem)
        self.whole = math.prod(len(parts.sheet.rows) for parts in self.lists)
        self.solved: dict[tuple[int, ...], Combination] = {}
        self.best: Result | None = None
        self.faults: list[str] = []

    def run(self, max_nodes: int) -> float:
        """Solve or exclude combinations until all are decided; return a lower bound of the objective over them."""
        root: Subset = tuple(tuple(range(len(parts.sheet.rows))) for parts in self.lists)
        self.solve(tuple(rows[0] for rows in root))
        bound = self.bound(root) if self.whole > self.at_once else 0.0
        return self.divide((bound, root), max_nodes)

    @cached_property
    def at_once(self) -> int:
        """Largest subset whose combinations are solved one by one without a bound of the subset."""
        numbers = [(self.groups[c], c.side) for parts in self.lists for c in parts.columns]
        is_easy = all(side or (moved and all(d.is_affine for d in moved)) for moved, side in numbers)
        return SMALL if is_easy or not all(d.is_affine for d in self.problem.decisions) else LARGE

    def is_fathomed(self, node: OpenNode[Subset]) -> bool:
        """Return True if no combination of a subset is better than the best one."""
        return node.bound >= self.value

    def branch(self, nodes: Sequence[OpenNode[Subset]]) -> BoundedParts[Subset]:
        """Yield the halves of a subset with bounds, the combinations of a small one, or the level of a single one."""
        ((bound, _, subset),) = nodes
        count = _count(subset)
        if count == 1:
            known = self.solve(tuple(rows[0] for rows in subset))
            self._check(bound, subset)
            yield FathomedPart(max(bound, known.bound))
        elif count <= self.at_once:
            for rows in itertools.product(*subset):
                yield bound, tuple((row,) for row in rows)
        else:
            for half in self.halves(subset):
                yield max(bound, self.bound(half) if _count(half) > self.at_once else 0.0), half

    def halves(self, subset: Subset) -> Iterator[Subset]:
        """Yield the halves of a subset across its widest number; numbers that cannot be open come first."""
        columns = [
            (math.inf if column.varies(rows) and not self.groups[column] else _width(column.values, rows), k, c)
            for k, rows in enumerate(subset) if len(rows) > 1
            for c, column in enumerate(self._columns(k))
        ]  # fmt: skip
        _, k, c = max(columns)
        values = self._columns(k)[c].values
        order = sorted(subset[k], key=lambda row: values[row])
        for half in (order[: len(order) // 2], order[len(order) // 2 :]):
            yield (*subset[:k], tuple(half), *subset[k + 1 :])

    def _columns(self, k: int) -> Sequence[Column]:
        # the price is a column of a list that has no other
        return self.lists[k].columns or (Column("", "", self.lists[k].prices, (("constraints", "max"),)),)

    @cached_property
    def groups(self) -> dict[Column, tuple[Decision, ...]]:
        """Decisions that each column moves if it is open; none for a limit, and where no bound holds."""
        groups, usual = dict[Column, tuple[Decision, ...]](), {decision.name for decision in self.problem.decisions}
        first = with_rows(self.tables, self.lists, ((0,),) * len(self.lists))
        for parts, column in [(of, column) for of in self.lists for column in of.columns]:
            rows, alone = tuple(range(len(parts.sheet.rows))), replace(parts, columns=(column,))
            try:
                decisions = _loaded(self.problem, with_rows(first, (alone,), (rows,))).decisions
            except _UNSOLVED:
                decisions = ()
            moved = tuple(decision for decision in decisions if decision.name not in usual)
            groups[column] = () if any(decision.address_drives for decision in moved) else moved
        return groups

    def solve(self, rows: tuple[int, ...]) -> Combination:
        """Return the outcome of a combination, which is solved at its first use."""
        if rows in self.solved:
            return self.solved[rows]
        value, bound, proof, reason = math.inf, 0.0, "not solved", ""
        try:
            result = self.decide(self._combined(rows))
        except _UNSOLVED as error:
            reason = str(error)
        else:
            bound, proof = _bound_of(result), str(result.status)
            if result.status.has_design and result.objective is not None:
                value = result.objective.value
                proof = str(result.certificate.kind if result.certificate is not None else Proof.GLOBAL)
                if value < self.value:
                    self.best, self.value = result, value
            elif result.status is not Status.INFEASIBLE:
                reason = result.message
        if reason:
            names = ", ".join(f"'{parts.sheet.rows[k][0]}'" for parts, k in zip(self.lists, rows, strict=True))
            self.faults.append(f"{names} ({reason})")
        self.solved[rows] = Combination(rows, value, bound, proof)
        return self.solved[rows]

    def _combined(self, rows: Sequence[int]) -> Problem:
        return _loaded(self.problem, with_rows(self.tables, self.lists, tuple((row,) for row in rows)))

    def bound(self, subset: Subset) -> float:
        """Return a lower bound of the objective over the combinations of a subset; zero if none is known."""
        try:
            problem = self._relaxed(subset)
            result = None if problem is None else self.decide(problem)
        except _UNSOLVED:
            # an error proves nothing
            return 0.0
        if result is None:
            return 0.0
        if result.status.has_design:
            self.solve(self._nearest(subset, result))
        return _bound_of(result)

    def _check(self, bound: float, part: Subset) -> None:
        # a combination in a subset has no value below its bound
        for known in self.solved.values():
            inside = all(row in rows for row, rows in zip(known.rows, part, strict=True))
            if inside and is_over(bound, known.value):
                result = self.decide(self._combined(known.rows))
                zero_level = numerical_zero(result.problem, result.final.engine)
                check_bound(self.what, bound, known.value * (1.0 + 2.0 * result.error_estimate), zero_level)

    def _relaxed(self, subset: Subset) -> Problem | None:
        """Return the problem of a subset with wider limits; None if a number that varies cannot be open."""
        pairs = [(column, rows) for parts, rows in zip(self.lists, subset, strict=True) for column in parts.columns]
        moved = [self.groups[column] for column, rows in pairs if column.varies(rows)]
        if not all(moved):
            return None
        problem = _loaded(self.problem, with_rows(self.tables, self.lists, subset))
        by_name = {decision.name: decision for decision in problem.decisions}
        for group in moved:
            # parts that take one row have one number
            first, *others = (by_name[decision.name] for decision in group)
            if all((other.set, other.start) == (first.set, first.start) for other in others):
                drives = tuple(itertools.chain(first.drives, *(by_name.pop(other.name).drives for other in others)))
                by_name[first.name] = replace(first, drives=drives)
        search = replace(problem.search, starts=1, boxes=min(problem.search.boxes_or(BOXES), BOXES))
        limits = tuple(_wider(limit) for limit in problem.limits if limit.outside is None)
        return replace(problem, decisions=tuple(by_name.values()), limits=limits, search=search)

    def _nearest(self, subset: Subset, result: Result) -> tuple[int, ...]:
        """Return the combination of a subset whose numbers are nearest to those of a design."""
        values, nearest = {decision.name: decision for decision in result.decisions}, list[int]()
        for parts, rows in zip(self.lists, subset, strict=True):
            distances = np.zeros(len(rows))
            for column in [column for column in parts.columns if column.varies(rows)]:
                decision, numbers = values[self.groups[column][0].name], np.array([column.values[row] for row in rows])
                share = (decision.value - decision.lower) / (decision.upper - decision.lower)
                distances += ((numbers - numbers.min()) / np.ptp(numbers) - share) ** 2
            nearest.append(rows[int(np.argmin(distances))])
        return tuple(nearest)

    @property
    def is_exact(self) -> bool:
        """True if every combination that may be better than the best has a bound that can reach its optimum."""
        proofs = (Proof.GLOBAL, Proof.WITHIN_GAP)
        return all(known.proof in proofs or known.bound >= self.value for known in self.solved.values())

    @cached_property
    def outcome(self) -> Outcome:
        """Combinations that were solved, the best first, and the number of those that bounds exclude."""
        solved = sorted(self.solved.values(), key=lambda known: (known.value, known.rows))
        parts = () if self.complete else (node.part for node in self.open_nodes)
        left = sum(rows not in self.solved for part in parts for rows in itertools.product(*part))
        return Outcome(self.lists, tuple(solved), self.whole, self.whole - len(solved) - left)

    @property
    def method(self) -> str:
        """Description of the search."""
        solved, excluded = len(self.outcome.solved), self.outcome.excluded
        return f"{solved} of {counted(self.whole, 'combination')} solved, {excluded} excluded by bounds of subsets"

    @property
    def faults_message(self) -> str:
        """Sentence about combinations without a result; empty if there are none."""
        count = len(self.faults)
        return f"{counted(count, 'combination')} had no result, such as {self.faults[0]}" if count else ""


def _bound_of(result: Result) -> float:
    # the value itself if nothing is open, so that the engine was evaluated alone
    if result.status is Status.INFEASIBLE:
        return math.inf
    if result.certificate is not None:
        return result.certificate.lower_bound
    return result.objective.value if result.objective is not None and result.status.has_design else 0.0


def _count(subset: Subset) -> int:
    return math.prod(map(len, subset))


def _width(values: Sequence[float], rows: Sequence[int]) -> float:
    # width over some rows, relative to the largest number
    return float(np.ptp([values[row] for row in rows]) / (max(map(abs, values)) or 1.0))


def _wider(limit: Limit) -> Limit:
    # by the relative violation that a design may have
    low, high = (FEASIBILITY_TOL * (abs(side) or 1.0) for side in (limit.minimum, limit.maximum))
    return replace(
        limit,
        minimum=limit.minimum - low if math.isfinite(limit.minimum) else limit.minimum,
        maximum=limit.maximum + high if math.isfinite(limit.maximum) else limit.maximum,
    )


REDUCTION = methods.Reduction(
    "parts lists", lambda problem: problem.extra(Choices) is not None,
    lambda problem, decide, _: solve_choices(problem, decide), refuse, "refined sampling",
)  # fmt: skip
