"""Multistart search of mounts, with unbalances and throws; the exact model evaluates every end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.simulated import COARSER
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, timed_rounds
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.decision import real_bounds
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import FEASIBLE, Design, initial_design
from laufruhe.solvers.mounts.places import Place, evaluate_design_at, started_at
from laufruhe.solvers.mounts.starts import start_points
from laufruhe.solvers.smooth.local_optimum import LocalOptimum, distinct, is_explored
from laufruhe.solvers.smooth.nonlinear import StopWhen, solve_nonlinear, try_all
from laufruhe.solvers.smooth.program import SmoothProgram

SLACK = 1e-5
# relative difference by which two designs have the same value
SAME = 1e-6
MOST_MARGINS = 6
# violation of a limit that a peak between samples may cause
NEAR = 0.05
ITERATIONS = 100
MOST_AROUND = 3
# ends of a search that are refined with exact simulations
MOST_REFINED = 1
# iterations of a search that simulates in every step
SIMULATED_ITERATIONS = 60
# share of the objective unit below which a search is repeated in a smaller unit, and number of such repetitions
SMALL = 1e-2
MOST_SIZES = 3
SPREAD = 0.4
# starts at which limits are checked; relative distance to a limit that leaves it out, and that puts it back
CHECKED_STARTS = 6
ROOM, CLOSE = 0.5, 0.05
# deviation of start throws from their star [rad]
NUDGE = 0.02


@dataclass(frozen=True, eq=False)
class SearchResult:
    """A design with the local optimum that it comes from; without one if it was only evaluated.

    Attributes
    ----------
    joint
        Program of the local optimum.
    """

    design: Design
    joint: SmoothProgram
    optimum: LocalOptimum | None = None

    @property
    def rank(self) -> tuple[float, float]:
        """Sort key: violation of limits, then objective."""
        return max(self.design.violation, SLACK), self.design.value


class MountSearch:
    """Multistart search of open mounts.

    Parameters
    ----------
    problem
        Problem with one crank star and one firing order.
    initial
        Evaluation of the baseline design, which competes with the results.
    workers
        Processes; as many as processors by default.
    moves
        Throws that may leave the star of the problem.
    first
        First start: mounts and columns of unbalances, or None for those that are best on the baseline mounts.
    beside
        Whether the baseline is a start too when `first` is given.
    coarser
        Length of time steps of simulations, as a multiple of that of the final evaluation.

    Attributes
    ----------
    best
        Best result so far; None if no end has loads.
    optima
        Local optima of all starts.
    """

    def __init__(
        self, problem: Problem, initial: Evaluation, workers: int | None = None, moves: ThrowMoves | None = None,
        first: Place | None = None, beside: bool = False, coarser: int = COARSER,
    ) -> None:  # fmt: skip
        self.problem, self.moves, self._workers, self._coarser = problem, moves, workers, coarser
        report_progress("starts of the mounts")
        self._points, self._size = start_points(problem)
        if first is not None:
            mounts, columns = first
            columns = self._points[0][1] if columns is None else columns
            self._points = [(mounts, columns), *self._points[0 if beside else 1 :]]
        self._ignored = self._limits_with_room()
        report_progress("smooth program of all that is open")
        self.joint = self._program()
        self._baseline = initial_design(problem, initial) if moves is None else None
        self.best: SearchResult | None = None
        self._nearly_feasible: list[SearchResult] = []
        self._active_again: set[Limit] = set()
        self.optima: tuple[LocalOptimum, ...] = ()

    def run(self) -> None:
        """Search from all starts, and again in a smaller objective unit if the first one hides the optimum.

        If the time budget is over, the first start is the result if it is feasible.
        """
        start = started_at(self.problem, self._points[0]) if is_time_over() and self.moves is None else None
        if start is not None and start.violation <= SLACK:
            self._keep_best(SearchResult(start, self.joint))
            return
        zero_level = numerical_zero(self.problem)
        self._repeat_with_active_limits(lambda: self._search(self._points))
        for _ in timed_rounds(MOST_SIZES):
            if self.best is None or self.best.design.value >= SMALL * self._size or self._size <= zero_level:
                break
            # the solver's tolerance is relative to the unit of the objective
            self._size = max(self.best.design.value, zero_level)
            self.joint = self._program()
            self._search([_start_of(self.best), *self._points[1:]])
        self._tighten()

    def refined(self) -> None:
        """Repeat the search from the best ends, with the time steps of the final evaluation."""
        ends = distinct(self.optima, max(abs(self.best.design.value) if self.best else 0.0, 1e-12), 1e-3)
        ends = ends or tuple(sorted(self.optima, key=lambda optimum: optimum.violation)[:1])
        places = [_split(self.joint, optimum.x) for optimum in ends[:MOST_REFINED]]
        if self.best is not None and self.best.optimum not in ends[:MOST_REFINED]:
            places.append(_start_of(self.best))
        self._coarser = 1
        self.joint = self._program()
        self._take(self._solve([self.joint.start(*place) for place in places]))
        self._tighten()

    def again(self, places: Sequence[Place]) -> bool:
        """Search from other mounts; return whether the best design improved.

        Starts without columns have the unbalances of the best design. Complete starts are candidates themselves.
        """
        before = self.best
        default = self._points[0][1] if before is None or before.optimum is None else _start_of(before)[1]
        starts = []
        for mounts, columns in places:
            starts.append((mounts, default if columns is None else columns))
            if columns is not None or not self.problem.unbalances:
                start = started_at(self.problem, starts[-1])
                # a rounding over a limit is no improvement
                if start is not None and start.violation <= 0.0:
                    self._keep_best(SearchResult(start, self.joint))
        self._repeat_with_active_limits(lambda: self._take(self._solve([self.joint.start(*start) for start in starts])))
        self._tighten()
        return self.best is not None and (before is None or self.best.rank < before.rank)

    @property
    def chosen(self) -> SearchResult | None:
        """The best of the results and the baseline; an equally good end lends the baseline its prices."""
        best, baseline = self.best, self._baseline
        if baseline is None or (best is not None and best.rank <= SearchResult(baseline, self.joint).rank):
            return best
        same = best is not None and best.rank[1] <= baseline.value * (1.0 + SAME) and best.design.violation <= SLACK
        return SearchResult(baseline, self.joint, best.optimum if best is not None and same else None)

    @property
    def turns(self) -> Array:
        """Deviations of the throws of the best design from their star [rad]."""
        optimum = self.best.optimum if self.best is not None else None
        return self.joint.throw_deviations(np.zeros(self.joint.program.x.numel()) if optimum is None else optimum.x)

    @property
    def _is_feasible(self) -> bool:
        return self.best is not None and self.best.design.violation <= SLACK

    def _search(self, points: Sequence[tuple[list[float], Array]]) -> None:
        """Search from points, then from random points around the best ends."""
        problem, joint = self.problem, self.joint
        generator = np.random.default_rng(problem.search.seed)
        starts = [
            joint.start(mounts, columns, self._nudged(generator, k)) for k, (mounts, columns) in enumerate(points)
        ]
        optima = self._solve(starts, self._is_explored)
        around = distinct(optima, max(abs(optima[0].value), 1e-12), 1e-3)[:MOST_AROUND]
        if around and len(points) > 1 and not self._is_explored(optima) and not is_time_over():
            low, high = real_bounds(problem.mount_decisions)
            starts = []
            for k in range(max(len(points) // 2, 1)):
                x = around[k % len(around)].x
                centre, columns = _split(joint, x)
                mounts = centre + SPREAD * generator.normal(size=len(low)) * np.minimum(high - low, np.abs(centre))
                starts.append(joint.start(np.clip(mounts, low, high).tolist(), columns, joint.throw_deviations(x)))
            more = self._solve(starts, try_all, len(points))
            optima = (*optima, *(replace(optimum, start=optimum.start + len(points)) for optimum in more))
        self._take(optima)

    def _program(self, margin: float = 0.0) -> SmoothProgram:
        limits = tuple(limit for limit in self.problem.limits if limit not in self._ignored)
        problem = self.problem if not self._ignored else replace(self.problem, limits=limits)
        return SmoothProgram(problem, self._size, margin, self.moves, coarser=self._coarser)

    def _limits_with_room(self) -> set[Limit]:
        # each load limit would add hundreds of rows to the program
        if self.moves is not None:
            return set()
        limits = [x for x in self.problem.load_limits if not x.measure.is_mass and not x.measure.channel.simulation]
        for place in self._points[:CHECKED_STARTS] if limits else ():
            design = started_at(self.problem, place)
            limits = [x for x in limits if design is not None and design.evaluation.check_limit(x).violation < -ROOM]
        return set(limits)

    def _repeat_with_active_limits(self, search: Callable[[], None]) -> None:
        search()
        while self._active_again and not (is_time_over() and self._is_feasible):
            self._ignored = self._ignored - self._active_again
            self._active_again, self.optima, self._nearly_feasible = set(), (), []
            self.joint = self._program()
            search()

    @property
    def _iterations(self) -> int:
        return ITERATIONS if self.joint.program.external is None else SIMULATED_ITERATIONS

    def _solve(
        self, starts: Sequence[Array], stop_when: StopWhen | None = None, known: int = 0
    ) -> tuple[LocalOptimum, ...]:
        return solve_nonlinear(
            self.joint.program, starts, self._workers, self._iterations, stop_when=stop_when, known=known
        )

    def _is_explored(self, optima: Sequence[LocalOptimum]) -> bool:
        return is_explored(optima, max(abs(min(o.value for o in optima)), 1e-12))

    def _take(self, optima: Sequence[LocalOptimum]) -> None:
        """Evaluate local optima by the exact model, whatever the solver reports of them."""
        self.optima += tuple(optima)
        designs: list[Design] = []
        for k, optimum in enumerate(optima):
            best = self.best.design.value if self.best is not None and self._is_feasible else np.inf
            report_progress("ends judged", k, len(optima), best)
            design = self._evaluated(optimum, self.joint)
            if design is not None:
                designs.append(design)
                result = SearchResult(design, self.joint, optimum)
                self._keep_best(result)
                if FEASIBLE < design.violation <= NEAR:
                    self._nearly_feasible.append(result)
        self._active_again = {
            limit for limit in self._ignored if any(self._comes_close(design, limit) for design in designs)
        }

    def _comes_close(self, design: Design, limit: Limit) -> bool:
        if self.best is not None and self._is_feasible and design.value > self.best.design.value:
            return False
        limits = [other for other in self.problem.limits if other not in self._ignored]
        return design.evaluation.check_limit(limit).violation > -CLOSE and design.evaluation.violation(limits) <= NEAR

    def _keep_best(self, result: SearchResult) -> None:
        if self.best is None or result.rank < self.best.rank:
            self.best = result

    def _evaluated(self, optimum: LocalOptimum, joint: SmoothProgram) -> Design | None:
        if not np.all(np.isfinite(optimum.x)):
            return None
        mounts, unbalances = (iter(part) for part in joint.split(optimum.x))
        try:
            problem = self.problem if self.moves is None else joint.problem_at(optimum.x)
        except ModelError:
            # throws at an end that is no optimum may not fire in their order
            return None
        values: list[Value] = [next(unbalances) if d.is_affine else next(mounts) for d in problem.decisions]
        return evaluate_design_at(problem, values)

    def _nudged(self, generator: np.random.Generator, k: int) -> Array:
        # a symmetric star may be a saddle, so later starts are random
        if self.moves is None or k == 0:
            return self.joint.throw_deviations(np.zeros(self.joint.program.x.numel()))
        nudge = NUDGE * generator.normal(size=self.moves.size)
        return np.clip(nudge, self.moves.lower, self.moves.upper)

    def _tighten(self) -> None:
        """Search with tighter limits from promising ends that a peak between samples makes infeasible."""
        by_value = sorted(self._nearly_feasible, key=lambda result: result.design.value)
        self._nearly_feasible = []
        values = [result.design.value for result in by_value]
        different = [
            result for k, result in enumerate(by_value)
            if k == 0 or abs(values[k] - values[k - 1]) > 1e-3 * abs(values[k - 1])
        ]  # fmt: skip
        for near in different[:MOST_AROUND]:
            best = self.best
            if best is None or best.design.violation > FEASIBLE or near.design.value < best.design.value:
                self._search_with_margin(near)

    def _search_with_margin(self, near: SearchResult) -> None:
        margin = 0.0
        for _ in timed_rounds(MOST_MARGINS):
            if near.optimum is None or not FEASIBLE < near.design.violation <= NEAR:
                break
            margin += 1.001 * near.design.violation
            joint = self._program(margin)
            ends = solve_nonlinear(joint.program, [near.optimum.x], 1, self._iterations)
            design = self._evaluated(ends[0], joint) if ends else None
            if design is None:
                break
            near = SearchResult(design, joint, ends[0])
            self._keep_best(near)


def _split(joint: SmoothProgram, x: Array) -> tuple[list[float], Array]:
    mounts, _ = joint.split(x)
    return list(mounts), x[len(mounts) : len(mounts) + joint.columns]


def _start_of(result: SearchResult) -> tuple[list[float], Array]:
    assert result.optimum is not None
    return _split(result.joint, result.optimum.x)
