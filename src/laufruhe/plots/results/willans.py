"""Friction readings: fuel over load with the Willans line, or drag over speed (W2, W3)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from laufruhe.physics.willans import FrictionTest
from laufruhe.plots.style import AFTER, SKY, entry, entry_of_dots, finish_page, page, styled
from laufruhe.plots.words import INK
from laufruhe.present.numbers import RPM
from laufruhe.solvers.result import Result

BAR, MAX_LINES = 1e-5, 4


def applies(result: Result) -> bool:
    """Return True if a load is based on friction readings."""
    return bool(result.problem.friction)


@styled()
def figure(result: Result) -> Figure:
    """Draw the friction measurements: fuel over load with the Willans line, or drag over speed, per operating point."""
    tests = result.problem.friction[:MAX_LINES]
    drawn = page(len(tests), 1, (6.4, 2.3), gap=0.75)
    for axes, test in zip(drawn.panels, tests, strict=True):
        _draw(axes, test)
    legend = [
        entry_of_dots("measured", color=INK), entry("least squares", color=SKY),
        entry("friction, and its deviations", color=AFTER),
    ]  # fmt: skip
    text = "; ".join(
        f"at {test.at} {BAR * test.friction.mean:.3g} bar, deviation {BAR * test.friction.deviation:.2g}"
        for test in tests
    )
    return finish_page(drawn, result, "Friction by measurement", f"Friction mean pressure {text}.", legend)


def _draw(axes: Axes, test: FrictionTest) -> None:
    """Draw fuel over brake mean pressure, whose line reaches zero fuel at the friction, or drag over speed."""
    (intercept, slope), friction, motored = test.line, test.friction, test.is_motored
    across, up = (RPM, BAR) if motored else (BAR, 1.0)
    ends = np.array([min(*test.x, test.target) if motored else -friction.mean, max(*test.x, test.target)])
    axes.plot(across * ends, up * (intercept + slope * ends), color=SKY, linewidth=1.6)
    axes.plot(across * np.array(test.x), up * np.array(test.y), "o", color=INK, markersize=5.0)
    look: Any = {"color": AFTER, "capsize": 4.0, "linewidth": 1.8}
    room = BAR * test.deviations * friction.deviation
    axes.margins(0.06)
    if motored:
        axes.errorbar(RPM * test.target, BAR * friction.mean, yerr=room, marker="D", **look)
        axes.set(xlabel=f"speed, asked for at {test.at} [rpm]", ylabel="drag [bar]")
    else:
        axes.errorbar(-BAR * friction.mean, 0.0, xerr=room, **look)
        axes.plot(BAR * test.target, intercept + slope * test.target, "D", color=AFTER, markersize=6.0)
        axes.axhline(0.0, color=INK, linewidth=0.8)
        axes.set(xlabel=f"brake mean pressure at {test.at} [bar]", ylabel="fuel, as measured")
