"""Limits of run-up and shut-down that are designed for: loads add up on mounts without bump stops (E28a, P11).

Each step of a run is affine in the unbalances, so that its largest force, travel and twist are convex. The cone program
has the steps that matter, more as designs break others: fewer steps ask for less, so its bound holds for all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import FEASIBLE, AffineModel, AffineProblem
from laufruhe.load_models.run_rows import RunRows
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import in_time
from laufruhe.numerics.progress import tell
from laufruhe.problem.decision import Kind, domains_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import broken_limits, none_within, with_limits
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.unbalances import conflict_of
from laufruhe.solvers.mounts.starts import unbalances_of
from laufruhe.solvers.result import Result, Status

_ROUNDS, _COARSE, _AGAIN = 40, 48, 4


def solve_runs(problem: Problem, limits: Sequence[Limit], decide: Callable[[Problem], Result]) -> Result | None:
    """The best design within limits of its run-ups; None where these are not linear in what is open."""
    kinds = {decision.kind for decision in problem.decisions}
    rows = RunRows.of(problem, limits) if kinds <= {Kind.UNBALANCE, Kind.SHARE} and problem.phasing is None else None
    if rows is None:
        return None
    steps = _Steps(problem, limits, rows)
    if not steps.found():
        names = [limit.name for limit in steps.problem.load_limits]
        return none_within(problem, evaluate(problem), conflict_of(steps.affine, names), {})
    for _ in in_time(range(_AGAIN)):
        result = decide(steps.problem)
        if result.status is Status.INFEASIBLE or not broken_limits(limits, result.final):
            break
        steps.add(np.concatenate([
            domain.columns_of(value)
            for domain, value in zip(domains_of(problem.decisions), unbalances_of(problem, result), strict=True)
        ]))  # fmt: skip
    return with_limits(replace(result, problem=problem), problem.limits)


class _Steps:
    """Steps of the runs that come near the limits of some design."""

    def __init__(self, problem: Problem, limits: Sequence[Limit], rows: RunRows) -> None:
        self._whole, self._limits, self._rows = problem, limits, rows
        self._places: dict[Measure, NDArray[np.intp]] = {}

    @property
    def problem(self) -> Problem:
        """With those steps; limits that none comes near are left out."""
        known = {measure: self._rows.known(measure, places) for measure, places in self._places.items()}
        kept = (x for x in self._whole.limits if not x.measure.channel.is_checked or x.measure in known)
        return replace(self._whole, known_rows=known, limits=tuple(kept))

    @property
    def affine(self) -> AffineProblem:
        """At few angles."""
        model = AffineModel(self.problem)
        return model.at(min(_COARSE, model.full_samples))

    def add(self, x: Array) -> None:
        """Those that a design brings near the limits."""
        for limit in self._limits:
            near = self._rows.near(limit, x)
            if len(near):
                known = self._places.get(limit.measure, near)
                self._places[limit.measure] = np.union1d(known, near).astype(np.intp)

    def found(self) -> bool:
        """Whether designs of few angles keep all steps; those that break some add them."""
        parts = [domain.columns_of(domain.decision.start) for domain in domains_of(self._whole.decisions)]
        x = np.concatenate(parts)
        for _ in in_time(range(_ROUNDS)):
            self.add(x)
            tell("steps of the run-up", sum(map(len, self._places.values())))
            solution = solve_cones(self.affine)
            if solution.x is None:
                return False
            x = solution.x
            if all(self._rows.worst(limit, x) <= limit.maximum * (1.0 + 0.1 * FEASIBLE) for limit in self._limits):
                break
        return True
