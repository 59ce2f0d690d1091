"""Natural modes of the crankshaft's twist, and the orders that meet them (V4, V6)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from laufruhe.extensions.torsion.channels import TORSIONAL_FREQUENCIES
from laufruhe.extensions.torsion.facts import TorsionFacts, facts_of, is_twisted, speed_range
from laufruhe.extensions.torsion.machine import Torsion
from laufruhe.extensions.torsion.physics import chain_of
from laufruhe.plots.speed_axis import LIMIT, limits_on, mark_points
from laufruhe.plots.style import AFTER, GREEN, ORANGE, entry, entry_of_dots, finish_page, page, styled
from laufruhe.plots.words import FAINT, INK, SMALL, fit_line, spread
from laufruhe.present.measures import is_changed
from laufruhe.present.numbers import RPM, number
from laufruhe.solvers.result import Result

MAX_MODES, MAX_NAMES, LARGEST = 3, 16, 11.0
COLOURS = (AFTER, ORANGE, GREEN)
applies = is_twisted


@styled()
def figure(result: Result) -> Figure:
    """Draw the swing of each disc on the left; on the right critical speeds, with a dot as large as its vector sum."""
    low, high = speed_range(result)
    facts = facts_of(result.final, low, high)
    drawn = page(1, 2, (3.9, 3.6), gap=0.85)
    shapes, speeds = drawn.panels
    _shapes(shapes, facts, chain_of(result.final.engine))
    _speeds(speeds, result, facts, high)
    count = min(MAX_MODES, len(facts.modes.frequencies))
    legend: list[Artist] = [
        entry(f"mode {m + 1}, {number(float(facts.modes.frequencies[m]))} Hz", color=COLOURS[m], linewidth=2.0)
        for m in range(count)
    ]
    legend += [entry("main order", color=INK, linewidth=1.4), entry("other order", color=FAINT, linewidth=0.6)]
    legend.append(entry_of_dots("vector sum of an order and mode", color=INK, markersize=6.0))
    which = "of the final design" if is_changed(result) else "of the initial design"
    text = f"Natural modes {which}, and critical speeds. The area of a dot grows with its vector sum."
    return finish_page(drawn, result, "Torsional vibration of the crankshaft", text, legend)


def _shapes(axes: Axes, facts: TorsionFacts, chain: Torsion) -> None:
    names = [disc.name for disc in chain.discs]
    places = range(len(names))
    axes.axhline(0.0, color=FAINT, linewidth=0.7)
    for m in range(min(MAX_MODES, facts.modes.shapes.shape[1])):
        shape = facts.modes.shapes[:, m]
        axes.plot(places, shape, "o", color=COLOURS[m], markersize=4.0)
        # a branch is thinner, and starts at the disc that drives it
        for front, rear, ratio in chain.links[: len(chain.sections)]:
            width = 1.6 if ratio == 1.0 and rear == front + 1 else 0.8
            axes.plot([front, rear], shape[[front, rear]], "-", color=COLOURS[m], linewidth=width)
    axes.set(ylim=(-1.1, 1.1), ylabel="angle at crank speed, scaled to 1")
    step = -(-len(names) // MAX_NAMES)
    labels = [fit_line(name, 1.1) if k % step == 0 else "" for k, name in enumerate(names)]
    axes.set_xticks(list(places), labels, rotation=60, ha="right", rotation_mode="anchor")


def _speeds(axes: Axes, result: Result, facts: TorsionFacts, high: float) -> None:
    frequencies = [float(f) for f in facts.modes.frequencies[:MAX_MODES]]
    bands = [limit.outside for limit in limits_on(result, TORSIONAL_FREQUENCIES) if limit.outside is not None]
    reach = 1.12 * max(
        [frequencies[0], *(f for f in frequencies if f <= max(facts.orders) * high / math.tau), *sum(bands, ())]
    )
    for band in bands:
        axes.axhspan(*band, color=LIMIT, alpha=0.13, linewidth=0)
    for order in facts.orders:
        is_main = order in facts.main
        look: Any = {"color": INK, "linewidth": 1.4} if is_main else {"color": FAINT, "linewidth": 0.6}
        axes.plot([0.0, high * RPM], [0.0, order * high / math.tau], **look, zorder=1)
    named = [order for order in facts.orders if order in facts.main or (order == int(order) and order <= 6)]
    _orders(axes, named, high, reach)
    largest = max(float(one.max(initial=0.0)) for one in facts.sums) or 1.0
    for m, frequency in enumerate(frequencies):
        axes.axhline(frequency, color=COLOURS[m], linewidth=1.3)
    for order, met, sums in zip(facts.orders, facts.met, facts.sums, strict=True):
        for colour, frequency, weights in zip(COLOURS, met.frequencies.tolist(), sums.tolist(), strict=False):
            speed = math.tau * frequency / order
            if speed <= high:
                size = LARGEST * math.sqrt(weights / largest)
                axes.plot(speed * RPM, frequency, "o", color=colour, markersize=size, zorder=5, alpha=0.85)
    axes.set(xlim=(0.0, high * RPM), ylim=(0.0, reach), xlabel="crank speed [rpm]", ylabel="frequency [Hz]")
    # above the names of orders
    mark_points(axes, result, lift=0.24)


def _orders(axes: Axes, orders: list[float], high: float, reach: float) -> None:
    # names of orders where they leave the panel, above it or to its right, without overlap
    above = [order for order in orders if order * high / math.tau > reach]
    right = [order for order in orders if order not in above]
    width, height = axes.bbox.width / axes.figure.dpi, axes.bbox.height / axes.figure.dpi
    across = spread(np.array([math.tau * reach / (order * high) for order in above]), 0.3 / width)
    up = spread(np.array([order * high / (math.tau * reach) for order in right]), 0.15 / height)
    look: Any = {"textcoords": "axes fraction", "xycoords": "axes fraction", "size": SMALL, "annotation_clip": False}
    for order, place in zip(above, across, strict=True):
        axes.annotate(f"{order:g}", (place, 1.0), (place, 1.01), ha="center", va="bottom", color=INK, **look)
    for order, place in zip(right, up, strict=True):
        axes.annotate(f"{order:g}", (1.0, place), (1.01, place), ha="left", va="center", color=INK, **look)
