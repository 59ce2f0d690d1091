"""Curves: parts of the mount force, polar diagrams, balance fraction, arrangements, mounting, gas trace."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import wrap
from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from laufruhe.plots.style import BLUE, FAINT, GREEN, GREY, ORANGE, VERMILION, page
from laufruhe.plots.tractor.sheet import FORCE, SERIES, dot, entitled, line
from laufruhe.studies.tractor.engines import KILOPOND


def parts(data: xr.Dataset) -> Figure:
    """Figs. 2, 5, 7: one panel each."""
    drawn = page(3, 1, (8.0, 1.9), lead=0.22, gap=0.35)
    titles = {
        "gas": "Fig. 2: gas",
        "reciprocating mass": "Fig. 5: reciprocating mass",
        "rod inertia": "Fig. 7: inertia of the rod, scale 100 times larger",
    }
    for axes, part in zip(drawn.panels, data["part"].values, strict=True):
        for mount, colour in (("left", BLUE), ("right", ORANGE)):
            curve = data["vertical_force"].sel(part=part, mount=mount) / KILOPOND
            axes.plot(data["angle"], curve, color=colour, linewidth=1.6)
        axes.set_title(titles[str(part)], loc="left")
        axes.set(xlim=(0, 720), ylim=(-400, 400) if part != "rod inertia" else (-4, 4), ylabel="[kp]")
        axes.xaxis.set_major_locator(MultipleLocator(90))
        axes.axhline(0.0, color=FAINT, linewidth=0.7)
        axes.tick_params(labelbottom=axes is drawn.panels[-1])
    drawn.panels[0].axhline(300.0, color=FAINT, linewidth=0.9, linestyle=(0, (3, 3)))
    drawn.panels[0].text(715, 310, "300 kp: largest in the study", ha="right", va="bottom", color=FAINT, size=8)
    drawn.panels[-1].set_xlabel("crank angle from the firing dead centre [deg]")
    return entitled(
        drawn.figure,
        "Vertical mount force of the single, part by part",
        "One working cycle on both mounts, 504 mm apart. 10 m/s, 9 kp/cm², 1.25 kg, rod inertia deficit −4.2 kg cm².",
        [line(BLUE, "left mount"), line(ORANGE, "right mount")],
        "Figs. 1 to 7",
    )


def polar(data: xr.Dataset) -> Figure:
    """Figs. 8, 9: the path of the force on each mount."""
    drawn = page(1, 2, (4.0, 4.4), lead=0.25, gap=0.6)
    colours = (GREY, BLUE, ORANGE)
    reach = 1.08 * float(np.abs(data["force"]).max()) / KILOPOND
    for axes, mount, where in zip(
        drawn.panels, ("left", "right"), ("Fig. 8: left mount", "Fig. 9: right mount"), strict=True
    ):
        for share, colour in zip(data["fraction"].values, colours, strict=True):
            path = data["force"].sel(fraction=share, mount=mount) / KILOPOND
            closed = np.concatenate([path.values, path.values[:1]])
            axes.plot(closed[:, 0], closed[:, 1], color=colour, linewidth=1.5 if share else 3.0)
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xlabel="lateral force [kp]")
        axes.axhline(0.0, color="#bbbbbb", linewidth=0.6, zorder=0.5)
        axes.axvline(0.0, color="#bbbbbb", linewidth=0.6, zorder=0.5)
        axes.set_title(where, loc="left")
    drawn.panels[0].set_ylabel("vertical force [kp]")
    legend = [line(c, f"{100 * f:.0f} % balanced") for f, c in zip(data["fraction"].values, colours, strict=True)]
    return entitled(
        drawn.figure,
        "Mount forces of the single for three balance fractions",
        "Path of the force over one working cycle, seen from the front. 10 m/s, 9 kp/cm².",
        legend,
        "Figs. 8 and 9",
    )


def fraction(data: xr.Dataset) -> Figure:
    """Fig. 10: mean force over the balance fraction."""
    drawn = page(1, 1, (7.2, 4.2))
    axes = drawn.panels[0]
    shades = SERIES[: data.sizes["speed"]]
    for speed, colour in zip(data["speed"].values, shades, strict=True):
        row = data.sel(speed=speed)
        axes.plot(100.0 * data["fraction"], row["mean"] / KILOPOND, color=colour, linewidth=2.0)
        axes.plot(100.0 * row["best_fraction"], row["best_mean"] / KILOPOND, "o", color=colour, markersize=6)
        axes.text(101.0, float(row["mean"][-1]) / KILOPOND, f"{speed:g} m/s", color=colour, va="center")
    axes.axvline(50.0, color=FAINT, linewidth=0.8, linestyle=(0, (3, 3)))
    axes.text(50.8, 4.0, "about 50 %: the study's optimum", color=FAINT, size=8)
    axes.set(
        xlim=(0, 112), ylim=(0, None), xlabel="balance fraction of the reciprocating mass [%]", ylabel="mean " + FORCE
    )
    best = 100.0 * float(data["best_fraction"].sel(speed=10.0))
    return entitled(
        drawn.figure,
        "How much of the piston a single should balance",
        f"Mean over the cycle and both mounts. At 10 m/s the proven optimum is {best:.1f} %.",
        [dot(GREY, "proven optimum, by mean piston speed")],
        "Fig. 10",
    )


def vee(data: xr.Dataset) -> Figure:
    """Fig. 29: parts of both orders by bank angle."""
    drawn = page(1, 2, (4.0, 3.3), lead=0.25, gap=0.6)
    styles: dict[str, tuple[str, Literal["-", "--"]]] = {
        "with the crank": (BLUE, "-"),
        "against the crank": (ORANGE, "--"),
    }
    for axes, order, name in zip(drawn.panels, (1, 2), ("First order", "Second order"), strict=True):
        for direction, (colour, style) in styles.items():
            curve = data["force"].sel(order=order, direction=direction)
            axes.plot(data["angle"], curve, color=colour, linestyle=style, linewidth=2.0)
        axes.set(xlim=(0, 180), ylim=(0, None), xlabel="bank angle [deg]")
        axes.xaxis.set_major_locator(MultipleLocator(30))
        axes.set_title(name, loc="left")
    drawn.panels[0].set_ylabel("rotating force over m r ω²")
    drawn.panels[0].annotate(
        "90°: webs alone\nbalance the rest",
        (90, 0),
        (67, 0.72),
        size=8,
        color=FAINT,
        arrowprops={"arrowstyle": "-", "color": FAINT},
    )
    legend = [line(c, f"turns {name}", s) for name, (c, s) in styles.items()]
    return entitled(
        drawn.figure,
        "Free forces of two cylinders on one throw, by bank angle",
        "Each order split into two rotating forces; webs take what turns with the crank at its speed.",
        legend,
        "Fig. 29",
    )


def boxer(data: xr.Dataset) -> Figure:
    """Fig. 30: force and couple by order, in line and opposed."""
    drawn = page(1, 2, (4.0, 3.0), lead=0.25, gap=0.8)
    places = np.arange(data.sizes["order"], dtype=float)
    panels = (("force", "free force [kp]", KILOPOND), ("couple", "free couple [N m]", 1.0))
    for axes, (name, label, unit) in zip(drawn.panels, panels, strict=True):
        top = float(data[name].max()) / unit
        for k, (engine, colour) in enumerate(zip(data["engine"].values, (GREY, BLUE), strict=True)):
            values = data[name].sel(engine=engine).values / unit
            at = places + (k - 0.5) * 0.36
            axes.bar(at, values, 0.34, color=colour)
            for x, value in zip(at, values, strict=True):
                shown = "0" if value < 1e-6 * top else f"{value:.3g}"
                axes.text(x, value + 0.01 * top, shown, ha="center", va="bottom", size=7.5, color=FAINT)
        axes.set_xticks(places, [f"order {order}" for order in data["order"].values])
        axes.grid(axis="x", visible=False)
        axes.set(ylabel=label, ylim=(0.0, 1.1 * top))
    return entitled(
        drawn.figure,
        "Four cylinders in line and opposed",
        "Inertia by order at 10 m/s: what adds up to a force in line becomes a couple in the boxer.",
        [Patch(facecolor=GREY, label="inline"), Patch(facecolor=BLUE, label="boxer")],
        "Fig. 30",
    )


def isolation(data: xr.Dataset) -> Figure:
    """Fig. 31: transmissibility over the speed ratio."""
    drawn = page(1, 1, (7.2, 4.0))
    axes = drawn.panels[0]
    for psi, colour in zip(data["damping"].values, SERIES, strict=False):
        curve = np.minimum(data["transmissibility"].sel(damping=psi), 8.0)
        axes.plot(data["speed_ratio"], curve, color=colour, linewidth=1.8)
    axes.axvline(math.sqrt(2.0), color=FAINT, linewidth=0.9, linestyle=(0, (3, 3)))
    axes.axhline(1.0, color=FAINT, linewidth=0.7)
    axes.text(1.44, 4.6, "√2: isolates from here on,\nwhatever the damping", color=FAINT, size=8.5)
    axes.set(xlim=(0, 3), ylim=(0, 5), xlabel="speed over critical speed", ylabel="force passed on over exciting force")
    legend = [line(c, f"ψ = {psi:g}") for psi, c in zip(data["damping"].values, SERIES, strict=False)]
    return entitled(
        drawn.figure,
        "When an elastic mounting isolates",
        "One mass on a spring with a constant loss factor η = ψ/(2π), ψ the share of its energy lost a cycle.",
        legend,
        "Fig. 31, eq. 40",
    )


def sag(data: xr.Dataset) -> Figure:
    """Fig. 32: static sag over the critical speed."""
    drawn = page(1, 1, (7.2, 4.0))
    axes = drawn.panels[0]
    for order, colour in zip(data["order"].values, (BLUE, ORANGE), strict=True):
        axes.loglog(data["critical_speed"], 1e3 * data["sag"].sel(order=order), color=colour, linewidth=2.0)
        value = 1e3 * float(data["example"].sel(order=order))
        axes.plot(400.0, value, "o", color=colour, markersize=7)
        axes.annotate(f"{value:.1f} mm", (400.0, value), (8, 4), textcoords="offset points", color=colour, size=10)
    speeds, sags = (150, 200, 300, 400, 600, 800, 1000), (0.2, 0.5, 1, 2, 5, 10, 20, 40)
    axes.set(xlim=(150, 1000), ylim=(0.2, 45), xlabel="critical speed [rpm]", ylabel="static sag [mm]")
    axes.set_xticks(speeds, [str(v) for v in speeds], minor=False)
    axes.set_yticks(sags, [f"{v:g}" for v in sags], minor=False)
    axes.minorticks_off()
    return entitled(
        drawn.figure,
        "How far an engine sags on mounts that are soft enough",
        "Dots: critical speed 400 rpm for an idle of 600 rpm, as in the study.",
        [line(BLUE, "excited in first order"), line(ORANGE, "excited in second order only")],
        "Fig. 32, eq. 41",
    )


def free_force(data: xr.Dataset) -> Figure:
    """The tolerance argument: free force against the worst sum of tolerances."""
    drawn = page(1, 1, (7.2, 3.6))
    axes = drawn.panels[0]
    axes.plot(data["speed"], data["force"] / KILOPOND, color=BLUE, linewidth=2.0)
    for level, words in (
        (1000.0, "1000 kp: free force of a vehicle diesel, as stated"),
        (100.0, "100 kp: worst sum of tolerances, as stated"),
    ):
        axes.axhline(level, color=VERMILION, linewidth=1.2, linestyle=(0, (4, 3)))
        axes.text(4.1 if level > 500.0 else 7.0, level + 12.0, words, size=8, color=FAINT, va="bottom")
    axes.axvline(10.0, color=FAINT, linewidth=0.8, linestyle=(0, (2, 3)))
    axes.set(xlim=(4, 14), ylim=(0, 1150), xlabel="mean piston speed [m/s]", ylabel="force [kp]")
    return entitled(
        drawn.figure,
        "Second-order force of four cylinders against tolerances",
        "Why finer balancing of parts does not help an engine with a free force of second order.",
        [line(BLUE, "four cylinders of the study, 1.25 kg, stroke 120 mm"), line(VERMILION, "stated", "--", 1.2)],
        "section on errors of balancing",
    )


def traces(data: xr.Dataset) -> Figure:
    """Every statement about the gas trace under every set of parameters."""
    from laufruhe.studies.tractor.identification import ALLOWED, CLAIMED

    labels = {
        "gas_force": ("largest gas force [kp]", 1.0),
        "cancelling_speed": ("orders 2 cancel at [m/s]", 1.0),
        "best_share": ("best Φ [%]", 100.0),
        "first_fall": ("force pair: less by [%]", 100.0),
        "second_fall": ("moment pair: less by [%]", 100.0),
    }
    drawn = page(1, len(labels) + 1, (1.75, 3.5), lead=0.25, gap=0.3)
    places = np.arange(data.sizes["case"], dtype=float)[::-1]
    _case_names(drawn.panels[0], data, places)
    fired = [not str(case).startswith("no load") for case in data["case"].values]
    for axes, (name, (label, factor)) in zip(drawn.panels[1:], labels.items(), strict=True):
        claim, span = factor * CLAIMED[name], factor * ALLOWED[name]
        axes.axvspan(claim - span, claim + span, color="#d9ecd9", linewidth=0)
        axes.axvline(claim, color=GREEN, linewidth=1.0)
        _scatter(axes, factor * data[name].values, places, fired)
        axes.set_title(label, loc="left", size=8.5)
        axes.set_yticks(places, [""] * len(places))
        axes.set_ylim(-0.6, len(places) - 0.4)
    return entitled(
        drawn.figure,
        "Which gas trace meets what the study says of it",
        "Seven sets of parameters. Green: stated, and what 'about' is taken to mean. Gas force: at 9 kp/cm².",
        [dot(ORANGE, "fired at 5.5 kp/cm²"), dot(BLUE, "without load"), line(GREEN, "the study")],
        "Figs. 2 and 22, and the 7 m/s of the text",
    )


def _case_names(axes: Axes, data: xr.Dataset, places: NDArray[np.float64]) -> None:
    """Names of the cases and their parameters, where the first panel would be."""
    axes.set_axis_off()
    axes.set(xlim=(0.0, 1.0), ylim=(-0.6, len(places) - 0.4))
    for case, words, place in zip(data["case"].values, data["parameters"].values, places, strict=True):
        axes.text(-0.3, place + 0.05, str(case), size=9, weight="bold", va="bottom")
        for k, part in enumerate(wrap(str(words), 38)):
            axes.text(-0.3, place - 0.03 - 0.24 * k, part, size=6.5, va="top", color=FAINT)


def _scatter(axes: Axes, values: NDArray[np.float64], places: NDArray[np.float64], fired: Sequence[bool]) -> None:
    for value, place, hot in zip(values, places, fired, strict=True):
        if math.isfinite(value):
            axes.plot(value, place, "o", color=ORANGE if hot else BLUE, markersize=7)
