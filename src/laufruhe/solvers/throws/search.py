"""Branch and bound over throws that leave the even steps: firing windows first, then boxes of angles (S29)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.throw_waves import ThrowWaves, averaged, averages
from laufruhe.load_models.uneven_model import rides_of
from laufruhe.machine.firing_windows import FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.witness import EXCESS
from laufruhe.problem.evaluation import over
from laufruhe.problem.measure import load_rows
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate, Intervals
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.best_first import Over
from laufruhe.prove.certificate import room_of
from laufruhe.prove.witness import Known, thin
from laufruhe.solvers.boxes.search import Search, divided
from laufruhe.solvers.conclusion import FEASIBLE, read_under
from laufruhe.solvers.stars.design import StarDesign
from laufruhe.solvers.stars.ranking import ranked_orders
from laufruhe.solvers.throws.boxes import ThrowBox, ThrowPrograms
from laufruhe.solvers.throws.riders import Riders
from laufruhe.solvers.throws.stages import FEWEST_SAMPLES, MOST_SAMPLES, STEPS_COST, Stage, missed
from laufruhe.solvers.throws.windows import (
    amid,
    design_at,
    firing_of,
    nearest,
    place_in,
    stay,
    turn_freely,
    windows_of,
)

Programs = tuple[Callable[[int], ThrowPrograms], Callable[[int], float], Sequence[FiringWindow]]
"""Programs at so many steps over the period, what their orders leave out of the objective, their windows."""

Improve = Callable[[Candidate, bool], StarDesign | None]
"""The best design near a candidate, or with its throws where they are; and only the allowed one."""

MOST_BOXES = 1500
# of the tolerance by which a design has to be better, for a box to be looked at
SHARE = 0.5
# windows that are tried for a crank that can be evaluated
_MOST_REALISED = 50
# boxes whose middle is tried: the first few, and one of so many
_TRIED_FIRST, _TRIED_EACH, _MOST_TRIED = 2, 100, 5
# how far from standing at one angle a mixture is whose middle is tried as it stands, and how often
_STANDING, _MOST_STANDING = 1e-5, 12


@dataclass(frozen=True)
class Searched:
    """What boxes of throws told.

    Attributes
    ----------
    bound
        Of every design; infinite where none is allowed.
    best
        The best design, None where none was found.
    boxes
        How many were looked at.
    told
        Limits that no throws keep together, where none is allowed.
    what
        Was divided.
    """

    bound: float
    best: StarDesign | None
    boxes: int
    told: tuple[str, ...]
    what: str = "boxes of throws"


@dataclass(frozen=True, eq=False)
class _Part:
    """A box, the steps that its bound has, and the set of shafts that it is of; all throws where it has no box."""

    bound: float
    box: ThrowBox | None = None
    stage: Stage | None = None
    left_out: tuple[str, ...] = ()

    @property
    def is_exact(self) -> bool:
        """Whether there is nothing left to cut."""
        return self.box is not None and self.box.is_exact


@dataclass(frozen=True, eq=False)
class _Best:
    design: StarDesign | None

    @property
    def value(self) -> float:
        """Infinite where none was found."""
        return math.inf if self.design is None else self.design.value

    @property
    def rank(self) -> tuple[bool, float]:
        """By its value."""
        return self.design is None, self.value


def search_throws(
    problem: Problem, phasing: Phasing, best: StarDesign | None, floor: float, improve: Improve
) -> Searched | None:
    """What no throws go under, and the best that was found on the way; None where boxes say nothing.

    Parameters
    ----------
    best
        The best design known.
    floor
        A bound that holds.
    improve
        Told of throws that look good.
    """
    nothing = numerical_zero(problem)
    proven = best is not None and best.value - floor <= room_of(best.value, problem.tolerance, nothing)
    if proven or not knows(problem):
        return None
    windows = windows_of(problem, phasing)
    if windows is None:
        return None
    if not windows:
        return None if best is not None else Searched(math.inf, None, 0, ())
    try:
        search = ThrowSearch(problem, phasing, windows, improve, best)
    except ModelError:
        return None
    try:
        for stage, _, _ in search.roots:
            # what is too much to hold shows at once
            _ = stage.programs
    except ModelError:
        # a throw alone may drive what no mount carries
        return None
    most = len(search.roots) + problem.search.boxes_or(MOST_BOXES)
    found, bound, boxes = divided(search, _Part(floor), _Best(best), nothing, search.reached, most, search.what)
    return Searched(bound, found.design, boxes, search.conflict, search.what)


def loss_of(waves: ThrowWaves, problem: Problem) -> Callable[[int], float]:
    """What orders that are left out take off the objective, at so many steps."""
    return lambda samples: sum(term.weight * waves.left_out(term.measure, samples) for term in problem.objective)


def knows(problem: Problem) -> bool:
    """Whether waves know what is asked."""
    if problem.feels_gas and any(r.shaft.ratio != round(r.shaft.ratio) for r in problem.engine.rotors):
        return False
    return bool(problem.objective)


class ThrowSearch(Search[_Part, _Best]):
    """Windows and boxes of the throws of a problem."""

    def __init__(
        self, problem: Problem, phasing: Phasing, windows: Sequence[FiringWindow], improve: Improve,
        best: StarDesign | None,
    ) -> None:  # fmt: skip
        self._problem, self._phasing, self._improve = problem, phasing, improve
        self._seen = self._tried = self._stood = 0
        self._best, self._not_met = _Best(best), set[str]()
        # of one angle there are few boxes, so that steps may be many
        self.most_samples, self.steps_cost = (6144, 2e-5) if self._is_one_angle else (MOST_SAMPLES, STEPS_COST)
        self._finest: Stage | None = None
        self.roots: list[tuple[Stage, FiringWindow, tuple[str, ...]]] = []
        free = all(decision.set.lower <= 0.0 for decision in problem.unbalances)
        for built in phasing.shafts.largest if free else phasing.shafts.allowed:
            left_out = phasing.without(built)
            for make, loss, own in self._programs(windows, left_out):
                value = best.value if best is not None and best.value > 0.0 else math.inf
                stage = Stage(
                    make, FEWEST_SAMPLES, cache(partial(self._steps_cost, best)), value, loss, self.most_samples,
                    self.steps_cost,
                )  # fmt: skip
                self.roots += [(stage, window, left_out) for window in own]

    @property
    def what(self) -> str:
        """What is divided, in words."""
        return "boxes of throws" + (" and angles" if any(self._phasing.opened) else "")

    @property
    def _is_one_angle(self) -> bool:
        phasing = self._phasing
        throws = phasing.layout(*phasing.least_geometry).throw_positions
        return sum(phasing.opened) == 1 and len(throws) == 1 and phasing.throw_bounds is None

    @property
    def cost(self) -> float:
        """Share of the best design that no bound gets back."""
        return max(stage.last.cost for stage in {id(stage): stage for stage, _, _ in self.roots}.values())

    @property
    def reached(self) -> float:
        """Gap at which dividing ends: the tolerance, or what no bound gets back beside it."""
        return max(self._problem.tolerance, min(self._problem.tolerance, self.cost) + self.cost)

    def _steps_cost(self, best: StarDesign | None, samples: int) -> float:
        """Of a design's value, what means averaged about the steps lose (P7), and peaks may miss between them (F7)."""
        if best is None:
            return 0.0
        problem, found = best.result.problem, best.result.final
        lost = 0.0
        for term in self._problem.objective:
            if averages(problem, term.measure):
                signals = over(problem.engine.cycle.base_order, found.signals(term.measure.load))
                short = [averaged(problem, term.measure, signal, samples) for signal in signals]
                # of a mean the rows between are as good, of a peak they are not there
                steps = 4 * samples if term.measure.norm.averages else samples
                rows = load_rows(term.measure, problem.points, short, found.engine, steps)
                lost += term.weight * max(found.value(term.measure) - rows.value, 0.0)
            elif term.measure.is_load and not term.measure.norm.is_euclidean and samples < self.most_samples:
                lost += term.weight * missed(term.measure, best.result, samples)
        return lost

    def _programs(self, windows: Sequence[FiringWindow], left_out: tuple[str, ...]) -> Iterator[Programs]:
        """Programs at so many steps over the period, what their orders leave out of the objective, their windows."""
        phasing = self._phasing
        for k, window in enumerate(windows):
            candidate = replace(self.candidate(window, amid(window)), left_out=left_out)
            try:
                realised = replace(phasing.realise(candidate), phasing=None)
            except ModelError:
                # what fires all but at once has no order
                if k + 1 < min(len(windows), _MOST_REALISED):
                    continue
                raise
            rides = rides_of(phasing, candidate)
            riders = Riders(realised, rides, candidate.throws)
            waves = self._waves(riders.problem, candidate, rides)
            yield partial(ThrowPrograms, waves, riders, firing_of(phasing)), loss_of(waves, realised), windows
            return
        raise ModelError("no crank fires")

    def _waves(self, problem: Problem, candidate: Candidate, rides: dict[str, int]) -> ThrowWaves:
        """Waves of the throws, and of angles that are open beside them."""
        phasing = self._phasing
        layout = phasing.layout_of(candidate)
        if not any(phasing.opened):
            return ThrowWaves(problem, layout, rides)
        if not stay(phasing, candidate):
            raise ModelError("what rides on a throw knows how far pins are apart")
        # where nothing tells when the crank turns, its first throw stays where it is, and what rides on it
        stands = phasing.throw_bounds is not None or turn_freely(phasing, candidate, rides)
        return ThrowWaves(problem, layout, rides, phasing.opened, 0.0 if stands else layout.side(0))

    def candidate(self, window: FiringWindow, throws: Array) -> Candidate:
        """A design with these throws, and with a firing order that they keep."""
        found = replace(design_at(self._phasing, throws), firing_order=window.order or None)
        if window.order:
            return found
        orders = ranked_orders(replace(self._phasing, intervals=Intervals(0.0, math.inf)), found)
        return replace(found, firing_order=orders[0].order if orders else None)

    @property
    def conflict(self) -> tuple[str, ...]:
        """Limits that were not met in boxes."""
        return tuple(limit.name for limit in self._problem.limits if limit.name in self._not_met)

    def cut(self, value: float) -> float:
        """What a design has to be better than."""
        return value * (1.0 - SHARE * self._problem.tolerance)

    def known(self, found: _Best) -> Known | None:
        """Return the best design as a witness of bounds; None where there is none."""
        best = found.design
        if best is None or best.result.final.excess(best.result.problem.limits) > FEASIBLE:
            return None
        return Known(np.array(best.candidate.throws), best.value, lambda: self._most(best))

    def _most(self, best: StarDesign) -> float:
        """Return what the objective of a design is not over, with what its samples may have missed."""
        nothing, result = numerical_zero(self._problem), best.result
        read = read_under(result.problem, result.final, best.value, math.inf, nothing)
        return read.value + read.doubt + nothing

    def around(self, found: _Best) -> _Part | Over | None:
        """Return a thin box of throws around a design, and its bound; None where it is an image of one that is kept."""
        best, stage = found.design, self._finest
        if best is None or stage is None:
            return None
        for _, window, left_out in self.roots:
            place = place_in(self._phasing, window, best.candidate)
            if left_out == best.candidate.left_out and place is not None:
                programs, most = stage.programs, self._most(best) * (1.0 + EXCESS)
                box = programs.box(programs.program(window), *thin(place, *window.box), 0.0, most)
                return box if isinstance(box, Over) else _Part(box.bound, box, stage, left_out)
        return None

    def level(self, value: float) -> float:
        """Boxes are cut as far as no design in what is cut off is better than that."""
        return self.cut(value)

    def parts(self, part: _Part, value: float) -> Iterator[tuple[_Part | Over, _Best | None]]:
        """Windows of all throws, halves of a box."""
        box, stage, cut = part.box, part.stage, self.cut(value)
        if box is None or stage is None:
            for first, window, left_out in self.roots:
                cut = self.cut(min(value, self._best.value))
                programs = first.programs
                found = programs.box(programs.program(window), *window.box, part.bound, cut, is_new=True)
                yield self._looked(first, found, left_out)
        elif stage.tells_all(part.bound, value, box) and stage.finer is not None:
            # more steps tell more than smaller boxes
            programs = stage.finer.programs
            finer = programs.box(programs.program(box.program.window), box.lower, box.upper, part.bound, cut)
            yield self._looked(stage.finer, finer, part.left_out)
        else:
            for half in stage.programs.parts(box, cut):
                yield self._looked(stage, half, part.left_out)

    def _looked(
        self, stage: Stage, found: ThrowBox | Over, left_out: tuple[str, ...]
    ) -> tuple[_Part | Over, _Best | None]:
        """A box, and a better design near its middle."""
        self._not_met |= stage.programs.told
        self._finest = stage
        if isinstance(found, Over):
            return found, None
        self._seen += 1
        moving = self._tried < _MOST_TRIED and (self._seen <= _TRIED_FIRST or self._seen % _TRIED_EACH == 0)
        stands = self._stood < _MOST_STANDING and float(found.spread.max()) < _STANDING
        if moving or stands:
            self._tried += moving
            self._stood += not moving
            window = found.program.window
            candidate = replace(self.candidate(window, nearest(window, found.middle)), left_out=left_out)
            improved = self._improve(candidate, moving) if candidate.firing_order is not None else None
            self._best = min(self._best, _Best(improved), key=lambda each: each.rank)
        return _Part(found.bound, found, stage, left_out), self._best if moving or stands else None
