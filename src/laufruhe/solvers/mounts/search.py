"""Multistart search of mounts, unbalances and throws; the exact model evaluates every local optimum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.simulated import COARSE_STEP
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, timed_rounds
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import FEASIBLE, Design, initial_design
from laufruhe.solvers.mounts.starts import StartPoint, design_at_start, evaluate_design_at, start_points
from laufruhe.solvers.smooth.local_optimum import LocalOptimum, distinct_optima, is_explored
from laufruhe.solvers.smooth.nonlinear import StopWhen, solve_nonlinear
from laufruhe.solvers.smooth.program import SmoothProgram

# largest relative violation of a limit by a feasible result
SLACK = 1e-5
# relative difference of objectives that counts as none
SAME = 1e-6
# largest number of searches with tighter limits from a local optimum
MAX_MARGINS = 6
# violation of a limit that a peak between samples may cause
NEAR = 0.05
# iterations of a search, and number of local optima that are searched again with tighter limits
ITERATIONS = 100
MAX_TIGHTENED = 3
# local optima of a search that are refined with exact simulations
MAX_REFINED = 1
# iterations of a search that simulates in every step
SIMULATED_ITERATIONS = 60
# deviation of start throws from their crank star [rad]
THROW_DEVIATION = 0.02


@dataclass(frozen=True, eq=False)
class SearchResult:
    """A design by the exact model, and the local optimum of a smooth program from which it was computed.

    The optimum is None if the design was only evaluated.
    """

    design: Design
    joint: SmoothProgram
    optimum: LocalOptimum | None = None

    @property
    def rank(self) -> tuple[float, float]:
        """Sort key: violation of limits, then objective."""
        return max(self.design.violation, SLACK), self.design.value


class MountSearch:
    """Multistart search of open mounts, with one crank star and one firing order.

    Parameters
    ----------
    initial
        Evaluation of the initial design, which competes with the results.
    workers
        Number of processes; by default the number of processors.
    moves
        Moves of the throws from their crank star; None if throws are fixed.
    first
        First start: numbers of the mounts, and columns of the unbalances. If the columns are None, the unbalances are
        those that are optimal on the initial mounts.
    keep_initial
        True to keep the initial design as a start if there is another first start.
    coarser
        Factor of the time step of simulations over the final evaluation.

    Attributes
    ----------
    best
        Best result so far; None if every local optimum is on an undamped resonance.
    optima
        Local optima from all starts.
    """

    def __init__(
        self, problem: Problem, initial: Evaluation, workers: int | None = None, moves: ThrowMoves | None = None,
        first: StartPoint | None = None, keep_initial: bool = False, coarser: int = COARSE_STEP,
    ) -> None:  # fmt: skip
        self.problem, self.moves, self._workers, self._coarser = problem, moves, workers, coarser
        report_progress("starts of the mounts")
        self._points, self._size = start_points(problem)
        if first is not None:
            mounts, columns = first
            columns = self._points[0][1] if columns is None else columns
            self._points = [(mounts, columns), *self._points[0 if keep_initial else 1 :]]
        report_progress("smooth program of all decisions")
        self.joint = self._program()
        self._initial = initial_design(problem, initial) if moves is None else None
        self.best: SearchResult | None = None
        self._nearly_feasible: list[SearchResult] = []
        self.optima: tuple[LocalOptimum, ...] = ()

    def run(self) -> None:
        """Search for the best mounts from all starts, and store the best result.

        If no time is left and the first start is feasible, it is the result.
        """
        start = design_at_start(self.problem, self._points[0]) if is_time_over() and self.moves is None else None
        if start is not None and start.violation <= SLACK:
            self._update_best(SearchResult(start, self.joint))
            return
        generator = np.random.default_rng(self.problem.search.seed)
        starts = [
            self.joint.start(mounts, columns, self._perturbed_throws(generator, k))
            for k, (mounts, columns) in enumerate(self._points)
        ]
        self._evaluate_optima(
            self._solve(starts, lambda optima: is_explored(optima, max(abs(min(o.value for o in optima)), 1e-12)))
        )
        self._tighten()

    def refine(self) -> None:
        """Search again from the best local optima, with the time step of the final evaluation."""
        optima = distinct_optima(self.optima, max(abs(self.best.design.value) if self.best else 0.0, 1e-12), 1e-3)
        optima = optima or tuple(sorted(self.optima, key=lambda optimum: optimum.violation)[:1])
        starts = [_split(self.joint, optimum.x) for optimum in optima[:MAX_REFINED]]
        if self.best is not None and self.best.optimum not in optima[:MAX_REFINED]:
            starts.append(_start_of(self.best))
        self._coarser = 1
        self.joint = self._program()
        self._evaluate_optima(self._solve([self.joint.start(*start) for start in starts]))
        self._tighten()

    def search_from(self, points: Sequence[StartPoint]) -> bool:
        """Search for better mounts from additional start points; return True if the best design improved.

        A start point has numbers of mounts and values of unbalances. Without unbalances, it takes those of the best
        design. A complete start point is itself a candidate for the best design.
        """
        previous = self.best
        default = self._points[0][1] if previous is None or previous.optimum is None else _start_of(previous)[1]
        starts = []
        for mounts, unbalances in points:
            starts.append((mounts, default if unbalances is None else unbalances))
            if unbalances is not None or not self.problem.unbalances:
                start = design_at_start(self.problem, starts[-1])
                # a start that exceeds a limit by rounding is no candidate
                if start is not None and start.violation <= 0.0:
                    self._update_best(SearchResult(start, self.joint))
        self._evaluate_optima(self._solve([self.joint.start(*start) for start in starts]))
        self._tighten()
        return self.best is not None and (previous is None or self.best.rank < previous.rank)

    @property
    def best_or_initial(self) -> SearchResult | None:
        """Best of search results and initial design, which takes the prices of an equally good local optimum."""
        best, initial = self.best, self._initial
        if initial is None or (best is not None and best.rank <= SearchResult(initial, self.joint).rank):
            return best
        is_equal = best is not None and best.rank[1] <= initial.value * (1.0 + SAME) and best.design.violation <= SLACK
        return SearchResult(initial, self.joint, best.optimum if best is not None and is_equal else None)

    @property
    def turns(self) -> Array:
        """Moves of the throws of the best design from their crank star [rad], shape (moves,)."""
        optimum = self.best.optimum if self.best is not None else None
        return self.joint.throw_deviations(np.zeros(self.joint.program.x.numel()) if optimum is None else optimum.x)

    def _program(self, margin: float = 0.0) -> SmoothProgram:
        return SmoothProgram(self.problem, self._size, margin, self.moves, coarser=self._coarser)

    @property
    def _iterations(self) -> int:
        return ITERATIONS if self.joint.program.external is None else SIMULATED_ITERATIONS

    def _solve(self, starts: Sequence[Array], stop_when: StopWhen | None = None) -> tuple[LocalOptimum, ...]:
        return solve_nonlinear(self.joint.program, starts, self._workers, self._iterations, stop_when=stop_when)

    def _evaluate_optima(self, optima: Sequence[LocalOptimum]) -> None:
        """Evaluate local optima by the exact model, whatever status the solver reports."""
        self.optima += tuple(optima)
        for k, optimum in enumerate(optima):
            is_feasible = self.best is not None and self.best.design.violation <= SLACK
            best = self.best.design.value if self.best is not None and is_feasible else np.inf
            report_progress("evaluated local optima", k, len(optima), best)
            design = self._evaluate_optimum(optimum, self.joint)
            if design is not None:
                result = SearchResult(design, self.joint, optimum)
                self._update_best(result)
                if FEASIBLE < design.violation <= NEAR:
                    self._nearly_feasible.append(result)

    def _update_best(self, result: SearchResult) -> None:
        if self.best is None or result.rank < self.best.rank:
            self.best = result

    def _evaluate_optimum(self, optimum: LocalOptimum, joint: SmoothProgram) -> Design | None:
        if not np.all(np.isfinite(optimum.x)):
            return None
        try:
            problem = self.problem if self.moves is None else joint.problem_at(optimum.x)
        except ModelError:
            # the throws may violate the firing order if the search stopped early
            return None
        return evaluate_design_at(problem, *joint.decision_values(optimum.x))

    def _perturbed_throws(self, generator: np.random.Generator, k: int) -> Array:
        # a symmetric star may be a saddle point, so later starts are random
        if self.moves is None or k == 0:
            return self.joint.throw_deviations(np.zeros(self.joint.program.x.numel()))
        deviations = THROW_DEVIATION * generator.normal(size=self.moves.size)
        return np.clip(deviations, self.moves.lower, self.moves.upper)

    def _tighten(self) -> None:
        """Search again, with tighter limits, from good local optima that violate a limit between two samples."""
        by_value = sorted(self._nearly_feasible, key=lambda result: result.design.value)
        self._nearly_feasible = []
        values = [result.design.value for result in by_value]
        distinct_results = [
            result for k, result in enumerate(by_value)
            if k == 0 or abs(values[k] - values[k - 1]) > 1e-3 * abs(values[k - 1])
        ]  # fmt: skip
        for result in distinct_results[:MAX_TIGHTENED]:
            best = self.best
            if best is not None and best.design.violation <= FEASIBLE and result.design.value >= best.design.value:
                continue
            margin = 0.0
            for _ in timed_rounds(MAX_MARGINS):
                if result.optimum is None or not FEASIBLE < result.design.violation <= NEAR:
                    break
                margin += 1.001 * result.design.violation
                joint = self._program(margin)
                ends = solve_nonlinear(joint.program, [result.optimum.x], 1, self._iterations)
                design = self._evaluate_optimum(ends[0], joint) if ends else None
                if design is None:
                    break
                result = SearchResult(design, joint, ends[0])
                self._update_best(result)


def _split(joint: SmoothProgram, x: Array) -> tuple[list[float], Array]:
    mounts, _ = joint.decision_values(x)
    return list(mounts), x[len(mounts) : len(mounts) + joint.columns]


def _start_of(result: SearchResult) -> tuple[list[float], Array]:
    assert result.optimum is not None
    return _split(result.joint, result.optimum.x)
