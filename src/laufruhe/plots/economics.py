"""Pareto pictures: mass on shafts against least force, one line for each set of shafts."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from laufruhe.plots.style import BEFORE, BLUE, FAINT, GREEN, INK, ORANGE, PURPLE, SKY, VERMILION, heading, page
from laufruhe.present.numbers import percent
from laufruhe.studies.economics import Standing
from laufruhe.studies.worth import verdicts, worths

COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
DASHES = ((0, (6, 2)), (0, (2, 2)), (0, (1, 3)))
LINE = 0.052


def economics(data: xr.Dataset) -> Figure:
    """Fronts on the left, what each set of shafts does and what is said of it on the right."""
    drawn = page(1, 2, (5.4, 4.4), gap=0.25)
    fronts, words = drawn.panels
    colours = _colours(data)
    _lines(fronts, data, colours)
    _levels(fronts, data)
    _table(words, data, colours)
    legend: list[Artist] = [
        Line2D([], [], color=INK, marker="o", markersize=4, label="least force for this mass"),
        Line2D([], [], color=INK, marker="D", markersize=6, linestyle="", label="optimum, whatever it weighs"),
        Line2D([], [], color=BEFORE, label="no shafts"),
        Line2D([], [], color=INK, linestyle=DASHES[0], linewidth=1.2, label="more cylinders, no shafts, equal power"),
    ]
    gap = float(data["gap"].max())
    said = (
        f"Every point a proven optimum: no design lies lower by more than {100.0 * gap:.1g} %. Crank weights are free."
    )
    heading(drawn.figure, data.attrs["title"], said, legend, _source(data))
    return drawn.figure


def _source(data: xr.Dataset) -> str:
    source = f"{data.attrs['source']}. " if data.attrs["source"] else ""
    return f"{source}Computed with Laufruhe; filled dots: no other point has less force, mass and shafts."


def _colours(data: xr.Dataset) -> dict[str, str]:
    built = [str(b) for b in data["build"].values[data["shafts"].values > 0]]
    return dict(zip(built, COLOURS * (1 + len(built) // len(COLOURS)), strict=False))


def _lines(axes: Axes, data: xr.Dataset, colours: dict[str, str]) -> None:
    limits = data["mass_limit"].values
    for k, (name, colour) in enumerate(colours.items()):
        row = data.sel(build=name)
        # lines that run together show one beside the other
        width = max(4.2 - 0.9 * k, 1.2)
        mass, force = float(row["optimum_mass"]), float(row["optimum"])
        shown = limits < mass
        x, y = np.append(limits[shown], mass), np.append(row["force"].values[shown], force)
        axes.plot(x, y, color=colour, linewidth=width)
        best = row["efficient"].values[shown]
        axes.plot(x[:-1][best], y[:-1][best], "o", color=colour, markersize=4)
        axes.plot(x[:-1][~best], y[:-1][~best], "o", color=colour, markersize=4, fillstyle="none")
        axes.plot(mass, force, "D", color=colour, markersize=6, zorder=3)
    # room on the right for the names of the levels
    axes.set_xlim(0.0, 1.3 * float(data["optimum_mass"].max()) or 1.0)
    axes.set_ylim(0.0, 1.06 * float(data["optimum"].max()))
    axes.set_xlabel("mass on balancer shafts [kg]")
    axes.set_ylabel(f"{data.attrs['objective']} [{data['optimum'].attrs['units']}]")


def _levels(axes: Axes, data: xr.Dataset) -> None:
    """Engines without shafts: grey, and dashed where they have more cylinders."""
    right = axes.get_xlim()[1]
    dashes = iter(DASHES * 4)
    top = float("inf")
    bare = data.isel(build=np.flatnonzero(data["shafts"].values == 0)).sortby("optimum", ascending=False)
    for name in bare["build"].values:
        force = float(bare["optimum"].sel(build=name))
        more = str(bare["standing"].sel(build=name).item()) == Standing.NEXT
        style = next(dashes) if more else "-"
        axes.axhline(force, color=INK if more else BEFORE, linestyle=style, linewidth=1.2, zorder=1)
        # names of levels close together stand one under the other
        top = min(force, top - LINE * axes.get_ylim()[1])
        colour = INK if more else FAINT
        place = top + 0.15 * LINE * axes.get_ylim()[1]
        label = axes.text(right, place, f"{name}: {force:.0f}", size=7.5, ha="right", va="bottom", color=colour)
        label.set_bbox({"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.0})


def _table(axes: Axes, data: xr.Dataset, colours: dict[str, str]) -> None:
    axes.set_axis_off()
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(0.0, 1.0)
    unit = data["optimum"].attrs["units"]
    y = 1.0
    said = verdicts(data)
    for worth in worths(data):
        row = data.sel(build=worth.build)
        axes.plot([0.0, 0.05], [y - 0.012] * 2, color=colours[worth.build], linewidth=2.5, clip_on=False)
        shafts = int(row["shafts"])
        fall = percent(-worth.fall)
        _write(axes, y, f"{worth.build}, {shafts} shaft{'s' if shafts > 1 else ''}", weight="bold")
        what = f"{float(row['optimum']):.0f} {unit} ({fall}) with {float(row['optimum_mass']):.2f} kg"
        _write(axes, y - LINE, what)
        _write(axes, y - 2 * LINE, f"{'worth building' if worth.worth else 'not worth building'}: {worth.why}", FAINT)
        y -= 3 * LINE
        for verdict in said.get(worth.build, ()):
            agreed = "confirmed" if verdict.agrees else f"not confirmed ({verdict.ours:+.0f} %)"
            mark, colour = ("✓", "#00664b") if verdict.agrees else ("✗", "#a63c00")
            beside = verdict.statement.partition(": ")[2]
            _write(axes, y, f"{mark} said: {verdict.paper} {beside}: {agreed}", colour)
            y -= LINE
        y -= 0.4 * LINE


def _write(axes: Axes, y: float, text: str, colour: str = INK, weight: str = "normal") -> None:
    axes.text(0.07, y, text, size=7.5, va="top", color=colour, weight=weight, clip_on=False)
