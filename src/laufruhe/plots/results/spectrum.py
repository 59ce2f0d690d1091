"""Amplitudes of the loads by order of crank speed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.plots.style import finish_page, page, point_name, series_of, styled
from laufruhe.plots.words import empty, in_thousands, omitted_words, round_ticks
from laufruhe.present.measures import hardest_point, has_loads, main_load, mount_orders, pad_orders
from laufruhe.problem.loads import PointLoads
from laufruhe.solvers.result import Result

Panel = tuple[str, str, Callable[[PointLoads], Array]]

SHARE = 0.005
LAST_ORDER = 24.0
SHORTEST = 6.0
NEGLIGIBLE = 1e-9
applies = has_loads


@styled()
def figure(result: Result) -> Figure:
    """Draw mount forces by order; without mounts the shaking force and its couples."""
    k, series = hardest_point(result), series_of(result, loads=True)
    with_mounts = bool(result.problem.engine.mounts)
    panels = _panels(len(result.problem.engine.mounts))
    base = float(main_load(series[0].design.loads[k]).base)
    amplitudes = [_visible([measure(item.design.loads[k]) for item in series], base) for _, _, measure in panels]
    last = base * max(len(values[0]) - 1 for values in amplitudes)
    tops = [max(float(values_of_design.max(initial=0.0)) for values_of_design in values) for values in amplitudes]
    drawn = page(len(panels), 1, (6.8, 3.2 if len(panels) == 1 else 1.5), gap=0.25)
    for axes, (label, unit, _), values, top in zip(drawn.panels, panels, amplitudes, tops, strict=True):
        words, (factor, symbol) = omitted_words(top, max(tops), unit), in_thousands(top, unit)
        axes.set(xlim=(-0.6, max(last, SHORTEST) + 0.6), ylim=(0.0, 1.1 * factor * top if top > 0.0 else 1.0))
        axes.set_ylabel(f"{label} [{symbol}]")
        axes.xaxis.set_major_locator(MaxNLocator(12, integer=True, steps=[1, 2, 5, 10]))
        round_ticks(axes.yaxis, 5)
        axes.grid(axis="x", visible=False)
        axes.tick_params(axis="x", length=2)
        if words:
            empty(axes, words)
        else:
            _bars(
                axes, [factor * values_of_design for values_of_design in values], base, [item.colour for item in series]
            )
        axes.tick_params(labelbottom=axes is drawn.panels[-1])
    drawn.panels[-1].set_xlabel("order, multiples of crank speed")
    title = "Mount forces by order" if with_mounts else "Shaking force and couples by order"
    what = "Amplitude of the force on a mount" if with_mounts else "Amplitude of the load on the block"
    lines = f"{what} at {point_name(result, k)}; order 0 is the steady part."
    legend = [Patch(facecolor=item.colour, label=item.name) for item in series]
    return finish_page(drawn, result, title, lines, legend)


def _panels(mounts: int) -> list[Panel]:
    if mounts:
        label = "amplitude" if mounts == 1 else f"amplitude, mean of {mounts} mounts"
        return [(label, "N", lambda loads: mount_orders(main_load(loads)).mean(axis=1))]

    def part(first: int, last: int) -> Callable[[PointLoads], Array]:
        return lambda loads: order_amplitude(loads.wrench.coefficients[:, first:last])

    return [
        ("shaking force", "N", part(0, 3)),
        ("rocking couple", "N m", part(4, 6)),
        ("roll moment", "N m", part(3, 4)),
    ]


def _visible(series: list[Array], base: float) -> list[Array]:
    length = max(len(values) for values in series)
    table = np.stack([pad_orders(values, length) for values in series])
    visible = np.flatnonzero(table.max(axis=0) > SHARE * float(table.max(initial=0.0)))
    last = min(int(visible[-1]) if len(visible) else 0, int(LAST_ORDER / base))
    return list(table[:, : last + 1])


def _bars(axes: Axes, series: list[Array], base: float, colours: list[str]) -> None:
    table = np.stack(series)
    drawn = np.flatnonzero(table.max(axis=0) > NEGLIGIBLE * float(table.max(initial=0.0)))
    step = float(np.diff(drawn).min(initial=2)) * base
    width = 0.8 * min(1.0, step) / len(series)
    for k, (values, colour) in enumerate(zip(series, colours, strict=True)):
        places = drawn * base + (k - 0.5 * (len(series) - 1)) * width
        axes.bar(places, values[drawn], width, color=colour, linewidth=0)
