"""Sections and pictures of reports: two designs under tolerance with prices, and parts that were chosen."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from laufruhe.extensions.robust.result import (
    CONFIDENCE,
    SHARES,
    AssemblyResult,
    BuiltDesign,
    Place,
    PricedTolerance,
    RobustResult,
)
from laufruhe.present.measures import objective_unit
from laufruhe.present.numbers import figure, number, percent, price_of, with_unit
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result


def _tolerance_tables(result: Result) -> list[Table]:
    """Return a table of two designs, and one of tolerances, a row each."""
    found, unit = result.details, objective_unit(result)
    assert isinstance(found, RobustResult)
    worst = "worst case" if found.exact else "worst drawn"
    below, sure = f"{100.0 * found.share:g} % of engines below", f"{100.0 * CONFIDENCE:g} % sure"
    head = ("design", "as drawn", worst, below, sure)
    rows = [_design(design, unit) for design in (found.nominal, found.robust)]
    pairs = ((getattr(found.nominal, key), getattr(found.robust, key)) for key in ("drawing", "worst", "share"))
    rows.append(("price", *(percent(b / a - 1.0) if a else "-" for a, b in pairs), ""))
    told = ("tolerance, dearest first", "is", "errors", "shadow price", "costs")
    own = [_tolerance(tolerance, unit) for tolerance in found.tolerances]
    note = "Costs: shadow price times tolerance, an estimate of what removing the tolerance would save."
    return [
        Table(head, rows, title="Under tolerance", note=_checked(found), file="under-tolerance"),
        Table(told, own, title="Tolerances", left=2, note=note, file="tolerances"),
    ]


def _design(design: BuiltDesign, unit: str) -> tuple[str, ...]:
    low, high = (number(value, 5) for value in (design.low, design.high))
    values = (figure(value, unit, 5) for value in (design.drawing, design.worst, design.share))
    return (design.name, *values, f"{low} to {high}")


def _tolerance(tolerance: PricedTolerance, unit: str) -> tuple[str, ...]:
    share = not tolerance.unit
    size = f"{100.0 * tolerance.size:.3g} %" if share else with_unit(tolerance.size, tolerance.unit)
    price = (
        f"{number(0.01 * tolerance.price)} {unit} per %" if share else price_of(tolerance.price, unit, tolerance.unit)
    )
    errors = f"{tolerance.errors}, {tolerance.law}" + (", batch" if tolerance.scope == "batch" else "")
    return tolerance.name, f"± {size}", errors, price, figure(tolerance.saving, unit, 3)


def _checked(found: RobustResult) -> str:
    told = f"Checked: of {found.engines:,} other engines {found.exceeding} exceed the objective"
    return f"{told}, so at most {100.0 * found.exceeding_at_most:.2g} % of all do ({100.0 * CONFIDENCE:g} % sure)."


def _assembly_tables(result: Result) -> list[Table]:
    found, unit = result.details, objective_unit(result)
    assert isinstance(found, AssemblyResult)
    head = ["cylinder"]
    for kind in found.kinds:
        head += [kind, "mass [g]"]
    rows = [_row(place) for place in found.places]
    return [Table(head, rows, title="Assembly", note=_beside(found, unit), file="assembly")]


def _row(place: Place) -> tuple[str, ...]:
    cells = [place.cylinder]
    for part, masses in zip(place.parts, place.masses, strict=True):
        cells += [f"no. {part}", " + ".join(f"{1e3 * mass:.1f}" for mass in masses if mass)]
    return tuple(cells)


def _beside(found: AssemblyResult, unit: str) -> str:
    middle, maximum = (figure(found.quantiles[int(share * (len(found.quantiles) - 1))], unit) for share in (0.5, 0.95))
    told = f"Of {found.assemblies:,.0f} assemblies; {found.random} of them at random"
    worst, mean = figure(found.worst, unit), figure(found.mean_parts, unit)
    return (
        f"{told}: half above {middle}, one of twenty above {maximum}, the worst {worst}. "
        f"With parts of mean mass {mean}."
    )


def _tolerance_record(result: Result) -> dict[str, Any]:
    # two designs under tolerance, and the price of each tolerance [SI]
    found = result.details
    assert isinstance(found, RobustResult)
    names = "exact share scenarios divisions engines seed exceeding exceeding_at_most"
    told: dict[str, Any] = {"over": "worst case" if found.over.share is None else found.over.share}
    told |= {name: getattr(found, name) for name in names.split()}
    for key, design in (("best_drawing", found.nominal), ("decided", found.robust)):
        decisions = {name: {"value": value, "unit": unit} for name, value, unit in design.decisions}
        told[key] = {name: getattr(design, name) for name in ["drawing", "worst", "share", "low", "high"]}
        told[key] |= {"quantiles": list(design.quantiles), "decisions": decisions}
    return {**told, "tolerances": [asdict(tolerance) for tolerance in found.tolerances]}


def _assembly_record(result: Result) -> dict[str, Any]:
    found = result.details
    assert isinstance(found, AssemblyResult)
    told = {name: getattr(found, name) for name in ["assemblies", "looked_at", "random", "worst", "mean_parts"]}
    places = [{"cylinder": one.cylinder, **dict(zip(found.kinds, one.parts, strict=True))} for one in found.places]
    return {**told, "quantiles": list(found.quantiles), "places": places}


def _shares(result: Result) -> Table:
    unit, found = objective_unit(result) or "-", result.details
    if isinstance(found, RobustResult):
        columns = {"best drawing": found.nominal.quantiles, "decided": found.robust.quantiles}
    else:
        assert isinstance(found, AssemblyResult)
        columns = {"assemblies at random": found.quantiles}
    rows = [[100.0 * share, *values] for share, *values in zip(SHARES, *columns.values(), strict=True)]
    return Table(["below [%]", *(f"{name} [{unit}]" for name in columns)], rows)


TOLERANCES = Section(
    "robust", lambda result: isinstance(result.details, RobustResult), _tolerance_tables, _tolerance_record,
    ("under-tolerance", "tolerances"),
    {"shares": (lambda result: isinstance(result.details, RobustResult | AssemblyResult), _shares)},
)  # fmt: skip
ASSEMBLY = Section(
    "assembly", lambda result: isinstance(result.details, AssemblyResult), _assembly_tables, _assembly_record,
    ("assembly",),
)  # fmt: skip
TOLERANCES_PICTURE = ResultPicture(
    "robust",
    "The best drawing and the design decided, each built many times, and what each tolerance costs.",
    "laufruhe.extensions.robust.picture",
)
ASSEMBLY_PICTURE = ResultPicture(
    "assembly",
    "The best assembly of measured parts beside those at random.",
    "laufruhe.extensions.robust.assembly_picture",
)
