"""Without a design: what the limits that conflict can reach, each while the others hold, and with which numbers."""

from __future__ import annotations

import math

from laufruhe.present.numbers import DASH, figure, trimmed, with_unit
from laufruhe.present.tables import Table
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import DecisionValue, Nearest, Reached, meaningful

NOTE = "None of these designs is an answer: each breaks the limit that it is named by."


def tables(result: Result) -> list[Table]:
    """A row a decision, a column a design: those of each limit, and the one that breaks limits least."""
    designs: list[tuple[str, Reached | Nearest]] = [
        (f"nearest to '{found.name}'", found) for found in result.reached if found.decisions
    ]
    designs += [("nearest to all limits", result.nearest)] if result.nearest is not None else []
    known = [{decision.name: decision for decision in meaningful(found.decisions)} for _, found in designs]
    names = dict.fromkeys(name for each in known for name in each)
    first = ("value reached", *(figure(found.value, found.unit) for _, found in designs))
    rows = tuple((name, *(_value(each.get(name)) for each in known)) for name in names)
    head = ("", *(title for title, _ in designs))
    return [Table(head, (first, *rows) if names else (), title="What the limits can reach", note=NOTE, file="reach")]


def _value(decision: DecisionValue | None) -> str:
    if decision is None:
        return DASH
    return figure(decision.value, decision.unit, scale=max(abs(decision.lower), abs(decision.upper)))


def sentences(result: Result) -> list[str]:
    """Of each limit, and of the nearest design."""
    held = "With the other limits held, " if len(result.problem.limits) > 1 else ""
    told = [_sentence(found, held) for found in result.reached]
    return told if result.nearest is None else [*told, _nearest(result.nearest)]


def _sentence(found: Reached, held: str) -> str:
    if found.why and math.isfinite(found.value):
        stands, asked = figure(found.value, found.unit), f"{found.side} {with_unit(found.limit, found.unit)}"
        return f"'{found.name}' stays at {stands}: {found.why}; {asked} is asked."
    if found.why:
        return f"What '{found.name}' can reach is not told: {found.why}."
    least, beyond = ("least", "lower") if found.side == "at most" else ("largest", "higher")
    value, bound = figure(found.value, found.unit), figure(found.bound, found.unit)
    proof = Proof.GLOBAL if value == bound else found.proof
    words = {
        Proof.GLOBAL: f"the {least} that '{found.name}' can reach is {value}, which is proven",
        Proof.WITHIN_GAP: f"the {least} found of '{found.name}' is {value}, and none {beyond} than {bound} is proven",
    }
    known = f"; no design is {beyond} than {bound}" if found.bound > 0.0 else ", and nothing is proven of it"
    said = words.get(proof, f"the {least} found of '{found.name}' is {value}, a local optimum{known}")
    ended = " Its search ended for want of time; give more by a time limit." if found.ended else ""
    text = f"{held}{said}; {found.side} {with_unit(found.limit, found.unit)} is asked.{ended}"
    return text[:1].upper() + text[1:]


def _nearest(found: Nearest) -> str:
    value, asked = figure(found.value, found.unit), with_unit(found.limit, found.unit)
    share = f", {trimmed(100.0 * found.excess, 3)} % beyond" if found.limit else ""
    return f"The nearest design found breaks '{found.name}' most: {value} where {found.side} {asked} is asked{share}."
