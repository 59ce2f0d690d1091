"""Namespaces of maths functions for formulas that work with NumPy numbers and with CasADi symbols.

A formula takes a namespace `lib`, calls `lib.sin` or `lib.matrix`, and combines results by `@`, `*`, `+` and `.T`.
Functions of `np` on symbols may be wrong without an error. CasADi is imported at first use.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Maths:
    """Functions that a formula may call: sine, cosine, and a matrix from rows of scalars."""

    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    matrix: Callable[[Sequence[Sequence[Any]]], Any]


NUMBERS = Maths(np.sin, np.cos, lambda rows: np.array(rows, dtype=float))


@cache
def symbols() -> Maths:
    """Return the namespace for CasADi's SX, MX and DM."""
    import casadi as ca

    return Maths(ca.sin, ca.cos, lambda rows: ca.vertcat(*(ca.horzcat(*row) for row in rows)))
