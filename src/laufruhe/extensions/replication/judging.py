"""Statements of a source compared with computed values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from laufruhe.extensions.replication.expressions import fill_in, number_of
from laufruhe.extensions.replication.models import StatementTable
from laufruhe.studies.text import UNSTATED, Text, marked_table

if TYPE_CHECKING:
    import xarray as xr

CONFIRMED, NOT_CONFIRMED, BEYOND = "confirmed", "not confirmed", UNSTATED
_SLACK, _NEGLIGIBLE = 1e-9, 1e-9
_CELLS = {CONFIRMED: "yes", NOT_CONFIRMED: "**no**", BEYOND: "–"}


def judge_statements(statements: Sequence[StatementTable], readings: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return coordinates of a dataset along statements and readings: printed, ours, verdict and why.

    `readings` are the values of names in each reading (interpretation) of the source.
    """
    if not statements:
        return {}
    verdicts = []
    for statement in statements:
        known = ({**names, "value": number_of(statement.value, names)} for names in readings.values())
        verdicts.append([(n["value"], verdict(statement, n), fill_in(statement.why, n)) for n in known])
    texts = [one.text + (f" ({one.where})" if one.where else "") for one in statements]
    return {
        "by_reading": list(readings),
        "statement": ("statement", texts),
        "printed": ("statement", [UNSTATED if one.printed is None else one.printed for one in statements]),
        "unit": ("statement", [one.unit for one in statements]),
        **{
            name: (("statement", "by_reading"), [[cell[k] for cell in row] for row in verdicts])
            for k, name in enumerate(("ours", "verdict", "why"))
        },
    }


def verdict(statement: StatementTable, names: Mapping[str, Any]) -> str:
    """Return the verdict on a statement; `names` are values by name, with the computed value as `value`."""
    if statement.printed is None:
        return BEYOND
    if statement.holds is not None:
        holds = bool(number_of(statement.holds, names))
    else:
        expected, allowed = number_of(statement.expected, names), statement.within
        if isinstance(allowed, str):
            allowed = 0.01 * float(allowed.removesuffix("%")) * abs(expected)
        holds = abs(names["value"] - expected) <= float(allowed or 0.0) * (1.0 + _SLACK)
    return CONFIRMED if holds else NOT_CONFIRMED


def rows(data: xr.Dataset) -> list[Text]:
    """Return the statements of the publication as a table, with our value and verdict by interpretation."""
    if not data.sizes.get("statement"):
        return []
    readings = [str(name) for name in data["by_reading"].values]
    columns = (cell for name in readings for cell in (name or "computed", "confirmed"))
    head = ["statement", "source", *columns, "reason"]
    return [marked_table(head, [_row(data.isel(statement=k), readings) for k in range(data.sizes["statement"])])]


def _row(statement: xr.Dataset, readings: Sequence[str]) -> list[str]:
    unit = statement["unit"].item()
    cells = [str(statement[name].item()) for name in ("statement", "printed")]
    for value, outcome in zip(statement["ours"].values.tolist(), statement["verdict"].values.tolist(), strict=True):
        cells += [f"{_format(value)} {unit}".strip(), _CELLS[outcome]]
    whys = statement["why"].values.tolist()
    if len(set(whys)) > 1:
        return [*cells, "<br>".join(f"{name}: {why}" for name, why in zip(readings, whys, strict=True))]
    return [*cells, whys[0]]


def _format(value: float) -> str:
    return "0" if abs(value) < _NEGLIGIBLE else f"{value:.0f}" if 1e4 <= abs(value) < 1e7 else f"{value:.4g}"


def count_confirmed(datasets: Iterable[xr.Dataset]) -> str:
    """Return how many statements of all parts are confirmed, in every reading; empty without statements."""
    judged_ones = [data for data in datasets if "verdict" in data.coords]
    readings = dict.fromkeys(str(name) for data in judged_ones for name in data["by_reading"].values)
    sentences = []
    for name in [name for name in readings if name] or list(readings):
        # a part without readings counts in all of them
        parts = [data.sel(by_reading=name if name in data["by_reading"] else "") for data in judged_ones]
        verdicts = [v for data in parts for v in data["verdict"].values[data["printed"].values != UNSTATED]]
        lead = f"{name}: " if name else ""
        sentences += [f"{lead}{verdicts.count(CONFIRMED)} of {len(verdicts)} statements are confirmed."] * bool(
            verdicts
        )
    return " ".join(sentences)
