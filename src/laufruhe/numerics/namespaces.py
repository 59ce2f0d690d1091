"""Namespaces of maths functions for formulas that work with NumPy numbers and with CasADi symbols.

A formula takes a namespace `lib`, calls `lib.sin` or `lib.matrix`, and combines results by `@`, `*`, `+` and `.T`.
Functions of `np` on symbols may be wrong without an error. CasADi is imported at first use.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, Protocol

import numpy as np


class Maths(Protocol):
    """Functions that a formula may call."""

    def sin(self, x: Any, /) -> Any:
        """Return the sine."""

    def cos(self, x: Any, /) -> Any:
        """Return the cosine."""

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
    """Return the namespace for CasADi's SX, MX and DM."""
    import casadi as ca

    class Symbols:
        sin = staticmethod(ca.sin)
        cos = staticmethod(ca.cos)

        @staticmethod
        def matrix(rows: Sequence[Sequence[Any]], /) -> Any:
            return ca.vertcat(*(ca.horzcat(*row) for row in rows))

    namespace: Maths = Symbols()
    return namespace
