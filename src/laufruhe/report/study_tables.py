"""Markdown tables of study parts: a row a point, what is swept with its unit, what is proven and what not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from laufruhe.present.numbers import percent
from laufruhe.units import readable

if TYPE_CHECKING:
    import xarray as xr

MOST_ROWS = 80
NEGLIGIBLE = 1e-9
NOTHING = "–"
_PROOFS = {"global": "proven", "global within gap": "proven within gap", "local": "local", "none": "not proven"}


def swept_names(data: xr.Dataset) -> list[str]:
    """Swept coordinates, in the order of the study file."""
    return [str(name) for name, values in data.coords.items() if values.attrs.get("swept")]


def with_unit(values: xr.DataArray) -> str:
    """A quantity's name and unit, as a column or an axis is headed."""
    name, unit = str(values.attrs.get("long_name", values.name)), str(values.attrs.get("units", ""))
    return name if unit in ("", "1") else f"{name} [{unit}]"


def number(value: float, digits: int = 5) -> str:
    """A number of a table; a dash where there is none."""
    return NOTHING if value != value else f"{value:.{digits}g}"


def settled(value: float, scale: float) -> float:
    """Zero for what rounding leaves beside a scale: an engine in balance has no small force."""
    return 0.0 if abs(value) < NEGLIGIBLE * abs(scale) else value


def readable_metric(data: xr.Dataset) -> xr.Dataset:
    """The dataset with its metric in the unit that a reader expects: a sag in mm, a stiffness in N/mm."""
    unit, factor = readable(data["objective"].attrs["units"])
    if factor == 1.0:
        return data
    names = ("objective_given", "objective", "lower_bound")
    return data.assign(
        {name: (factor * data[name]).assign_attrs({**data[name].attrs, "units": unit}) for name in names}
    )


def by_point(data: xr.Dataset, *named: str) -> list[str]:
    """The table of a part whose points were solved.

    Parameters
    ----------
    named
        Coordinates that tell rows apart beside case and swept values.
    """
    data = readable_metric(data)
    columns = ["case", *named, *swept_names(data)]
    metric, unit = data.attrs["metric"], data["objective"].attrs["units"]
    head = ["case", *named, *(with_unit(data[name]) for name in swept_names(data))]
    in_unit = f" [{unit}]" if unit else ""
    head += [f"{metric}, as given{in_unit}", f"at the optimum{in_unit}", f"lower bound{in_unit}", "change"]
    head += [*(["largest mount force [N]"] if data.sizes["mount"] else []), "proof"]
    rows = [_row(data.isel(point=k), columns) for k in range(min(data.sizes["point"], MOST_ROWS))]
    return table(head, rows, data.sizes["point"])


def by_shafts(data: xr.Dataset) -> list[str]:
    """As `by_point`, with the shafts that each row has."""
    return by_point(data, "shafts")


def table(head: Sequence[str], rows: Sequence[Sequence[str]], whole: int) -> list[str]:
    """Lines of Markdown, and how many of `whole` rows stand in the CSV file only."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (head, ["---"] * len(head), *rows)]
    rest = whole - len(rows)
    return [*lines, "", f"{rest} more rows are in the CSV file."] if rest > 0 else lines


def _row(row: xr.Dataset, columns: Sequence[str]) -> list[str]:
    given, best, bound = (float(row[name]) for name in ("objective_given", "objective", "lower_bound"))
    best = settled(best, given)
    proof, status = str(row["proof"].item()), str(row["status"].item())
    decided = proof != "as given"
    change = percent(best / given - 1.0) if decided and given and best == best else NOTHING
    cells = [_cell(row[name].item()) for name in columns]
    cells += [number(given), number(best) if decided else NOTHING, number(bound), change]
    if row.sizes["mount"]:
        cells.append(number(float(row["maximum"].max())))
    cells.append("as given" if not decided else _PROOFS[proof] if status in ("optimal", "feasible") else status)
    optimum = bool(row["optimum"].item()) if "optimum" in row.coords else False
    return [f"**{cell}**" for cell in cells] if optimum else cells


def _cell(value: Any) -> str:
    return number(value) if isinstance(value, float) else str(value)
