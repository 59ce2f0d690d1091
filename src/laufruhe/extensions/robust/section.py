"""Report sections and pictures of designs under tolerance and of chosen parts."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from laufruhe.extensions.robust.result import CONFIDENCE, SHARES, AssemblyResult, PricedTolerance, RobustResult
from laufruhe.present.measures import objective_unit
from laufruhe.present.numbers import figure, number, percent, price_of, with_unit
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result


def _tolerance_tables(result: Result) -> list[Table]:
    """Return a table that compares the optimum for tolerances with that of the drawing, and a table of tolerances."""
    details, unit = result.details, objective_unit(result)
    assert isinstance(details, RobustResult)
    worst = "worst case" if details.exact else "worst drawn"
    level, confidence = f"{100.0 * details.share:g} % of engines below", f"{100.0 * CONFIDENCE:g} % sure"
    head = ("design", "as drawn", worst, level, confidence)
    rows = []
    for design in (details.nominal, details.robust):
        values = (figure(value, unit, 5) for value in (design.drawing, design.worst, design.share))
        rows.append((design.name, *values, f"{number(design.low, 5)} to {number(design.high, 5)}"))
    pairs = ((getattr(details.nominal, key), getattr(details.robust, key)) for key in ("drawing", "worst", "share"))
    rows.append(("price", *(percent(robust / nominal - 1.0) if nominal else "-" for nominal, robust in pairs), ""))
    tolerance_head = ("tolerance, dearest first", "is", "errors", "shadow price", "costs")
    tolerance_rows = [_tolerance(tolerance, unit) for tolerance in details.tolerances]
    count = f"Checked: of {details.engines:,} other engines {details.exceeding} exceed the objective"
    check = f"{count}, so at most {100.0 * details.exceeding_at_most:.2g} % of all do ({confidence})."
    note = "Costs: shadow price times tolerance, an estimate of what removing the tolerance would save."
    return [
        Table(head, rows, title="Under tolerance", note=check, file="under-tolerance"),
        Table(tolerance_head, tolerance_rows, title="Tolerances", left=2, note=note, file="tolerances"),
    ]


def _tolerance(tolerance: PricedTolerance, unit: str) -> tuple[str, ...]:
    is_share = not tolerance.unit
    size = f"{100.0 * tolerance.size:.3g} %" if is_share else with_unit(tolerance.size, tolerance.unit)
    price = (
        f"{number(0.01 * tolerance.price)} {unit} per %"
        if is_share
        else price_of(tolerance.price, unit, tolerance.unit)
    )
    errors = f"{tolerance.errors}, {tolerance.law}" + (", batch" if tolerance.scope == "batch" else "")
    return tolerance.name, f"± {size}", errors, price, figure(tolerance.saving, unit, 3)


def _assembly_tables(result: Result) -> list[Table]:
    details, unit = result.details, objective_unit(result)
    assert isinstance(details, AssemblyResult)
    head, rows = ["cylinder"], []
    for kind in details.kinds:
        head += [kind, "mass [g]"]
    for place in details.places:
        cells = [place.cylinder]
        for part, masses in zip(place.parts, place.masses, strict=True):
            cells += [f"no. {part}", " + ".join(f"{1e3 * mass:.1f}" for mass in masses if mass)]
        rows.append(cells)
    middle, maximum = (
        figure(details.quantiles[int(share * (len(details.quantiles) - 1))], unit) for share in (0.5, 0.95)
    )
    count = f"Of {details.assemblies:,.0f} assemblies; {details.random} of them at random"
    worst, mean = figure(details.worst, unit), figure(details.mean_parts, unit)
    note = (
        f"{count}: half above {middle}, one of twenty above {maximum}, the worst {worst}. "
        f"With parts of mean mass {mean}."
    )
    return [Table(head, rows, title="Assembly", note=note, file="assembly")]


def _tolerance_record(result: Result) -> dict[str, Any]:
    details = result.details
    assert isinstance(details, RobustResult)
    names = "exact share scenarios divisions engines seed exceeding exceeding_at_most"
    record: dict[str, Any] = {"over": "worst case" if details.population.share is None else details.population.share}
    record |= {name: getattr(details, name) for name in names.split()}
    for key, design in (("best_drawing", details.nominal), ("decided", details.robust)):
        decisions = {name: {"value": value, "unit": unit} for name, value, unit in design.decisions}
        record[key] = {name: getattr(design, name) for name in ["drawing", "worst", "share", "low", "high"]}
        record[key] |= {"quantiles": list(design.quantiles), "decisions": decisions}
    return {**record, "tolerances": [asdict(tolerance) for tolerance in details.tolerances]}


def _assembly_record(result: Result) -> dict[str, Any]:
    details = result.details
    assert isinstance(details, AssemblyResult)
    record = {name: getattr(details, name) for name in ["assemblies", "looked_at", "random", "worst", "mean_parts"]}
    places = [
        {"cylinder": place.cylinder, **dict(zip(details.kinds, place.parts, strict=True))} for place in details.places
    ]
    return {**record, "quantiles": list(details.quantiles), "places": places}


def _shares(result: Result) -> Table:
    unit, details = objective_unit(result) or "-", result.details
    if isinstance(details, RobustResult):
        columns = {"best drawing": details.nominal.quantiles, "decided": details.robust.quantiles}
    else:
        assert isinstance(details, AssemblyResult)
        columns = {"assemblies at random": details.quantiles}
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
    "Nominal and robust design, each built many times, and the cost of each tolerance.",
    "laufruhe.extensions.robust.picture",
)
ASSEMBLY_PICTURE = ResultPicture(
    "assembly",
    "The best assembly of measured parts, and random assemblies.",
    "laufruhe.extensions.robust.assembly_picture",
)
