"""Constraints and largest values of a smooth program as they are collected."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import casadi as ca


@dataclass
class Gathered:
    """Constraints as they are collected, every one of size one, and the variables that stand for largest values.

    Attributes
    ----------
    slopes
        Of each constraint's side over the limit that it comes from.
    heads
        Further variables, each with where it stands at a given point (E22).
    floors
        Their least values.
    """

    expressions: list[Any] = field(default_factory=list)
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    slopes: list[float] = field(default_factory=list)
    heads: list[tuple[Any, Any]] = field(default_factory=list)
    floors: list[float] = field(default_factory=list)

    def add(self, expression: Any, lower: float, upper: float, name: str, slope: float = 0.0) -> None:
        """One constraint, or a column of them."""
        expression = ca.MX(expression)
        count = expression.numel()
        self.expressions.append(expression.reshape((count, 1)))
        self.lower += [lower] * count
        self.upper += [upper] * count
        self.names += [name] * count
        self.slopes += [slope] * count

    def named(self, name: str, symbol: Any = ca.MX) -> Named:
        """What a norm adds to, under the name of its measure."""
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
        """Every entry at most zero."""
        self.into.add(expression, -math.inf, 0.0, self.name)
