"""Smooth forms of norms, taken as functions of what they are made of."""

from __future__ import annotations

from typing import Any

import casadi as ca

from laufruhe.load_models.uneven_model import UnevenModel
from laufruhe.problem.measure import Measure


class AtItsValues:
    """A program whose variables are the values that they start from; what it holds is kept."""

    def __init__(self) -> None:
        self.held: list[Any] = []
        self.has_free = False

    def head(self, value: Any) -> Any:
        """The value itself."""
        return value

    def free(self, value: Any) -> Any:
        """The value itself, from which a solver goes on to a better one."""
        self.has_free = True
        return value

    def hold(self, expression: Any) -> None:
        """Nothing but kept."""
        self.held.append(expression)


class WithVariables:
    """A program whose variables are symbols of their own."""

    def __init__(self) -> None:
        self.held: list[Any] = []
        self.variables: list[Any] = []

    def head(self, value: Any) -> Any:
        """One more variable."""
        return self.free(value)

    def free(self, value: Any) -> Any:
        """As many as the value has numbers."""
        self.variables.append(ca.SX.sym(f"v{len(self.variables)}", *value.shape))
        return self.variables[-1]

    def hold(self, expression: Any) -> None:
        """Nothing but kept."""
        self.held.append(ca.reshape(expression, -1, 1))


def smooth_value(model: UnevenModel, measure: Measure, share: float) -> Any:
    """What a program would minimise of a measure, softened by this much of one."""
    rows, grid = model.rows(measure)
    program = AtItsValues()
    value = measure.norm.smooth_expression(program, grid, rows, 1.0, share)
    for expression in program.held:
        assert float(ca.mmax(expression)) <= 1e-9 * float(value)
    return value
