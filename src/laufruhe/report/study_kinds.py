"""How each kind of study part is shown: one line each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import xarray as xr
from matplotlib.figure import Figure

from laufruhe.plots import economics, layouts, tolerance
from laufruhe.plots import study as pictures
from laufruhe.report import cost_tables
from laufruhe.report import study_tables as tables


@dataclass(frozen=True)
class Shown:
    """Table, as lines of Markdown, and picture of one kind of part, both made of its dataset alone."""

    table: Callable[[xr.Dataset], list[str]]
    picture: Callable[[xr.Dataset], Figure]


SHOWN: Mapping[str, Shown] = {
    "counterweight fraction": Shown(tables.by_point, pictures.counterweight_fraction),
    "balancer sizing": Shown(tables.by_shafts, pictures.balancer_sizing),
    "layout comparison": Shown(tables.by_point, pictures.layout_comparison),
    "economics": Shown(cost_tables.economics, economics.economics),
    "tolerance": Shown(cost_tables.tolerance, tolerance.tolerance),
    "free forces": Shown(cost_tables.free_forces, layouts.free_forces),
}
