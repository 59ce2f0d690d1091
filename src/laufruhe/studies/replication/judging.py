"""Statements of a source beside what is computed here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from laufruhe.studies.replication.expressions import filled, value_of
from laufruhe.studies.replication.models import StatementTable
from laufruhe.studies.text import Rows, Text
from laufruhe.studies.verdict import UNSTATED

if TYPE_CHECKING:
    import xarray as xr

CONFIRMED, NOT_CONFIRMED, DEPENDS, BEYOND = "confirmed", "not confirmed", "depends on an assumption", UNSTATED
_SLACK, _NOTHING = 1e-9, 1e-9
_CELLS = {CONFIRMED: "yes", NOT_CONFIRMED: "**no**", BEYOND: "–"}


def judged(statements: Sequence[StatementTable], names: Mapping[str, Any]) -> dict[str, Any]:
    """Coordinates of a dataset along its statements: words, printed, ours, verdict and why."""
    found: dict[str, list[Any]] = {key: [] for key in ("statement", "printed", "ours", "unit", "verdict", "why")}
    for one in statements:
        value = float(value_of(one.value, names))
        own = {**names, "value": value}
        found["statement"].append(one.text + (f" ({one.where})" if one.where else ""))
        found["printed"].append(UNSTATED if one.printed is None else one.printed)
        found["ours"].append(value)
        found["unit"].append(one.unit)
        found["verdict"].append(verdict(one, own))
        found["why"].append(filled(one.why, own))
    return {name: ("statement", values) for name, values in found.items()}


def verdict(statement: StatementTable, names: Mapping[str, Any]) -> str:
    """Whether a statement holds; `names` has our value as `value`."""
    if statement.holds is not None:
        holds = bool(value_of(statement.holds, names))
    else:
        expected, allowed = float(value_of(statement.expected, names)), statement.within
        if isinstance(allowed, str):
            allowed = 0.01 * float(allowed.removesuffix("%")) * abs(expected)
        holds = abs(names["value"] - expected) <= float(allowed or 0.0) * (1.0 + _SLACK)
    if holds:
        return BEYOND if statement.printed is None else CONFIRMED
    assuming = statement.assuming
    return f"{DEPENDS}: {assuming.what}" if assuming and value_of(assuming.holds, names) else NOT_CONFIRMED


def rows(data: xr.Dataset) -> list[Text]:
    """The statements of a dataset as a table, and how many are confirmed."""
    if not data.sizes.get("statement"):
        return []
    columns = [data[name].values.tolist() for name in ("statement", "printed", "ours", "unit", "verdict", "why")]
    cells = [
        [text, printed, f"{_shown(ours)} {unit}".strip(), _CELLS.get(said, said), why]
        for text, printed, ours, unit, said, why in zip(*columns, strict=True)
    ]
    return [Rows(["statement", "the source", "here", "confirmed", "why"], cells)]


def _shown(value: float) -> str:
    return "0" if abs(value) < _NOTHING else f"{value:.4g}"


def counted(datasets: Iterable[xr.Dataset]) -> str:
    """How many of the statements of all parts are confirmed; empty where there are none."""
    judged_ones = [data for data in datasets if "verdict" in data.coords]
    verdicts = [v for data in judged_ones for v in data["verdict"].values[data["printed"].values != UNSTATED]]
    return f"{verdicts.count(CONFIRMED)} of {len(verdicts)} statements are confirmed." if verdicts else ""
