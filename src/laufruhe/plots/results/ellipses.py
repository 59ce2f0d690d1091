"""Mass ellipses: the path of shaking force and rocking couple of each order (L9)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.plots.style import Series, axis_end, entry_of_dots, finish_page, page, point_name, series_of, styled
from laufruhe.plots.words import FAINT, INK, SMALL, in_thousands, round_ticks
from laufruhe.present.measures import hardest_point, has_loads, has_mounts
from laufruhe.solvers.result import Result

PANEL, GAP, ACROSS, LEAD = 2.0, 0.55, 0.3, 0.25
MAX_ORDERS, SHARE, ROUND = 4, 0.005, 0.02
"""Largest number of orders, share of the largest load in N and N m below which an order is left out, and ratio of the
axes of an ellipse from which it is no line."""
TURN = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 361))


@dataclass(frozen=True)
class Load:
    """Load in the plane across the crank: its components of the wrench (C7), unit, and labels."""

    name: str
    components: tuple[int, int]
    unit: str
    labels: tuple[str, str]


LOADS = (
    Load("force", (1, 2), "N", ("lateral", "vertical")),
    Load("couple", (4, 5), "N m", ("about y", "about z")),
)  # fmt: skip


def applies(result: Result) -> bool:
    """Return True if an ellipse is no line, or if there are no mounts whose forces have a picture of their own."""
    if not has_loads(result):
        return False
    wrenches = [item.design.loads[hardest_point(result)].wrench for item in series_of(result, loads=True)]
    ellipses = [
        _path(wrench, load, order) for load, orders in _rows(wrenches) for order in orders for wrench in wrenches
    ]
    is_round = any(size[1] > ROUND * size[0] for size in (np.linalg.svd(path, compute_uv=False) for path in ellipses))
    return is_round or (bool(ellipses) and not has_mounts(result))


@styled()
def figure(result: Result) -> Figure:
    """Draw the ellipse of each large order: forces above, couples below, each row to one scale."""
    k, series = hardest_point(result), series_of(result, loads=True)
    wrenches = [item.design.loads[k].wrench for item in series]
    rows = _rows(wrenches)
    columns = max(len(orders) for _, orders in rows)
    drawn = page(len(rows), columns, (PANEL, PANEL), gap=GAP, lead=LEAD, across=ACROSS)
    for j, (load, orders) in enumerate(rows):
        panels = drawn.panels[j * columns : (j + 1) * columns]
        _row(panels, wrenches, series, load, orders)
    legend = [*(item.entry() for item in series), entry_of_dots("at 0°", color=INK, markersize=4.5)]
    what = " and ".join(load.name for load, _ in rows)
    lines = f"Free {what} of each order at {point_name(result, k)}, seen from the front: the tip draws an ellipse."
    return finish_page(drawn, result, "Mass ellipses", lines, legend)


def _rows(wrenches: Sequence[Spectrum]) -> list[tuple[Load, list[float]]]:
    """Return force and couple with their largest orders, without a load that is small in all orders."""
    sizes = {load: dict[float, float]() for load in LOADS}
    for load, by_order in sizes.items():
        for wrench in wrenches:
            for order, pair in zip(wrench.orders.tolist(), wrench.coefficients[:, load.components], strict=True):
                if order > 0.0:
                    by_order[order] = max(by_order.get(order, 0.0), float(np.linalg.norm(pair)))
    minimum = SHARE * max((size for by_order in sizes.values() for size in by_order.values()), default=0.0)
    rows = []
    for load, by_order in sizes.items():
        large = sorted(
            (order for order, size in by_order.items() if size > minimum), key=lambda order: -by_order[order]
        )
        rows += [(load, sorted(large[:MAX_ORDERS]))] if large else []
    return rows


def _row(
    panels: Sequence[Axes], wrenches: Sequence[Spectrum], series: Sequence[Series], load: Load, orders: Sequence[float]
) -> None:
    paths = [[_path(wrench, load, order) for wrench in wrenches] for order in orders]
    size = axis_end([float(np.abs(path).max()) for by_design in paths for path in by_design])
    factor, unit = in_thousands(size, load.unit)
    for axes in panels[len(orders) :]:
        axes.remove()
    for k, (axes, order, by_design) in enumerate(zip(panels, orders, paths, strict=False)):
        for path, item, width in zip(by_design, series, (2.4, 1.5)[-len(series) :], strict=True):
            axes.plot(*(factor * path), color=item.colour, linewidth=width)
            axes.plot(*(factor * path[:, 0]), "o", color=item.colour, markersize=4.5)
        end = 1.1 * factor * size
        axes.set(xlim=(-end, end), ylim=(-end, end), aspect="equal", xlabel=f"{load.labels[0]} [{unit}]")
        axes.set_title(f"{load.name} of order {order:g}", loc="left", size=SMALL)
        axes.axhline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
        axes.axvline(0.0, color=FAINT, linewidth=0.7, zorder=0.5)
        for axis in (axes.xaxis, axes.yaxis):
            round_ticks(axis, 4, symmetric=True)
        axes.tick_params(labelleft=k == 0, length=2)
    panels[0].set_ylabel(f"{load.labels[1]} [{unit}]")


def _path(wrench: Spectrum, load: Load, order: float) -> Array:
    pair: ComplexArray = wrench.at(order)[list(load.components)]
    return np.real(pair[:, None] * TURN)
