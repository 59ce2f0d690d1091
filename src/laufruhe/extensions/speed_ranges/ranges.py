"""Speed ranges of a problem, and the problem with finitely many of their speeds (P22)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from laufruhe.machine import OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.processes import call_by_name
from laufruhe.present.numbers import RPM
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Drawing, Extra, Path, Problem, Rebuild

if TYPE_CHECKING:
    from laufruhe.files.measures import QuantityTable

_WORST_OF = "laufruhe.extensions.worst_mean.norm:worst_of"
WORST = ("mean", "worst mean", "rms", "maximum")
"""Names of the norms whose largest value over operating points is a norm."""


@dataclass(frozen=True)
class WorstMeasure(Measure):
    """Largest value of a measure at the speeds of a range; `span` is the name of the range."""

    span: str = ""

    @property
    def name(self) -> str:
        """Name in reports."""
        values = {key: value for key, value in vars(self).items() if key != "span"}
        return f"{Measure(**{**values, 'points': None}).name} over {self.span}"


Curve: TypeAlias = tuple[tuple[float, ...], tuple[float, ...]]
"""Crank speeds in ascending order [rad/s], and values at them [SI]; linear between them, constant beyond."""


@dataclass(frozen=True)
class SpeedRange:
    """A range of crank speeds at the load of one operating point.

    Attributes
    ----------
    low, high
        Lowest and highest crank speed [rad/s].
    point
        Name of the operating point whose gas acts at every speed.
    measure
        Measure whose value at each speed counts; None for that of the objective.
    minimised
        True if the objective is the worst value over the range.
    limit
        Largest allowed value over speed [SI]; None without one.
    shares
        Share of time over speed, up to a factor; None for equal shares.
    table, quantity
        Keys of the measure in the file, and its name; None and empty for the objective's.
    """

    name: str
    low: float
    high: float
    point: str
    measure: Measure | None = None
    minimised: bool = False
    limit: Curve | None = None
    shares: Curve | None = None
    table: QuantityTable | None = field(default=None, compare=False)
    quantity: str = ""

    def at(self, speeds: Iterable[float], points: Sequence[OperatingPoint]) -> list[OperatingPoint]:
        """Return an operating point at each crank speed [rad/s], with the gas of that in `points`."""
        load = next(point for point in points if point.name == self.point)
        return [replace(load, name=f"{self.name} {RPM * speed:.7g} rpm", speed=speed, weight=1.0) for speed in speeds]

    def limits_at(self, speeds: Array) -> Array:
        """Return the limit at crank speeds [rad/s], infinite without one."""
        return np.full(np.shape(speeds), math.inf) if self.limit is None else np.interp(speeds, *self.limit)

    def measure_of(self, problem: Problem) -> Measure:
        """Return the measure at each speed: that of the range, or of the objective."""
        return replace(self.measure or problem.objective[0].measure, points=None)


@dataclass(frozen=True)
class SpeedRanges(Extra):
    """Speed ranges that a problem reports, minimises or limits."""

    words: ClassVar[str] = "speed ranges"
    evaluates: ClassVar[bool] = True
    ranges: tuple[SpeedRange, ...] = field(default=())

    @property
    def limit_names(self) -> tuple[str, ...]:
        """Names of the ranges with a limit that is a curve."""
        return tuple(span.name for span in self.ranges if span.limit is not None)

    def evaluated(self, problem: Problem, result: Any, /) -> Any:
        """Return the result of the initial design at its peaks over the ranges."""
        return call_by_name("laufruhe.extensions.speed_ranges.exchange:evaluate_ranges", problem, result)

    def objective_name(self, name: str) -> str:
        """Return the name of the worst value over the range that is minimised, from the name of its measure."""
        minimised = next((span for span in self.ranges if span.minimised), None)
        if minimised is None:
            return name
        return f"{name if name.startswith(('worst', 'maximum')) else f'worst {name}'} over {minimised.name}"


Speeds: TypeAlias = Mapping[str, Sequence[float]]
"""Crank speeds of each range [rad/s], by the name of the range."""


def at_speeds(problem: Problem, ranges: Sequence[SpeedRange], speeds: Speeds) -> Problem:
    """Return the problem with the measures of its ranges at finitely many speeds (P22).

    It relaxes the problem over the whole ranges: it has fewer limits, and a maximum over fewer speeds.
    """
    ordinary = tuple(point.name for point in problem.points)
    # a measure of all operating points counts none of the ranges
    terms = [replace(term, measure=_named(term.measure, ordinary)) for term in problem.objective]
    limits = [replace(limit, measure=_named(limit.measure, ordinary)) for limit in problem.limits]
    for span in ranges:
        measure, names = span.measure_of(problem), [point.name for point in span.at(speeds[span.name], problem.points)]
        if span.minimised:
            arguments = {**vars(measure), "norm": call_by_name(_WORST_OF, measure.norm), "points": tuple(names)}
            terms = [Term(WorstMeasure(**arguments, span=span.name))]
        if span.limit is not None:
            maxima = span.limits_at(np.array(speeds[span.name])).tolist()
            limits += [
                Limit(f"{measure.name} at {name}", replace(measure, points=(name,)), maximum)
                for name, maximum in zip(names, maxima, strict=True)
            ]
    return problem.changed(
        points=with_speeds(problem.points, ranges, speeds), objective=tuple(terms), limits=tuple(limits), extras=(),
        rebuild=partial(_rebuilt, problem.rebuild, ranges, speeds),
    )  # fmt: skip


def _named(measure: Measure, names: tuple[str, ...]) -> Measure:
    counts = "operating_points" in measure.channel.keys and measure.points is None
    return replace(measure, points=names) if counts else measure


def with_speeds(
    points: Sequence[OperatingPoint], ranges: Sequence[SpeedRange], speeds: Speeds
) -> tuple[OperatingPoint, ...]:
    """Return operating points, and after them one at each speed of each range."""
    return (*points, *(point for span in ranges for point in span.at(speeds[span.name], points)))


def _rebuilt(
    rebuild: Rebuild, ranges: Sequence[SpeedRange], speeds: Speeds, changes: Mapping[Path, str | float]
) -> Drawing:
    drawing = rebuild(changes)
    return replace(drawing, points=with_speeds(drawing.points, ranges, speeds))
