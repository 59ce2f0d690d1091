"""Study kind `layout comparison`: engines of equal cylinders or equal power (Hasselgruber 1964, Figs. 12 and 13)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field

from laufruhe.errors import InputError, ModelError
from laufruhe.extension import missing_extension, object_at
from laufruhe.extensions.sweeps.swept import SweptPart
from laufruhe.extensions.sweeps.swept_report import (
    MAX_ROWS,
    bars,
    by_point,
    claim_of,
    in_words,
    over_sweep,
    readable_metric,
    swept_names,
)
from laufruhe.files import fields as f
from laufruhe.files.measures import MeasureContext, QuantityName, QuantityTable
from laufruhe.files.problem_file import EXTENSION_KEYS
from laufruhe.files.study_tables import CaseTable
from laufruhe.machine.slider_crank import displacement
from laufruhe.physics.torque import crank_torque
from laufruhe.present import picture as p
from laufruhe.present.numbers import number as figures
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import MEASURES, Measure
from laufruhe.problem.problem import Problem
from laufruhe.studies.part import Record
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.solved import NOTHING_OPEN, Decided, decide_scene, has_design, record_of
from laufruhe.studies.text import DASH, Text, marked_table, number
from laufruhe.units import readable

if TYPE_CHECKING:
    import xarray as xr

Quantity: TypeAlias = Callable[[Evaluation], float]
"""Function that returns a quantity of a design; its `ModelError` states why the design has no value."""
EQUAL = "equal cylinders"
_SAME, _NEGLIGIBLE, _FIGURES = 1e-9, 1e-7, 1e-5
_MIN_FLYWHEEL, _SWING = "least flywheel", "laufruhe.extensions.flywheel.torque:swing_of"
_RESIZED = (
    "Resized engines. With z cylinders, all lengths of a problem file are multiplied by the root of the number of "
    "reference cylinders over z: bore, stroke, spacing, planes of weights, and positions of mounts. Masses grow with "
    "the cube of this factor, and speeds fall with it (Hasselgruber 1964, eqs. 18 to 22). So mounts follow the size of "
    "a cylinder; with the number of cylinders they move only if the problem file of a case has other positions. "
    "Flywheel and limits stay as in the file. Power is the mean power of the crankshaft."
)
# height of a row, and of the margins above and below [inch]
ROW, AROUND = 0.19, 0.9
# panels side by side, and spread of values from which an axis is logarithmic
MAX_PANELS_OF_RANKS, SPREAD = 4, 200.0


class LayoutComparison(SweptPart):
    """Engines side by side, of equal cylinders or of equal power."""

    kind: Literal["layout comparison"]
    further: list[QuantityName] = Field(
        default_factory=list, max_length=8, description="Further quantities by which the final designs are ranked."
    )
    flywheel_for: f.Positive | None = f.optional(
        "Degree of irregularity; the smallest inertia beside pistons and rods that keeps it is ranked too."
    )

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute: every case at every combination of swept values.

        Cylinders must have one size.
        """
        if self.flywheel_for is not None and "flywheel" not in EXTENSION_KEYS:
            raise problem_files.refused(self.cases[0], "study.flywheel_for", *missing_extension("flywheel"))
        points = super().points(problem_files)
        power = self.cases[0].equal_power_to
        odd = next((case for case in self.cases if case.equal_power_to != power), None)
        if odd is not None:
            rule = f"differs between cases '{self.cases[0].name}' and '{odd.name}'"
            raise problem_files.refused(odd, "equal_power_to", rule, "give all cases the same equal_power_to, or none")
        self._check_cylinders(problem_files)
        at = self.combinations()[0]
        measures_by_case = [
            self._measures(problem_files.problem(Point(case, at, self.metric)), case, problem_files)
            for case in self.cases
        ]
        for name in self.further:
            first, *others = (measures[name] for measures in measures_by_case)
            if isinstance(first, InputError) and all(isinstance(other, InputError) for other in others):
                raise first
        return points

    def _measures(
        self, problem: Problem, case: CaseTable, problem_files: ProblemFiles
    ) -> dict[str, Measure | InputError]:
        """Return further measures by name; for an engine without that quantity, the error in place of the measure."""
        context, measures = MeasureContext(problem.engine, problem.points), dict[str, Measure | InputError]()
        for name in self.further:
            # an engine without weights has a mass of zero
            is_mass = name in MEASURES and MEASURES[name][0].is_mass
            try:
                with problem_files.named(case):
                    plain, table = Measure(*MEASURES[name]) if is_mass else None, QuantityTable()
                    measures[name] = plain or context.measure(name, table, "study.further")
            except InputError as error:
                measures[name] = error
        return measures

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the record of one layout's proven optimum, with every further quantity of that design."""
        problem = problem_files.problem(point)
        further: dict[str, Quantity] = {
            n: partial(_value, m) for n, m in self._measures(problem, point.case, problem_files).items()
        }
        if self.flywheel_for is not None:
            degree, swing_of = self.flywheel_for, object_at(_SWING)
            further[_MIN_FLYWHEEL] = lambda design: max(
                swing_of(design.engine, loads.point, design.fidelity).minimum_inertia(degree) for loads in design.loads
            )
        sizes = {} if point.case.equal_power_to is None else _sizes(problem)
        decided = decide_scene(problem)
        record = record_of(problem, decided)
        record["further"], record["why_none"] = _values_of(decided, further)
        record["size"], _ = _values_of(decided, {name: size for name, (_, size) in sizes.items()})
        record["size_units"] = {name: unit for name, (unit, _) in sizes.items()}
        record["places"] = {mount.name: list(mount.position) for mount in problem.engine.mounts}
        return record

    def _check_cylinders(self, problem_files: ProblemFiles) -> None:
        """Raise `InputError` for layouts with different cylinders, because size would then change the comparison."""
        sizes = []
        for case in self.cases:
            as_drawn = Point(case.model_copy(update={"equal_power_to": None}), self.combinations()[0], self.metric)
            sizes.append(
                {(c.bore or 0.0, c.crank_radius) for c in problem_files.problem(as_drawn).engine.slider_cranks}
            )
        for case, size in zip(self.cases, sizes, strict=True):
            if len(size) > 1:
                rule = "has cylinders of different bore or stroke"
                raise problem_files.refused(case, "engine", rule, "give all cylinders the same size")
        bore_1, radius_1 = next(iter(sizes[0]))
        for case, ((bore, radius),) in zip(self.cases, sizes, strict=True):
            if abs(radius - radius_1) > _SAME * radius_1 or abs(bore - bore_1) > _SAME:
                rule = f"has another bore or stroke in '{case.name}' than in '{self.cases[0].name}'"
                raise problem_files.refused(case, "engine", rule, "compare layouts of one cylinder")

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return the results of all layouts as a dataset, with the further quantities."""
        power = self.cases[0].equal_power_to
        size = EQUAL if power is None else f"the power of {power} cylinders"
        data = super().dataset(points, records).assign_attrs(at=size)
        if power is not None:
            data = _with_sizes(data, records)
        names = list(dict.fromkeys(name for record in records for name in record["further"]))
        if not names:
            return data
        values = np.array([[record["further"][name] for name in names] for record in records], dtype=float)
        why = [[record["why_none"][name] for name in names] for record in records]
        about = {"long_name": "further quantity of the final design, in quantity_unit", "unit_of": "quantity_unit"}
        wheel = f"flywheel for 1/{number(1.0 / self.flywheel_for)}" if self.flywheel_for else ""
        units = ["kg m^2" if name == _MIN_FLYWHEEL else MEASURES[name][0].unit for name in names]
        dims = ("point", "quantity")
        return data.assign(
            further=(dims, values, about),
            why_none=(dims, why, {"long_name": "reason for a missing value"}),
        ).assign_coords(
            quantity=[wheel if name == _MIN_FLYWHEEL else name for name in names], quantity_unit=("quantity", units)
        )

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return a row per point; then the ranking by the metric, with the place by every further quantity."""
        tables = [*_best(data), *by_point(data), *(_size_table(data) if "size" in data.data_vars else [])]
        return [*tables, *_ranking(data)] if "further" in data else tables

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Draw bars of the initial and the final objective of every layout; lines if a number is swept."""
        size, is_equal = data.attrs["at"], data.attrs["at"] == EQUAL
        if swept_names(data):
            decided = (data["proof"].values != NOTHING_OPEN).any()
            words = f"Every point: {claim_of(data)}." if decided else "Initial designs."
            return over_sweep(data, [], words if is_equal else f"At {size}. {words}")
        words = f"Engines of {size}." if is_equal else f"At {size}."
        return _side_by_side(data, words) if "further" in data else bars(data, data["case"].values, words)


def _values_of(decided: Decided, quantities: Mapping[str, Quantity]) -> tuple[dict[str, float], dict[str, str]]:
    # quantities of a final design [SI], NaN for missing values, and the reason why one has no value
    values, reasons = dict.fromkeys(quantities, math.nan), dict.fromkeys(quantities, "")
    for name, quantity in quantities.items() if has_design(decided) else ():
        try:
            value = quantity(decided[0].final)
            values[name] = value if math.isfinite(value) else math.nan
        except ModelError as error:
            reasons[name] = str(error).partition("; ")[0]
    return values, reasons


def _sizes(problem: Problem) -> dict[str, tuple[str, Quantity]]:
    """Return the sizes of a resized engine by name: unit, and function of its design."""

    def power(k: int) -> Quantity:
        def value(design: Evaluation) -> float:
            point = design.loads[k].point
            return point.speed * float(crank_torque(design.engine, point, design.fidelity).coefficients[0].real)

        return value

    def speed(k: int) -> Quantity:
        return lambda design: design.loads[k].point.speed

    sizes: dict[str, tuple[str, Quantity]] = {
        "bore": ("m", lambda design: math.sqrt(4.0 * design.engine.slider_cranks[0].piston_area / math.pi)),
        "stroke": ("m", lambda design: design.engine.slider_cranks[0].stroke),
        "displacement": ("m^3", lambda design: displacement(design.engine.slider_cranks)),
    }
    for k, point in enumerate(problem.points):
        at = f" at {point.name}" if len(problem.points) > 1 else ""
        sizes |= {f"speed{at}": ("rad/s", speed(k)), f"power{at}": ("W", power(k))}
    return sizes


def _with_sizes(data: xr.Dataset, records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    units = {name: unit for record in records for name, unit in record["size_units"].items()}
    values = [[record["size"].get(name, math.nan) for name in units] for record in records]
    about = {"long_name": "size of the resized engine, in size_unit", "unit_of": "size_unit"}
    places = np.full((len(records), data.sizes["mount"], 3), math.nan)
    for row, record in zip(places, records, strict=True):
        for k, name in enumerate(data["mount"].values.tolist()):
            row[k] = record["places"].get(name, math.nan)
    data = data.assign(size=(("point", "size_name"), np.array(values), about))
    for k, axis in enumerate("xyz"):
        along = {"units": "m", "long_name": f"{axis} of the mount"}
        data = data.assign({f"mount_{axis}": (("point", "mount"), places[..., k], along)})
    return data.assign_coords(size_name=list(units), size_unit=("size_name", list(units.values())))


def _best(data: xr.Dataset) -> list[Text]:
    """Return a sentence that names the best of several points; several are named if their values agree."""
    data = readable_metric(data)
    values, unit = data["objective"].values, data["objective"].attrs["units"]
    best = [k for k, place in enumerate(_places(values)) if place == 1]
    if not best or np.isfinite(values).sum() < 2:
        return []
    names = [
        ", ".join(
            [str(data["case"].values[k]), *(in_words(data[n], data[n].values[k].item()) for n in swept_names(data))]
        )
        for k in best
    ]
    return [f"Best: {' and '.join(names)}, with {number(float(values[best[0]]))} {unit}".rstrip() + "."]


def _size_table(data: xr.Dataset) -> list[Text]:
    """Return the sizes of the resized engines, a row for each point, and the rule of resizing."""
    usual = {"m^3": "l", "W": "kW"}
    units = [readable(unit, usual.get(unit, "")) for unit in map(str, data["size_unit"].values)]
    (length, millimetres), swept, rows = readable("m"), swept_names(data), []
    mounts = data["mount"].values.tolist()
    for k in range(min(data.sizes["point"], MAX_ROWS)):
        sizes = zip(data["size"].values[k], units, strict=True)
        places = (millimetres * np.array([data[f"mount_{axis}"].values[k] for axis in "xyz"])).T
        rows.append([
            str(data["case"].values[k]), *(in_words(data[name], data[name].values[k].item()) for name in swept),
            *(number(factor * value) for value, (_, factor) in sizes),
            *(", ".join(figures(value, 4, 1.0) for value in place) if np.isfinite(place).all() else DASH
              for place in places.tolist()),
        ])  # fmt: skip
    names = [f"{name} [{unit}]" for name, (unit, _) in zip(data["size_name"].values.tolist(), units, strict=True)]
    head = ["case", *swept, *names, *(f"{name}, x, y, z [{length}]" for name in mounts)]
    return [_RESIZED, marked_table(head, rows, data.sizes["point"] - len(rows))]


def _value(measure: Measure | InputError, design: Evaluation) -> float:
    if isinstance(measure, InputError):
        raise ModelError(measure.complaints[0].rule)
    return design.value(measure)


def _ranking(data: xr.Dataset) -> list[Text]:
    """Return a table of the layouts, best first; values that differ by rounding share a rank."""
    best, points = data["objective"].values, data.sizes["point"]
    columns = [(data.attrs["metric"], data["objective"].attrs["units"], best, [""] * points)]
    for k, name in enumerate(data["quantity"].values.tolist()):
        values = data["further"].values[:, k]
        # loads that cancel leave a rounding error
        zero_level = _NEGLIGIBLE * float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
        values = np.where(np.abs(values) < zero_level, 0.0, values)
        columns.append((name, str(data["quantity_unit"].values[k]), values, data["why_none"].values[:, k].tolist()))
    swept, rows = swept_names(data), []
    scaled = [(name, *readable(unit), values, _places(values), why) for name, unit, values, why in columns]
    for k in sorted(range(points), key=lambda k: (math.isnan(best[k]), best[k])):
        row = [str(data["case"].values[k]), *(str(data[name].values[k]) for name in swept)]
        rows.append(row + [
            f"{number(factor * values[k])} ({places[k]})" if places[k] else f"{DASH} {why[k]}".strip()
            for _, _, factor, values, places, why in scaled
        ])  # fmt: skip
    head = ["case", *swept, *(f"{name} [{unit}]" if unit else name for name, unit, *_ in scaled)]
    words = "Ranked by the first quantity; ranks by each quantity in parentheses. After a dash: why a value is missing."
    return [words, marked_table(head, rows[:MAX_ROWS], len(rows[MAX_ROWS:]))]


def _places(values: np.ndarray) -> list[int]:
    finite = values[np.isfinite(values)]
    tolerance = _SAME * float(np.abs(finite).max(initial=0.0))
    return [
        1 + int((finite < value - max(tolerance, _FIGURES * abs(value))).sum()) if math.isfinite(value) else 0
        for value in values
    ]


def _side_by_side(data: xr.Dataset, words: str) -> p.Picture:
    """Draw the layouts by rank, best first: a panel for the objective and for each further quantity."""
    order = np.argsort(np.nan_to_num(data["objective"].values, nan=np.inf), kind="stable")
    names = [str(name) for name in data["case"].values[order]]
    units = data["quantity_unit"].values.tolist()
    quantities = [
        (str(name), *readable(str(unit)), data["further"].values[order, k])
        for k, (name, unit) in enumerate(zip(data["quantity"].values.tolist(), units, strict=True))
    ]
    unit, metric = data["objective"].attrs["units"], data.attrs["metric"]
    if unit not in ("", "1") and metric not in [name for name, *_ in quantities]:
        quantities.insert(0, (metric, *readable(unit), data["objective"].values[order]))
    # rows of similar length
    columns = -(-len(quantities) // -(-len(quantities) // MAX_PANELS_OF_RANKS))
    panels = [
        _panel(f"{name}\n[{unit}]" if unit else f"{name}\n", factor * values, names if k % columns == 0 else [])
        for k, (name, unit, factor, values) in enumerate(quantities)
    ]
    proven, count = int((data["proof"].values == "global").sum()), data.sizes["point"]
    claim = "All designs are proven optima" if proven == count else f"{proven} of {count} designs are proven optima"
    size = (p.WIDEST / columns, AROUND + ROW * len(names))
    text = f"{words} {claim}; the best is first."
    gap = 0.12 if len(quantities) == columns else 0.5
    return p.Picture(data.attrs["title"], text, panels, p.credit(data), size=size, columns=columns, gap=gap)


def _panel(title: str, values: np.ndarray, names: list[str]) -> p.Panel:
    maximum = float(np.nanmax(values, initial=0.0)) or 1.0
    minimum = float(np.nanmin(values, initial=maximum))
    # values over decades need a logarithmic axis
    low = 10.0 ** math.floor(math.log10(minimum)) if 0.0 < minimum < maximum / SPREAD else 0.0
    span = math.log(maximum / low) if low else maximum
    finite, places = np.isfinite(values), np.arange(len(values), dtype=float)
    marks: list[p.Mark] = [p.Bars(places[finite], values[finite], 0.62, upright=False)]
    for place, value in zip(places.tolist(), values.tolist(), strict=True):
        is_known = math.isfinite(value)
        text = figures(value, scale=maximum) if is_known else "no value"
        start = value if is_known else low
        marks.append(p.Words(start * math.exp(0.03 * span) if low else start + 0.03 * span, place, text))
    ticks = [(float(row), name) for row, name in enumerate(names)]
    side = p.Axis(ends=(len(values) - 0.4, -0.6), ticks=ticks, grid=False)
    if not low:
        return p.Panel(marks, p.Axis(ends=(low, 1.7 * span)), side, title)
    end = low * math.exp(1.7 * span)
    first, last = round(math.log10(low)), math.floor(math.log10(end))
    decades = [(10.0**k, f"{10.0**k:g}") for k in range(first, last + 1, max((last - first) // 2, 1))]
    return p.Panel(marks, p.Axis(ends=(low, end), log=(1.0,), ticks=decades), side, title)
