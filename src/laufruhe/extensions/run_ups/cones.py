"""Optimum of unbalances for run-up and shut-down on mounts without bump stops, where loads add up (E28a, P11).

Each step of a run is affine in the unbalances, so that its largest force, travel and twist are convex. The cone program
has only the steps near a limit or a maximum, and steps that a design violates join it. Fewer steps relax the program,
so that its lower bound is valid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.extensions.run_ups.peaks import RunPeaks
from laufruhe.extensions.run_ups.runs import STRETCHES
from laufruhe.load_models.affine import FEASIBLE, AffineModel, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import until_time_limit
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.decision import decision_vector, domains_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import KnownRows, Problem
from laufruhe.solvers.conclusion import infeasible_result, unbalance_values, with_constant_limits
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.unbalances import smallest_conflict
from laufruhe.solvers.result import Result, Status

# most rounds that gather time steps, samples of their programs, and most solutions after them
_ROUNDS, _COARSE, _AGAIN = 40, 48, 4
Decide = Callable[[Problem], Result]
"""Function that solves a problem without run-ups, or with known rows in place of them."""
NEAR = 0.98
"""Share of a limit, or of a maximum, above which a time step joins the program."""


@dataclass(frozen=True, eq=False)
class RunRows:
    """Signals of each time step of run-up and shut-down, as rows affine in the n columns of unbalances.

    For each measure, constants have the shape (steps, places, d), and slopes the shape (steps, places, d, n).
    """

    constants: dict[Measure, Array]
    slopes: dict[Measure, Array]

    @classmethod
    def from_problem(cls, problem: Problem, measures: Sequence[Measure]) -> RunRows | None:
        """Return the signals of run-up measures as rows that are affine in the unbalances.

        The result is None if they are not linear.
        """
        count = sum(domain.width for domain in domains_of(problem.unbalances))
        signals = RunPeaks(problem, measures).rows([np.zeros(count), *np.eye(count)])
        if signals is None:
            return None
        constants, *unit_signals = signals
        slopes = {
            measure: np.stack([signal[measure] - constant for signal in unit_signals], axis=-1)
            for measure, constant in constants.items()
        }
        return cls(constants, slopes)

    def worst(self, measure: Measure, x: Array) -> float:
        """Return the largest length of a row of a measure at unbalances `x`, shape (n,)."""
        return float(self._lengths(measure, x).max())

    def near(self, measure: Measure, x: Array, height: float) -> NDArray[np.intp]:
        """Return flat indices of the longest row in each interval and place, if it is above NEAR * `height`.

        Rows are evaluated at the unbalances `x`.
        """
        sizes = self._lengths(measure, x)
        interval_length = -(-len(sizes) // (2 * STRETCHES))
        places = []
        for start in range(0, len(sizes), interval_length):
            interval = sizes[start : start + interval_length]
            longest = interval.argmax(axis=0)
            is_near = interval[longest, np.arange(interval.shape[1])] >= NEAR * height
            places.append((start + longest[is_near]) * sizes.shape[1] + np.flatnonzero(is_near))
        return np.concatenate(places)

    def known(self, measure: Measure, places: NDArray[np.intp]) -> KnownRows:
        """Return the rows of a measure with the flat indices `places`."""
        constant, slope = self.constants[measure], self.slopes[measure]
        d, n = slope.shape[2:]
        return KnownRows(constant.reshape(-1, d)[places], slope.reshape(-1, d, n)[places])

    def _lengths(self, measure: Measure, x: Array) -> Array:
        return np.asarray(np.linalg.norm(self.constants[measure] + self.slopes[measure] @ x, axis=-1))


def solve_run_cones(
    problem: Problem, limits: Sequence[Limit], terms: Sequence[Term], rows: RunRows, decide: Decide
) -> Result:  # fmt: skip
    """Return the optimal unbalances for run-ups, with their proof, by cone programs.

    `limits` and `terms` are the limits and objective terms of run-ups; `rows` are all their time steps.
    """
    steps = _Steps(problem, limits, terms, rows)
    if not steps.gather():
        names = [limit.name for limit in steps.problem.load_limits]
        return infeasible_result(problem, evaluate(problem), smallest_conflict(steps.affine(averaged=True), names), {})
    for _ in until_time_limit(range(_AGAIN)):
        result = decide(steps.problem)
        x, domains = None, domains_of(problem.decisions)
        if result.decisions:
            x = decision_vector(domains, unbalance_values(problem, result))
        if result.problem.fidelity != problem.fidelity:
            # compute the rows again with the fidelity that the accuracy needs
            refined = problem.at(result.problem.fidelity)
            refined_rows = RunRows.from_problem(refined, [*rows.constants])
            return solve_run_cones(refined, limits, terms, refined_rows or rows, decide)
        if x is not None and result.status is Status.FEASIBLE:
            # the result may be the initial design, because the optimum violates steps that the program lacks
            x = solve_cones(steps.affine(result.final.samples)).x
        if x is None or result.status is Status.INFEASIBLE or steps.has_all(x):
            break
        steps.add(x)
    return with_constant_limits(replace(result, problem=problem), problem.limits)


class _Steps:
    """Time steps of the runs near the limits, or near the maximum of an objective, in any design so far."""

    def __init__(self, problem: Problem, limits: Sequence[Limit], terms: Sequence[Term], rows: RunRows) -> None:
        self._problem, self._limits, self._terms, self._rows = problem, limits, terms, rows
        self._places: dict[Measure, NDArray[np.intp]] = {}

    @property
    def problem(self) -> Problem:
        """Problem with the rows of these steps; limits of run-ups without such steps are omitted."""
        rows_of_steps = {measure: self._rows.known(measure, places) for measure, places in self._places.items()}
        limits = [x for x in self._problem.limits if not x.measure.channel.simulation or x.measure in rows_of_steps]
        return replace(self._problem, known_rows=rows_of_steps, limits=tuple(limits))

    def affine(self, samples: int = _COARSE, averaged: bool = False) -> AffineProblem:
        """Return the program at up to `samples` samples; averaged means exclude no feasible design (P7)."""
        model = AffineModel(self.problem)
        return model.at(min(samples, model.full_samples), averaged)

    def add(self, x: Array) -> None:
        """Add to the program the time steps near the limits, and near the maximum, at unbalances `x`."""
        heights = [(limit.measure, limit.maximum) for limit in self._limits]
        heights += [(term.measure, self._rows.worst(term.measure, x)) for term in self._terms]
        for measure, height in heights:
            near_steps = self._rows.near(measure, x, height)
            if len(near_steps):
                places = self._places.get(measure, near_steps)
                self._places[measure] = np.union1d(places, near_steps).astype(np.intp)

    def has_all(self, x: Array) -> bool:
        """Return True if the program needs no more time steps at unbalances `x`.

        The design then satisfies the limits in all steps, and no step exceeds those in the program.
        """
        satisfies_limits = all(
            self._rows.worst(limit.measure, x) <= limit.maximum * (1.0 + 0.1 * FEASIBLE) for limit in self._limits
        )
        for term in self._terms if satisfies_limits else ():
            rows_in_program = self._rows.known(term.measure, self._places[term.measure])
            maximum = np.linalg.norm(rows_in_program.constant + rows_in_program.slope @ x, axis=-1).max()
            if self._rows.worst(term.measure, x) > float(maximum) * (1.0 + 0.1 * self._problem.tolerance):
                return False
        return satisfies_limits

    def gather(self) -> bool:
        """Add time steps to the program until its design satisfies all steps; return True if there is such a design."""
        x = decision_vector(domains_of(self._problem.decisions))
        for _ in until_time_limit(range(_ROUNDS)):
            self.add(x)
            report_progress("steps of the run-up", sum(map(len, self._places.values())))
            optimum = solve_cones(self.affine()).x
            if optimum is None:
                optimum = solve_cones(self.affine(averaged=True)).x
            if optimum is None:
                return False
            x = optimum
            if self.has_all(x):
                break
        return True
