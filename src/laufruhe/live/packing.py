"""Signals of a live model as JSON: words as they are, numbers as one deflated block of float64."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from laufruhe.live.signals import Bends, PointSignal, Signal, Waves
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


def packed(signal: Signal, block: Block) -> dict[str, Any]:
    """A signal whose numbers stand in the block."""
    return {
        "name": signal.name,
        "places": signal.places,
        "base": signal.base,
        "samples": signal.samples,
        "adds": signal.adds,
        **with_unit(signal.unit),
        "points": [_point(point, block) for point in signal.points],
    }


def _point(point: PointSignal, block: Block) -> dict[str, Any]:
    return {
        "share": point.share,
        "series": _waves(point.series, block),
        "bends": None if point.bends is None else _bends(point.bends, block),
        "slope": _waves(point.slope, block),
        "bent": [{"column": column, **_bends(bends, block)} for column, bends in point.bent],
    }


def _bends(bends: Bends, block: Block) -> dict[str, Any]:
    return {
        "smooth": _waves(bends.smooth, block),
        "corners": block.add(bends.corners),
        "pieces": block.add(bends.pieces),
        "at": block.add(bends.at),
    }


def _waves(waves: Waves, block: Block) -> dict[str, Any]:
    return {"orders": block.add(waves.orders), "coefficients": block.add(waves.coefficients)}
