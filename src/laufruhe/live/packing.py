"""Signals of a live model as JSON: words as they are, numbers as one deflated block of float64."""

from __future__ import annotations

import base64
import zlib
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from laufruhe.units import readable


class Block:
    """Numbers one behind the other; each array is told by its place and its shape."""

    def __init__(self) -> None:
        self._parts: list[np.ndarray] = []
        self._length = 0

    def add(self, values: ArrayLike) -> list[Any]:
        """Place and shape of an array; a complex one has a last axis of two."""
        array = np.asarray(values)
        if np.iscomplexobj(array):
            array = np.stack([array.real, array.imag], axis=-1)
        flat = np.ascontiguousarray(array, dtype="<f8").ravel()
        self._parts.append(flat)
        self._length += len(flat)
        return [self._length - len(flat), list(array.shape)]

    def text(self) -> str:
        """All of them, deflated, as base64."""
        whole = np.concatenate([np.zeros(0), *self._parts]).astype("<f8")
        return base64.b64encode(zlib.compress(whole.tobytes(), 6)).decode("ascii")


def with_unit(unit: str) -> dict[str, Any]:
    """SI unit, the one that is shown, and its factor."""
    name, factor = readable(unit)
    return {"unit": unit, "shown": name, "factor": factor}


def packed(part: Any, block: Block) -> Any:
    """A part of a signal, field by field; its numbers stand in the block."""
    if isinstance(part, np.ndarray):
        return block.add(part)
    if isinstance(part, tuple):
        return [packed(one, block) for one in part]
    if not is_dataclass(part):
        return part
    return {field.name: packed(getattr(part, field.name), block) for field in fields(part)}
