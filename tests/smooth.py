"""Programs that evaluate smooth forms of norms."""

from __future__ import annotations

from typing import Any

import casadi as ca

from laufruhe.load_models.uneven_model import UnevenModel
from laufruhe.problem.measure import Measure


class AtItsValues:
    """Program whose variables are their start values; it keeps the expressions that it holds."""

    def __init__(self) -> None:
        self.held: list[Any] = []
        self.has_free = False

    def head(self, value: Any) -> Any:
        """Return one more variable."""
        return value

    def free(self, value: Any) -> Any:
        """Return as many variables as the value has numbers."""
        self.has_free = True
        return value

    def hold(self, expression: Any) -> None:
        """Keep an expression."""
        self.held.append(expression)


class WithVariables:
    """Program whose variables are symbols of their own."""

    def __init__(self) -> None:
        self.held: list[Any] = []
        self.variables: list[Any] = []

    def head(self, value: Any) -> Any:
        """Return one more variable."""
        return self.free(value)

    def free(self, value: Any) -> Any:
        """Return as many variables as the value has numbers."""
        self.variables.append(ca.SX.sym(f"v{len(self.variables)}", *value.shape))
        return self.variables[-1]

    def hold(self, expression: Any) -> None:
        """Keep an expression."""
        self.held.append(ca.reshape(expression, -1, 1))


def smooth_value(model: UnevenModel, measure: Measure, share: float) -> Any:
    """Return the value of a measure in a smooth program, softened by a share of one."""
    rows, grid = model.rows(measure)
    program = AtItsValues()
    value = measure.norm.smooth_expression(program, grid, rows, 1.0, share)
    for expression in program.held:
        assert float(ca.mmax(expression)) <= 1e-9 * float(value)
    return value
