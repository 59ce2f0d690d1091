"""A search for mounts, and unbalances and throws with them: from many starts, every end judged by the exact model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.simulated import COARSER
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import passed, rounds
from laufruhe.numerics.progress import report_progress
from laufruhe.problem.decision import sides_of
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import Limit
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import FEASIBLE, Design, given_design
from laufruhe.solvers.mounts.places import Place, judged_at, started_at
from laufruhe.solvers.mounts.starts import start_points
from laufruhe.solvers.smooth.local_optimum import LocalOptimum, distinct, is_explored
from laufruhe.solvers.smooth.nonlinear import Enough, solve_nonlinear, try_all
from laufruhe.solvers.smooth.program import SmoothProgram

SLACK = 1e-5
# share by which two designs are worth the same
SAME = 1e-6
MOST_MARGINS = 6
# excess over a limit that is more than a peak between the samples
NEAR = 0.05
ITERATIONS = 100
MOST_AROUND = 3
# ends of a search from which simulations are followed exactly
MOST_REFINED = 1
# of a search whose every step takes a simulation
SIMULATED_ITERATIONS = 60
# share of the size that a search counted in from which it is done again in a smaller one, and how often
SMALL = 1e-2
MOST_SIZES = 3
SPREAD = 0.4
# starts at which limits are looked at, share of a limit that has to be left there, and within which it is felt
LOOKED = 6
ROOM, FELT = 0.5, 0.05
# of the throws that a search starts from, about their star [rad]
NUDGE = 0.02


@dataclass(frozen=True, eq=False)
class Found:
    """A design, and the end of the search that it stands at; none where it was only looked at.

    Attributes
    ----------
    joint
        The program that the end is of.
    """

    design: Design
    joint: SmoothProgram
    optimum: LocalOptimum | None = None

    @property
    def rank(self) -> tuple[float, float]:
        """By what breaks limits least, then by what is least."""
        return max(self.design.excess, SLACK), self.design.value


class MountSearch:
    """What was found so far.

    Parameters
    ----------
    problem
        With one star and one firing order.
    initial
        The design as given, which is looked at as well.
    workers
        Processes; as many as processors when left out.
    moves
        Throws that may leave the star of the problem.
    first
        Mounts and columns to start from before all others, in place of those given or `beside` them; without columns
        the unbalances are those that are best on the mounts as given.
    coarser
        Times as long as those of the last word steps of simulations are.

    Attributes
    ----------
    best
        None where no end of the search has loads.
    optima
        Where all starts ended.
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
            own = self._points[0][1] if columns is None else columns
            self._points = [(mounts, own), *self._points[0 if beside else 1 :]]
        self._left_out = self._kept_anyway()
        report_progress("smooth program of all that is open")
        self.joint = self._program()
        self._given = given_design(problem, initial) if moves is None else None
        self.best: Found | None = None
        self._near: list[Found] = []
        self._felt: set[Limit] = set()
        self.optima: tuple[LocalOptimum, ...] = ()

    def run(self) -> None:
        """From all starts, and again in a smaller size where that of the starts hid what was found.

        Where time is over already, the first start is the design if it is one.
        """
        start = started_at(self.problem, self._points[0]) if passed() and self.moves is None else None
        if start is not None and start.excess <= SLACK:
            self._keep(Found(start, self.joint))
            return
        nothing = numerical_zero(self.problem)
        self._under_what_is_felt(lambda: self._search(self._points))
        for _ in rounds(MOST_SIZES):
            if self.best is None or self.best.design.value >= SMALL * self._size or self._size <= nothing:
                break
            # a search ends at a share of the size that it counts in
            self._size = max(self.best.design.value, nothing)
            self.joint = self._program()
            self._search([_point(self.best), *self._points[1:]])
        self._tighten()

    def refined(self) -> None:
        """Once more from the best ends, with simulations in the steps of the last word."""
        ends = distinct(self.optima, max(abs(self.best.design.value) if self.best else 0.0, 1e-12), 1e-3)
        ends = ends or tuple(sorted(self.optima, key=lambda optimum: optimum.violation)[:1])
        places = [_parted(self.joint, optimum.x) for optimum in ends[:MOST_REFINED]]
        if self.best is not None and self.best.optimum not in ends[:MOST_REFINED]:
            places.append(_point(self.best))
        self._coarser = 1
        self.joint = self._program()
        starts = [self.joint.start(*place) for place in places]
        self._take(self._ends(starts))
        self._tighten()

    def again(self, places: Sequence[Place]) -> bool:
        """From other mounts, where no unbalances are told with those found; whether a better design came of it.

        The places themselves are judged too, where they are whole designs: a search may leave a good start.
        """
        before = self.best
        columns = self._points[0][1] if before is None or before.optimum is None else _point(before)[1]
        starts = [(mounts, columns if own is None else own) for mounts, own in places]
        for place, (_, own) in zip(starts, places, strict=True):
            alone = None if self.problem.unbalances and own is None else started_at(self.problem, place)
            # what passes a limit by a rounding is no better for it
            if alone is not None and alone.excess <= 0.0:
                self._keep(Found(alone, self.joint))
        self._under_what_is_felt(lambda: self._take(self._ends([self.joint.start(*start) for start in starts])))
        self._tighten()
        return self.best is not None and (before is None or self.best.rank < before.rank)

    @property
    def chosen(self) -> Found | None:
        """The best of all, the design as given included; it has the prices of an end that is worth the same."""
        best, given = self.best, self._given
        if given is None or (best is not None and best.rank <= Found(given, self.joint).rank):
            return best
        same = best is not None and best.rank[1] <= given.value * (1.0 + SAME) and best.design.excess <= SLACK
        return Found(given, self.joint, best.optimum if best is not None and same else None)

    @property
    def turns(self) -> Array:
        """Deviations of the throws of the best design."""
        optimum = self.best.optimum if self.best is not None else None
        return self.joint.turns(np.zeros(self.joint.program.x.numel()) if optimum is None else optimum.x)

    def _search(self, points: Sequence[tuple[list[float], Array]]) -> None:
        """From the points, and from others drawn around the best ends."""
        problem, joint = self.problem, self.joint
        generator = np.random.default_rng(problem.search.seed)
        starts = [
            joint.start(mounts, columns, self._nudged(generator, k)) for k, (mounts, columns) in enumerate(points)
        ]
        optima = self._ends(starts, self._is_explored)
        around = distinct(optima, max(abs(optima[0].value), 1e-12), 1e-3)[:MOST_AROUND]
        if around and len(points) > 1 and not self._is_explored(optima) and not passed():
            decisions = problem.mount_decisions
            low, high = sides_of(decisions)
            again = []
            for k in range(max(len(points) // 2, 1)):
                x = around[k % len(around)].x
                found, columns = _decided(joint, x)
                mounts = found + SPREAD * generator.normal(size=len(low)) * np.minimum(high - low, np.abs(found))
                again.append(joint.start(np.clip(mounts, low, high).tolist(), columns, joint.turns(x)))
            more = self._ends(again, try_all, len(points))
            optima = (*optima, *(replace(optimum, start=optimum.start + len(points)) for optimum in more))
        self._take(optima)

    def _program(self, margin: float = 0.0) -> SmoothProgram:
        limits = tuple(limit for limit in self.problem.limits if limit not in self._left_out)
        asked = self.problem if not self._left_out else replace(self.problem, limits=limits)
        return SmoothProgram(asked, self._size, margin, self.moves, coarser=self._coarser)

    def _kept_anyway(self) -> set[Limit]:
        """Limits on loads that are kept where the search starts, with room to spare: each is hundreds of rows."""
        if self.moves is not None:
            return set()
        limits = [x for x in self.problem.load_limits if not x.measure.is_mass and not x.measure.channel.simulation]
        for place in self._points[:LOOKED] if limits else ():
            design = started_at(self.problem, place)
            limits = [x for x in limits if design is not None and design.evaluation.standing(x).excess < -ROOM]
        return set(limits)

    def _under_what_is_felt(self, search: Callable[[], None]) -> None:
        """A search, and again under the limits that were left out where its best ends come near them."""
        search()
        while self._felt and not (passed() and self.best is not None and self.best.design.excess <= SLACK):
            self._left_out, self._felt, self.optima, self._near = self._left_out - self._felt, set(), (), []
            self.joint = self._program()
            search()

    @property
    def _iterations(self) -> int:
        return ITERATIONS if self.joint.program.told is None else SIMULATED_ITERATIONS

    def _ends(self, starts: Sequence[Array], enough: Enough | None = None, known: int = 0) -> tuple[LocalOptimum, ...]:
        """Where starts of the program lead to, which has had so many before."""
        return solve_nonlinear(self.joint.program, starts, self._workers, self._iterations, enough=enough, known=known)

    def _is_explored(self, optima: Sequence[LocalOptimum]) -> bool:
        return is_explored(optima, max(abs(min(o.value for o in optima)), 1e-12))

    def _take(self, optima: Sequence[LocalOptimum]) -> None:
        """Judge where starts ended; whatever the solver says of an end, the exact model tells."""
        self.optima += tuple(optima)
        designs: list[Design] = []
        for k, optimum in enumerate(optima):
            kept = self.best is not None and self.best.design.excess <= SLACK
            report_progress(
                "ends judged", k, len(optima), self.best.design.value if self.best is not None and kept else np.inf
            )
            design = self._judged(optimum, self.joint)
            if design is not None:
                designs.append(design)
                found = Found(design, self.joint, optimum)
                self._keep(found)
                if FEASIBLE < design.excess <= NEAR:
                    self._near.append(found)
        self._felt = {limit for limit in self._left_out if any(self._feels(design, limit) for design in designs)}

    def _feels(self, design: Design, limit: Limit) -> bool:
        """Whether a design that is as good as the best but for what was left out is near a limit, or over it."""
        best = self.best
        if best is not None and best.design.excess <= SLACK and design.value > best.design.value:
            return False
        held = [other for other in self.problem.limits if other not in self._left_out]
        return design.evaluation.standing(limit).excess > -FELT and design.evaluation.excess(held) <= NEAR

    def _keep(self, found: Found) -> None:
        if self.best is None or found.rank < self.best.rank:
            self.best = found

    def _judged(self, optimum: LocalOptimum, joint: SmoothProgram) -> Design | None:
        if not np.all(np.isfinite(optimum.x)):
            return None
        mounts, unbalances = (iter(part) for part in joint.split(optimum.x))
        try:
            problem = self.problem if self.moves is None else joint.designed(optimum.x)
        except ModelError:
            # throws where a search was left may not fire in their order
            return None
        values: list[Value] = [next(unbalances) if d.is_affine else next(mounts) for d in problem.decisions]
        return judged_at(problem, values)

    def _nudged(self, generator: np.random.Generator, k: int) -> Array:
        """Throws to start from: on their star first, then beside it, for its own mirror image may be a saddle."""
        if self.moves is None or k == 0:
            return self.joint.turns(np.zeros(self.joint.program.x.numel()))
        nudge = NUDGE * generator.normal(size=self.moves.size)
        return np.clip(nudge, self.moves.lower, self.moves.upper)

    def _tighten(self) -> None:
        """Again with limits a little tighter, from ends that promise more: a peak between the samples breaks them."""
        worth = sorted(self._near, key=lambda found: found.design.value)
        self._near = []
        for near in [found for k, found in enumerate(worth) if k == 0 or _is_other(found, worth[k - 1])][:MOST_AROUND]:
            best = self.best
            if best is None or best.design.excess > FEASIBLE or near.design.value < best.design.value:
                self._tightened(near)

    def _tightened(self, near: Found) -> None:
        margin = 0.0
        for _ in rounds(MOST_MARGINS):
            if near.optimum is None or not FEASIBLE < near.design.excess <= NEAR:
                break
            margin += 1.001 * near.design.excess
            joint = self._program(margin)
            ends = solve_nonlinear(joint.program, [near.optimum.x], 1, self._iterations)
            design = self._judged(ends[0], joint) if ends else None
            if design is None:
                break
            near = Found(design, joint, ends[0])
            self._keep(near)


def _is_other(found: Found, other: Found) -> bool:
    return abs(found.design.value - other.design.value) > 1e-3 * abs(other.design.value)


def _decided(joint: SmoothProgram, x: Array) -> tuple[Array, Array]:
    """Mounts and columns of the unbalances."""
    mounts, _ = joint.split(x)
    return np.array(mounts), x[len(mounts) : len(mounts) + joint.columns]


def _parted(joint: SmoothProgram, x: Array) -> tuple[list[float], Array]:
    mounts, columns = _decided(joint, x)
    return mounts.tolist(), columns


def _point(found: Found) -> tuple[list[float], Array]:
    """Mounts and columns that an end of a search stands at."""
    assert found.optimum is not None
    return _parted(found.joint, found.optimum.x)
