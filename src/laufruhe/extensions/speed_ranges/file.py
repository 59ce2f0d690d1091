"""[[speed_ranges]] of a problem file, and the CSV files of curves over speed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Any, TypeAlias

from pydantic import PlainValidator, WithJsonSchema

from laufruhe.extension import is_installed, missing_extension
from laufruhe.extensions.speed_ranges.ranges import WORST, Curve, SpeedRange, SpeedRanges
from laufruhe.files import fields as f
from laufruhe.files.complaints import Refused, nearest, require_distinct, si_value
from laufruhe.files.csv_rows import table_of
from laufruhe.files.fields import Name
from laufruhe.files.measures import QuantityName, QuantityTable
from laufruhe.files.problem_file import ExtensionContext, Key
from laufruhe.problem.measure import MEASURES
from laufruhe.problem.problem import Problem

MAX_RANGES, MAX_PAIRS = 8, 1000
_UNIT = re.compile(r"[\[(](.+?)[\])]")


def _curve(raw: object) -> object:
    if isinstance(raw, str) or (isinstance(raw, list) and all(isinstance(row, list) and len(row) == 2 for row in raw)):
        return raw
    raise f.refusal('is no curve; write "5 mm/s", [["2000 rpm", "5 mm/s"], ["6000 rpm", "9 mm/s"]], or a CSV file')


_PAIR = {"type": "array", "items": {"type": ["string", "number"]}, "minItems": 2, "maxItems": 2}
CurveField: TypeAlias = Annotated[
    str | list[list[Any]],
    PlainValidator(_curve),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": _PAIR, "minItems": 1}]}),
]


class SpeedRangeTable(QuantityTable):
    """A range of crank speeds over which the worst value of a quantity is found, minimised or limited."""

    name: Name
    speeds: f.Pair[f.Speed] = f.required("Lowest and highest crank speed.")
    operating_point: str | None = f.optional(
        "Operating point whose gas acts at every speed; by default the only one of the file."
    )
    quantity: QuantityName | None = f.optional("Quantity whose value at each speed counts; by default the objective.")
    minimise: bool = f.optional("The objective is its worst value over the range, not that of the points.", False)
    max: CurveField | None = f.optional(
        "Largest value at each speed: one value, pairs of speed and value with straight lines between them, or a CSV "
        "file of such pairs."
    )
    time_shares: CurveField | None = f.optional(
        "Share of time over speed for the mean, up to a factor: pairs of speed and share, or a CSV file; equal shares "
        "by default."
    )


def _read(tables: Sequence[SpeedRangeTable], problem: Problem, context: ExtensionContext) -> Problem:
    require_distinct([table.name for table in tables], "speed_ranges", "speed ranges have one name")
    if len(tables) > MAX_RANGES:
        raise Refused("speed_ranges", None, f"has {len(tables)} tables", f"give at most {MAX_RANGES}")
    ranges = [_range(table, problem, context, f"speed_ranges[{k}]") for k, table in enumerate(tables, 1)]
    minimised = [k for k, span in enumerate(ranges, 1) if span.minimised]
    if len(minimised) > 1:
        where, rule = f"speed_ranges[{minimised[1]}].minimise", f"is true for speed_ranges[{minimised[0]}] too"
        raise Refused(where, None, rule, "minimise over one range, and limit the other")
    return replace(problem, extras=(*problem.extras, SpeedRanges(tuple(ranges)))) if ranges else problem


def _range(table: SpeedRangeTable, problem: Problem, context: ExtensionContext, where: str) -> SpeedRange:
    low, high = table.speeds
    if low >= high:
        raise Refused(f"{where}.speeds", None, "has its ends reversed", "write the lower speed first")
    names = [point.name for point in problem.points]
    if table.operating_point is None and len(names) > 1:
        rule = f"is missing, and the file has {len(names)} operating points"
        raise Refused(f"{where}.operating_point", None, rule, f"name the load of the range: {', '.join(names)}")
    if table.operating_point not in (None, *names):
        raise Refused(f"{where}.operating_point", table.operating_point, "is no operating point here",
                      nearest(str(table.operating_point), names))  # fmt: skip
    point = problem.points[0 if table.operating_point is None else names.index(table.operating_point)]
    if problem.engine.torques(point):
        rule = f"takes its load from '{point.name}', whose electric machine has a torque at its own speed alone"
        raise Refused(f"{where}.operating_point", point.name, rule, "name an operating point without this torque")
    if table.operating_points is not None:
        raise Refused(f"{where}.operating_points", None, "is for single speeds", "name one as operating_point")
    quantity = table.quantity or _objective(table, context, where)
    if quantity not in MEASURES:
        raise Refused(f"{where}.quantity", quantity, "is no quantity", nearest(quantity, list(MEASURES)))
    measure = table.measure(quantity)
    if table.quantity is None and measure != QuantityTable().measure(quantity):
        rule = "is missing, and the range has keys that narrow it"
        raise Refused(f"{where}.quantity", None, rule, "name the quantity, or narrow the objective")
    if not measure.is_load or "operating_points" not in measure.channel.keys:
        rule = "is no norm of a load, and has no value at each speed"
        raise Refused(f"{where}.quantity", quantity, rule, 'name one such as "rms mount force"')
    if table.minimise and not is_installed("worst_mean"):
        raise Refused(f"{where}.minimise", None, *missing_extension("worst_mean"))
    if table.minimise and (table.quantity is not None or measure.norm.name not in WORST):
        rule = (
            "takes the quantity of [objective], and the range names its own" if table.quantity is not None
            else f"needs a quantity with one of the norms {', '.join(WORST)}"
        )  # fmt: skip
        raise Refused(f"{where}.minimise", None, rule, "change the objective, and remove quantity")
    unit, limit = measure.unit, table.max
    if isinstance(limit, str) and not limit.lower().endswith(".csv"):
        limit = [["1 rpm", limit]]
    return SpeedRange(
        table.name, low, high, point.name, None if table.quantity is None else measure, table.minimise,
        _read_curve(limit, unit, context, f"{where}.max"),
        _read_curve(table.time_shares, "", context, f"{where}.time_shares"),
        None if table.quantity is None else table, table.quantity or "",
    )  # fmt: skip


def _objective(table: SpeedRangeTable, context: ExtensionContext, where: str) -> str:
    tables = context.file.objective
    if tables is None and not table.minimise:
        return "mean mount force"
    if tables is None or len(tables) != 1 or tables[0].minimise is None:
        rule = "is missing, and the objective is not a single quantity"
        raise Refused(f"{where}.quantity", None, rule, "name the quantity, or write [objective] with minimise")
    return tables[0].minimise


def _read_curve(raw: CurveField | None, unit: str, context: ExtensionContext, where: str) -> Curve | None:
    """Return a curve from pairs of a file or from a CSV file; its values have a unit, or none [SI]."""
    if raw is None:
        return None
    if isinstance(raw, str):
        pairs = _rows(raw, unit, context, where)
    else:
        pairs = [(si_value(speed, "rad/s", where), si_value(value, unit, where)) for speed, value in raw]
    speeds, values = (tuple(column) for column in zip(*pairs, strict=True)) if pairs else ((), ())
    if not 1 <= len(speeds) <= MAX_PAIRS or any(b <= a for a, b in pairwise(speeds)):
        rule = f"has speeds that do not rise, or not 1 to {MAX_PAIRS} of them"
        raise Refused(where, None, rule, "sort its pairs by speed, each speed once")
    if min(values) < 0.0 or (min(values) == 0.0 if unit else max(values) == 0.0):
        raise Refused(where, None, "has a value that is not above zero", "give positive values")
    return speeds, values


def _rows(file: str, unit: str, context: ExtensionContext, where: str) -> list[tuple[float, float]]:
    table, names = table_of(file, context.folder / file, where), []
    for name in table.names[:2]:
        units = _UNIT.search(name)
        names.append(units[1] if units else "")
    if table.values.shape[1] != 2 or len(names) < 2 or not names[0] or bool(names[1]) != bool(unit):
        head = f"speed [rpm], value [{unit}]" if unit else "speed [rpm], share"
        raise Refused(where, file, "has not two columns with these heads and units", f"write the head: {head}")
    factors = [
        si_value(f"1 {name}", si, where, name) if si else 1.0 for name, si in zip(names, ("rad/s", unit), strict=True)
    ]
    return [(a * factors[0], b * factors[1]) for a, b in table.values.tolist()]


KEY = Key("speed_ranges", list[SpeedRangeTable], _read, single=True)
