"""Where one decision may lie, and the least value a linear function takes there (P4)."""

from __future__ import annotations

import cmath
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.problem.problem import UnbalanceDecision

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Domain:
    """Columns of the decision vector and the convex set they lie in.

    Attributes
    ----------
    decision
        The unbalance decided on.
    start
        Index of its first column.
    """

    decision: UnbalanceDecision
    start: int

    @property
    def width(self) -> int:
        """One real number with the angle fixed, two for a complex one."""
        return 1 if self.decision.fixed_angle else 2

    @property
    def columns(self) -> slice:
        """In the decision vector."""
        return slice(self.start, self.start + self.width)

    @property
    def scale(self) -> float:
        """Largest size."""
        return max(abs(self.decision.lower), abs(self.decision.upper)) or 1.0

    @property
    def directions(self) -> tuple[complex, ...]:
        """Complex decision per unit of each column (C4)."""
        return (cmath.exp(1j * self.decision.angle[0]),) if self.width == 1 else (1.0, 1.0j)

    @property
    def edges(self) -> Array:
        """Unit vectors along the two sides of a sector, shape (2, 2); none for a disc."""
        if self.width == 1 or self.decision.free_angle:
            return np.zeros((0, 2))
        low, high = self.decision.angle
        return np.array([[np.cos(low), np.sin(low)], [np.cos(high), np.sin(high)]])

    def complex_value(self, x: Array) -> complex:
        """The decision u from the decision vector."""
        return complex(sum(part * d for part, d in zip(x[self.columns], self.directions, strict=True)))

    def columns_of(self, u: complex) -> Array:
        """The columns of a complex decision."""
        if self.width == 1:
            return np.array([(u * self.directions[0].conjugate()).real])
        return np.array([u.real, u.imag])

    def least(self, gradient: Array) -> float:
        """min g . x over the set, in closed form: the negative support function of -g (P4)."""
        g = gradient[self.columns]
        if self.width == 1:
            return float(min(g[0] * self.decision.lower, g[0] * self.decision.upper))
        if self._inside_cone(-g):
            return -self.decision.upper * float(np.hypot(*g))
        return min(0.0, self.decision.upper * float((self.edges @ g).min()))

    def project(self, x: Array) -> Array:
        """The nearest point of the set to the columns of x."""
        v = x[self.columns]
        if self.width == 1:
            return np.clip(v, self.decision.lower, self.decision.upper)
        if not self._inside_cone(v):
            along = np.maximum(self.edges @ v, 0.0)
            best = int(np.argmax(along))
            v = along[best] * self.edges[best]
        size = float(np.hypot(*v))
        return v * (self.decision.upper / size) if size > self.decision.upper else v

    def _inside_cone(self, v: Array) -> bool:
        edges = self.edges
        if not len(edges):
            return True
        (ax, ay), (bx, by) = edges
        return bool(ax * v[1] - ay * v[0] >= 0.0 and bx * v[1] - by * v[0] <= 0.0)


def domains_of(decisions: tuple[UnbalanceDecision, ...]) -> tuple[Domain, ...]:
    """Domains in the order of the decisions, their columns side by side."""
    out: list[Domain] = []
    start = 0
    for decision in decisions:
        out.append(Domain(decision, start))
        start += out[-1].width
    return tuple(out)
