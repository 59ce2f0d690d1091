"""Two designs built many times: share of engines against what they make; and what each tolerance costs."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from laufruhe.extensions.robust.result import SHARES, RobustResult
from laufruhe.plots.style import AFTER, BEFORE, axis_end, entry, finish_page, page, styled
from laufruhe.plots.words import FAINT, INK, SMALL, label_of
from laufruhe.present.measures import objective_unit
from laufruhe.present.numbers import number
from laufruhe.solvers.result import Result

WORST, DRAWN = (0, (4, 2)), (0, (1, 2))
MOST_TOLERANCES, WIDE = 8, 6.4


def applies(result: Result) -> bool:
    """Return whether built engines were decided for."""
    return isinstance(result.details, RobustResult)


@styled()
def figure(result: Result) -> Figure:
    """Draw the share of engines that stays below, design by design, over bars of what tolerances cost."""
    found, unit = result.details, objective_unit(result)
    if not isinstance(found, RobustResult):
        raise ValueError("nothing was decided for built engines")
    drawn = page(2, 1, (WIDE, 2.5), gap=0.7)
    first, second = drawn.panels
    for design, colour in ((found.nominal, BEFORE), (found.robust, AFTER)):
        first.plot(design.quantiles, [100.0 * share for share in SHARES], color=colour, linewidth=1.8)
        first.axvline(design.drawing, color=colour, linewidth=1.2, linestyle=DRAWN)
        first.axvline(design.worst, color=colour, linewidth=1.4, linestyle=WORST)
    first.axhline(100.0 * found.share, color=FAINT, linewidth=0.7, linestyle=DRAWN)
    name = result.problem.drawing.objective_name
    first.set(ylim=(0.0, 104.0), ylabel="engines below [%]", xlabel=label_of(name, unit, WIDE))
    _bars(second, found, unit)
    worst = "worst case, which no engine exceeds" if found.exact else "worst engine drawn"
    legend = [
        entry("best drawing", color=BEFORE), entry("decided", color=AFTER),
        entry("as drawn", color=INK, linestyle=DRAWN), entry(worst, color=INK, linestyle=WORST),
    ]  # fmt: skip
    lines = (
        f"{found.engines:,} engines built at random within their tolerances; below, which tolerance to narrow first."
    )
    return finish_page(drawn, result, "The price of tolerances", lines, legend)


def _bars(axes: Axes, found: RobustResult, unit: str) -> None:
    shown = found.tolerances[:MOST_TOLERANCES]
    top = axis_end(one.saving for one in shown)
    axes.barh(range(len(shown)), [max(one.saving, 0.0) for one in shown], color=AFTER, height=0.55)
    for k, one in enumerate(shown):
        axes.text(0.01 * top, k - 0.36, one.name, size=SMALL, color=INK, va="bottom")
        price = f"{number(one.saving, 3)} {unit}"
        axes.text(max(one.saving, 0.0) + 0.01 * top, k, price, size=SMALL, color=FAINT, va="center")
    axes.set(
        ylim=(len(shown) - 0.4, -0.75), xlim=(0.0, 1.15 * top), yticks=[],
        xlabel=label_of("shadow price times tolerance", unit, WIDE),
    )  # fmt: skip
    axes.grid(axis="y", visible=False)
