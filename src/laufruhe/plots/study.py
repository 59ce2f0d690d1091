"""Pictures of study parts: lines over what is swept, bars where engines are compared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator

from laufruhe.plots.style import AFTER, BEFORE, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, credit, heading, page
from laufruhe.present.numbers import number
from laufruhe.report.study_tables import readable_metric, settled, swept_names, with_unit

COLOURS = (BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY, "#332288", "#999933")
PANEL = (6.4, 3.6)
# width of a letter of a tick [inch], and the points of a line from which on dots would hide it
LETTER, MOST_DOTS = 0.066, 40
# nothing lies between two labels
LABELLED: dict[str, Any] = {"marker": "o", "markersize": 6, "linestyle": ""}


def counterweight_fraction(data: xr.Dataset) -> Figure:
    """The metric over the fraction, the proven optimum of every line marked; or the best fraction over speed."""
    data = readable_metric(data)
    if "optimum" not in data.coords:
        return _best_fraction(data)
    names = swept_names(data)
    along = next(name for name in names if name.endswith("balance_fraction"))
    figure, (axes,) = _page(1)
    legend: list[Artist] = []
    best = data["optimum"].values
    for label, chosen, colour in _groups(data, [name for name in names if name != along]):
        x, y = data[along].values, data["objective"].values
        # the optimum is a point of its line too
        line, dot = np.flatnonzero(chosen), chosen & best
        line = line[np.argsort(x[line])]
        axes.plot(x[line], y[line], color=colour)
        axes.plot(x[dot], y[dot], "o", color=colour)
        legend.append(Line2D([], [], color=colour, marker="o", label=label))
    axes.set_xlabel("balance fraction")
    _metric_axis(axes, data)
    return _headed(figure, data, legend, f"Dot: {_claimed(data)}, the fraction left open.")


def _best_fraction(data: xr.Dataset) -> Figure:
    names = swept_names(data)
    if not names:
        return _bars(data, data["case"].values, "The balance fraction is decided.")
    figure, (upper, lower) = _page(2)
    fractions = [k for k, name in enumerate(data["decision"].values) if str(name).endswith("balance_fraction")]
    legend = _lines(upper, data, names, "objective")
    for _, chosen, colour in _groups(data, names[:-1]):
        place = _places(data, names[-1])[chosen]
        for k in fractions:
            lower.plot(place, data["decided"].values[chosen, k], color=colour)
    _along(lower, data[names[-1]].values)
    lower.set_ylabel("best balance fraction")
    lower.set_xlabel(with_unit(data[names[-1]]))
    return _headed(figure, data, legend, f"Every point: {_claimed(data)}.")


def balancer_sizing(data: xr.Dataset) -> Figure:
    """Bars of every set of shafts, the plain engine drawn once; lines where something is swept."""
    data = readable_metric(data)
    if swept_names(data):
        return _over_sweep(data, ["shafts"], "Every set of shafts at its own optimum.")
    plain = data["shafts"].values == "none"
    if np.ptp(data["objective"].values[plain]) == 0.0:
        # cases that differ in their shafts alone have one plain engine
        shown = np.concatenate([np.flatnonzero(plain)[:1], np.flatnonzero(~plain)])
        data, shared = data.isel(point=shown), True
    else:
        shared = False
    alone = len(set(data["case"].values.tolist())) == 1
    labels = [
        _wrapped(shafts) if alone or (shared and shafts == "none") else f"{case}\n{_wrapped(shafts)}"
        for case, shafts in zip(data["case"].values.tolist(), data["shafts"].values.tolist(), strict=True)
    ]
    return _bars(data, labels, "Every set of shafts at its own optimum.", data["shafts"].values == "none")


def layout_comparison(data: xr.Dataset) -> Figure:
    """Bars of every engine as given and at its optimum; lines where something is swept."""
    data = readable_metric(data)
    words = f"Engines of {data.attrs['at']}." if data.attrs["at"] == "equal cylinders" else f"At {data.attrs['at']}."
    if swept_names(data):
        alone = len(set(data["case"].values.tolist())) == 1
        open_points = (data["proof"].values != "as given").any()
        claim = f"Every point: {_claimed(data)}." if open_points else "As given."
        return _over_sweep(data, [], claim if alone else words)
    return _bars(data, data["case"].values, words)


def _over_sweep(data: xr.Dataset, told_apart: Sequence[str], words: str) -> Figure:
    figure, (axes,) = _page(1)
    names = swept_names(data)
    legend = _lines(axes, data, [*told_apart, *names], "objective")
    axes.set_xlabel(with_unit(data[names[-1]]))
    return _headed(figure, data, legend, words)


def _lines(axes: Axes, data: xr.Dataset, names: Sequence[str], variable: str) -> list[Artist]:
    """One line for every case and combination of all named but the last, over the last."""
    legend: list[Artist] = []
    places, values = _places(data, names[-1]), data[names[-1]].values
    numbers = values.dtype.kind in "fi"
    for label, chosen, colour in _groups(data, names[:-1]):
        style = {"marker": "." if chosen.sum() <= MOST_DOTS else "", "markersize": 4} if numbers else LABELLED
        axes.plot(places[chosen], data[variable].values[chosen], color=colour, **style)
        legend.append(Line2D([], [], color=colour, label=label, **({} if numbers else LABELLED)))
    if numbers:
        _along(axes, values)
    else:
        labels = list(dict.fromkeys(values.tolist()))
        axes.set_xticks(range(len(labels)), [str(label) for label in labels], size=8)
    _metric_axis(axes, data)
    return legend


def _along(axes: Axes, values: Any) -> None:
    """A logarithmic axis for values that grow by equal factors."""
    each = np.unique(values[np.isfinite(values)])
    if len(each) < 4 or each[0] <= 0.0 or not np.allclose(np.diff(np.log(each)), np.log(each[1] / each[0]), rtol=1e-6):
        return
    axes.set_xscale("log")
    within = (1.0, 2.0, 5.0) if each[-1] > 20.0 * each[0] else (1.0, 2.0, 3.0, 4.0, 6.0, 8.0)
    axes.xaxis.set_major_locator(LogLocator(10.0, within, numticks=12))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.minorticks_off()


def _places(data: xr.Dataset, name: str) -> Any:
    """Numbers along an axis; labels stand side by side."""
    values = data[name].values
    if values.dtype.kind in "fi":
        return values
    labels = list(dict.fromkeys(values.tolist()))
    return np.array([labels.index(value) for value in values.tolist()])


def _groups(data: xr.Dataset, names: Sequence[str]) -> list[tuple[str, Any, str]]:
    """Label, points and colour of every line: cases, where there are several, and what else is named."""
    told = [*(["case"] if len(set(data["case"].values.tolist())) > 1 else []), *names]
    keys = (
        list(zip(*(data[name].values.tolist() for name in told), strict=True)) if told else [()] * data.sizes["point"]
    )
    groups = []
    for k, key in enumerate(dict.fromkeys(keys)):
        words = [_said(data[name], value) for name, value in zip(told, key, strict=True)]
        chosen = np.array([one == key for one in keys])
        groups.append((", ".join(words) or str(data["case"].values[0]), chosen, k))
    return [(label, chosen, _colour(k, len(groups))) for label, chosen, k in groups]


def _colour(k: int, count: int) -> str:
    """Of the k-th line: told apart by hue, or ordered from dark to light where there are too many."""
    return COLOURS[k] if count <= len(COLOURS) else to_hex(colormaps["viridis"](k / (count - 1)))


def _legend(entries: Sequence[Artist]) -> Sequence[Artist]:
    """All entries, or a few of very many: first, last, and some between."""
    if len(entries) <= len(COLOURS):
        return entries
    return [entries[k] for k in np.linspace(0, len(entries) - 1, 5).round().astype(int)]


def _said(values: xr.DataArray, value: Any) -> str:
    unit = values.attrs.get("units", "")
    if not isinstance(value, float):
        return str(value)
    return f"{values.attrs['long_name']} {value:.4g}" if unit == "1" else f"{value:.4g} {unit}"


def _bars(data: xr.Dataset, labels: Any, words: str, once: Any = None) -> Figure:
    """As given in grey beside the optimum in blue; one grey bar where nothing is open, or `once` says so."""
    count = data.sizes["point"]
    widest = max(len(line) for label in labels for line in str(label).split("\n"))
    figure, (axes,) = _page(1, max(PANEL[0], count * max(1.15, 0.2 + LETTER * widest)))
    alone = data["proof"].values == "as given"
    single = alone if once is None else np.ones(count, dtype=bool)
    plain = alone | (np.zeros(count, dtype=bool) if once is None else once)
    given, best = data["objective_given"].values, data["objective"].values
    most = max(np.nanmax(given, initial=0.0), np.nanmax(best, initial=0.0))
    for k in range(count):
        if single[k]:
            _bar(axes, k, best[k], 0.5 if single.all() else 0.36, BEFORE if plain[k] else AFTER, most)
            continue
        for shift, value, colour in ((-0.2, given[k], BEFORE), (0.2, best[k], AFTER)):
            _bar(axes, k + shift, value, 0.36, colour, most)
    axes.set_xticks(range(count), [str(label) for label in labels], size=7.5)
    axes.set_xlim(-0.6, count - 0.4)
    axes.grid(axis="x", visible=False)
    _metric_axis(axes, data, *(() if single.all() else ("objective_given",)))
    grey = "no shafts" if once is not None else "as given"
    legend: list[Artist] = [Patch(color=BEFORE, label=grey)] if plain.any() or not single.all() else []
    legend += [Patch(color=AFTER, label=_claimed(data))] if not plain.all() else []
    return _headed(figure, data, legend, words)


def _bar(axes: Axes, place: float, value: float, width: float, colour: str, most: float) -> None:
    """One bar and its value; what rounding leaves of a balanced engine is zero."""
    if not np.isfinite(value):
        axes.text(place, 0.02 * most, "no design", ha="center", va="bottom", size=7.5)
        return
    drawn = axes.bar([place], [value], width, color=colour, linewidth=0)
    axes.bar_label(drawn, [number(settled(value, most))], size=7.5)


def _claimed(data: xr.Dataset) -> str:
    """What may be said of all that was decided."""
    decided = (data["proof"].values != "as given") & np.isfinite(data["objective"].values)
    return "proven optimum" if np.all(data["proof"].values[decided] == "global") else "best found"


def _wrapped(shafts: str) -> str:
    """Names of shafts, two a line."""
    names = shafts.split(" + ")
    lines = [" + ".join(names[k : k + 2]) for k in range(0, len(names), 2)]
    return "no shafts" if shafts == "none" else "\n".join(lines)


def _page(panels: int, wide: float = PANEL[0]) -> tuple[Figure, tuple[Axes, ...]]:
    drawn = page(panels, 1, (wide, PANEL[1] if panels == 1 else 2.4))
    return drawn.figure, drawn.panels


def _metric_axis(axes: Axes, data: xr.Dataset, *drawn: str) -> None:
    unit = data["objective"].attrs["units"]
    axes.set_ylabel(f"{data.attrs['metric']} [{unit}]" if unit else data.attrs["metric"])
    top = max(float(np.nanmax(data[name].values, initial=0.0)) for name in ("objective", *drawn))
    axes.set_ylim(0.0, 1.08 * top or 1.0)


def _headed(figure: Figure, data: xr.Dataset, legend: Sequence[Artist], words: str) -> Figure:
    heading(figure, data.attrs["title"], words, _legend(legend), credit(data))
    return figure
