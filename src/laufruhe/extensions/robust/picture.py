"""Picture of two designs built many times: share of engines over objective, and cost of each tolerance."""

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
MAX_TOLERANCES, WIDE = 8, 6.4


def applies(result: Result) -> bool:
    """Return True if the result is a design for built engines."""
    return isinstance(result.details, RobustResult)


@styled()
def figure(result: Result) -> Figure:
    """Draw the percentage of built engines below each objective for both designs, and the cost of each tolerance."""
    details, unit = result.details, objective_unit(result)
    if not isinstance(details, RobustResult):
        raise ValueError("the result has no built engines")
    layout = page(2, 1, (WIDE, 2.5), gap=0.7)
    first, second = layout.panels
    for design, colour in ((details.nominal, BEFORE), (details.robust, AFTER)):
        first.plot(design.quantiles, [100.0 * share for share in SHARES], color=colour, linewidth=1.8)
        first.axvline(design.drawing, color=colour, linewidth=1.2, linestyle=DRAWN)
        first.axvline(design.worst, color=colour, linewidth=1.4, linestyle=WORST)
    first.axhline(100.0 * details.share, color=FAINT, linewidth=0.7, linestyle=DRAWN)
    name = result.problem.drawing.objective_name
    first.set(ylim=(0.0, 104.0), ylabel="engines below [%]", xlabel=label_of(name, unit, WIDE))
    _bars(second, details, unit)
    worst = "worst case, which no engine exceeds" if details.exact else "worst engine drawn"
    legend = [
        entry("nominal design", color=BEFORE), entry("robust design", color=AFTER),
        entry("as drawn", color=INK, linestyle=DRAWN), entry(worst, color=INK, linestyle=WORST),
    ]  # fmt: skip
    text = (
        f"{details.engines:,} engines built at random within their tolerances; below, which tolerance to narrow first."
    )
    return finish_page(layout, result, "The price of tolerances", text, legend)


def _bars(axes: Axes, details: RobustResult, unit: str) -> None:
    tolerances = details.tolerances[:MAX_TOLERANCES]
    maximum = axis_end(tolerance.saving for tolerance in tolerances)
    axes.barh(
        range(len(tolerances)), [max(tolerance.saving, 0.0) for tolerance in tolerances], color=AFTER, height=0.55
    )
    for row, tolerance in enumerate(tolerances):
        axes.text(0.01 * maximum, row - 0.36, tolerance.name, size=SMALL, color=INK, va="bottom")
        price = f"{number(tolerance.saving, 3)} {unit}"
        axes.text(max(tolerance.saving, 0.0) + 0.01 * maximum, row, price, size=SMALL, color=FAINT, va="center")
    axes.set(
        ylim=(len(tolerances) - 0.4, -0.75), xlim=(0.0, 1.15 * maximum), yticks=[],
        xlabel=label_of("shadow price times tolerance", unit, WIDE),
    )  # fmt: skip
    axes.grid(axis="y", visible=False)
