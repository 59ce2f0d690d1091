"""Signals of a live model as JSON: words as they are, numbers as one deflated block of float64."""

from __future__ import annotations

import base64
import zlib
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from laufruhe.units import readable


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
    """Return a part of a signal field by field; its numbers are in the block."""
    if isinstance(part, np.ndarray):
        return block.add(part)
    if isinstance(part, tuple):
        return [pack_part(entry, block) for entry in part]
    if not is_dataclass(part):
        return part
    return {field.name: pack_part(getattr(part, field.name), block) for field in fields(part)}
