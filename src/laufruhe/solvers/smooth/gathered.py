"""Constraints and largest values of a smooth program as they are collected."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import casadi as ca

from laufruhe.problem.measure import Side

Slope: TypeAlias = tuple[Side, float] | None
"""A side of a limit, and the slope of a constraint's side over it."""


@dataclass
class Gathered:
    """Constraints as they are collected, every one of size one, and the variables that stand for largest values.

    Attributes
    ----------
    slopes
        Of each constraint's lower and upper side over the side of the limit that it comes from.
    heads
        Further variables, each with where it stands at a given point (E22).
    floors
        Their least values.
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
        """Add a scalar or column constraint, and the limits that its lower and upper sides give a price to."""
        expression = ca.MX(expression)
        count = expression.numel()
        self.expressions.append(expression.reshape((count, 1)))
        self.lower += [lower] * count
        self.upper += [upper] * count
        self.names += [name] * count
        self.slopes += [(minimum, maximum)] * count

    def named(self, name: str, symbol: Any = ca.MX) -> Named:
        """Return a collector that a norm adds its variables and constraints to, under the name of its measure."""
        return Named(self, name, symbol)


@dataclass(frozen=True)
class Named:
    """A `SmoothProgram` that norms add to."""

    into: Gathered
    name: str
    symbol: Any

    def head(self, value: Any) -> Any:
        """A variable for a largest value (E22)."""
        return self._added(value, 0.0)

    def free(self, value: Any) -> Any:
        """A row of variables without bounds."""
        return self._added(value.T, -math.inf).T

    def _added(self, value: Any, floor: float) -> Any:
        found = self.symbol.sym(f"head{len(self.into.heads)}", value.numel())
        self.into.heads.append((found, value))
        self.into.floors += [floor] * value.numel()
        return found

    def hold(self, expression: Any) -> None:
        """Constrain every entry of an expression to at most zero."""
        self.into.add(expression, -math.inf, 0.0, self.name)
