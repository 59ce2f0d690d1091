"""Attainable values of conflicting limits, each with the other limits met, and the designs that attain them."""

from __future__ import annotations

import math

from laufruhe.present.numbers import DASH, figure, share, with_unit
from laufruhe.present.tables import Table
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import AttainableLimit, DecisionValue, NearestDesign, relevant_decisions

NOTE = "Each column breaks the limit in its heading; none is an answer."


def tables(result: Result) -> list[Table]:
    """Return the designs nearest to each limit, a row per decision."""
    designs: list[tuple[str, AttainableLimit | NearestDesign]] = [
        (f"nearest to '{design.name}'", design) for design in result.reached if design.decisions
    ]
    designs += [("nearest to all limits", result.nearest)] if result.nearest is not None else []
    decisions_by_design = [
        {decision.name: decision for decision in relevant_decisions(design.decisions)} for _, design in designs
    ]
    names = dict.fromkeys(name for decisions in decisions_by_design for name in decisions)
    first = ("value reached", *(figure(design.value, design.unit) for _, design in designs))
    rows = tuple((name, *(_value(decisions.get(name)) for decisions in decisions_by_design)) for name in names)
    head = ("", *(title for title, _ in designs))
    return [
        Table(head, (first, *rows) if names else (), title="Attainable values of the limits", note=NOTE, file="reach")
    ]


def _value(decision: DecisionValue | None) -> str:
    if decision is None:
        return DASH
    return figure(decision.value, decision.unit, scale=max(abs(decision.lower), abs(decision.upper)))


def sentences(result: Result) -> list[str]:
    """Return a sentence per limit, and one about the nearest design."""
    lead = "With the other limits met, " if len(result.problem.limits) > 1 else ""
    texts = [_sentence(limit, lead) for limit in result.reached]
    return texts if result.nearest is None else [*texts, _nearest(result.nearest)]


def _sentence(limit: AttainableLimit, lead: str) -> str:
    if limit.why and math.isfinite(limit.value):
        value_text, required = figure(limit.value, limit.unit), f"{limit.side} {with_unit(limit.limit, limit.unit)}"
        return f"'{limit.name}' stays at {value_text}: {limit.why}; {required} is required."
    if limit.why:
        return f"The range of '{limit.name}' is not known: {limit.why}."
    minimum, beyond = ("smallest", "lower") if limit.side == "at most" else ("largest", "higher")
    value, bound = figure(limit.value, limit.unit), figure(limit.bound, limit.unit)
    proof = Proof.GLOBAL if value == bound else limit.proof
    words = {
        Proof.GLOBAL: f"the {minimum} value of '{limit.name}' is {value}, which is proven",
        Proof.WITHIN_GAP: f"the {minimum} value found of '{limit.name}' is {value}; none is {beyond} than {bound}",
    }
    bound_text = f"; no design is {beyond} than {bound}" if limit.bound > 0.0 else " without a proof"
    text_of_proof = words.get(
        proof, f"the {minimum} value found of '{limit.name}' is {value}, a local optimum{bound_text}"
    )
    ended = " Its search ended at the time limit; raise it." if limit.ended else ""
    text = f"{lead}{text_of_proof}; {limit.side} {with_unit(limit.limit, limit.unit)} is required.{ended}"
    return text[:1].upper() + text[1:]


def _nearest(design: NearestDesign) -> str:
    value, required = figure(design.value, design.unit), with_unit(design.limit, design.unit)
    beyond = f", {share(design.violation, 3)} beyond" if design.limit else ""
    return f"The nearest design found breaks '{design.name}' most: {value}; required: {design.side} {required}{beyond}."
