"""Tables and pictures of swept problems: a row for each point, bars, and lines over the swept values."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from laufruhe.present import picture as p
from laufruhe.present.numbers import number as figures
from laufruhe.present.numbers import percent
from laufruhe.present.pictures import rows_of
from laufruhe.studies.solved import NOTHING_OPEN
from laufruhe.studies.text import DASH, Text, marked_table, number
from laufruhe.units import readable

if TYPE_CHECKING:
    import xarray as xr

MAX_ROWS, MAX_DOTS = 80, 40
NEGLIGIBLE = 1e-9
# width of a tick's letter [inch], and letters per line
LETTER, LETTERS = 0.078, 18
_PROOFS = {"global": "proven", "global within gap": "proven within gap", "local": "local", "none": "not proven"}


def swept_names(data: xr.Dataset) -> list[str]:
    """Return the swept coordinates, in the order of the study file."""
    return [str(name) for name, values in data.coords.items() if values.attrs.get("swept")]


def with_unit(values: xr.DataArray) -> str:
    """Return a quantity's name and unit, as the head of a column or an axis."""
    name, unit = str(values.attrs.get("long_name", values.name)), str(values.attrs.get("units", ""))
    return name if unit in ("", "1") else f"{name} [{unit}]"


def without_rounding(value: float, scale: float) -> float:
    """Return the value, or zero if it is a rounding error relative to the scale."""
    return 0.0 if abs(value) < NEGLIGIBLE * abs(scale) else value


def readable_metric(data: xr.Dataset) -> xr.Dataset:
    """Return the dataset with its metric in a readable unit, such as mm for a sag."""
    unit, factor = readable(data["objective"].attrs["units"])
    if factor == 1.0:
        return data
    names = ("objective_given", "objective", "lower_bound")
    return data.assign(
        {name: (factor * data[name]).assign_attrs({**data[name].attrs, "units": unit}) for name in names}
    )


def claim_of(data: xr.Dataset) -> str:
    """Return "proven optimum" if all decided designs are proven, else "best found"."""
    decided = (data["proof"].values != NOTHING_OPEN) & np.isfinite(data["objective"].values)
    return "proven optimum" if np.all(data["proof"].values[decided] == "global") else "best found"


def by_point(data: xr.Dataset, *named: str) -> list[Text]:
    """Return a table with a row for each point: case, swept values with units, the objective and its proof."""
    data = readable_metric(data)
    columns = ["case", *named, *swept_names(data)]
    metric, unit = data.attrs["metric"], data["objective"].attrs["units"]
    in_unit = f" [{unit}]" if unit else ""
    head = ["case", *named, *(with_unit(data[name]) for name in swept_names(data))]
    head += [f"{metric}, initial{in_unit}", f"final{in_unit}", f"lower bound{in_unit}", "change"]
    head += [*(["largest mount force [N]"] if data.sizes["mount"] else []), "proof"]
    rows = [_row(data.isel(point=k), columns) for k in range(min(data.sizes["point"], MAX_ROWS))]
    return [marked_table(head, rows, data.sizes["point"] - len(rows))]


def _row(row: xr.Dataset, columns: Sequence[str]) -> list[str]:
    initial, best, bound = (float(row[name]) for name in ("objective_given", "objective", "lower_bound"))
    best = without_rounding(best, initial)
    proof, status = str(row["proof"].item()), str(row["status"].item())
    decided = proof != NOTHING_OPEN
    change = percent(best / initial - 1.0) if decided and initial and best == best else DASH
    named = (row[name].item() for name in columns)
    cells = [number(value) if isinstance(value, float) else str(value) for value in named]
    cells += [number(initial), number(best) if decided else DASH, number(bound), change]
    if row.sizes["mount"]:
        cells.append(number(float(row["maximum"].max())))
    cells.append(NOTHING_OPEN if not decided else _PROOFS[proof] if status in ("optimal", "feasible") else status)
    optimum = bool(row["optimum"].item()) if "optimum" in row.coords else False
    return [f"**{cell}**" for cell in cells] if optimum else cells


def over_sweep(data: xr.Dataset, line_coords: Sequence[str], words: str) -> p.Picture:
    """Draw the objective over the last swept number, one line for each case and combination of the others."""
    data = readable_metric(data)
    names = swept_names(data)
    panel = p.Panel(lines(data, [*line_coords, *names]), swept_axis(data, names[-1]), metric_axis(data))
    return p.Picture(data.attrs["title"], words, [panel], p.credit(data))


def lines(data: xr.Dataset, names: Sequence[str]) -> list[p.Mark]:
    """Return lines of the objective over the last coordinate, one for each case and combination of the others."""
    place, numbers = spread(data, names[-1]), data[names[-1]].dtype.kind in "fi"
    marks: list[p.Mark] = []
    for label, chosen, colour in groups(data, names[:-1]):
        # points of labels are not joined by a line; many dots would hide theirs
        dots = not numbers or chosen.sum() <= MAX_DOTS
        size, width = (2.5, 1.5) if numbers else (6.0, 0.0)
        y = data["objective"].values[chosen]
        marks.append(p.Line(place[chosen], y, colour, label, width, marker="o" if dots else "", size=size))
    return marks


def spread(data: xr.Dataset, name: str) -> Any:
    """Return the values of a coordinate as numbers along an axis; labels become 0, 1, 2 ..."""
    values = data[name].values
    labels = list(dict.fromkeys(values.tolist()))
    return values if values.dtype.kind in "fi" else np.array([labels.index(value) for value in values.tolist()])


def swept_axis(data: xr.Dataset, name: str, named: bool = True) -> p.Axis:
    """Return the axis of a swept coordinate, logarithmic for values that grow by equal factors."""
    values, label = data[name].values, with_unit(data[name]) if named else ""
    if values.dtype.kind not in "fi":
        return p.Axis(label, ticks=[(float(k), str(text)) for k, text in enumerate(dict.fromkeys(values.tolist()))])
    distinct = np.unique(values[np.isfinite(values)])
    if (
        len(distinct) < 4
        or distinct[0] <= 0.0
        or not np.allclose(np.diff(np.log(distinct)), np.log(distinct[1] / distinct[0]), rtol=1e-6)
    ):
        return p.Axis(label)
    return p.Axis(label, log=(1.0, 2.0, 5.0) if distinct[-1] > 20.0 * distinct[0] else (1.0, 2.0, 3.0, 4.0, 6.0, 8.0))


def metric_axis(data: xr.Dataset, *names: str) -> p.Axis:
    """Return an axis from zero to a little over the largest drawn value."""
    unit = data["objective"].attrs["units"]
    top = max(float(np.nanmax(data[name].values, initial=0.0)) for name in ("objective", *names))
    return p.Axis(f"{data.attrs['metric']} [{unit}]" if unit else data.attrs["metric"], (0.0, 1.08 * top or 1.0))


def groups(data: xr.Dataset, names: Sequence[str]) -> list[tuple[str, Any, p.Colour]]:
    """Return the lines of a picture: label, mask of its points in the dataset, and colour."""
    keyed_by = [*(["case"] if len(set(data["case"].values.tolist())) > 1 else []), *names]
    columns = [data[name].values.tolist() for name in keyed_by]
    keys = list(zip(*columns, strict=True)) if keyed_by else [()] * data.sizes["point"]
    distinct = list(dict.fromkeys(keys))
    line_groups = []
    for k, key in enumerate(distinct):
        words = ", ".join(in_words(data[name], value) for name, value in zip(keyed_by, key, strict=True))
        chosen = np.array([row_key == key for row_key in keys])
        line_groups.append((words or str(data["case"].values[0]), chosen, p.colour(k, len(distinct))))
    return line_groups


def in_words(values: xr.DataArray, value: Any) -> str:
    """Return a swept value with its unit, or with its name if it is a plain number."""
    unit = values.attrs.get("units", "")
    if not isinstance(value, float):
        return str(value)
    return f"{values.attrs['long_name']} {value:.4g}" if unit == "1" else f"{value:.4g} {unit}"


def bars(data: xr.Dataset, labels: Any, words: str, once: Any = None) -> p.Picture:
    """Draw bars of the initial and the final objective of every point.

    A point without decisions, or where `once` is true, has one bar.
    """
    data = readable_metric(data)
    count = data.sizes["point"]
    has_no_decisions = data["proof"].values == NOTHING_OPEN
    single = has_no_decisions if once is None else np.ones(count, dtype=bool)
    plain = has_no_decisions | (np.zeros(count, dtype=bool) if once is None else once)
    initial, best = data["objective_given"].values, data["objective"].values
    maximum = max(np.nanmax(initial, initial=0.0), np.nanmax(best, initial=0.0))
    marks: list[tuple[float, p.Mark]] = []
    for k in range(count):
        single_bar = [(k + 0.0, best[k], "before" if plain[k] else "after")]
        pair = [(k - 0.2, initial[k], "before"), (k + 0.2, best[k], "after")]
        width = 0.5 if single.all() else 0.36
        for place, value, colour in single_bar if single[k] else pair:
            if np.isfinite(value):
                numbers = [figures(without_rounding(value, maximum))]
                marks.append((place, p.Bars([place], [value], width, colour, numbers=numbers)))
            else:
                words_of_none = p.Words(place, 0.02 * maximum, "no design", across="center", along="bottom")
                marks.append((place, words_of_none))
    labels = ["\n".join(part for line in str(label).split("\n") for part in wrap(line, LETTERS)) for label in labels]
    widest = max(len(line) for label in labels for line in str(label).split("\n"))
    width_of_group = max(1.15, 0.2 + LETTER * widest)
    up = metric_axis(data, *(() if single.all() else ("objective_given",)))
    rows, side = rows_of(count, max(int(p.WIDEST / width_of_group), 1))
    ticks = [(float(k), str(label)) for k, label in enumerate(labels)]
    panels = [
        p.Panel(
            [mark for place, mark in marks if row[0] - 0.5 < place < row[-1] + 0.5],
            p.Axis(ends=(row[0] - 0.6, row[0] + side - 0.4), ticks=ticks[row[0] : row[-1] + 1], grid=False),
            up,
        )
        for row in rows
    ]
    grey = "no shafts" if once is not None else "initial"
    legend = [p.Bars(colour="before", label=grey)] if plain.any() or not single.all() else []
    legend += [p.Bars(label=claim_of(data))] if not plain.all() else []
    lines = max(str(label).count("\n") for label in labels)
    size = (max(p.WIDE, side * width_of_group), p.HIGH if len(rows) == 1 else 0.7 * p.HIGH)
    gap = 0.42 + 0.16 * lines
    return p.Picture(data.attrs["title"], words, panels, p.credit(data), size=size, gap=gap, legend=legend)
