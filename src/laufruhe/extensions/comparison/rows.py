"""Rows of a comparison: numbers of every design in SI units, as the CSV file has them, and as tables show them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

from pydantic_core import PydanticCustomError

from laufruhe.extensions.comparison.designs import Design
from laufruhe.files.fields import Number, Open
from laufruhe.files.nested import Place, at, number_at
from laufruhe.files.problem_file import file_model
from laufruhe.files.study_tables import path_text
from laufruhe.files.toml_text import toml_value
from laufruhe.present.numbers import DASH, number, percent
from laufruhe.present.tables import Table
from laufruhe.problem.channels import LoadChannel, load_channels
from laufruhe.units import readable

Value: TypeAlias = float | str | None

DESIGNS, OBJECTIVES, INPUTS, DECISIONS, ORDERS = "Designs", "Objectives", "Inputs that differ", "Decisions", "Orders"
TEXTS = ("title", "source", "assumptions", "format", "units")
"""Keys of a file that change no number of its result."""
MAX_ORDERS, SHARE = 6, 0.005
"""Largest number of orders of a load, and share of its maximum below which an order is left out."""
INPUT_FIGURES, FIGURES = 10, 5
SHAKING = (("force", "shaking force", "N"), ("roll", "roll moment", "N m"), ("rocking", "rocking couple", "N m"))


@dataclass(frozen=True)
class Row:
    """A quantity of every design [SI]; None for a design without it.

    Attributes
    ----------
    group
        Title of its table.
    """

    group: str
    name: str
    unit: str
    values: Sequence[Value]


def rows_of(designs: Sequence[Design]) -> list[Row]:
    """Return the rows of all groups, in the order of the page."""
    groups = (_proofs, _objectives, _inputs, _decisions, _at_places, _orders)
    return [row for rows in groups for row in rows(designs)]


def assumptions_of(designs: Sequence[Design]) -> list[str]:
    """Return the assumptions of all designs, with the names of the designs if some do not have them."""
    names: dict[str, list[str]] = {}
    for design in designs:
        for text in design.record.get("assumptions") or ():
            names.setdefault(text, []).append(design.name)
    return [text if len(of) == len(designs) else f"{', '.join(of)}: {text}" for text, of in names.items()]


def tables_of(rows: Sequence[Row], designs: Sequence[Design]) -> list[Table]:
    """Return a table of each group in units of reports."""
    tables = []
    for group in dict.fromkeys(row.group for row in rows):
        rows_of_group = [row for row in rows if row.group == group]
        units = [readable(row.unit) for row in rows_of_group]
        has_change = len(designs) == 2 and group not in (DESIGNS, INPUTS)
        head = ("", "unit", *(design.name for design in designs), *(("change",) if has_change else ()))
        cells = [
            (row.name, unit, *_cells(row, factor), *((_change(row),) if has_change else ()))
            for row, (unit, factor) in zip(rows_of_group, units, strict=True)
        ]
        if not any(row.unit for row in rows_of_group):
            head, cells = (head[0], *head[2:]), [(cell[0], *cell[2:]) for cell in cells]
        left = 2 if any(row.unit for row in rows_of_group) else 1
        tables.append(Table(head, cells, title=group, note=_note(group, designs, rows_of_group), left=left))
    return tables


def number_table(rows: Sequence[Row], designs: Sequence[Design]) -> Table:
    """Return all rows as a table of numbers in SI units and full precision."""
    head = ("table", "quantity", "unit", *(design.name for design in designs))
    return Table(head, [(row.group, row.name, row.unit, *("" if v is None else v for v in row.values)) for row in rows])


def _cells(row: Row, factor: float) -> list[str]:
    numbers = [abs(value) for value in row.values if isinstance(value, float)]
    scale = factor * max(numbers, default=0.0)
    return [
        DASH if value is None
        else value if isinstance(value, str)
        else f"{factor * value:.{INPUT_FIGURES}g}" if row.group == INPUTS
        else number(factor * value, FIGURES, scale)
        for value in row.values
    ]  # fmt: skip


def _change(row: Row) -> str:
    first, last = row.values
    # a share of an angle says nothing
    if row.unit != "rad" and isinstance(first, float) and isinstance(last, float) and first:
        return percent(last / first - 1.0)
    return DASH


def _note(group: str, designs: Sequence[Design], rows: Sequence[Row]) -> str:
    if group == OBJECTIVES:
        unknown = [f"{design.name}: {design.note}" for design in designs if design.note]
        text = "Each objective, with its operating points, is evaluated for every design whose cylinders, and mounts "
        text += "or other places of the objective, have the same names. Limits of other problems are not checked."
        return f"{text} Not evaluated with other objectives: {'; '.join(unknown)}." if unknown else text
    return "A dash: not in this file." if group == INPUTS and any(None in row.values for row in rows) else ""


def _proofs(designs: Sequence[Design]) -> Iterator[Row]:
    records = [design.record for design in designs]
    yield Row(DESIGNS, "status", "", [record["status"] for record in records])
    yield Row(DESIGNS, "objective", "", [(record["objective"] or {}).get("name") for record in records])
    units = {str(record["objective"]["unit"]) for record in records if record["objective"]}
    for name, table, key in (("value", "objective", "value"), ("lower bound", "certificate", "lower_bound")):
        values = [(record[table] or {}).get(key) for record in records]
        if len(units) == 1:
            yield Row(DESIGNS, name, next(iter(units)), values)
        else:
            yield Row(DESIGNS, name, "", [_with_unit(v, record) for v, record in zip(values, records, strict=True)])
    yield Row(DESIGNS, "gap", "", [record["certificate"]["gap"] for record in records])
    yield Row(DESIGNS, "proof", "", [record["certificate"]["kind"] for record in records])


def _with_unit(value: float | None, record: Mapping[str, Any]) -> str | None:
    if value is None or not record["objective"]:
        return None
    unit, factor = readable(record["objective"]["unit"])
    return f"{number(factor * value, FIGURES)} {unit}".rstrip()


def _objectives(designs: Sequence[Design]) -> Iterator[Row]:
    for of, others in _by_objective(designs).items():
        about = of.record["objective"]
        suffix = "" if len(others) == len(designs) else f", of {' and '.join(other.name for other in others)}"
        values = [design.value_for(design if design in others else of) for design in designs]
        yield Row(OBJECTIVES, f"{about['name']}{suffix}", about["unit"], values)


def _by_objective(designs: Sequence[Design]) -> dict[Design, list[Design]]:
    groups: dict[Design, list[Design]] = {}
    for design in designs:
        if design.record["objective"]:
            alike = (first for first in groups if design.has_objective_of(first))
            groups.setdefault(next(alike, design), []).append(design)
    return groups


def _inputs(designs: Sequence[Design]) -> Iterator[Row]:
    files = [dict(_leaves(design.tables)) for design in designs]
    addresses = dict.fromkeys(address for file in files for address in file)
    tables = list(dict.fromkeys(_table(address) for address in addresses))
    for address in sorted(addresses, key=lambda address: tables.index(_table(address))):
        pairs = [file.get(address, ("", None)) for file in files]
        values = [value for _, value in pairs]
        if any(value != values[0] for value in values[1:]):
            yield Row(INPUTS, address, next((unit for unit, _ in pairs if unit), ""), values)


def _table(address: str) -> str:
    return address.partition(".")[0]


def _leaves(tables: Mapping[str, Any], place: Place = ()) -> Iterator[tuple[str, tuple[str, Value]]]:
    """Yield (address, (unit, value)) of the numbers and texts of a file; addresses are those of studies."""
    node = at(tables, place)
    field = number_at(file_model(), place) if place else None
    if isinstance(node, list):
        for k in range(len(node)):
            yield from _leaves(tables, (*place, k))
    elif isinstance(node, Mapping) and (field is None or "between" not in node):
        for key in node:
            # the address of an entry of a list has its name
            is_name = key == "name" and isinstance(place[-1], int) if place else key in TEXTS
            if not is_name:
                yield from _leaves(tables, (*place, key))
    else:
        yield path_text(tables, place), _value(node, field)


def _value(node: Any, field: Number | None) -> tuple[str, Value]:
    # a number with a note of an extension, such as a tolerance, stays a text
    with suppress(PydanticCustomError):
        if field is not None:
            read = field.read(node)
            return (field.unit, read) if isinstance(read, float) else ("", _open(read, field.unit))
    return "", node if isinstance(node, str) else toml_value(node)


def _open(value: Open, unit: str) -> str:
    name, factor = readable(unit)
    low, high, start = (f"{factor * number:.{INPUT_FIGURES}g}" for number in (value.lower, value.upper, value.start))
    return f"open, {low} to {high} {name}".rstrip() + f", from {start}"


def _decisions(designs: Sequence[Design]) -> Iterator[Row]:
    columns = [design.record["decisions"] for design in designs]
    for name in dict.fromkeys(name for column in columns for name in column):
        entries = [column.get(name) for column in columns]
        unit = next(entry["unit"] for entry in entries if entry)
        yield Row(DECISIONS, name, unit, [entry["value"] if entry else None for entry in entries])


def common_places(designs: Sequence[Design]) -> Iterator[tuple[LoadChannel, list[list[Mapping[str, Any]]]]]:
    """Yield each load at mounts, bearings or other places that all designs have, with its entries by design."""
    for load in (load for load in load_channels() if load.display.title):
        entries = [design.record.get(load.key) or [] for design in designs if design.has_design]
        if all(entries) and len(entries) > 1:
            yield load, [(design.record[load.key] if design.has_design else []) for design in designs]


def shared_names(columns: Collection[Sequence[Mapping[str, Any]]]) -> list[str]:
    """Return the names of the places that all designs have."""
    filled = [[entry["name"] for entry in column] for column in columns if column]
    return [name for name in filled[0] if all(name in names for names in filled)]


def of_place(column: Sequence[Mapping[str, Any]], name: str, key: str) -> float | None:
    """Return a number of a place of one design; None without a design or a number."""
    return next((entry[key] for entry in column if entry["name"] == name), None)


def _at_places(designs: Sequence[Design]) -> Iterator[Row]:
    for load, columns in common_places(designs):
        for name in shared_names(columns):
            for key, words in (("mean", "mean"), ("max", "maximum")):
                values = [of_place(column, name, key) for column in columns]
                yield Row(load.display.title, f"{name}, {words}", load.unit, values)
        largest = [max((e["max"] for e in column if e["max"] is not None), default=None) for column in columns]
        yield Row(load.display.title, "largest of all", load.unit, largest)


def _orders(designs: Sequence[Design]) -> Iterator[Row]:
    for name, unit, columns in order_columns(designs):
        for order, values in columns.items():
            yield Row(ORDERS, f"{name}, order {order:g}", unit, values)


def order_columns(designs: Sequence[Design]) -> Iterator[tuple[str, str, dict[float, list[float | None]]]]:
    """Yield loads with their unit, and the amplitude of each design by order, for the largest orders.

    Mount forces are a mean over the mounts.
    """
    for load, columns in common_places(designs):
        if load.key == "mounts":
            yield "mean mount force", load.unit, _largest(designs, [_mean_orders(column) for column in columns])
    for key, name, unit in SHAKING:
        shaking = [design.record["shaking"] for design in designs]
        by_order = _largest(designs, [dict(zip(part["orders"], part[key], strict=True)) for part in shaking])
        if by_order:
            yield name, unit, by_order


def _largest(designs: Sequence[Design], columns: Sequence[Mapping[float, float]]) -> dict[float, list[float | None]]:
    by_order = {
        order: [
            column.get(order, 0.0) if design.has_design else None
            for design, column in zip(designs, columns, strict=True)
        ]
        for order in dict.fromkeys(order for column in columns for order in column)
    }
    sizes = {order: max((value for value in values if value), default=0.0) for order, values in by_order.items()}
    minimum = SHARE * max(sizes.values(), default=0.0)
    largest = sorted((order for order in sizes if sizes[order] > minimum), key=lambda order: -sizes[order])
    return {order: by_order[order] for order in sorted(largest[:MAX_ORDERS])}


def _mean_orders(mounts: Sequence[Mapping[str, Any]]) -> dict[float, float]:
    sums: dict[float, float] = {}
    for entry in (entry for mount in mounts for entry in mount["orders"]):
        sums[entry["order"]] = sums.get(entry["order"], 0.0) + (entry["amplitude"] or 0.0) / len(mounts)
    return sums
