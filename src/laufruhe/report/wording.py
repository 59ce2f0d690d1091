"""Numbers and sentences as an engineer reads them."""

from __future__ import annotations

import math

from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.report.measures import breaks_a_limit, changed
from laufruhe.solvers.result import DecisionValue, Result, Status
from laufruhe.units import readable

DASH = "-"
NOTHING = 1e-9
# A change that would be printed as 0.0 %.
UNFELT = 5e-4


def number(value: float, digits: int = 4, scale: float = 0.0) -> str:
    """To `digits` figures, without an exponent where it can be read without.

    Parameters
    ----------
    scale
        Size beside which the number is read: what is a rounding of it is shown as 0.
    """
    if not math.isfinite(value):
        return DASH
    if value == 0.0 or abs(value) <= NOTHING * scale:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if not -4 <= size <= 6:
        return f"{value:.{digits - 1}e}"
    # rounding may add a figure: 999.96 becomes 1000
    size = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    return f"{value:.{max(digits - 1 - size, 0)}f}"


def aligned(value: float, largest: float, digits: int = 5) -> str:
    """As many decimals as the largest number of its column needs for `digits` figures."""
    if value == 0.0 or largest <= 0.0 or not math.isfinite(largest) or not -4 <= math.log10(largest) < digits:
        return number(value, scale=largest)
    return f"{value:.{digits - 1 - math.floor(math.log10(largest))}f}"


def trimmed(value: float, digits: int = 4) -> str:
    """As `number`, without zeros that say nothing: bounds and limits as they were typed."""
    text = number(value, digits)
    return text.rstrip("0").rstrip(".") if "." in text and "e" not in text else text


def with_unit(value: float, unit: str) -> str:
    """A value in readable units: 90 deg, 2500 rpm, 1.25 kg."""
    name, factor = readable(unit)
    return f"{trimmed(value * factor)} {name}".rstrip()


def figure(value: float, unit: str, digits: int = 4, scale: float = 0.0) -> str:
    """As `number`, in readable units and with the unit's name."""
    name, factor = readable(unit)
    return f"{number(value * factor, digits, scale * factor)} {name}".rstrip()


def percent(share: float) -> str:
    """A change as a reader expects it: with its sign."""
    return f"{100.0 * share:+.1f} %" if math.isfinite(share) else DASH


def headline(result: Result) -> str:
    """The result in one sentence."""
    o = result.objective
    if result.status in (Status.INFEASIBLE, Status.FAILED):
        return f"{result.message[:1].upper()}{result.message[1:]}." if result.message else "No design was found."
    if o is None:
        return "The design as given, evaluated; nothing was to be minimised."
    name = o.name[:1].upper() + o.name[1:]
    if not changed(result):
        return f"{name} of the design as given: {figure(o.value, o.unit)}."
    if abs(o.reduction) < UNFELT:
        return f"{name} stays at {figure(o.initial, o.unit)}, {_proven(result.certificate)}."
    if math.isinf(o.initial):
        found = f"{name} is {figure(o.value, o.unit)}, {_proven(result.certificate)}"
        return f"{found}; the design as given stands on a resonance."
    change = percent(-o.reduction)
    given, decided = figure(o.initial, o.unit), figure(o.value, o.unit, scale=o.initial)
    sentence = f"{name} falls from {given} to {decided}"
    if o.value > o.initial:
        why = ", which breaks a limit," if breaks_a_limit(result.problem, result.initial) else ""
        sentence = f"{name} goes from {given}{why} to {decided}"
    return f"{sentence} ({change}), {_proven(result.certificate)}."


def _proven(certificate: Certificate | None) -> str:
    if certificate is None:
        return "not proven"
    words = {
        "global": "the proven optimum",
        "global within gap": f"proven to within {gap_text(certificate)} of the optimum",
        "local": "a local optimum",
    }
    return words.get(str(certificate.kind), "not proven")


def gap_text(certificate: Certificate) -> str:
    """The gap in percent, to two figures."""
    return f"{trimmed(100.0 * max(certificate.gap, 0.0), 2)} %"


def explained(result: Result) -> str:
    """The certificate in two sentences."""
    c, o = result.certificate, result.objective
    if result.status is Status.INFEASIBLE and result.problem.phasing is not None:
        return "Every star and firing order allowed was ruled out; what they conflict with is named above."
    if result.status is Status.INFEASIBLE:
        return (
            "The cone solver proved that the limits cannot be met together. "
            "Each limit that is named is needed for the contradiction: without it, the others named can be met."
        )
    if c is None or o is None:
        return "Nothing was decided, so there is nothing to prove."
    if c.kind is Proof.LOCAL:
        return (
            f"The best of the local optima found ({c.method}), with {figure(o.value, o.unit, 6)}. "
            f"The optimality conditions, taken anew, hold with a residual of {c.kkt_residual:.1e}; "
            f"that nothing better exists is proven only down to {figure(c.lower_bound, o.unit, 6)}."
        )
    origin = "was not taken from the solver but computed from the exact model"
    if "SCIP" in c.method:
        origin = "is SCIP's dual bound less its tolerances, or that of dual rows where it is better"
    return (
        f"No design within the bounds and limits has less than {figure(c.lower_bound, o.unit, 6)}; "
        f"this one has {figure(o.value, o.unit, 6)}, a gap of {gap_text(c)} (proof: {c.kind}). "
        f"The bound {origin} ({c.method}), "
        f"and the optimality conditions hold with a residual of {c.kkt_residual:.1e}."
    )


def is_nothing(decision: DecisionValue) -> bool:
    """Whether a decided size is none, so that its angle means nothing."""
    return abs(decision.value) <= 1e-5 * max(abs(decision.lower), abs(decision.upper))
