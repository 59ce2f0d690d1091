"""Constraints of a smooth program as they are collected."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass
class Gathered:
    """Constraints as they are collected, every one of size one."""

    expressions: list[Any] = field(default_factory=list)
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    slopes: list[float] = field(default_factory=list)

    def add(self, expression: Any, lower: float, upper: float, name: str, slope: float = 0.0) -> None:
        """One constraint, or a column of them; `slope` is that of its side over the limit it comes from."""
        count = expression.numel()
        self.expressions.append(expression.reshape((count, 1)))
        self.lower += [lower] * count
        self.upper += [upper] * count
        self.names += [name] * count
        self.slopes += [slope] * count
