"""Deciding the flywheel: everything asked of it goes one way with its numbers, so boxes prove the optimum (T9)."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from laufruhe.machine import Flywheel
from laufruhe.problem.decision import Numbers, moved_numbers
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Limit, Measure, Side
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Reach
from laufruhe.prove.monotone_boxes import Divided, OneWay, OneWayProblem, divided
from laufruhe.solvers.conclusion import Shown, concluded, judged, none_within
from laufruhe.solvers.result import Result

Array = NDArray[np.float64]

WIDTH = "flywheel.width"
# boxes close in fast where the sum goes one way: at so small a share of the tolerance limits hold the design
SHARPER = 1e-3
# a limit, and a bound, that is met to this share holds the design; step of a slope
HELD, STEP = 1e-6, 1e-6


@dataclass(frozen=True, eq=False)
class _Coordinates:
    """What the boxes are of: the decisions, or, where the width of a rim is one of several, its mass in place of it.

    Mass, inertia and stress hang on diameter, height and mass alone, so boxes of these need not follow a width that
    makes good what a height leaves out.

    Attributes
    ----------
    width
        Place of the width among the decisions; None where the boxes are of the decisions themselves.
    """

    problem: Problem
    given: Flywheel
    width: int | None

    @classmethod
    def of(cls, problem: Problem, weighs: bool) -> _Coordinates:
        """Of what is open, with its mass where that `weighs`."""
        if problem.engine.flywheel is None:
            raise TypeError("an engine without a flywheel has none to decide")
        names = [decision.name for decision in problem.decisions]
        has_mass = weighs and len(names) > 1 and WIDTH in names
        return cls(problem, problem.engine.flywheel, names.index(WIDTH) if has_mass else None)

    def wheel(self, x: Array) -> Flywheel:
        """The flywheel of a point."""
        values = x.tolist()
        if self.width is not None:
            values = [*values[: self.width], self.problem.decisions[self.width].start, *values[self.width : -1]]
        numbers = moved_numbers(Numbers(flywheel=list(self.given.numbers)), self.problem.decisions, values)
        wheel = self.given.moved(numbers.flywheel)
        return wheel if self.width is None else wheel.weighing(float(x[-1]))

    def decided(self, x: Array) -> Array:
        """The decisions of a point."""
        if self.width is None:
            return x
        return np.clip(np.insert(x[:-1], self.width, self.wheel(x).ring.width), *self._bounds)

    def _width(self, sign: float, ways: Array) -> OneWay:
        return OneWay(lambda x: sign * self.wheel(x).ring.width, sign * ways)

    @property
    def _bounds(self) -> tuple[Array, Array]:
        decisions = self.problem.decisions
        return np.array([d.lower for d in decisions]), np.array([d.upper for d in decisions])

    def asked(self, initial: Evaluation, limits: Sequence[Limit]) -> OneWayProblem:
        """What is asked as functions of these coordinates: at an even speed the flywheel moves nothing else."""
        lower, upper = self._bounds
        width: list[tuple[float, OneWay]] = []
        if self.width is not None:
            ways = np.array([*(-1.0 for _ in lower[1:]), 1.0])
            width = [
                (sign * bound[self.width], self._width(sign, ways)) for sign, bound in ((1.0, upper), (-1.0, lower))
            ]
            ends = (replace(self, width=None).wheel(bound).ring.mass for bound in (lower, upper))
            lower, upper = (
                np.append(np.delete(b, self.width), end) for b, end in zip((lower, upper), ends, strict=True)
            )

        def number(measure: Measure) -> OneWay:
            if measure.channel.of_wheel is None:
                raise TypeError(f"{measure.name} is not of the flywheel")
            of_wheel = measure.channel.of_wheel(measure, initial)
            return OneWay(
                lambda x: of_wheel(self.wheel(x)), np.full(len(lower), 1.0 if measure.channel.rises else -1.0)
            )

        return OneWayProblem(
            tuple((term.weight, number(term.measure)) for term in self.problem.objective),
            (*((limit.maximum, number(limit.measure)) for limit in limits), *width),
            lower,
            upper,
        )


def solve_flywheel(problem: Problem) -> Result:
    """The best flywheel, proven; or the limits that no flywheel within its bounds keeps."""
    started = time.perf_counter()
    initial, boxes = evaluate(problem), _Coordinates.of(problem, weighs=True)
    asked = boxes.asked(initial, problem.limits)
    found = divided(asked, (SHARPER if asked.goes_one_way else 1.0) * problem.tolerance)
    timing = {"solve": time.perf_counter() - started}
    if found.x is None:
        return none_within(problem, initial, _conflict(problem, initial, boxes), timing)
    x = boxes.decided(found.x)
    plain = _Coordinates.of(problem, weighs=False).asked(initial, problem.limits)
    return concluded(judged(problem, x.tolist()), initial, _shown(problem, plain, found, x), timing)


def _conflict(problem: Problem, initial: Evaluation, boxes: _Coordinates) -> tuple[str, ...]:
    """A smallest set of limits that no flywheel keeps together."""
    kept = list(problem.limits)
    for limit in problem.limits:
        without = [other for other in kept if other is not limit]
        # nothing is minimised, so the first design found ends it
        if divided(replace(boxes.asked(initial, without), terms=()), problem.tolerance).x is None:
            kept = without
    return tuple(limit.name for limit in kept)


def _shown(problem: Problem, asked: OneWayProblem, found: Divided, x: Array) -> Shown:
    """Bound, multipliers and how far they are from balance (T9)."""
    widths = asked.upper - asked.lower
    own = _slope(asked.value, x, asked, widths)
    held = [
        (limit, _slope(number.value, x, asked, widths))
        for limit, (maximum, number) in zip(problem.limits, asked.limits, strict=True)
        if number.value(x) >= maximum * (1.0 - HELD)
    ]
    low, high = (np.abs(x - edge) <= HELD * widths for edge in (asked.lower, asked.upper))
    sides = [sign * np.eye(len(x))[k] for mask, sign in ((low, -1.0), (high, 1.0)) for k in np.flatnonzero(mask)]
    size = float(np.abs(own).max()) or 1.0
    columns = [*(slope / (float(np.abs(slope).max()) or 1.0) for _, slope in held), *sides]
    shares, rest = nnls(np.column_stack(columns), -own / size) if columns else (np.zeros(0), float(np.abs(own).max()))
    prices: dict[Side, float] = {}
    left = own.copy()
    for (limit, slope), share in zip(held, shares, strict=False):
        price = float(share) * size / (float(np.abs(slope).max()) or 1.0)
        prices[limit, "at most"] = price
        left = left + price * slope
    slopes = {d.name: np.array([left[k] / widths[k]]) for k, d in enumerate(problem.decisions)}
    unfinished = "" if found.complete else ", some of them not finished"
    method = f"monotone quantities, bounded on {found.boxes} boxes of the flywheel's numbers{unfinished}"
    return Shown(found.bound, Reach.WHOLE, float(rest), method, prices, slopes)


def _slope(value: Callable[[Array], float], x: Array, asked: OneWayProblem, widths: Array) -> Array:
    """Change of a number for each whole width of what is open."""
    out = np.zeros(len(x))
    for k in range(len(x)):
        ends = [np.clip(x + sign * STEP * widths * np.eye(len(x))[k], asked.lower, asked.upper) for sign in (-1.0, 1.0)]
        low, high = (value(end) for end in ends)
        out[k] = (high - low) / (ends[1][k] - ends[0][k]) * widths[k]
    return out
