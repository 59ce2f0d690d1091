"""Choice of rows by branch and bound over subsets of lists of parts.

A subset is bounded by the problem of its file, in which every number that varies is open. A combination is solved as
the problem of a file with its numbers. The bound of the choice is the least of all combinations that were solved, and
of all subsets that were not divided further.
"""

from __future__ import annotations

import bisect
import itertools
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from laufruhe.errors import InputError, ModelError, SolverError, counted
from laufruhe.extensions.parts_lists.lists import RANKED, Choices, Column, Combination, Outcome, Subset, with_rows
from laufruhe.extensions.parts_lists.price import PARTS_PRICE, price_of
from laufruhe.files.complaints import errors_in_file
from laufruhe.files.reader import load_tables
from laufruhe.problem.decision import Decision
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import BoundedParts, BranchAndBound, FathomedPart, OpenNode
from laufruhe.prove.certificate import USELESS_GAP, Proof, ProofStrength, make_certificate
from laufruhe.prove.witness import Witness
from laufruhe.solvers import methods
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, failed_result, infeasible_result, nearest_record
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import NearestDesign, ObjectiveValue
from laufruhe.solvers.walk import check_by_walk

MAX_NODES, MAX_WHOLE = 200_000, 10_000_000
"""Largest number of subsets and combinations that are looked at, and of all combinations."""
SMALL, LARGE = 4, 64
"""Largest subset whose combinations are solved one by one: usually, and where only its bound is hard to compute."""
BOXES = 64
"""Largest number of boxes for the bound of a subset."""
_UNSOLVED = (InputError, ModelError, SolverError)
_CHANGED = "a choice from lists of parts needs the problem of a file, and code has changed this one; change the file"
_SAME = ("objective", "limits", "points", "fidelity", "decisions")


def refuse(problem: Problem) -> None:
    """Raise an error for a choice that is not supported, or for a row with which no engine can be built."""
    if problem.phasing is not None:
        raise ModelError("[[choices]] needs a crank with given throws, and throws are open; fix them")
    if len(problem.extras) > 1:
        words = " and ".join(extra.words for extra in problem.extras if not isinstance(extra, Choices))
        raise ModelError(f"[[choices]] is not supported together with {words}; remove one of the two")
    if not problem.objective:
        raise ModelError("[[choices]] has no objective to minimise; add [objective]")
    search = _Search(problem)
    for k, parts in enumerate(search.lists):
        for row in range(len(parts.rows)):
            try:
                drawing = search.problem_of(tuple((row if j == k else 0,) for j in range(len(search.lists))))
            except InputError as error:
                with errors_in_file(error.source):
                    raise parts.refused_file(row, error.complaints[0]) from None
    methods.refuse(drawing)


def solve_choices(problem: Problem, decide: methods.Decide, max_nodes: int = MAX_NODES) -> Result:
    """Return the design with the best rows; `decide` solves problems without lists, `max_nodes` ends the search."""
    started, spent = time.perf_counter(), time.thread_time()
    initial, search = evaluate_start(problem.drawing), _Search(problem, decide)
    bound = search.run(max_nodes)
    timing, best, outcome = {"solve": time.perf_counter() - started}, search.best, search.outcome
    faults = f"{counted(len(search.faults), 'combination')} had no result: {search.faults[0]}" if search.faults else ""
    if best is None:
        result = infeasible_result(problem, initial, (), timing)
        text = f"no design exists: each of {counted(outcome.whole, 'combination')} of rows violates a limit"
        if bound < math.inf:
            result = failed_result(problem, initial, [limit.name for limit in problem.limits], timing)
            text = "; ".join(filter(None, (result.message, faults)))
        elif search.nearest is not None:
            text += f"; {search.nearest[0]} is nearest"
        return replace(result, message=text, nearest=search.nearest and search.nearest[1])
    checked = check_by_walk(best.problem, best, time.thread_time() - spent)
    # a walk may refute the bound
    best, bound = checked, bound if checked is best else 0.0
    assert best.objective is not None
    value, kinds = best.objective.value + search.price, (Proof.GLOBAL, Proof.WITHIN_GAP)
    is_exact = all(known.proof in kinds or known.bound >= value for known in outcome.solved)
    is_exact = is_exact and bound > (1.0 - USELESS_GAP) * value
    certificate = make_certificate(
        value, bound, numerical_zero(problem, best.final.engine), problem.tolerance,
        ProofStrength.EXACT if is_exact else ProofStrength.RELAXED,
        best.certificate.kkt_residual if best.certificate is not None else 0.0, outcome.words,
        # the bound of the best combination is above its value by errors of sampling at most
        max(_bound_of(best) + search.price - value, 0.0),
    )  # fmt: skip
    return replace(
        best, problem=replace(best.problem, extras=problem.extras, objective=problem.objective), initial=initial,
        details=outcome, timing=timing, certificate=certificate,
        status=Status.OPTIMAL if certificate.kind is Proof.GLOBAL else Status.FEASIBLE,
        objective=ObjectiveValue.of(problem, value, objective_value(problem, initial)),
        message="; ".join(filter(None, (best.message, faults))),
    )  # fmt: skip


class _Search(BranchAndBound[Subset]):
    """Branch and bound over subsets of rows; `decide` solves the problems of their files."""

    what = "combinations of rows"

    def __init__(self, problem: Problem, decide: methods.Decide = methods.solve) -> None:
        choices = problem.extra(Choices)
        if choices is None or problem.origin is None:
            raise ModelError(_CHANGED)
        self.problem, self.decide, self.path = problem, decide, problem.origin.path
        self.tables = {key: value for key, value in problem.origin.tables.items() if key != "choices"}
        drawing = load_tables(self.tables, self.path)
        if any(getattr(drawing, name) != getattr(problem, name) for name in _SAME):
            raise ModelError(_CHANGED)
        with errors_in_file(self.path):
            self.lists = choices.at_addresses(self.tables)
        self.whole = math.prod(len(parts.rows) for parts in self.lists)
        if self.whole > MAX_WHOLE:
            raise ModelError(f"[[choices]] has {self.whole:,} combinations, more than {MAX_WHOLE:,}; shorten the lists")
        self.solved: dict[tuple[int, ...], Combination] = {}
        self.best: Result | None = None
        self.price = 0.0
        self.nearest: tuple[str, NearestDesign] | None = None
        self.values, self.faults = list[float](), list[str]()

    def problem_of(self, subset: Subset) -> Problem:
        """Return the problem of a subset, whose numbers are open where its rows differ."""
        drawing = load_tables(with_rows(self.tables, self.lists, subset), self.path)
        return replace(drawing, search=self.problem.search, tolerance=self.problem.tolerance)

    @cached_property
    def groups(self) -> dict[Column, tuple[Decision, ...]]:
        """Decisions that each column moves if it is open; none for a limit, and where no bound holds."""
        groups, usual = dict[Column, tuple[Decision, ...]](), {decision.name for decision in self.problem.decisions}
        first = with_rows(self.tables, self.lists, ((0,),) * len(self.lists))
        for parts, column in [(of, column) for of in self.lists for column in of.columns]:
            tables = with_rows(first, (replace(parts, columns=(column,)),), (tuple(range(len(parts.rows))),))
            try:
                decisions = load_tables(tables, self.path).decisions
            except _UNSOLVED:
                decisions = ()
            moved = tuple(decision for decision in decisions if decision.name not in usual)
            groups[column] = () if any(decision.address_drives for decision in moved) else moved
        return groups

    @cached_property
    def at_once(self) -> int:
        """Largest subset whose combinations are solved one by one without a bound of the subset."""
        columns = (column for parts in self.lists for column in parts.columns if not column.side)
        is_easy = all(moved and all(d.is_affine for d in moved) for moved in map(self.groups.__getitem__, columns))
        return SMALL if is_easy or not all(d.is_affine for d in self.problem.decisions) else LARGE

    def run(self, max_nodes: int) -> float:
        """Solve or exclude combinations until all are decided; return a lower bound of the objective over them."""
        root: Subset = tuple(tuple(range(len(parts.rows))) for parts in self.lists)
        self.solve(tuple(rows[0] for rows in root))
        return self.divide((self.bound(root), root), max_nodes)

    @property
    def cutoff(self) -> float:
        """Objective of the last combination that is ranked; a subset with a bound above has none of these."""
        return self.values[RANKED - 1] if len(self.values) >= RANKED else math.inf

    def is_fathomed(self, node: OpenNode[Subset]) -> bool:
        """Return True if no combination of a subset is one of the best that are ranked."""
        return node.bound >= self.cutoff

    def branch(self, nodes: Sequence[OpenNode[Subset]]) -> BoundedParts[Subset]:
        """Yield the halves of a subset with bounds, the combinations of a small one, or the level of a single one."""
        ((bound, _, subset),) = nodes
        if _count(subset) == 1:
            yield FathomedPart(max(bound, self.solve(tuple(rows[0] for rows in subset), bound).bound))
        elif _count(subset) <= self.at_once:
            yield from ((bound, tuple((row,) for row in rows)) for rows in itertools.product(*subset))
        else:
            yield from ((max(bound, self.bound(half)), half) for half in self.halves(subset))

    def halves(self, subset: Subset) -> Iterator[Subset]:
        """Yield the halves of a subset across its widest number; numbers that cannot be open come first."""

        def width(k: int, column: Column) -> float:
            values = [column.values[row] for row in subset[k]]
            is_closed = column.varies(subset[k]) and not self.groups[column]
            return math.inf if is_closed else float(np.ptp(values)) / (max(map(abs, column.values)) or 1.0)

        lists = [(k, column) for k, parts in enumerate(self.lists) for column in parts.columns if len(subset[k]) > 1]
        k, column = max(lists, key=lambda pair: width(*pair))
        order, middle = sorted(subset[k], key=column.values.__getitem__), len(subset[k]) // 2
        for half in (order[:middle], order[middle:]):
            yield (*subset[:k], tuple(half), *subset[k + 1 :])

    def solve(self, rows: tuple[int, ...], below: float = 0.0) -> Combination:
        """Return the outcome of a combination, solved at its first use; `below` is the bound of its subset."""
        if rows in self.solved:
            return self.solved[rows]
        value, bound, proof, reason = math.inf, 0.0, "not solved", ""
        names = ", ".join(f"'{parts.rows[k][0]}'" for parts, k in zip(self.lists, rows, strict=True))
        problem = self.problem_of(tuple((row,) for row in rows))
        try:
            result, price = self._decided(problem)
        except _UNSOLVED as error:
            reason = str(error)
        else:
            bound, proof = _bound_of(result) + price, str(result.status)
            if result.status.has_design and result.objective is not None:
                value, certificate = result.objective.value + price, result.certificate
                proof = str(Proof.GLOBAL if certificate is None else certificate.kind)
                witness = Witness(np.array(rows), value, lambda: _upper_value(result) + price)
                witness.check(self.what, below)
                bisect.insort(self.values, value)
                if value < self.value:
                    self.best, self.price, self.value, self.witness = result, price, value, witness
            elif result.status is not Status.INFEASIBLE:
                reason = result.message
            elif not problem.decisions:
                # with open numbers the design of the result is the initial one
                record = nearest_record(problem, result.final, ())
                if self.nearest is None or record.violation < self.nearest[1].violation:
                    self.nearest = names, record
        if reason:
            self.faults.append(f"{names} ({reason})")
        self.solved[rows] = Combination(rows, value, bound, proof)
        return self.solved[rows]

    def bound(self, subset: Subset) -> float:
        """Return a lower bound of the objective over a subset; zero if it is small, or none is known."""
        if _count(subset) <= self.at_once:
            return 0.0
        try:
            problem = self._relaxed(subset)
            result, price = (None, 0.0) if problem is None else self._decided(problem)
        except _UNSOLVED:
            # an error proves nothing
            return 0.0
        bound = 0.0 if result is None else _bound_of(result) + price
        if result is not None and result.status.has_design:
            self.solve(self._nearest(subset, result), bound)
        return bound

    def _decided(self, problem: Problem) -> tuple[Result, float]:
        # result without terms of the price, which nothing open changes, and their sum; a price over its limit decides
        limits = [limit for limit in problem.limits if limit.measure.channel is PARTS_PRICE]
        cost = price_of(problem.engine)
        dear = tuple(limit.name for limit in limits if limit.slack(cost)[0] < -FEASIBILITY_TOL)
        if dear:
            return infeasible_result(problem, evaluate_start(problem), dear, {}), 0.0
        terms = [term for term in problem.objective if term.measure.channel is PARTS_PRICE]
        others = tuple(term for term in problem.objective if term not in terms)
        if not terms or not others:
            return self.decide(problem), 0.0
        return self.decide(replace(problem, objective=others)), sum(term.weight for term in terms) * cost

    def _relaxed(self, subset: Subset) -> Problem | None:
        """Return the problem of a subset, with limits wider by the violation that designs may have.

        The result is None if a number that varies cannot be open.
        """
        pairs = [(column, rows) for parts, rows in zip(self.lists, subset, strict=True) for column in parts.columns]
        moved = [self.groups[column] for column, rows in pairs if column.varies(rows)]
        if not all(moved):
            return None
        problem = self.problem_of(subset)
        by_name = {decision.name: decision for decision in problem.decisions}
        for group in moved:
            # parts that take one row have one number
            first, *others = (by_name[decision.name] for decision in group)
            if all((other.set, other.start) == (first.set, first.start) for other in others):
                drives = itertools.chain(first.drives, *(by_name.pop(other.name).drives for other in others))
                by_name[first.name] = replace(first, drives=tuple(drives))
        limits = tuple(
            replace(
                limit, minimum=limit.minimum - FEASIBILITY_TOL * (abs(limit.minimum) or 1.0),
                maximum=limit.maximum + FEASIBILITY_TOL * (abs(limit.maximum) or 1.0),
            )
            for limit in problem.limits if limit.outside is None
        )  # fmt: skip
        search = replace(problem.search, starts=1, boxes=min(problem.search.boxes_or(BOXES), BOXES))
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

    def contains_witness(self, part: Subset) -> bool:
        """Return True if the best combination lies in a subset."""
        return self.witness is not None and all(k in rows for k, rows in zip(self.witness.place, part, strict=True))

    @property
    def outcome(self) -> Outcome:
        """Combinations that were solved, the best first, and the number of those that bounds exclude."""
        solved = sorted(self.solved.values(), key=lambda known: (known.value, known.rows))
        parts = () if self.complete else (node.part for node in self.open_nodes)
        left = sum(rows not in self.solved for part in parts for rows in itertools.product(*part))
        return Outcome(self.lists, tuple(solved), self.whole, self.whole - len(solved) - left)


def _bound_of(result: Result) -> float:
    if result.status is Status.INFEASIBLE:
        return math.inf
    if result.certificate is not None:
        return result.certificate.lower_bound
    # nothing is open, so that the engine was evaluated alone
    return result.objective.value if result.objective is not None and result.status.has_design else 0.0


def _upper_value(result: Result) -> float:
    # value with errors of sampling and numerical zero
    assert result.objective is not None
    zero_level = numerical_zero(result.problem, result.final.engine)
    return result.objective.value * (1.0 + 2.0 * result.error_estimate) + zero_level


def _count(subset: Subset) -> int:
    return math.prod(map(len, subset))


REDUCTION = methods.Reduction(
    "parts lists", lambda problem: problem.extra(Choices) is not None,
    lambda problem, decide, _: solve_choices(problem, decide), refuse, "refined sampling",
)  # fmt: skip
