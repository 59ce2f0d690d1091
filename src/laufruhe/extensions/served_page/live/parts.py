"""Parts of a live model, and its JSON (docs/how-to/live-page.md)."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from laufruhe.extensions.served_page.live.saving import NOT_SAVED, Saved
from laufruhe.extensions.served_page.live.signals import Signal
from laufruhe.solvers.conclusion import FEASIBILITY_TOL
from laufruhe.units import readable

VERSION = 1
MAX_MB = 2.0
"""Largest size of the compressed numbers of a page."""


@dataclass(frozen=True)
class Slider:
    """An open number that loads are affine in, with the bounds of its size and of an open angle [rad].

    Attributes
    ----------
    column, width
        First column in the decision vector, and 1 for a real number or 2 for size and angle.
    angle
        Name of the angle in results.
    shown, factor
        Unit of the file, and the factor from an SI value to this unit.
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
    refinement
        Factor on the number of steps at which the norm is taken.
    signal
        Index of its signal; None for a constant.
    sides
        Sense of each side of a limit, "at most" or "at least", and its bound [SI].
    value
        Value of a constant; value in the decided design if `followed` is False.
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


@dataclass(frozen=True, eq=False)
class LiveModel:
    """A problem as a live page shows it, with the names of its operating points and the turns in a cycle.

    Attributes
    ----------
    curves
        Title and index of the signal of each drawn curve.
    designs
        Decision vector `x` and `measured` values of every measure by the exact model, None if it does not move: of the
        given design, decided design if different, and one between the bounds for the page's self-check.
    reference
        Design for comparison; None if a server provides it.
    without_slider
        Names of open numbers and measures that do not follow the sliders, with reasons.
    why_not
        Reason why the page has no sliders; empty if it has sliders.
    """

    name: str
    title: str
    file: str
    points: tuple[str, ...]
    turns: int
    sliders: tuple[Slider, ...] = ()
    signals: tuple[Signal, ...] = ()
    curves: tuple[Mapping[str, Any], ...] = ()
    measures: tuple[DisplayedMeasure, ...] = ()
    designs: Mapping[str, Any] = field(default_factory=dict)
    objective: str = ""
    unit: str = ""
    reference: Mapping[str, Any] | None = None
    without_slider: tuple[tuple[str, str], ...] = ()
    save: Saved = NOT_SAVED
    why_not: str = ""

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences about numbers that do not follow sliders."""
        reasons = dict.fromkeys(why for _, why in self.without_slider)
        names = {why: ", ".join(name for name, reason in self.without_slider if reason == why) for why in reasons}
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
        as_they_are = ("name", "title", "file", "points", "turns", "sliders", "curves", "designs", "reference", "save")
        plain = {
            "version": VERSION,
            # the rule of `is_met`
            "tolerance": FEASIBILITY_TOL,
            **{key: getattr(self, key) for key in as_they_are},
            "signals": signals,
            "measures": [
                {**asdict(entry), "value": or_none(entry.value), **with_unit(entry.unit)} for entry in self.measures
            ],
            "objective": {"name": self.objective, **with_unit(self.unit)},
            "unmoved": [{"name": name, "why": why} for name, why in self.without_slider],
            "whyNot": self.why_not,
            "data": data,
        }
        return json.dumps(plain, ensure_ascii=False, allow_nan=False, default=asdict).replace("<", "\\u003c")


def or_none(value: float | None) -> float | None:
    """Return the number, or None if it is not finite."""
    return None if value is None or not np.isfinite(value) else value


class PackedBlock:
    """Concatenated arrays, each addressed by offset and shape."""

    def __init__(self) -> None:
        self._parts: list[np.ndarray] = []
        self._length = 0

    def add(self, values: ArrayLike) -> list[Any]:
        """Append an array and return its offset and shape; a complex array gets a last axis of two."""
        array = np.asarray(values)
        if np.iscomplexobj(array):
            array = np.stack([array.real, array.imag], axis=-1)
        flat = np.ascontiguousarray(array, dtype="<f8").ravel()
        self._parts.append(flat)
        self._length += len(flat)
        return [self._length - len(flat), list(array.shape)]

    def text(self) -> str:
        """Return all numbers deflated, as base64."""
        numbers = np.concatenate([np.zeros(0), *self._parts]).astype("<f8")
        return base64.b64encode(zlib.compress(numbers.tobytes(), 6)).decode("ascii")


def with_unit(unit: str) -> dict[str, Any]:
    """Return the SI unit, the readable unit and its factor."""
    name, factor = readable(unit)
    return {"unit": unit, "shown": name, "factor": factor}


def pack_part(part: Any, block: PackedBlock) -> Any:
    """Return a part of a signal as JSON data, field by field; its numbers go into the packed block."""
    if isinstance(part, np.ndarray):
        return block.add(part)
    if isinstance(part, tuple):
        return [pack_part(entry, block) for entry in part]
    if not is_dataclass(part):
        return part
    return {entry.name: pack_part(getattr(part, entry.name), block) for entry in fields(part)}
