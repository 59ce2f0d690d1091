"""The best drawing and the design decided, each under the same tolerances, and which of these to narrow first."""

from __future__ import annotations

from laufruhe.present.measures import objective_unit
from laufruhe.present.numbers import figure, number, percent, price_of, with_unit
from laufruhe.report.grid import Grid
from laufruhe.solvers.result import Result
from laufruhe.solvers.tolerances.result import CONFIDENCE, BuiltDesign, PricedTolerance, RobustResult


def tables(result: Result) -> list[Grid]:
    """Two designs, and a row a tolerance."""
    found, unit = result.details, objective_unit(result)
    if not isinstance(found, RobustResult):
        return []
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
        Grid("Under tolerance", head, rows, note=_checked(found), sheet="under-tolerance"),
        Grid("Tolerances", told, own, 2, note=note, sheet="tolerances"),
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
