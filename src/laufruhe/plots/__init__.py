"""Pictures of a result, as PNG files; they read results and never call a solver."""

from __future__ import annotations

from pathlib import Path

from laufruhe.plots import bars, mounting, polar, spectrum, star
from laufruhe.plots.style import save
from laufruhe.present.mounting import is_elastic
from laufruhe.solvers.result import Result


def draw(result: Result, folder: Path) -> tuple[str, ...]:
    """Every picture that this result fills, in the order of a report.

    Returns
    -------
    File names in `folder`.
    """
    makers = {"polar.png": polar.figure, "bars.png": bars.figure} if result.problem.engine.mounts else {}
    makers["spectrum.png"] = spectrum.figure
    if is_elastic(result.final):
        makers |= mounting.FIGURES
    if result.phasing is not None and result.phasing.ranking:
        makers = {"star.png": star.figure, "firings.png": star.firings, **makers}
        if len(result.phasing.trade) > 1:
            makers["trade.png"] = star.trade
    for name, figure in makers.items():
        save(figure(result), folder / name)
    return tuple(makers)
