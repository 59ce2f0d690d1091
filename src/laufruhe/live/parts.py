"""Parts of a live model, and its JSON (docs/how-to/live-page.md)."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from laufruhe.live.packing import PackedBlock, pack_part, with_unit
from laufruhe.live.saving import NOT_SAVED, Saved
from laufruhe.live.signals import Signal
from laufruhe.present.numbers import share
from laufruhe.prove.certificate import Proof

VERSION = 1
MAX_MB = 2.0
"""Largest size of the compressed numbers of a page."""


@dataclass(frozen=True)
class Slider:
    """An open number that loads are affine in.

    Attributes
    ----------
    name, unit
        Name in results, and SI unit.
    column, width
        First column in the decision vector, and 1 for a real number or 2 for size and angle.
    lower, upper
        Bounds of the size.
    angles
        Bounds of the angle [rad], where that is open.
    angle
        Name of the angle in results.
    shown, factor
        The unit of the file, and its factor on an SI value.
    """

    name: str
    unit: str
    column: int
    width: int
    lower: float
    upper: float
    angles: tuple[float, float]
    angle: str
    shown: str
    factor: float


@dataclass(frozen=True)
class DisplayedMeasure:
    """A measure that follows the sliders, or a constant.

    Attributes
    ----------
    role
        `objective` for a term of it, `rank` for one of a later objective, or `limit`.
    signal
        Number of its signal; None of what stays as it is.
    norm, refinement
        Name, and times as many steps.
    weight
        Weight in the objective.
    sides
        Sense and edge of a limit, "at most" or "at least" [SI].
    value
        Value of a constant.
    followed
        True if known for every design; else `value` is that of the decided design.
    """

    role: str
    name: str
    unit: str
    norm: str
    refinement: int
    signal: int | None
    weight: float = 1.0
    sides: tuple[tuple[str, float], ...] = ()
    value: float = 0.0
    followed: bool = True


@dataclass(frozen=True)
class Curve:
    """A drawn signal."""

    title: str
    signal: int


@dataclass(frozen=True)
class LiveDesign:
    """A decision vector with every measure by the exact model; None for constants."""

    name: str
    x: tuple[float, ...]
    measured: tuple[float | None, ...]


@dataclass(frozen=True)
class Reference:
    """A design for comparison: its objective [SI] and its name."""

    value: float
    name: str
    is_proven: bool

    @classmethod
    def from_proof(cls, value: float, proof: Proof, gap: float) -> Reference:
        """Return the reference of a design with this proof."""
        if proof is Proof.GLOBAL:
            return cls(value, "the proven optimum", True)
        if proof is Proof.WITHIN_GAP:
            return cls(value, f"the best design found (gap {share(gap)})", False)
        return cls(value, "the best design found (a local optimum)", False)


@dataclass(frozen=True, eq=False)
class LiveModel:
    """A problem as a live page shows it.

    Attributes
    ----------
    points
        Names of the operating points.
    turns
        Turns of the crank in a cycle.
    designs
        Given design, decided design if different, and one between the bounds for the page's self-check.
    reference
        Design for comparison; None if a server provides it.
    unmoved
        Names that do not follow the sliders, with reasons.
    why_not
        Why there are no sliders; empty where there are.
    """

    name: str
    title: str
    file: str
    points: tuple[str, ...]
    turns: int
    sliders: tuple[Slider, ...] = ()
    signals: tuple[Signal, ...] = ()
    curves: tuple[Curve, ...] = ()
    measures: tuple[DisplayedMeasure, ...] = ()
    designs: tuple[LiveDesign, ...] = ()
    objective: str = ""
    unit: str = ""
    reference: Reference | None = None
    unmoved: tuple[tuple[str, str], ...] = ()
    save: Saved = NOT_SAVED
    why_not: str = ""

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about numbers that do not follow sliders."""
        reasons = dict.fromkeys(why for _, why in self.unmoved)
        names = {why: ", ".join(name for name, reason in self.unmoved if reason == why) for why in reasons}
        return tuple(f"{names[why]}: {why}." for why in reasons)

    @property
    def too_large(self) -> str:
        """Reason why the model does not fit a page; empty if it does."""
        size = len(self._packed[1]) / 1e6
        if size <= MAX_MB:
            return ""
        return f"The loads of this problem take {size:.2g} MB; a page carries at most {MAX_MB:g} MB."

    @cached_property
    def _packed(self) -> tuple[list[dict[str, Any]], str]:
        block = PackedBlock()
        return [{**pack_part(signal, block), **with_unit(signal.unit)} for signal in self.signals], block.text()

    def as_json(self) -> str:
        """Return the argument of the page's `show`; safe inside an HTML element."""
        signals, data = self._packed
        as_they_are = ("name", "title", "file", "points", "turns", "sliders", "curves", "reference", "save")
        plain = {
            "version": VERSION,
            **{key: getattr(self, key) for key in as_they_are},
            "signals": signals,
            "measures": [
                {**asdict(entry), "value": _or_none(entry.value), **with_unit(entry.unit)} for entry in self.measures
            ],
            "designs": {
                entry.name: {"x": entry.x, "measured": [*map(_or_none, entry.measured)]} for entry in self.designs
            },
            "objective": {"name": self.objective, **with_unit(self.unit)},
            "unmoved": [{"name": name, "why": why} for name, why in self.unmoved],
            "whyNot": self.why_not,
            "data": data,
        }
        return json.dumps(plain, ensure_ascii=False, allow_nan=False, default=asdict).replace("<", "\\u003c")


def _or_none(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else value
