"""Branch and bound over throws that leave the even steps: firing windows first, then boxes of angles (S29)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.throw_waves import ThrowWaves, averaged, averages
from laufruhe.load_models.uneven_model import rides_of
from laufruhe.machine.firing_windows import FiringWindow
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import common_base
from laufruhe.numerics.witness import EXCESS
from laufruhe.problem.evaluation import with_common_base
from laufruhe.problem.measure import Measure, load_rows, narrow_signal
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.phasing import Candidate, Intervals
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.branch_and_bound import FathomedPart
from laufruhe.prove.certificate import gap_tolerance_of
from laufruhe.prove.witness import Witness, thin_box
from laufruhe.solvers.boxes.search import BoxSearch, divided
from laufruhe.solvers.conclusion import FEASIBLE, read_under
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import ranked_orders
from laufruhe.solvers.stars.star_results import StarDesign
from laufruhe.solvers.throws.riding_weights import Riders
from laufruhe.solvers.throws.throw_boxes import ThrowBox, ThrowPrograms
from laufruhe.solvers.throws.throw_windows import (
    design_at,
    firing_bounds,
    has_same_unbalances,
    middle_of,
    nearest,
    place_in,
    turns_freely,
    windows_of,
)

Improve = Callable[[Candidate, bool], StarDesign | None]
"""Return the best design near a candidate, or with its throws where they are; None if it breaks limits."""

MOST_BOXES = 1500
# share of the tolerance by which a design has to be better, for a box to be looked at
SHARE = 0.5
FEWEST_SAMPLES, MOST_SAMPLES = 96, 384
# share of the best design that steps over the period may cost
STEPS_COST = 1e-3
# of one open angle there are few boxes, so that steps may be many
MOST_OF_ONE_ANGLE, COST_OF_ONE_ANGLE = 6144, 2e-5
# share of what steps cost within which a bound takes more of them
_FINER = 1.5
# windows that are tried for a crank that can be evaluated
_MOST_REALISED = 50
# boxes whose middle is tried: the first few, and one of so many
_TRIED_FIRST, _TRIED_EACH, _MOST_TRIED = 2, 100, 5
# distance from standing at one angle up to which a mixture's middle is tried as it stands, and how often
_STANDING, _MOST_STANDING = 1e-5, 12


@dataclass(frozen=True)
class ThrowBound:
    """Bound that boxes of throws prove.

    Attributes
    ----------
    bound
        Bound of every design; infinite where none is allowed [SI].
    best
        The best design, None where none was found.
    boxes
        Number of boxes.
    conflict
        Limits that no throws keep together, where none is allowed.
    what
        What was divided, in words.
    """

    bound: float
    best: StarDesign | None
    boxes: int
    conflict: tuple[str, ...]
    what: str = "boxes of throws"


class Stage:
    """Programs at one number of steps over the period, and those at twice as many (S29).

    Parameters
    ----------
    make
        Return programs at so many steps.
    lost
        Return what means and peaks of the best design lose by so many steps (P7).
    value
        Objective of the best design.
    left_out
        Return the part of the objective that the orders left out may have.
    maximum, tolerable
        Largest number of steps, and the share of the value that they may cost.
    """

    def __init__(
        self, make: Callable[[int], ThrowPrograms], samples: int, lost: Callable[[int], float], value: float,
        left_out: Callable[[int], float], maximum: int = MOST_SAMPLES, tolerable: float = STEPS_COST,
    ) -> None:  # fmt: skip
        self._make, self._samples, self._lost, self._value, self._left_out = make, samples, lost, value, left_out
        self._maximum, self._enough = maximum, tolerable

    @cached_property
    def programs(self) -> ThrowPrograms:
        """Programs at this number of steps."""
        return self._make(self._samples)

    @cached_property
    def cost(self) -> float:
        """Share of the best design that no bound gets back."""
        return (self._lost(self._samples) + self._left_out(self._samples)) / self._value

    @cached_property
    def next(self) -> Stage | None:
        """Stage with twice as many steps; None where these are enough."""
        finer = 2 * self._samples
        if self._lost(self._samples) <= self._enough * self._value or finer > self._maximum:
            return None
        stage = Stage(self._make, finer, self._lost, self._value, self._left_out, self._maximum, self._enough)
        # short averages know less of a pressure that jumps
        return stage if stage.cost < self.cost else None

    @cached_property
    def finer(self) -> Stage | None:
        """Stage with twice as many steps, unless its numbers are too many to hold."""
        if self.next is not None:
            with suppress(ModelError):
                _ = self.next.programs
                return self.next
        return None

    @property
    def last(self) -> Stage:
        """Stage with the most steps."""
        return self if self.next is None else self.next.last

    def is_exhausted(self, bound: float, value: float, box: ThrowBox) -> bool:
        """Return True if steps cost more than a smaller box could gain."""
        return bound > value * (1.0 - _FINER * self.cost) or float(box.spread.sum()) < self.cost


def missed_peak(measure: Measure, best: Result, samples: int) -> float:
    """Return how much a peak of a design may be over its samples, wherever these stand (F7) [SI]."""
    signals = best.final.signals(measure.load)
    rebased = with_common_base(common_base([signal.repeat_order() for signal in signals]), signals)
    counted = [narrow_signal(measure, signal, best.final.engine) for signal in rebased]
    steps = max(samples // measure.norm.refinement, 1)
    return measure.norm.sampling_bound(counted, measure.shares(best.problem.points), steps, 2 * samples)


@dataclass(frozen=True, eq=False)
class _Part:
    """A box, the steps of its bound, and the shafts that are not built; all throws where it has no box."""

    bound: float
    box: ThrowBox | None = None
    stage: Stage | None = None
    left_out: tuple[str, ...] = ()

    @property
    def is_exact(self) -> bool:
        return self.box is not None and self.box.is_exact


@dataclass(frozen=True, eq=False)
class _Best:
    design: StarDesign | None

    @property
    def value(self) -> float:
        return math.inf if self.design is None else self.design.value

    @property
    def rank(self) -> tuple[bool, float]:
        return self.design is None, self.value


def search_throws(
    problem: Problem, phasing: Phasing, best: StarDesign | None, floor: float, improve: Improve
) -> ThrowBound | None:
    """Bound all throws, and return the best design on the way; None where boxes prove nothing.

    Parameters
    ----------
    best
        The best design known.
    floor
        A bound that holds.
    improve
        Local search from throws that look good.
    """
    zero_level = numerical_zero(problem)
    is_proven = best is not None and best.value - floor <= gap_tolerance_of(best.value, problem.tolerance, zero_level)
    # gas beside a shaft of a ratio that is no whole number does not repeat after a working cycle
    repeats = not problem.depends_on_gas or all(r.shaft.ratio == round(r.shaft.ratio) for r in problem.engine.rotors)
    if is_proven or not repeats or not problem.objective:
        return None
    windows = windows_of(problem, phasing)
    if windows is None:
        return None
    if not windows:
        return None if best is not None else ThrowBound(math.inf, None, 0, ())
    try:
        search = ThrowSearch(problem, phasing, windows, improve, best)
        for stage, _, _ in search.roots:
            # what is too much to hold shows at once, or that a throw alone drives what no mount carries
            _ = stage.programs
    except ModelError:
        return None
    maximum = len(search.roots) + problem.search.boxes_or(MOST_BOXES)
    incumbent, bound, boxes = divided(
        search, _Part(floor), _Best(best), zero_level, search.reached, maximum, search.what
    )
    return ThrowBound(bound, incumbent.design, boxes, search.conflict, search.what)


class ThrowSearch(BoxSearch[_Part, _Best]):
    """Windows and boxes of the throws of a problem."""

    def __init__(
        self, problem: Problem, phasing: Phasing, windows: Sequence[FiringWindow], improve: Improve,
        best: StarDesign | None,
    ) -> None:  # fmt: skip
        self._problem, self._phasing, self._improve = problem, phasing, improve
        self._seen = self._tried = self._stood = 0
        self._best, self._not_met = _Best(best), set[str]()
        self.what = "boxes of throws" + (" and angles" if any(phasing.is_geometry_open) else "")
        throws = phasing.layout(*phasing.minimum_geometry).throw_positions
        is_one_angle = sum(phasing.is_geometry_open) == 1 and len(throws) == 1 and phasing.throw_bounds is None
        self._most_samples = MOST_OF_ONE_ANGLE if is_one_angle else MOST_SAMPLES
        tolerable = COST_OF_ONE_ANGLE if is_one_angle else STEPS_COST
        self._finest: Stage | None = None
        self.roots: list[tuple[Stage, FiringWindow, tuple[str, ...]]] = []
        may_vanish = all(decision.set.lower <= 0.0 for decision in problem.unbalances)
        value = best.value if best is not None and best.value > 0.0 else math.inf
        lost = cache(partial(self._lost_by_steps, best))
        for built in phasing.shafts.largest if may_vanish else phasing.shafts.allowed:
            left_out = phasing.without(built)
            make, loss = self._programs(windows, left_out)
            stage = Stage(make, FEWEST_SAMPLES, lost, value, loss, self._most_samples, tolerable)
            self.roots += [(stage, window, left_out) for window in windows]

    @property
    def reached(self) -> float:
        """Gap at which dividing ends: the tolerance, or what no bound gets back beside it."""
        tolerance = self._problem.tolerance
        cost = max(stage.last.cost for stage in {id(stage): stage for stage, _, _ in self.roots}.values())
        return max(tolerance, min(tolerance, cost) + cost)

    @property
    def conflict(self) -> tuple[str, ...]:
        """Limits that were not met in boxes."""
        return tuple(limit.name for limit in self._problem.limits if limit.name in self._not_met)

    def _lost_by_steps(self, best: StarDesign | None, samples: int) -> float:
        """Return what means averaged about the steps lose of a design (P7), and peaks may miss between them (F7)."""
        if best is None:
            return 0.0
        problem, final = best.result.problem, best.result.final
        lost = 0.0
        for term in self._problem.objective:
            if averages(problem, term.measure):
                signals = with_common_base(problem.engine.cycle.base_order, final.signals(term.measure.load))
                short = [averaged(problem, term.measure, signal, samples) for signal in signals]
                # of a mean the rows between are as good, of a peak they are not there
                steps = 4 * samples if term.measure.norm.averages else samples
                rows = load_rows(term.measure, problem.points, short, final.engine, steps)
                lost += term.weight * max(final.value(term.measure) - rows.value, 0.0)
            elif term.measure.is_load and not term.measure.norm.is_euclidean and samples < self._most_samples:
                lost += term.weight * missed_peak(term.measure, best.result, samples)
        return lost

    def _programs(
        self, windows: Sequence[FiringWindow], left_out: tuple[str, ...]
    ) -> tuple[Callable[[int], ThrowPrograms], Callable[[int], float]]:
        """Return programs at so many steps over the period, and what their orders leave out of the objective."""
        phasing = self._phasing
        candidate, realised = self._first_crank(windows, left_out)
        rides = rides_of(phasing, candidate)
        riders = Riders(realised, rides, candidate.throws)
        waves = self._waves(riders.problem, candidate, rides)

        def loss(samples: int) -> float:
            return sum(term.weight * waves.left_out(term.measure, samples) for term in realised.objective)

        return partial(ThrowPrograms, waves, riders, firing_bounds(phasing)), loss

    def _first_crank(self, windows: Sequence[FiringWindow], left_out: tuple[str, ...]) -> tuple[Candidate, Problem]:
        # a crank with nearly simultaneous firings cannot be evaluated
        tried = windows[:_MOST_REALISED]
        for k, window in enumerate(tried):
            candidate = replace(self.candidate(window, middle_of(window)), left_out=left_out)
            try:
                return candidate, replace(self._phasing.realise(candidate), phasing=None)
            except ModelError:
                if k + 1 == len(tried):
                    raise
        raise ModelError("no crank fires")

    def _waves(self, problem: Problem, candidate: Candidate, rides: dict[str, int]) -> ThrowWaves:
        phasing = self._phasing
        layout = phasing.layout_of(candidate)
        if not any(phasing.is_geometry_open):
            return ThrowWaves(problem, layout, rides)
        if not has_same_unbalances(phasing, candidate):
            raise ModelError("what rides on a throw knows how far pins are apart")
        # where nothing tells when the crank turns, its first throw stays where it is, and what rides on it
        stands = phasing.throw_bounds is not None or turns_freely(phasing, candidate, rides)
        return ThrowWaves(problem, layout, rides, phasing.is_geometry_open, 0.0 if stands else layout.side(0))

    def candidate(self, window: FiringWindow, throws: Array) -> Candidate:
        """Return a design with these throws, and with a firing order that they keep."""
        design = replace(design_at(self._phasing, throws), firing_order=window.order or None)
        if window.order:
            return design
        orders = ranked_orders(replace(self._phasing, intervals=Intervals(0.0, math.inf)), design)
        return replace(design, firing_order=orders[0].order if orders else None)

    def cut(self, value: float) -> float:
        """Return the value that a design has to beat."""
        return value * (1.0 - SHARE * self._problem.tolerance)

    def level(self, value: float) -> float:
        """Return the value under which no design lies in what is cut off boxes."""
        return self.cut(value)

    def known(self, incumbent: _Best) -> Witness | None:
        """Return the best design as a witness of bounds; None where there is none."""
        best = incumbent.design
        if best is None or best.result.final.violation(best.result.problem.limits) > FEASIBLE:
            return None
        return Witness(np.array(best.candidate.throws), best.value, lambda: self._highest_objective(best))

    def _highest_objective(self, best: StarDesign) -> float:
        zero_level, result = numerical_zero(self._problem), best.result
        read = read_under(result.problem, result.final, best.value, math.inf, zero_level)
        return read.value + read.doubt + zero_level

    def around(self, incumbent: _Best) -> _Part | FathomedPart | None:
        """Return a thin box of throws around a design, and its bound; None where it is an image of one that stays."""
        best, stage = incumbent.design, self._finest
        if best is None or stage is None:
            return None
        for _, window, left_out in self.roots:
            place = place_in(self._phasing, window, best.candidate)
            if left_out == best.candidate.left_out and place is not None:
                programs, maximum = stage.programs, self._highest_objective(best) * (1.0 + EXCESS)
                box = programs.box(programs.program(window), *thin_box(place, *window.box), 0.0, maximum)
                return box if isinstance(box, FathomedPart) else _Part(box.bound, box, stage, left_out)
        return None

    def parts(self, part: _Part, value: float) -> Iterator[tuple[_Part | FathomedPart, _Best | None]]:
        """Yield windows of all throws, or halves of a box."""
        box, stage, cut = part.box, part.stage, self.cut(value)
        if box is None or stage is None:
            for first, window, left_out in self.roots:
                cut = self.cut(min(value, self._best.value))
                programs = first.programs
                root = programs.box(programs.program(window), *window.box, part.bound, cut, is_new=True)
                yield self._examine(first, root, left_out)
        elif stage.is_exhausted(part.bound, value, box) and stage.finer is not None:
            # more steps gain more than smaller boxes
            programs = stage.finer.programs
            finer = programs.box(programs.program(box.program.window), box.lower, box.upper, part.bound, cut)
            yield self._examine(stage.finer, finer, part.left_out)
        else:
            for half in stage.programs.parts(box, cut):
                yield self._examine(stage, half, part.left_out)

    def _examine(
        self, stage: Stage, box: ThrowBox | FathomedPart, left_out: tuple[str, ...]
    ) -> tuple[_Part | FathomedPart, _Best | None]:
        """Return a box, and a better design near its middle."""
        self._not_met |= stage.programs.conflict
        self._finest = stage
        if isinstance(box, FathomedPart):
            return box, None
        self._seen += 1
        moving = self._tried < _MOST_TRIED and (self._seen <= _TRIED_FIRST or self._seen % _TRIED_EACH == 0)
        stands = self._stood < _MOST_STANDING and float(box.spread.max()) < _STANDING
        if moving or stands:
            self._tried += moving
            self._stood += not moving
            window = box.program.window
            candidate = replace(self.candidate(window, nearest(window, box.middle)), left_out=left_out)
            improved = self._improve(candidate, moving) if candidate.firing_order is not None else None
            self._best = min(self._best, _Best(improved), key=lambda each: each.rank)
        return _Part(box.bound, box, stage, left_out), self._best if moving or stands else None
