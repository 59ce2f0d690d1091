"""Collect constraints and epigraph variables of a smooth program."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import casadi as ca

from laufruhe.problem.measure import Side

Slope: TypeAlias = tuple[Side, float] | None
"""Side of a limit, and the derivative of the constraint's bound by it."""


@dataclass
class ConstraintCollector:
    """Collected constraints, each scaled to size one, and epigraph variables for largest values.

    Attributes
    ----------
    slopes
        Derivatives of each constraint's lower and upper bound by the side of the limit that it comes from.
    heads
        Epigraph variables, each with the expression of its start value (E22).
    floors
        Lower bounds of the epigraph variables.
    """

    expressions: list[Any] = field(default_factory=list)
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    slopes: list[tuple[Slope, Slope]] = field(default_factory=list)
    heads: list[tuple[Any, Any]] = field(default_factory=list)
    floors: list[float] = field(default_factory=list)

    def add(
        self, expression: Any, lower: float, upper: float, name: str, minimum: Slope = None, maximum: Slope = None
    ) -> None:
        """Add the constraint lower <= expression <= upper for every entry of an expression, a scalar or a column.

        Shadow prices of the sides `minimum` and `maximum` follow from multipliers of the lower and upper bound.
        """
        expression = ca.MX(expression)
        count = expression.numel()
        self.expressions.append(expression.reshape((count, 1)))
        self.lower += [lower] * count
        self.upper += [upper] * count
        self.names += [name] * count
        self.slopes += [(minimum, maximum)] * count

    def named(self, name: str) -> MeasureCollector:
        """Return a collector to which a norm adds its variables and constraints, under the name of its measure."""
        return MeasureCollector(self, name)


@dataclass(frozen=True)
class MeasureCollector:
    """Collector for variables and constraints of one measure."""

    into: ConstraintCollector
    name: str

    def head(self, value: Any, lower: float = 0.0) -> Any:
        """Return new epigraph variables (upper bounds to minimise), at least `lower`; `value` is the start (E22)."""
        variable = ca.MX.sym(f"head{len(self.into.heads)}", value.numel())
        self.into.heads.append((variable, value))
        self.into.floors += [lower] * value.numel()
        return variable

    def free(self, value: Any) -> Any:
        """Add a row of variables without bounds, and return their symbols; `value` is the start."""
        return self.head(value.T, -math.inf).T

    def hold(self, expression: Any) -> None:
        """Constrain every entry of an expression to at most zero."""
        self.into.add(expression, -math.inf, 0.0, self.name)
