"""Pictures of the tractor study, by the name of the figure."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import xarray as xr
from matplotlib.figure import Figure

from laufruhe.plots.tractor import bars, lines

DRAW: dict[str, Callable[[xr.Dataset], Figure]] = {
    "fig-02-05-07": lines.parts,
    "fig-08-09": lines.polar,
    "fig-10": lines.fraction,
    "fig-12": bars.equal_cylinders,
    "fig-13": bars.equal_power,
    "fig-15": partial(
        bars.with_shaft, title="Two cylinders with a first-order balancer shaft", where="Figs. 14 and 15, eq. 24"
    ),
    "fig-17": partial(
        bars.with_shaft, title="Three cylinders with a first-order balancer shaft", where="Figs. 16 and 17, eq. 25"
    ),
    "fig-22": bars.pairs,
    "fig-25": bars.front,
    "fig-28": bars.two_stroke,
    "fig-29": lines.vee,
    "fig-30": lines.boxer,
    "fig-31": lines.isolation,
    "fig-32": lines.sag,
    "free-force": lines.free_force,
    "gas-trace": lines.traces,
}
