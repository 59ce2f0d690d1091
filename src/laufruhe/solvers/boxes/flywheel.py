"""Deciding the flywheel: everything asked of it goes one way with its numbers, so boxes prove the optimum (T9)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.machine import Flywheel
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Numbers, moved_numbers
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import Divided
from laufruhe.prove.boxes.monotone import OneWay, OneWayProblem, divided
from laufruhe.prove.certificate import Reach
from laufruhe.solvers.conclusion import Design, concluded, known_of, none_within
from laufruhe.solvers.conflicts import smallest_conflict
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import LocalProgram, looks, proven, searched, shown

WIDTH = "flywheel.width"
# boxes close in fast where the sum goes one way: at so small a share of the tolerance limits hold the design
SHARPER = 1e-3
# relative room that local programs leave inside limits, less than boxes tell apart
INSIDE = 1e-9
# boxes that tell whether limits can be kept together
FEW_BOXES = 64


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
        wheel = moved_numbers(Numbers(), self.problem.decisions, values).flywheel(self.given)
        return wheel if self.width is None else wheel.weighing(float(x[-1]))

    def decided(self, x: Array) -> Array:
        """The decisions of a point."""
        if self.width is None:
            return x
        return np.clip(np.insert(x[:-1], self.width, self.wheel(x).ring.width), *self.bounds)

    def place(self, values: Sequence[Value]) -> Array:
        """Return the point of a design."""
        own = np.array([float(value.real) for value in values])
        if self.width is None:
            return own
        mass = replace(self, width=None).wheel(own).ring.mass
        return np.append(np.delete(own, self.width), mass)

    def _width(self, sign: float, ways: Array) -> OneWay:
        return OneWay(lambda x: sign * self.wheel(x).ring.width, sign * ways)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Of the decisions."""
        decisions = self.problem.decisions
        return np.array([d.lower for d in decisions]), np.array([d.upper for d in decisions])

    def asked(self, initial: Evaluation, limits: Sequence[Limit]) -> OneWayProblem:
        """What is asked as functions of these coordinates: at an even speed the flywheel moves nothing else."""
        lower, upper = self.bounds
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


@dataclass(frozen=True, eq=False)
class _WheelProgram(LocalProgram):
    """Objective and rooms of the flywheel alone."""

    asked: OneWayProblem

    def numbers(self, shares: Array) -> Array:
        """The objective, then the relative room under each limit."""
        x = np.array(self.values(shares))
        return np.array(
            [self.asked.value(x), *(1.0 - number.value(x) / most - INSIDE for most, number in self.asked.limits)]
        )


def solve_flywheel(problem: Problem) -> Result:
    """The best flywheel, proven; or the limits that no flywheel within its bounds keeps."""
    started = time.perf_counter()
    initial, boxes, whole = evaluate(problem), *(_Coordinates.of(problem, weighs) for weighs in (True, False))
    asked = boxes.asked(initial, problem.limits)
    program = _WheelProgram(problem, *whole.bounds, whole.asked(initial, problem.limits))
    best = searched(program, [program.shares(problem.start), *looks(problem)], problem.search.starts)

    def bounded(value: float, room: float, design: Design) -> Divided:
        known = None if math.isinf(value) else known_of(design, boxes.place(design.values), excess=0.0)
        found = divided(asked, value, (SHARPER if asked.goes_one_way else 1.0) * room, known=known)
        return replace(found, places=tuple(boxes.decided(x) for x in found.places))

    found = proven(program, best, bounded)
    timing = {"solve": time.perf_counter() - started}
    if found.excludes_all:
        return none_within(problem, initial, _conflict(problem, initial, boxes), timing)
    method = f"monotone quantities, bounded on {found.divided.boxes} boxes of the flywheel's numbers"
    proof = shown(program, found.design, found.bound, Reach.WHOLE, method)
    return concluded(found.design, initial, proof, timing)


def _conflict(problem: Problem, initial: Evaluation, boxes: _Coordinates) -> tuple[str, ...]:
    """Limits that no flywheel keeps together, as far as a few boxes tell."""

    def excluded(kept: Sequence[Limit]) -> bool:
        asked = replace(boxes.asked(initial, kept), terms=())
        return divided(asked, math.inf, 0.0, FEW_BOXES).bound == math.inf

    return smallest_conflict(problem.limits, excluded)
