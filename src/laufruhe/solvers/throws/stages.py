"""Cone programs of throws at so many steps over the period, and what steps cost a bound (S29)."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property

from laufruhe.errors import ModelError
from laufruhe.numerics.spectrum import common_base
from laufruhe.problem.evaluation import over
from laufruhe.problem.measure import Measure, selected
from laufruhe.solvers.result import Result
from laufruhe.solvers.throws.boxes import ThrowBox, ThrowPrograms

FEWEST_SAMPLES, MOST_SAMPLES = 96, 384
# of the best design, that steps over the period may cost
STEPS_COST = 1e-3
# of what steps cost, that a bound is beside the best design where more of them are taken
_FINER = 1.5


class Stage:
    """Programs at so many steps over the period, and those at twice as many.

    Parameters
    ----------
    make
        Programs.
    lost
        Of the best design, that means and peaks lose by steps (P7).
    value
        Of the best design.
    left_out
        Of the objective, by the orders left out.
    most, enough
        Steps, and share of the value that they may cost.
    """

    def __init__(
        self, make: Callable[[int], ThrowPrograms], samples: int, lost: Callable[[int], float], value: float,
        left_out: Callable[[int], float], most: int = MOST_SAMPLES, enough: float = STEPS_COST,
    ) -> None:  # fmt: skip
        self._make, self._samples, self._lost, self._value, self._left_out = make, samples, lost, value, left_out
        self._most, self._enough = most, enough

    @cached_property
    def programs(self) -> ThrowPrograms:
        """With so many steps."""
        return self._make(self._samples)

    @cached_property
    def cost(self) -> float:
        """Share of the best design that no bound gets back."""
        return (self._lost(self._samples) + self._left_out(self._samples)) / self._value

    @cached_property
    def next(self) -> Stage | None:
        """With twice as many; None where these are enough."""
        finer = 2 * self._samples
        if self._lost(self._samples) <= self._enough * self._value or finer > self._most:
            return None
        found = Stage(self._make, finer, self._lost, self._value, self._left_out, self._most, self._enough)
        # short averages know less of a pressure that jumps
        return found if found.cost < self.cost else None

    @cached_property
    def finer(self) -> Stage | None:
        """The next, unless its numbers are too many to hold."""
        if self.next is not None:
            with suppress(ModelError):
                _ = self.next.programs
                return self.next
        return None

    def tells_all(self, bound: float, value: float, box: ThrowBox) -> bool:
        """Whether steps cost more than what a smaller box could tell."""
        return bound > value * (1.0 - _FINER * self.cost) or float(box.spread.sum()) < self.cost

    @property
    def last(self) -> Stage:
        """With the most."""
        return self if self.next is None else self.next.last


def missed(measure: Measure, best: Result, samples: int) -> float:
    """What a peak of a design may be over its samples, wherever these stand (F7)."""
    signals = best.final.signals(measure.load)
    own = over(common_base([signal.repeats() for signal in signals]), signals)
    counted = [selected(measure, signal, best.final.engine) for signal in own]
    steps = max(samples // measure.norm.refinement, 1)
    return measure.norm.sampling_bound(counted, measure.shares(best.problem.points), steps, 2 * samples)
