"""Study kind `skip fire`: the smoothest of all firing patterns of a length and a number of firings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import groupby
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Field, PlainValidator, WithJsonSchema

from laufruhe import units
from laufruhe.errors import plural, refused
from laufruhe.extensions.skip_fire.patterns import count_patterns, is_even, patterns
from laufruhe.extensions.skip_fire.torque import FiringModel
from laufruhe.files import fields as f
from laufruhe.files.complaints import nearest
from laufruhe.files.cylinder_states import CylinderState
from laufruhe.files.measures import MeasureContext, QuantityName, QuantityTable
from laufruhe.files.study_tables import CaseTable
from laufruhe.numerics.spectrum import Spectrum, order_amplitude
from laufruhe.physics.torque import excess_torque
from laufruhe.present import picture as p
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Measure
from laufruhe.studies.part import Part, Record, variable
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.text import Text, marked_table, number

if TYPE_CHECKING:
    import xarray as xr

MAX_PATTERNS, LISTED, DRAWN, STEPS, ALIKE = 10_000, 8, 4, 72, 1e-9
"""Most patterns to compare, to list, comparisons to draw, steps of torque over a turn, and relative rounding."""


def _share_of(demand: str) -> Fraction | None:
    # share of opportunities that fire: "2/3", "0.5" or "50 %"; None for a torque
    text = demand.removesuffix("%").rstrip()
    try:
        return Fraction(text) / (1 if text == demand else 100)
    except (ValueError, ZeroDivisionError):
        return None


def _checked(demand: object) -> str:
    text = str(demand).strip() if isinstance(demand, str | int | float) and not isinstance(demand, bool) else ""
    share = _share_of(text)
    if share is None:
        try:
            units.parse(text, "N m")
        except units.UnitError as error:
            raise f.refusal(f'is neither a share, such as "2/3", 0.5 or "50 %", nor a torque: {error}') from None
    elif not 0 <= share <= 1:
        raise f.refusal('is no share from 0 to 1; write "2/3", 0.5 or "50 %", or a torque such as "90 N m"')
    return text


Demand: TypeAlias = Annotated[
    str, PlainValidator(_checked), WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]})
]


class PatternMeasureTable(QuantityTable):
    """Measure of a pattern."""

    quantity: QuantityName


class SkipFirePart(Part):
    """Firing patterns of the design as given, the smoothest first."""

    kind: Literal["skip fire"]
    opportunities: list[Annotated[int, Field(ge=1, le=32)]] = Field(
        min_length=1, description="Lengths of patterns in opportunities to fire; a cycle has one of each cylinder."
    )
    demands: list[Demand] = Field(
        min_length=1, description="Shares of opportunities that fire, or mean torques.", examples=[["2/3", "90 N m"]]
    )
    skipped: Literal["closed valves", "open valves", "misfire"] = f.optional(
        "Skipped cylinder: cut with closed or open valves, or with a charge that does not burn.", "closed valves"
    )
    measures: list[PatternMeasureTable] = f.optional(
        "Measures of a pattern, of which the first decides; by default what the problem minimises.", []
    )
    operating_point: str | None = f.optional("Operating point; the first by default.")

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute: one for each case."""
        for case in self.cases:
            with problem_files.blamed(Point(case)):
                self._comparisons(case, problem_files)
        return [Point(case) for case in self.cases]

    def _comparisons(
        self, case: CaseTable, problem_files: ProblemFiles
    ) -> tuple[list[Measure], dict[tuple[int, int], FiringModel]]:
        """Return the measures, and a model for every length and number of firings."""
        problem = problem_files.problem(Point(case))
        names, engine, fidelity = [point.name for point in problem.points], problem.engine, problem.fidelity
        name = self.operating_point or names[0]
        if name not in names:
            raise problem_files.refused(case, "operating_points", f"has no '{name}'", nearest(name, names))
        if fidelity.has_uneven_speed or fidelity.mounts == "time":
            rule = "has crank_inertia or mounts in the time domain, and skip fire needs loads by order"
            raise problem_files.refused(case, "fidelity", rule, "remove these keys")
        problem = replace(problem, points=(problem.points[names.index(name)],))
        fired, parts = fidelity.gas_of(problem.points[0]), tuple(s.name for s in engine.slider_cranks if s.bore != 0.0)
        misfire, cut = (parts, ()) if self.skipped == "misfire" else ((), parts)
        with problem_files.named(case):
            state = CylinderState(misfire, cut, self.skipped == "open valves", "")
            skipped, context = state.gas(fired, engine.cycle, "skipped"), MeasureContext(engine, problem.points)
            measures = [
                context.measure(table.quantity, table, f"measures[{k}]") for k, table in enumerate(self.measures, 1)
            ]
        measures = [replace(m, points=None) for m in measures or (term.measure for term in problem.objective)]
        if fired is None or skipped is None or not measures:
            raise problem_files.refused(case, "objective", "is missing", "name measures in this part of the study")
        model, whole, count = FiringModel(problem, fired, skipped, 1), evaluate(problem), len(engine.cylinders)
        every, none = model.evaluation("1"), model.evaluation("0")
        for measure in measures:
            # firings of all cylinders have the loads of the engine, and others than no firing
            value = every.value(measure)
            if not math.isclose(value, whole.value(measure), rel_tol=1e-6) or value == none.value(measure):
                rule = f"has no {measure.name} of a firing pattern, which does not follow from its torque"
                remedy = "name a measure of roll moment, mounts, receivers, stored work or irregularity"
                raise problem_files.refused(case, "engine", rule, remedy)
        idle, full = (float(model.crank_torque(pattern).coefficients[0].real) for pattern in "01")
        comparisons = dict[tuple[int, int], FiringModel]()
        for length in self.opportunities:
            model = replace(model, cycles=math.lcm(length, count) // count)
            for demand in self.demands:
                share = _share_of(demand)
                if share is None:
                    share_of_torque = (units.parse(demand, "N m") - idle) / (full - idle)
                    firings = Fraction(max(math.ceil(length * (share_of_torque - ALIKE)), 0))
                else:
                    firings = length * share
                if firings > length or firings % 1:
                    rule = f"cannot fire {demand} of {length} opportunities"
                    remedy = f"all give {full:.4g} N m"
                    if share is not None:
                        remedy = f"give a multiple of {share.denominator} opportunities"
                    raise problem_files.refused(case, "engine", rule, remedy)
                if count_patterns(length, int(firings), math.gcd(count, length)) > MAX_PATTERNS:
                    rule = f"has more than {MAX_PATTERNS} patterns of {int(firings)} firings in {length} opportunities"
                    raise refused("opportunities", str(length), rule, "compare shorter patterns", self.kind)
                comparisons[length, int(firings)] = model
        return measures, comparisons

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the smoothest patterns and the worst one of every comparison, for one case."""
        measures, comparisons = self._comparisons(point.case, problem_files)
        rows = [row for key, model in comparisons.items() for row in _compare(model, measures, *key)]
        return {"measures": {measure.name: measure.unit for measure in measures}, "rows": rows}

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return the listed patterns as a dataset; torque is NaN after the last cycle of a pattern."""
        import xarray as xr

        rows = [
            {"case": point.case.name, **row}
            for point, record in zip(points, records, strict=True)
            for row in record["rows"]
        ]
        units = {name: unit for record in records for name, unit in record["measures"].items()}
        orders = sorted({order for row in rows for order in row["amplitude"]}, key=float)
        angles = max((row["torque"] for row in rows), key=len)
        columns = {
            "value": ("measure", units, "value of every measure, in measure_unit", "1"),
            "torque": ("angle", angles, "crank torque over the crank angle", "N m"),
            "amplitude": ("order", orders, "amplitude of the first measure, or of torque for a number", "1"),
        }
        tables = {
            key: variable(("point", along), [[row[key].get(k, math.nan) for k in names] for row in rows], words, unit)
            for key, (along, names, words, unit) in columns.items()
        }
        facts = {key: ("point", [row[key] for row in rows]) for key in rows[0] if key not in columns}
        axes = {"order": [*map(float, orders)], "angle": variable("angle", [*map(float, angles)], "crank angle", "deg")}
        unit = {"measure": list(units), "measure_unit": ("measure", list(units.values()))}
        return xr.Dataset(tables, {**facts, **axes, **unit}, self.about())

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return, for every comparison, what is proven and a table of patterns."""
        texts: list[Text] = []
        for title, rows in _comparisons_in(data):
            scales = [units.readable(str(unit)) for unit in rows["measure_unit"].values]
            names = zip(rows["measure"].values, scales, strict=True)
            heads = [f"{name} [{unit}]" if unit else str(name) for name, (unit, _) in names]
            factors = np.array([factor for _, factor in scales])
            values, first = rows["value"].values * factors, rows.isel(point=0)
            ends = [number(value) for value in (*values[[0, -1], 0], float(first["all_fire"]) * factors[0])]
            texts.append(
                f"{title}: `{first['pattern'].item()}` is the smoothest. {heads[0]}: {ends[0]}, in the worst pattern "
                f"{ends[1]}, while all cylinders fire {ends[2]}. Proof: all {int(first['compared'])} patterns were "
                f"compared ({int(first['different'])} different up to rotation by whole cycles)."
            )
            facts = [rows[key].values for key in ("pattern", "alike", "mean_torque", "remark")]
            cells = [
                [f"`{pattern}`", str(alike), *map(number, row), number(torque), str(remark)]
                for row, pattern, alike, torque, remark in zip(values, *facts, strict=True)
            ]
            head = ["pattern", "patterns with this value", *heads, "mean torque [N m]", "remark"]
            texts.append(marked_table(head, cells))
        return texts

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Draw the torque and the orders of the smoothest and the worst pattern of the first comparisons."""
        panels = list[p.Panel]()
        for title, rows in _comparisons_in(data)[:DRAWN]:
            orders, (unit, factor) = rows["order"].values[1:], units.readable(str(rows["measure_unit"].values[0]))
            torques, sizes, patterns = list[p.Mark](), list[p.Mark](), rows["pattern"].values[[0, -1]]
            ends = ((-1, "before", "worst pattern"), (0, "after", "smoothest pattern"))
            # patterns of one class have one curve
            for k, colour, word in ends[rows.sizes["point"] == 1 :]:
                row, label = rows.isel(point=k), "" if panels else word
                torques.append(p.Line(rows["angle"].values, row["torque"].values, colour, label))
                sizes.append(p.Bars(orders, factor * row["amplitude"].values[1:], 0.1 if k == 0 else 0.2, colour))
            panels.append(p.Panel(torques, p.Axis("crank angle [deg]"), p.Axis("crank torque [N m]"),
                                  f"{title}: {', worst '.join(dict.fromkeys(patterns))}"))  # fmt: skip
            panels.append(p.Panel(sizes, p.Axis("order of crank speed"), p.Axis(f"amplitude [{unit or 'N m'}]")))
        words = f"Torque of the smoothest and the worst pattern, and orders. Measure: {data['measure'].values[0]}."
        return p.Picture(data.attrs["title"], words, panels, p.credit(data), (4.2, 2.4), 2, 0.7)


def _compare(model: FiringModel, measures: list[Measure], length: int, firings: int) -> list[Record]:
    """Return a record for each of the least values of all patterns, and for the largest."""
    count, turns = len(model.opportunities), model.problem.engine.cycle.turns
    # loads repeat with the cycle, so a pattern and its rotation by a cycle are alike
    different = patterns(length, firings, math.gcd(length, count))
    values = {pattern: model.evaluation(pattern).value(measures[0]) for pattern in different}
    # other patterns, such as mirrored ones, have equal values but for rounding
    rounded = {pattern: float(f"{value:.9g}") for pattern, value in values.items()}
    classes = [list(alike) for _, alike in groupby(sorted(values, key=rounded.__getitem__), rounded.__getitem__)]
    rows, all_fire = [], model.evaluation("1").value(measures[0])
    for alike in classes[:LISTED] + classes[LISTED:][-1:]:
        pattern, cycles = max(alike), math.ceil(length / count)
        design, torque, fires = model.evaluation(pattern), model.crank_torque(pattern), pattern * (model.cycles * count)
        signal = _signal(measures[0], design).truncated(2 * count / turns)
        curve = np.resize(torque.sample(STEPS * round(torque.period / math.tau)), STEPS * turns * cycles)
        states = {one.name.removeprefix("cylinder "): {*fires[k::count]} for k, one in enumerate(model.opportunities)}
        fixed = [name for name, state in states.items() if state == {"1"}]
        is_fixed = 0 < firings < length and all(len(state) == 1 for state in states.values())
        remarks = ["even"] * is_even(pattern)
        remarks += [f"only {plural('cylinder', len(fixed))} {', '.join(fixed)}"] * is_fixed
        rows.append({
            "opportunities": length, "firings": firings, "compared": math.comb(length, firings),
            "different": len(values), "all_fire": all_fire, "pattern": pattern,
            "alike": len(alike), "mean_torque": float(torque.coefficients[0].real),
            "remark": "; ".join(remarks),
            "value": {measure.name: design.value(measure) for measure in measures},
            "torque": {f"{360.0 * k / STEPS:g}": value for k, value in enumerate(curve.tolist())},
            "amplitude": {
                f"{order:.9g}": float(order_amplitude(row).max())
                for order, row in zip(signal.orders, signal.coefficients, strict=True)
            },
        })  # fmt: skip
    return rows


def _signal(measure: Measure, design: Evaluation) -> Spectrum:
    # the load of a measure, shape (n, places, d); for a number, the torque that makes the speed uneven
    if measure.is_load:
        return measure.signal(design.loads[0], design.engine)
    return excess_torque(design.engine, design.loads[0].point, design.fidelity).mapped(lambda row: row[:, None, None])


def _comparisons_in(data: xr.Dataset) -> list[tuple[str, xr.Dataset]]:
    keys = list(zip(*(data[key].values.tolist() for key in ("case", "opportunities", "firings")), strict=True))
    return [
        (
            f"{key[0]}, {key[2]} firings of {key[1]}",
            # cases may have different measures
            data.isel(point=[k for k, at in enumerate(keys) if at == key]).dropna("measure", subset=["value"]),
        )
        for key in dict.fromkeys(keys)
    ]
