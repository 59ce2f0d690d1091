"""Claims of a page on the numbers that it shows. Every claim is made here; the page's scripts only render it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from laufruhe.present.measures import is_met
from laufruhe.present.numbers import figure, number
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import LimitValue

_MAX_NAMES = 2
"""Broken limits that a claim names before it counts the others."""


class ClaimKind(StrEnum):
    """Kind and strength of a claim."""

    PROVEN = "proven"
    """The whole problem was solved, and no design is better within the tolerance."""
    BEST = "found"
    """The whole problem was solved, and the design is the best that was found."""
    ESTIMATE = "estimate"
    """The whole problem, solved at few samples."""
    SIMPLIFIED = "held"
    """A simpler problem, solved at few samples."""
    INITIAL = "given"
    """The initial design; nothing was decided."""
    NO_DESIGN = "no design"


@dataclass(frozen=True)
class Simplification:
    """Phrases for fixed numbers ("these mounts") and neglected requirements while a slider moves; false without any."""

    fixed_parts: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.fixed_parts or self.left_out)

    @property
    def phrase(self) -> str:
        """Words that follow a number, with a blank before them."""
        fixed = f" for {join_phrases(self.fixed_parts)}" if self.fixed_parts else ""
        return f"{fixed} without {join_phrases(self.left_out)}" if self.left_out else fixed


COMPLETE = Simplification()


@dataclass(frozen=True)
class Claim:
    """Words about the displayed design: a number in the lead, and the claim about it.

    Attributes
    ----------
    position
        Number of the page settings that the claim is about; the page shows it for no other settings.
    value
        Objective of the design [SI]; None where there is no design.
    reference
        Name of the design for comparisons, "the proven optimum"; empty where the page draws another one.
    breaks
        Limits that the design breaks, in words; empty if it meets all known ones.
    is_last
        True if the solution for these settings is complete.
    """

    kind: ClaimKind
    position: int
    lead: str
    words: str
    value: float | None = None
    reference: str = ""
    breaks: str = ""
    is_last: bool = False


def breaks_words(limits: Iterable[LimitValue]) -> str:
    """Return the broken limits with value and bound, in words; empty if all are met."""
    broken = [limit for limit in limits if not is_met(limit)]
    words = [
        f"{limit.name} ({figure(limit.value, limit.unit)}, {limit.side} {figure(limit.limit, limit.unit)})"
        for limit in broken[:_MAX_NAMES]
    ]
    unnamed = len(broken) - _MAX_NAMES
    return f"breaks {', '.join(words)}{f' and {unnamed} more' if unnamed > 0 else ''}" if broken else ""


def preview_claim(
    position: int, problem: Problem, value: float, simpler: Simplification, limits: Iterable[LimitValue]
) -> Claim:
    """Return what the page states about a design while a slider moves, from its objective [SI] and all limits."""
    kind = ClaimKind.SIMPLIFIED if simpler else ClaimKind.ESTIMATE
    lead = f"Estimate {figure(value, problem.objective_unit or '')}"
    words = f"{problem.objective_name}{simpler.phrase}"
    return Claim(kind, position, lead, words, value, f"the estimate{simpler.phrase}", breaks_words(limits))


def initial_claim(position: int, problem: Problem, value: float | None, limits: Iterable[LimitValue]) -> Claim:
    """Return what the page states about the initial design, if no number follows sliders."""
    if value is None or not math.isfinite(value):
        words = "No objective" if value is None else "The initial design is on a resonance"
        return Claim(ClaimKind.INITIAL, position, "", words, breaks=breaks_words(limits))
    lead = figure(value, problem.objective_unit or "")
    words = f"{problem.objective_name} of the initial design"
    return Claim(ClaimKind.INITIAL, position, lead, words, value, "the initial design", breaks_words(limits))


def conflict_claim(
    position: int, names: Sequence[str], simpler: Simplification = COMPLETE, is_last: bool = False
) -> Claim:
    """Return the statement that no design meets these limits together; final if `is_last`."""
    names_text = join_phrases([f"'{name}'" for name in names])
    why = f"{names_text} contradict each other" if len(names) > 1 else f"{names_text} cannot be met within the bounds"
    lead = "No design exists:" if is_last else "No design found:"
    return Claim(ClaimKind.NO_DESIGN, position, lead, f"{why}{simpler.phrase}. Move one of the limits", is_last=is_last)


def settled_claim(position: int, result: Result) -> Claim:
    """Return what the page states about the proven optimum of the whole problem."""
    objective, certificate = result.objective, result.certificate
    if result.status is Status.INFEASIBLE and result.conflict:
        return conflict_claim(position, result.conflict, is_last=True)
    if not result.status.has_design or objective is None or certificate is None:
        return Claim(ClaimKind.NO_DESIGN, position, "", result.message or "No design was found.", is_last=True)
    value, breaks = figure(objective.value, objective.unit, 5), breaks_words(result.limits)
    minimum = f"no design has less than {figure(certificate.lower_bound, objective.unit, 5)}"
    is_proven = result.status is Status.OPTIMAL and not breaks
    # the page shows the drawing without extras
    reference = "" if result.problem.extras else "the proven optimum" if is_proven else "the best design found"
    kind, lead = (ClaimKind.PROVEN, "Optimum") if is_proven else (ClaimKind.BEST, "Best design found")
    if is_proven:
        words = f"{objective.name}, proven: {minimum}"
    elif certificate.kind is Proof.NONE or not certificate.is_useful:
        words = f"{objective.name}; no useful bound was found in the time given"
    else:
        local = ", a local optimum" if certificate.kind is Proof.LOCAL else ""
        words = f"{objective.name}; {minimum} (gap {number(100.0 * certificate.gap, 2)} %{local})"
    return Claim(kind, position, f"{lead} {value}", words, objective.value, reference, breaks, is_last=True)


def join_phrases(phrases: Sequence[str]) -> str:
    """Return phrases as one, with commas and "and" before the last."""
    *first, last = phrases
    return f"{', '.join(first)} and {last}" if first else last
