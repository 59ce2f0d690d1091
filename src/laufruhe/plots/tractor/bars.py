"""Bars of mean and largest mount force (Figs. 12, 13, 15, 17, 22, 25, 28)."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from laufruhe.plots.style import BLUE, FAINT, GREY, ORANGE, page
from laufruhe.plots.tractor.sheet import bar_legend, entitled, mount_bars
from laufruhe.present.numbers import with_unit
from laufruhe.studies.tractor.engines import KILOPOND


def equal_cylinders(data: xr.Dataset) -> Figure:
    """Fig. 12: one panel a mounting, front and rear mounts and all of them, four engines."""
    drawn = page(2, 1, (9.0, 2.7), lead=0.25)
    usual = data.sel(design="webs for half the couple")
    for axes, mounting in zip(drawn.panels, data["mounting"].values, strict=True):
        mount_bars(axes, usual.sel(mounting=mounting))
        axes.set_title(
            f"{mounting} mounting" if "," not in mounting else mounting.replace(",", " mounting,"), loc="left"
        )
    legend = bar_legend([f"{z} cylinders" for z in data["cylinders"].values])
    return entitled(
        drawn.figure,
        "Two, three, four and six equal cylinders on four mounts",
        "Webs balance half of a first-order couple where there is one. 10 m/s, 9 kp/cm², rigid mounts.",
        legend,
        "Figs. 11 and 12",
    )


def equal_power(data: xr.Dataset) -> Figure:
    """Fig. 13: the same at equal total power."""
    drawn = page(1, 1, (9.0, 3.3))
    mount_bars(drawn.panels[0], data)
    rows = zip(data["cylinders"].values, data["displacement"].values, data["crank_speed"].values, strict=True)
    labels = [f"{z} cyl.: {1e3 * v:.2f} l, {with_unit(float(n), 'rad/s')}" for z, v, n in rows]
    return entitled(
        drawn.figure,
        "Two, three, four and six cylinders of equal total power",
        "Similar cylinders, mean piston speed and indicated pressure kept, long mounting. 10 m/s, 9 kp/cm².",
        bar_legend(labels),
        "Fig. 13, eqs. 14-23",
    )


def with_shaft(data: xr.Dataset, title: str, where: str) -> Figure:
    """Figs. 15, 17: webs alone and with a first-order shaft, by the study and at the optimum."""
    drawn = page(1, 1, (9.0, 3.3))
    mount_bars(drawn.panels[0], data)
    legend = bar_legend(["webs", "+ shaft (study)", "webs, optimum", "+ shaft, optimum"])
    return entitled(
        drawn.figure,
        title,
        "Sizes of the study beside the proven optimum of all unbalances. Long mounting, 10 m/s, 9 kp/cm².",
        legend,
        where,
    )


def pairs(data: xr.Dataset) -> Figure:
    """Fig. 22: what force and moment pair do; below, the share of the moment pair at three loads."""
    drawn = page(2, 1, (9.0, 2.9), lead=0.3, gap=0.6)
    mount_bars(drawn.panels[0], data)
    drawn.panels[0].set_title("5.5 kp/cm², 10 m/s", loc="left")
    lower = drawn.panels[1]
    for load, colour in zip(data["load"].values, (ORANGE, BLUE, GREY), strict=True):
        curve = data["swept_mean"].sel(load=load) / KILOPOND
        lower.plot(100.0 * data["share"], curve, color=colour, linewidth=2.0)
        best = float(curve.idxmin("share"))
        lower.plot(100.0 * best, float(curve.min()), "o", color=colour, markersize=6)
        lower.text(101.0, float(curve[-1]), str(load), color=colour, va="center")
    lower.axvline(50.0, color=FAINT, linewidth=0.8, linestyle=(0, (3, 3)))
    lower.text(50.5, 2.0, "Φ = 50 % of the study", color=FAINT, size=8)
    lower.set(xlim=(0, 113), ylim=(0, None), xlabel="share Φ of the moment pair [%]", ylabel="mean force [kp]")
    lower.set_title("Mean force over the share of the moment pair, force pair in place; dots: best share", loc="left")
    legend = bar_legend(["none", "force pair", "+ moment pair", "force, optimum", "both, optimum"])
    return entitled(
        drawn.figure,
        "Four cylinders with a force pair and a moment pair at twice crank speed",
        "Sizes of the study (eqs. 26 and 28, Φ = 50 %) beside the proven optimum. Long mounting.",
        legend,
        "Figs. 21 and 22",
    )


def front(data: xr.Dataset) -> Figure:
    """Fig. 25: one pair at the front end."""
    drawn = page(1, 1, (10.8, 3.6))
    mount_bars(drawn.panels[0], data)
    short = ["none", "force 72 %", "force + moment", "force, optimum", "both, optimum", "pairs of Fig. 21"]
    return entitled(
        drawn.figure,
        "Four cylinders with one balancer pair at the front end of the crank",
        "A pair for force, or one above the other for force and moment; Fig. 21 for comparison. 5.5 kp/cm², 10 m/s.",
        bar_legend(short),
        "Figs. 23 to 25",
    )


def two_stroke(data: xr.Dataset) -> Figure:
    """Fig. 28: two cranks, with and without a shaft, and what order is left."""
    drawn = page(2, 1, (9.0, 2.7), lead=0.3)
    colours = (GREY, ORANGE, BLUE)
    for axes, star in zip(drawn.panels, data["star"].values, strict=True):
        row = data.sel(star=star)
        mount_bars(axes, row, colours)
        axes.set(ylim=(0.0, 1.13 * float(data["maximum"].max()) / KILOPOND))
        left = row["inertia_left"].isel(design=1).values
        words = ", ".join(f"order {k}: {v:.2f} m r ω² a" for k, v in zip((1, 2), left, strict=True))
        axes.set_title(f"Crank of {star}. Inertia couples left with the shaft: {words}", loc="left")
    return entitled(
        drawn.figure,
        "Two-stroke four-cylinder: which of two cranks, with and without a shaft",
        "Shaft by eqs. 30 and 31 and at the proven optimum. Long mounting, 10 m/s, 6.5 kp/cm².",
        bar_legend(["webs", "+ shaft (study)", "shaft and webs, optimum"], colours),
        "Figs. 26 to 28",
    )
