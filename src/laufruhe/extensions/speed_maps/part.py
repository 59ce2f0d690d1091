"""Study kind `speed map`: measures over crank speed, limits, and the amplitude of every order."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from laufruhe.files import fields as f
from laufruhe.files.complaints import nearest, si_value
from laufruhe.files.measures import MeasureContext, QuantityName, QuantityTable
from laufruhe.files.study_tables import CaseTable
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.physics.elastic_mounts import ResonanceError
from laufruhe.present import picture as p
from laufruhe.problem.channels import LoadChannel, mounting_in
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure, narrow_signal
from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import FINAL, INITIAL, present_name
from laufruhe.studies.part import Part, Record, variable
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.solved import FAILED, NOTHING_OPEN, decide_scene
from laufruhe.studies.text import DASH, Text, marked_table, number
from laufruhe.units import readable

if TYPE_CHECKING:
    import xarray as xr

DesignName = Annotated[
    Literal["initial", "final"], BeforeValidator(lambda name: present_name(name) if isinstance(name, str) else name)
]
RPM, PER_RAD = readable("rad/s")
MAX_SPEEDS, MAX_ORDERS, PRESENT = 20_000, 8, 0.01


class SpeedsTable(f.Table):
    """Crank speeds from the lower to the higher, by their number or by steps."""

    first: f.Speed = Field(alias="from")
    last: f.Speed = Field(alias="to")
    points: Annotated[int, Field(ge=2, le=MAX_SPEEDS)] | None = None
    step: f.Speed | None = None

    @model_validator(mode="after")
    def _is_a_range(self) -> SpeedsTable:
        if self.first >= self.last:
            raise f.refusal("do not ascend; write the lower speed as from and the higher as to")
        if (self.points is None) == (self.step is None):
            raise f.refusal("need either points or step; give one of them")
        if self.step is not None and not 1.0 <= (self.last - self.first) / self.step < MAX_SPEEDS:
            raise f.refusal("have a step that is above their range or far below it; give another step")
        return self

    def with_point(self, point: OperatingPoint) -> Array:
        """Return the speeds of the map, ascending [rad/s], with that of an operating point if it is in the range."""
        count = self.points or int((self.last - self.first) / (self.step or 1.0) + 1e-9) + 1
        steps = self.first + (self.step or (self.last - self.first) / (count - 1)) * np.arange(count)
        steps = steps[~np.isclose(steps, point.speed, rtol=1e-9)]
        return np.sort([*steps, *([point.speed] if self.first <= point.speed <= self.last else [])])


class MeasureTable(QuantityTable):
    """Line of the map."""

    quantity: QuantityName
    limit: str | None = f.optional("Limit to draw in addition to those of the problem.")


class SpeedMapStudy(Part):
    """Measures over crank speed, of the initial and the final design of every case."""

    kind: Literal["speed map"]
    speeds: SpeedsTable
    measures: list[MeasureTable] = f.optional(
        "Measures of the map; by default all that the problem minimises or limits.", []
    )
    operating_point: str | None = f.optional("Operating point whose load applies at every speed; the first by default.")
    designs: list[DesignName] = Field(default=["initial", "final"], min_length=1)
    by_order: bool = f.optional("Show the amplitude of every order of the first measure too.", False)

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute: one for each case, because decisions do not depend on the map's speeds."""
        for case in self.cases:
            problem = problem_files.problem(Point(case))
            self._load(problem, case, problem_files)
            measures = list(self._measures(problem, case, problem_files))
            if not measures:
                rule = "has no measure that depends on speed"
                raise problem_files.refused(case, "objective", rule, "name measures in this part of the study")
            if self.by_order and not measures[0].is_load:
                rule = f"has no orders of its first measure, {measures[0].name}"
                raise problem_files.refused(case, "objective", rule, "name a force, couple, moment or travel first")
            with problem_files.blamed(Point(case)):
                evaluate(problem)
        return [Point(case) for case in self.cases]

    def _load(self, problem: Problem, case: CaseTable, problem_files: ProblemFiles) -> OperatingPoint:
        names, name = [point.name for point in problem.points], self.operating_point
        if name is not None and name not in names:
            raise problem_files.refused(case, "operating_points", f"has no '{name}'", nearest(name, names))
        return problem.points[0 if name is None else names.index(name)]

    def _measures(self, problem: Problem, case: CaseTable, problem_files: ProblemFiles) -> dict[Measure, float]:
        # mapped measures, at any speed, with the limits of this part
        context, limits = MeasureContext(problem.engine, problem.points), dict.fromkeys(problem.measures, math.inf)
        with problem_files.named(case):
            if self.measures:
                limits = {}
            for k, table in enumerate(self.measures, 1):
                measure = context.measure(table.quantity, table, f"measures[{k}].quantity")
                where = f"measures[{k}].limit"
                limits[measure] = math.inf if table.limit is None else si_value(table.limit, measure.unit, where)
        narrowed = {"operating_points", "orders"}
        return {replace(m, points=None): limit for m, limit in limits.items() if narrowed <= set(m.channel.keys)}

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return measures, limits and orders of every design at every speed, for one point of the study."""
        problem = problem_files.problem(point)
        load, limits = (
            self._load(problem, point.case, problem_files),
            self._measures(problem, point.case, problem_files),
        )
        measures = list(limits)
        speeds = self.speeds.with_point(load)
        designs = {
            name: {**_speed_curves(problem, load, speeds, engine, measures, self.by_order), "proof": proof}
            for name, engine, proof in self._engines(problem)
        }
        return {
            "speeds": speeds.tolist(),
            "measures": [[measure.name, measure.unit] for measure in measures],
            "limits": [_limits(problem, measure, load, speeds, limit) for measure, limit in limits.items()],
            "designs": designs,
        }

    def _engines(self, problem: Problem) -> Iterator[tuple[str, Engine | None, str]]:
        is_open = bool(problem.decisions or problem.phasing)
        if INITIAL in self.designs or not is_open:
            yield INITIAL, problem.engine, NOTHING_OPEN
        if FINAL in self.designs and is_open:
            result, status, proof = decide_scene(problem)
            has_design = status in ("optimal", "feasible")
            yield FINAL, result.final.engine if has_design else None, proof if has_design else status

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return the measures as a dataset over case, design and speed; NaN on an undamped resonance."""
        import xarray as xr

        units = {name: unit for record in records for name, unit in record["measures"]}
        parts = [
            _design_dataset(point.case.name, design, attributes, record)
            for point, record in zip(points, records, strict=True)
            for design, attributes in record["designs"].items()
        ]
        data = xr.concat(parts, "point", join="outer").reindex(measure=list(units))
        data = data.drop_dims([name for name in ("order", "mode") if not data.sizes[name]])
        words = {"value": "value of every measure, in measure_unit", "limit": "limit of every measure, in measure_unit"}
        for name, text in words.items():
            data[name].attrs.update(long_name=text, unit_of="measure_unit")
        if "amplitude" in data:
            attributes = {"long_name": "largest amplitude of every order of crank speed", "of": next(iter(units))}
            data["amplitude"].attrs.update(attributes | {"units": next(iter(units.values()))})
        if "frequency" in data:
            data["frequency"].attrs.update(units="Hz", long_name="natural frequencies on the mounts")
        return data.assign_coords(measure_unit=("measure", list(units.values()))).assign_attrs(self.about())

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return a table of measures: extremes over speed, and speeds at which a limit is broken."""
        data = _readable(data)
        head = ["case", "design", "measure", "least", "largest", f"at [{RPM}]", "limit", f"above it, from to [{RPM}]"]
        rows = []
        for case, design, curves in _designs(data):
            for name, unit in zip(data["measure"].values, data["measure_unit"].values, strict=True):
                values = curves.sel(measure=name)
                proof, label = str(curves["proof"].values[0]), f"{name} [{unit}]" if unit else str(name)
                speeds, sizes, limits = (values[what].values for what in ("speed", "value", "limit"))
                cells, finite = [DASH] * 5, limits[np.isfinite(limits)]
                if not np.isnan(sizes).all():
                    maximum = int(np.nanargmax(sizes))
                    cells[:3] = [number(np.nanmin(sizes)), number(sizes[maximum]), f"{speeds[maximum]:.4g}"]
                    over = speeds[sizes > limits * (1.0 + 1e-6)]
                    where = f"{over.min():.4g} to {over.max():.4g}" if len(over) else "nowhere"
                    cells[3:] = [number(finite[0]), where] if len(finite) else [DASH, DASH]
                elif proof not in ("infeasible", FAILED):
                    # a case lists only its own measures
                    continue
                rows.append([case, design, label, *cells, proof])
        return [marked_table([*head, "proof"], rows)]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Draw each measure over speed, initial designs dashed, and the orders of each design in a panel of its own."""
        data = _readable(data)
        designs = list(_designs(data))
        panels = [_panel(data, designs, k) for k in range(data.sizes["measure"])]
        panels += [
            _orders(*design) for design in designs if "amplitude" in data and design[2]["amplitude"].notnull().any()
        ]
        words = "Each design over speed, at constant load."
        words += (
            " Strokes on the axis: speeds at which an order meets a natural frequency."
            if "amplitude" in data and "frequency" in data
            else ""
        )
        legend = [replace(m, x=(), y=()) for m in panels[0].marks if isinstance(m, p.Line) and m.label]
        legend += [p.Line(dash=p.DASHES[1], width=1.2, label="limit")] if data["limit"].notnull().any() else []
        size = (p.WIDE, p.HIGH if len(panels) == 1 else 2.2)
        return p.Picture(data.attrs["title"], words, panels, p.credit(data), size, gap=0.8, legend=legend)


def _speed_curves(
    problem: Problem,
    load: OperatingPoint,
    speeds: Array,
    engine: Engine | None,
    measures: Sequence[Measure],
    by_order: bool,
) -> Record:
    """Return the curves of one design over speed: measures, amplitudes by order, and natural frequencies [Hz]."""
    values = np.full((len(measures), len(speeds)), math.nan)
    if engine is None:
        return {"values": values.tolist(), "orders": [], "sizes": [], "modes": []}
    sizes: dict[float, Array] = {}
    channel = measures[0].channel
    for k, speed in enumerate(speeds):
        try:
            evaluation = evaluate(replace(problem, points=(replace(load, speed=float(speed)),)), engine)
        except ResonanceError:
            continue
        values[:, k] = [evaluation.value(measure) for measure in measures]
        if by_order and isinstance(channel, LoadChannel):
            signal = narrow_signal(measures[0], channel.signal(evaluation.loads[0]), evaluation.engine)
            amplitudes = order_amplitude(signal.coefficients).max(axis=1)
            for order, size in zip(signal.orders, amplitudes, strict=True):
                sizes.setdefault(float(order), np.zeros(len(speeds)))[k] = size
    largest = sorted((order for order in sizes if order), key=lambda order: -sizes[order].max())[:MAX_ORDERS]
    present = sorted(order for order in largest if sizes[order].max() > PRESENT * sizes[largest[0]].max())
    modes = mounting_in(engine).modes.frequencies.tolist() if engine.block is not None else []
    return {"values": values.tolist(), "orders": present, "sizes": [sizes[h].tolist() for h in present], "modes": modes}


def _limits(problem: Problem, measure: Measure, load: OperatingPoint, speeds: Array, part_limit: float) -> list[float]:
    lowest = np.full(len(speeds), part_limit)
    for limit in problem.limits:
        if replace(limit.measure, points=None) == measure and limit.measure.includes_point(load):
            applies = (speeds == load.speed) | (limit.measure.points is None)
            lowest[applies] = np.minimum(lowest[applies], limit.maximum)
    return [float(value) if math.isfinite(value) else math.nan for value in lowest]


def _design_dataset(case: str, design: str, values: Mapping[str, Any], record: Mapping[str, Any]) -> xr.Dataset:
    import xarray as xr

    speeds = [float(f"{PER_RAD * speed:.12g}") for speed in record["speeds"]]
    count, names = len(speeds), [name for name, _ in record["measures"]]
    return xr.Dataset(
        {
            "value": (("point", "measure"), np.transpose(values["values"])),
            "limit": (("point", "measure"), np.transpose(record["limits"])),
            "amplitude": (("point", "order"), np.reshape(values["sizes"], (-1, count)).T),
            "frequency": (("point", "mode"), np.tile(values["modes"], (count, 1))),
        },
        {
            **{name: ("point", [value] * count) for name, value in
               {"case": case, "design": design, "proof": values["proof"]}.items()},
            "speed": variable("point", speeds, "crank speed", RPM),
            "measure": names,
            "order": values["orders"],
            "mode": np.arange(1, len(values["modes"]) + 1),
        },
    )  # fmt: skip


def _readable(data: xr.Dataset) -> xr.Dataset:
    units, factors = zip(*(readable(str(unit)) for unit in data["measure_unit"].values), strict=True)
    converted = data.assign(value=data["value"] * np.array(factors), limit=data["limit"] * np.array(factors))
    if "amplitude" in data:
        converted["amplitude"] = (data["amplitude"] * factors[0]).assign_attrs(data["amplitude"].attrs)
    return converted.assign_coords(measure_unit=("measure", list(units)))


def _designs(data: xr.Dataset) -> Iterator[tuple[str, str, xr.Dataset]]:
    keys = list(zip(data["case"].values.tolist(), data["design"].values.tolist(), strict=True))
    for case, design in dict.fromkeys(keys):
        yield case, design, data.isel(point=np.flatnonzero([key == (case, design) for key in keys]))


def _panel(data: xr.Dataset, designs: Sequence[tuple[str, str, xr.Dataset]], k: int) -> p.Panel:
    cases = list(dict.fromkeys(case for case, *_ in designs))
    lines: list[p.Mark] = []
    borders: list[p.Mark] = []
    for case, design, curves in designs:
        speeds, values, limits = curves["speed"].values, curves["value"].values[:, k], curves["limit"].values[:, k]
        is_initial = design == INITIAL
        single: p.Colour = "before" if is_initial else "after"
        colour = single if len(cases) == 1 else p.colour(cases.index(case), len(cases))
        label = design if len(cases) == 1 else f"{case}, {design}"
        lines.append(p.Line(speeds, values, colour, label, dash=p.DASHES[0] if is_initial else ()))
        finite = np.isfinite(limits)
        # a limit at a single operating point is a stroke
        look: dict[str, Any] = {"width": 1.2} if finite.sum() > 1 else {"width": 0.0, "marker": "_", "size": 14.0}
        borders.append(p.Line(speeds[finite], limits[finite], dash=p.DASHES[1], behind=True, **look))
    name, unit = str(data["measure"].values[k]), str(data["measure_unit"].values[k])
    top = max(float(data[what].isel(measure=k).max()) for what in ("value", "limit") if data[what].notnull().any())
    label, ends = f"{name} [{unit}]" if unit else name, (0.0, 1.08 * top or 1.0)
    # a single panel has room for the name on its axis
    is_single = data.sizes["measure"] == 1 and "amplitude" not in data
    axis, title = (p.Axis(label, ends), "") if is_single else (p.Axis(ends=ends), label)
    return p.Panel([*lines, *borders], _speed_axis(data), axis, title)


def _speed_axis(data: xr.Dataset) -> p.Axis:
    return p.Axis(f"crank speed [{RPM}]", (float(data["speed"].min()), float(data["speed"].max())))


def _orders(case: str, design: str, curves: xr.Dataset) -> p.Panel:
    """Draw the amplitude of every order; strokes on the axis mark speeds at which it meets a natural frequency."""
    speeds, top = curves["speed"].values, float(curves["amplitude"].max()) or 1.0
    edge = float(speeds.max() + 0.015 * np.ptp(speeds))
    marks: list[p.Mark] = []
    for k, order in enumerate(curves["order"].values):
        values, colour = curves["amplitude"].values[:, k], p.colour(k, curves.sizes["order"])
        if np.isnan(values).all():
            continue
        marks.append(p.Line(speeds, values, colour))
        marks.append(p.Words(edge, (1.08 - 0.11 * k) * top, f"order {order:g}", colour=colour))
        critical = (
            2.0 * math.pi * PER_RAD * curves["frequency"].values[0] / order if "frequency" in curves else np.zeros(0)
        )
        critical = critical[(critical > speeds.min()) & (critical < speeds.max())]
        marks.append(p.Line(critical, np.zeros(len(critical)), colour, width=0.0, marker="|", size=10.0))
    title = f"{case}, {design}: orders of {curves['amplitude'].attrs['of']} [{curves['measure_unit'].values[0]}]"
    return p.Panel(marks, _speed_axis(curves), p.Axis(ends=(0.0, 1.15 * top)), title)
