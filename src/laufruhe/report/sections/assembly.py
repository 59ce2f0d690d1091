"""Which measured part goes into which cylinder, and what choosing buys."""

from __future__ import annotations

from laufruhe.present.measures import objective_unit
from laufruhe.present.numbers import figure
from laufruhe.report.grid import Grid
from laufruhe.solvers.result import Result
from laufruhe.solvers.tolerances.assembly_result import AssemblyResult, Place


def tables(result: Result) -> list[Grid]:
    """A row a cylinder, with the number of each part in the order of its file."""
    found, unit = result.details, objective_unit(result)
    if not isinstance(found, AssemblyResult):
        return []
    head = ["cylinder"]
    for kind in found.kinds:
        head += [kind, "mass [g]"]
    rows = [_row(place) for place in found.places]
    return [Grid("Assembly", head, rows, note=_beside(found, unit), sheet="assembly")]


def _row(place: Place) -> tuple[str, ...]:
    cells = [place.cylinder]
    for part, masses in zip(place.parts, place.masses, strict=True):
        cells += [f"no. {part}", " + ".join(f"{1e3 * mass:.1f}" for mass in masses if mass)]
    return tuple(cells)


def _beside(found: AssemblyResult, unit: str) -> str:
    middle, most = (figure(found.quantiles[int(share * (len(found.quantiles) - 1))], unit) for share in (0.5, 0.95))
    told = f"Of {found.assemblies:,.0f} assemblies; {found.random} of them at random"
    worst, mean = figure(found.worst, unit), figure(found.mean_parts, unit)
    return (
        f"{told}: half above {middle}, one of twenty above {most}, the worst {worst}. With parts of mean mass {mean}."
    )
