"""Tables of forces on mounts, main bearings and crank pins, and friction power, initial and final."""

from __future__ import annotations

from laufruhe.physics.mount_forces import CycleMeasures
from laufruhe.present.measures import Places, evaluations_with_loads, places_of
from laufruhe.present.numbers import DASH, number, percent
from laufruhe.present.tables import Table
from laufruhe.problem.evaluation import place_measures
from laufruhe.problem.measure import Measure
from laufruhe.solvers.result import Result
from laufruhe.units import readable

ONE, TWO = ("mean", "max", "rms"), ("initial mean", "final mean", "change", "initial max", "final max")


def tables(result: Result) -> list[Table]:
    """Return a row per place, at every operating point."""
    return [_table(result, places) for places in places_of(result)]


def _table(result: Result, places: Places) -> Table:
    points, designs = result.problem.points, evaluations_with_loads(result)
    names = places.channel.places(result.problem.engine)
    measures = [
        ((point.name, name) if len(points) > 1 else (name,), by_design)
        for k, point in enumerate(points)
        for name, *by_design in zip(
            names, *(place_measures(design, k, places.channel) for design in designs), strict=True
        )
    ]
    unit, factor = readable(places.channel.unit)
    scale = factor * max((by_design[0].max for _, by_design in measures), default=0.0)
    rows = tuple(
        (*lead, *_cells([cycle_measures.times(factor) for cycle_measures in by_design], scale))
        for lead, by_design in measures
    )
    at, first = ("", ("at", places.place)) if len(points) > 1 else (f" at {points[0].name}", (places.place,))
    note = f"The initial design has no finite loads: {result.initial.resonance}." if result.initial.resonance else ""
    if places.channel.sums_places:
        sums = [number(design.value(Measure(places.channel))) for design in designs]
        note = f"Sum, mean over the cycle: {' initial, '.join(sums)}{' final' if len(sums) > 1 else ''}."
    head = (*first, *(TWO if len(designs) > 1 else ONE))
    return Table(head, rows, title=f"{places.title}{at} [{unit}]", note=note, left=len(first))


def _cells(measures: list[CycleMeasures], scale: float) -> list[str]:
    a, b = measures[0], measures[-1]
    if len(measures) == 1:
        return [number(value, scale=scale) for value in (b.mean, b.max, b.rms)]
    change = percent(b.mean / a.mean - 1.0) if a.mean > 1e-9 * scale else DASH
    means, maximum = ([number(value, scale=scale) for value in pair] for pair in ((a.mean, b.mean), (a.max, b.max)))
    return [*means, change, *maximum]
