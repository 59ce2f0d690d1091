"""The maths namespaces that generic kernels take: NumPy for numbers, CasADi for symbols.

A kernel calls `lib.sin`, `lib.matrix` and the like and works by `@`, `*`, `+` and `.T` on
what they return, so that one formula serves both. `np.*` on symbols is wrong without an
error in places, and CasADi is imported when first asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, Protocol

import numpy as np


class Maths(Protocol):
    """Functions that a kernel may call."""

    def sin(self, x: Any, /) -> Any:
        """Sine."""

    def cos(self, x: Any, /) -> Any:
        """Cosine."""

    def matrix(self, rows: Sequence[Sequence[Any]], /) -> Any:
        """Return a matrix from rows of scalars."""


class _Numbers:
    @staticmethod
    def sin(x: Any, /) -> Any:
        return np.sin(x)

    @staticmethod
    def cos(x: Any, /) -> Any:
        return np.cos(x)

    @staticmethod
    def matrix(rows: Sequence[Sequence[Any]], /) -> Any:
        return np.array(rows, dtype=float)


NUMBERS: Maths = _Numbers()


@cache
def symbols() -> Maths:
    """Return the namespace of CasADi's SX, MX and DM."""
    import casadi as ca

    class Symbols:
        sin = staticmethod(ca.sin)
        cos = staticmethod(ca.cos)

        @staticmethod
        def matrix(rows: Sequence[Sequence[Any]], /) -> Any:
            return ca.vertcat(*(ca.horzcat(*row) for row in rows))

    found: Maths = Symbols()
    return found
