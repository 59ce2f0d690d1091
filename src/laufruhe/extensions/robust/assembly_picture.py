"""Picture of the best assembly together with random assemblies, the given one, and parts of mean mass."""

from __future__ import annotations

from matplotlib.figure import Figure

from laufruhe.extensions.robust.result import SHARES, AssemblyResult
from laufruhe.plots.style import AFTER, BEFORE, SKY, entry, finish_page, page, styled
from laufruhe.plots.words import INK, label_of
from laufruhe.solvers.result import Result

MEAN, WIDE = (0, (1, 2)), 6.4


def applies(result: Result) -> bool:
    """Return True if the result is a choice of measured parts."""
    return isinstance(result.details, AssemblyResult)


@styled()
def figure(result: Result) -> Figure:
    """Draw the percentage of random assemblies below each objective; lines show the best, initial and mean assembly."""
    details, objective = result.details, result.objective
    if not isinstance(details, AssemblyResult) or objective is None:
        raise ValueError("the result has no chosen pistons or rods, so there is no picture of an assembly")
    layout = page(1, 1, (WIDE, 3.0))
    axes = layout.panels[0]
    axes.plot(details.quantiles, [100.0 * share for share in SHARES], color=SKY, linewidth=1.8)
    axes.axvline(objective.value, color=AFTER, linewidth=1.8)
    axes.axvline(objective.initial, color=BEFORE, linewidth=1.8)
    axes.axvline(details.mean_parts, color=INK, linewidth=1.2, linestyle=MEAN)
    axes.margins(x=0.06)
    axes.set(ylim=(0.0, 104.0), ylabel="assemblies below [%]", xlabel=label_of(objective.name, objective.unit, WIDE))
    legend = [
        entry("at random", color=SKY), entry("as they come", color=BEFORE), entry("chosen", color=AFTER),
        entry("parts of mean mass", color=INK, linestyle=MEAN),
    ]  # fmt: skip
    text = f"{details.random} of {details.assemblies:,.0f} ways to assemble the measured parts."
    return finish_page(layout, result, "What choosing parts buys", text, legend)
