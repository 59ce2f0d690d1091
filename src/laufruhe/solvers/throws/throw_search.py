"""Branch and bound over open throws: first over firing windows, then over boxes of angles (S29)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.throw_waves import ThrowWaves, averaged_signal, uses_averages
from laufruhe.load_models.uneven_model import rotor_throws_of
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
from laufruhe.solvers.boxes.search import BoxSearch, SearchPart
from laufruhe.solvers.conclusion import FEASIBLE, is_sampled, refine_objective
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import ranked_orders
from laufruhe.solvers.stars.star_results import StarDesign
from laufruhe.solvers.throws.riding_weights import Riders
from laufruhe.solvers.throws.throw_boxes import ThrowBox, ThrowPrograms
from laufruhe.solvers.throws.throw_windows import (
    design_at,
    firing_bounds,
    has_same_unbalances,
    nearest_throws,
    place_in,
    windows_of,
)

EvaluateCrank = Callable[[Candidate], StarDesign | None]
"""Function from a candidate to its design; None if infeasible."""

# largest number of boxes after the first box of every window
MAX_BOXES = 1500
# share of the tolerance by which a design must improve on the incumbent
SHARE = 0.5
# smallest and largest number of samples over the period
FEWEST_SAMPLES, MAX_SAMPLES = 96, 384
# largest sampling error of bounds, relative to the best objective
STEPS_COST = 1e-3
# with one open angle, boxes are few, so samples may be many
MAX_OF_ONE_ANGLE, COST_OF_ONE_ANGLE = 6144, 2e-5
# factor of the sampling error within which a bound uses more samples
_FINER_FACTOR = 1.5
# windows to try for a crank that the model can evaluate
_MAX_REALISED = 50
# spread up to which the middle of a box is evaluated as a design, and the largest number of such designs
_SMALL_SPREAD, _MAX_EVALUATED = 1e-5, 12


@dataclass(frozen=True)
class ThrowBound:
    """Lower bound by branch and bound over throws.

    Attributes
    ----------
    bound
        Lower bound of the objective of all designs [SI]; infinite if no design is feasible.
    best
        Best design; None if no feasible design is known.
    boxes, what
        Number of boxes, and their name in words.
    conflict
        Names of limits that contradict each other, if no design is feasible.
    """

    bound: float
    best: StarDesign | None
    boxes: int
    conflict: tuple[str, ...]
    what: str = "boxes of throws"


@dataclass(frozen=True, eq=False)
class Stage:
    """Programs at one number of samples over the period, linked to the stage with twice as many (S29).

    Attributes
    ----------
    build
        Function from the number of samples to the programs.
    loss
        Function from the number of samples to the error of means and peaks of the best design (P7) [SI].
    truncation
        Function from the number of samples to the largest part of the objective in truncated orders [SI].
    value
        Objective of the best design [SI].
    maximum, target
        Largest number of samples, and the error relative to the objective at which samples suffice.
    """

    build: Callable[[int], ThrowPrograms]
    samples: int
    loss: Callable[[int], float]
    value: float
    truncation: Callable[[int], float]
    maximum: int = MAX_SAMPLES
    target: float = STEPS_COST

    @cached_property
    def programs(self) -> ThrowPrograms:
        """Programs at this number of samples."""
        return self.build(self.samples)

    @cached_property
    def cost(self) -> float:
        """Error of bounds by sampling and truncation, relative to the best objective."""
        return (self.loss(self.samples) + self.truncation(self.samples)) / self.value

    @cached_property
    def next(self) -> Stage | None:
        """Stage with twice as many samples; None if these suffice."""
        stage = replace(self, samples=2 * self.samples)
        if self.loss(self.samples) <= self.target * self.value or stage.samples > self.maximum:
            return None
        # averages over short steps may truncate more of a pressure jump
        return stage if stage.cost < self.cost else None

    @cached_property
    def finer(self) -> Stage | None:
        """Stage with twice as many samples; None if these suffice now or exceed the memory."""
        if self.next is not None:
            with suppress(ModelError):
                _ = self.next.programs
                return self.next
        return None

    @property
    def last(self) -> Stage:
        """Stage with the most samples."""
        return self if self.next is None else self.next.last

    def is_exhausted(self, bound: float, value: float, box: ThrowBox) -> bool:
        """Return True if more samples improve the bound of a box [SI] more than its division."""
        return bound > value * (1.0 - _FINER_FACTOR * self.cost) or float(box.spread.sum()) < self.cost


def peak_error(measure: Measure, best: Result, samples: int) -> float:
    """Return an upper bound of the error of a sampled peak, at any phase of the samples (F7) [SI]."""
    signals = best.final.signals(measure.load)
    rebased = with_common_base(common_base([signal.repeat_order() for signal in signals]), signals)
    spectra = [narrow_signal(measure, signal, best.final.engine) for signal in rebased]
    steps = max(samples // measure.norm.refinement, 1)
    return measure.norm.sampling_bound(spectra, measure.shares(best.problem.points), steps, 2 * samples)


@dataclass(frozen=True, eq=False)
class _Part(SearchPart):
    """A box with the stage of its bound, and the optional shafts that are not built; the root has no box."""

    box: ThrowBox | None = None
    stage: Stage | None = None
    left_out: tuple[str, ...] = ()


def search_throws(
    problem: Problem, phasing: Phasing, best: StarDesign | None, floor: float, evaluate_crank: EvaluateCrank
) -> ThrowBound | None:
    """Return a lower bound of the objective over all throw angles, by branch and bound; None if nothing is proven.

    Parameters
    ----------
    best
        Best known design; None if there is none.
    floor
        Known lower bound of the objective [SI].
    evaluate_crank
        Exact model of a crank.
    """
    zero_level = numerical_zero(problem)
    is_proven = best is not None and best.value - floor <= gap_tolerance_of(best.value, problem.tolerance, zero_level)
    # with gas and a shaft of non-integer ratio, loads do not repeat after a working cycle
    is_periodic = not problem.depends_on_gas or all(
        r.shaft.ratio == round(r.shaft.ratio) for r in problem.engine.rotors
    )
    if is_proven or not is_periodic or not problem.objective:
        return None
    windows = windows_of(problem, phasing)
    if windows is None:
        return None
    if not windows:
        return None if best is not None else ThrowBound(math.inf, None, 0, ())
    try:
        search = ThrowSearch(problem, phasing, windows, evaluate_crank, best)
        for stage, _, _ in search.roots:
            # raises ModelError at once if memory does not suffice or loads have no finite response
            _ = stage.programs
    except ModelError:
        return None
    maximum = len(search.roots) + problem.search.boxes_or(MAX_BOXES)
    incumbent, bound, boxes = search.search(_Part(floor, False), best, zero_level, search.gap_target, maximum)
    return ThrowBound(bound, incumbent, boxes, search.conflict, search.what)


class ThrowSearch(BoxSearch[_Part, StarDesign]):
    """Branch and bound search over firing windows and boxes of throws."""

    def __init__(
        self, problem: Problem, phasing: Phasing, windows: Sequence[FiringWindow], evaluate_crank: EvaluateCrank,
        best: StarDesign | None,
    ) -> None:  # fmt: skip
        self._problem, self._phasing, self._evaluate_crank = problem, phasing, evaluate_crank
        self._evaluation_count = 0
        self._best, self._violated = best, set[str]()
        self.what = "boxes of throws" + (" and angles" if any(phasing.is_geometry_open) else "")
        throws = phasing.layout(*phasing.minimum_geometry).throw_positions
        is_one_angle = sum(phasing.is_geometry_open) == 1 and len(throws) == 1 and phasing.throw_bounds is None
        self._most_samples = MAX_OF_ONE_ANGLE if is_one_angle else MAX_SAMPLES
        target = COST_OF_ONE_ANGLE if is_one_angle else STEPS_COST
        self._finest: Stage | None = None
        self.roots: list[tuple[Stage, FiringWindow, tuple[str, ...]]] = []
        may_vanish = all(decision.set.lower <= 0.0 for decision in problem.unbalances)
        value = best.value if best is not None and best.value > 0.0 else math.inf
        sampling_loss = cache(partial(self._sampling_loss, best))
        for built in phasing.shafts.largest if may_vanish else phasing.shafts.allowed:
            left_out = phasing.without(built)
            build, truncation = self._programs(windows, left_out)
            stage = Stage(build, FEWEST_SAMPLES, sampling_loss, value, truncation, self._most_samples, target)
            self.roots += [(stage, window, left_out) for window in windows]

    @property
    def gap_target(self) -> float:
        """Gap at which the search ends: the tolerance, or more if the error of bounds does not allow that."""
        tolerance = self._problem.tolerance
        cost = max(stage.last.cost for stage in {id(stage): stage for stage, _, _ in self.roots}.values())
        return max(tolerance, min(tolerance, cost) + cost)

    @property
    def conflict(self) -> tuple[str, ...]:
        """Names of limits that boxes without a design violate."""
        return tuple(limit.name for limit in self._problem.limits if limit.name in self._violated)

    def _sampling_loss(self, best: StarDesign | None, samples: int) -> float:
        """Return the error of the best design's objective by averaged means (P7) and sampled peaks (F7) [SI]."""
        if best is None:
            return 0.0
        problem, final = best.result.problem, best.result.final
        loss = 0.0
        for term in self._problem.objective:
            if uses_averages(problem, term.measure):
                signals = with_common_base(problem.engine.cycle.base_order, final.signals(term.measure.load))
                averaged_signals = [averaged_signal(problem, term.measure, signal, samples) for signal in signals]
                # averages have rows between the samples, peaks do not
                steps = 4 * samples if term.measure.norm.averages else samples
                rows = load_rows(term.measure, problem.points, averaged_signals, final.engine, steps)
                loss += term.weight * max(final.value(term.measure) - rows.value, 0.0)
            elif is_sampled(term.measure) and samples < self._most_samples:
                loss += term.weight * peak_error(term.measure, best.result, samples)
        return loss

    def _programs(
        self, windows: Sequence[FiringWindow], left_out: tuple[str, ...]
    ) -> tuple[Callable[[int], ThrowPrograms], Callable[[int], float]]:
        """Return two functions of the number of samples: bounding programs, and the part of the objective they omit.

        `left_out` has the names of the shafts that are not built.
        """
        phasing = self._phasing
        candidate, star_problem = self._first_crank(windows, left_out)
        throw_of_rotor, layout = rotor_throws_of(phasing, candidate), phasing.layout_of(candidate)
        riders = Riders(star_problem, throw_of_rotor, candidate.throws)
        if any(phasing.is_geometry_open) and not has_same_unbalances(phasing, candidate):
            raise ModelError("unbalances on offset pins depend on the open bank or split pin angle")
        side = layout.side(0) if any(phasing.is_geometry_open) and phasing.throw_bounds is None else 0.0
        waves = ThrowWaves(riders.problem, layout, throw_of_rotor, phasing.is_geometry_open, side)

        def truncation(samples: int) -> float:
            return sum(term.weight * waves.left_out(term.measure, samples) for term in star_problem.objective)

        return partial(ThrowPrograms, waves, riders, firing_bounds(phasing)), truncation

    def _first_crank(self, windows: Sequence[FiringWindow], left_out: tuple[str, ...]) -> tuple[Candidate, Problem]:
        # the model cannot evaluate a crank with nearly simultaneous firings
        first_windows = windows[:_MAX_REALISED]
        for k, window in enumerate(first_windows):
            candidate = replace(self.candidate(window, nearest_throws(window)), left_out=left_out)
            try:
                return candidate, replace(self._phasing.problem_of(candidate), phasing=None)
            except ModelError:
                if k + 1 == len(first_windows):
                    raise
        raise ModelError("the problem has no firing window")

    def candidate(self, window: FiringWindow, throws: Array) -> Candidate:
        """Return the candidate with these throws [rad] and the firing order of the window, or else their best order."""
        design = replace(design_at(self._phasing, throws), firing_order=window.order or None)
        if window.order:
            return design
        orders = ranked_orders(replace(self._phasing, intervals=Intervals(0.0, math.inf)), design)
        return replace(design, firing_order=orders[0].order if orders else None)

    @property
    def level(self) -> float:
        """Smallest objective that designs in cut-off boxes may have [SI]."""
        return self._level_below(self.value)

    def _level_below(self, value: float) -> float:
        return value * (1.0 - SHARE * self._problem.tolerance)

    def rank(self, design: StarDesign) -> tuple[bool, float]:
        """Return the sort key of a design."""
        return False, design.value

    def witness_of(self, best: StarDesign) -> Witness | None:
        """Return the best design as a witness, a value that no bound may exceed; None if it violates limits."""
        if best.result.final.violation(best.result.problem.limits) > FEASIBLE:
            return None
        return Witness(np.array(best.candidate.throws), best.value, lambda: self._highest_objective(best))

    def _highest_objective(self, best: StarDesign) -> float:
        zero_level, result = numerical_zero(self._problem), best.result
        _, value, value_error = refine_objective(result.problem, result.final, best.value, math.inf, zero_level)
        return value + value_error + zero_level

    def around(self, best: StarDesign) -> _Part | FathomedPart | None:
        """Return a thin box of throws around a design, with its bound; None if no window contains the design."""
        stage = self._finest
        if stage is None:
            return None
        for _, window, left_out in self.roots:
            place = place_in(self._phasing, window, best.candidate)
            if left_out == best.candidate.left_out and place is not None:
                programs, maximum = stage.programs, self._highest_objective(best) * (1.0 + EXCESS)
                box = programs.box(programs.program(window), *thin_box(place, *window.box), 0.0, maximum)
                return box if isinstance(box, FathomedPart) else _Part(box.bound, box.is_exact, box, stage, left_out)
        return None

    def parts(self, part: _Part, value: float) -> Iterator[tuple[_Part | FathomedPart, StarDesign | None]]:
        """Yield the parts of a search node, each with a better design if one was computed.

        The parts are the boxes of all firing windows for the root, else the box at more samples, or its halves.
        """
        box, stage, cutoff = part.box, part.stage, self._level_below(value)
        if box is None or stage is None:
            for first, window, left_out in self.roots:
                value = value if self._best is None else min(value, self._best.value)
                programs, cutoff = first.programs, self._level_below(value)
                root = programs.box(programs.program(window), *window.box, part.bound, cutoff, reuse_multipliers=True)
                yield self._examine(first, root, left_out)
        elif stage.is_exhausted(part.bound, value, box) and stage.finer is not None:
            programs = stage.finer.programs
            finer = programs.box(programs.program(box.program.window), box.lower, box.upper, part.bound, cutoff)
            yield self._examine(stage.finer, finer, part.left_out)
        else:
            for half in stage.programs.parts(box, cutoff):
                yield self._examine(stage, half, part.left_out)

    def _examine(
        self, stage: Stage, box: ThrowBox | FathomedPart, left_out: tuple[str, ...]
    ) -> tuple[_Part | FathomedPart, StarDesign | None]:
        """Return a box as a search node, and a design near its middle if one was computed and is the best."""
        self._violated |= stage.programs.conflict
        self._finest = stage
        if isinstance(box, FathomedPart):
            return box, None
        evaluates_middle = self._evaluation_count < _MAX_EVALUATED and float(box.spread.max()) < _SMALL_SPREAD
        if evaluates_middle:
            self._evaluation_count += 1
            window = box.program.window
            candidate = replace(self.candidate(window, nearest_throws(window, box.middle)), left_out=left_out)
            middle = self._evaluate_crank(candidate) if candidate.firing_order is not None else None
            known = [design for design in (self._best, middle) if design is not None]
            self._best = min(known, key=self.rank, default=None)
        best = self._best if evaluates_middle else None
        return _Part(box.bound, box.is_exact, box, stage, left_out), best
