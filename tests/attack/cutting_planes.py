"""Least value of a convex problem by cutting planes: linear programs alone, with a lower bound and prices of limits.

Every norm of loads is a largest linear function, so a subgradient anywhere is a plane under it. The least of all planes
so far is a lower bound; the next point is the one nearest the best so far that promises a fixed part of what is left
(level method).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linprog

from attack.openings import Openings, Weight
from attack.plain_loads import number
from attack.plain_scene import Table, norm_and_channel, smallest_ball, terms_of

Plane = tuple[float, np.ndarray]
STEPS = {
    "mean": 8, "worst mean": 8, "rms": 8, "worst rms": 8, "rmq": 8, "worst rmq": 8, "maximum": 2, "peak to peak": 2,
}  # fmt: skip
LEVEL = 0.4


class Load:
    """A norm of rows that are affine in the vector."""

    def __init__(self, openings: Openings, term: Table, star: Table | None, order: tuple[int, ...] | None) -> None:
        self.norm, _ = norm_and_channel(term["quantity"])
        step = STEPS[self.norm]
        zero = np.zeros(openings.size)
        first = openings.scene(zero, star, order)
        self.at_zero = first.signal(term)[:, :, ::step]
        rows = [openings.scene(unit, star, order).signal(term)[:, :, ::step] for unit in np.eye(openings.size)]
        self.slopes = np.stack([r - self.at_zero for r in rows], axis=-1) if rows else self.at_zero[..., None][..., :0]
        weights = first.weights(term)
        self.share = weights / weights.sum()

    def planes(self, x: np.ndarray) -> list[Plane]:
        """Return the values and subgradients of which the largest counts."""
        rows = self.at_zero + self.slopes @ x
        if self.norm == "peak to peak":
            return [plane for k in np.flatnonzero(self.share) for plane in self._balls(rows[k], self.slopes[k])]
        length = np.linalg.norm(rows, axis=-1)
        along = rows / np.where(length > 0.0, length, 1.0)[..., None]
        if self.norm == "maximum":
            return [
                (float(length[k, j, n]), along[k, j, n] @ self.slopes[k, j, n])
                for k in np.flatnonzero(self.share)
                for j in range(length.shape[1])
                for n in [int(np.argmax(length[k, j]))]
            ]
        if self.norm == "worst mean":
            ways = np.einsum("kjnd,kjndq->kq", along, self.slopes) / (length.shape[1] * length.shape[2])
            return [(float(length[k].mean()), ways[k]) for k in np.flatnonzero(self.share)]
        if self.norm.startswith("worst"):
            power = {"worst rms": 2, "worst rmq": 4}[self.norm]
            values = (length**power).mean(axis=(1, 2)) ** (1.0 / power)
            ways = np.einsum("kjn,kjnd,kjndq->kq", length ** (power - 2), rows, self.slopes)
            ways /= (length.shape[1] * length.shape[2] * np.where(values > 0.0, values, 1.0) ** (power - 1))[:, None]
            return [(float(values[k]), ways[k]) for k in np.flatnonzero(self.share)]
        weights = self.share[:, None, None] / (length.shape[1] * length.shape[2])
        if self.norm == "mean":
            return [
                (
                    float((weights * length).sum()),
                    np.einsum("kjn,kjnd,kjndq->q", weights + 0 * length, along, self.slopes),
                )
            ]
        if self.norm == "rmq":
            value = float((weights * length**4).sum()) ** 0.25
            slope = np.einsum("kjn,kjnd,kjndq->q", weights * length**2, rows, self.slopes)
            return [(value, slope / (value**3 or 1.0))]
        value = math.sqrt(float((weights * length**2).sum()))
        slope = np.einsum("kjn,kjnd,kjndq->q", weights + 0 * length, rows, self.slopes)
        return [(value, slope / (value or 1.0))]

    def _balls(self, rows: np.ndarray, slopes: np.ndarray) -> list[Plane]:
        planes = []
        for v, s in zip(rows, slopes, strict=True):
            value, active, pull = smallest_ball(v)
            planes.append((value, np.einsum("nd,ndq->q", pull, s[active])))
        return planes


class Mass:
    """Sum of the masses of some weights."""

    def __init__(self, openings: Openings, term: Table) -> None:
        self.openings = openings
        self.roles = {"counterweight mass": "c", "balancer mass": "b", "added mass": "cb"}[term["quantity"]]

    def planes(self, x: np.ndarray) -> list[Plane]:
        value, slope, at = 0.0, np.zeros(len(x)), 0
        for w, part in self.openings.parts(x):
            times = sum(1.0 / f.radius for f in self._led_by(w) if f.role in self.roles)
            span = slice(at, at + w.entries)
            if w.entries == 2:
                size = math.hypot(*part)
                value += times * w.maximum * size
                slope[span] += times * w.maximum * part / (size or 1.0)
            elif not w.follows:
                value += times * abs(w.unbalance(part))
                slope[span] += times * (w.maximum - w.minimum)
            at += w.entries
        return [(value, slope)]

    def _led_by(self, leader: Weight) -> list[Weight]:
        return [w for w in self.openings.weights if w is leader or (w.follows and w.follows[0] == leader.name)]


class Constant:
    """A measure that is the same for all unbalances."""

    def __init__(self, value: float, size: int) -> None:
        self.value, self.size = value, size

    def planes(self, x: np.ndarray) -> list[Plane]:
        return [(self.value, np.zeros(self.size))]


def function_of(openings: Openings, term: Table, star: Table | None, order: tuple[int, ...] | None) -> Any:
    norm, channel = norm_and_channel(term["quantity"])
    if norm:
        return Load(openings, term, star, order)
    if channel.endswith("mass"):
        return Mass(openings, term)
    return Constant(openings.scene(np.zeros(openings.size), star, order).measure(term), openings.size)


@dataclass(frozen=True)
class Optimum:
    """Best vector, its objective at the planes' samples, largest excess of a limit, bound, prices of the limits."""

    vector: np.ndarray
    value: float
    violation: float
    bound: float
    prices: tuple[float, ...]


class Program:
    """A problem in which unbalances alone are open; a star may be told.

    The excess of limits is charged with `charge` times the unit, which no price may exceed.
    """

    def __init__(self, openings: Openings, star: Table | None = None, order: tuple[int, ...] | None = None) -> None:
        self.openings = openings
        terms, limits = terms_of(openings.table), openings.table.get("constraints", [])
        self.factors = [t.get("weight", 1.0) for t in terms]
        self.terms = [function_of(openings, t, star, order) for t in terms]
        self.maximum = [number(c["max"]) for c in limits]
        self.limits = [function_of(openings, {**c, "quantity": c["limit"]}, star, order) for c in limits]

    def minimum(
        self,
        start: np.ndarray,
        accuracy: float = 2e-6,
        maximum: int = 250,
        charge: float = 1e3,
        target: float = math.inf,
    ) -> Optimum:
        """Return the least objective; what cannot be kept is broken as little as the charge makes it.

        Parameters
        ----------
        enough
            The search ends when no design under this value can be left.
        """
        value = sum(f * max(p[0] for p in t.planes(start)) for f, t in zip(self.factors, self.terms, strict=True))
        return _Search(self, value or 1.0, charge).run(start, accuracy, maximum, target / (value or 1.0))

    def minimum_violation(self, start: np.ndarray, accuracy: float = 1e-6, maximum: int = 250) -> Optimum:
        """Return the least largest excess of the limits as a share; a bound above zero proves that no design exists."""
        return _Search(self, 1.0, 1.0, only_limits=True).run(start, accuracy, maximum, 1e-6)


class _Search:
    """Planes so far, and linear programs of them. Columns: x, a height for every term, the excess, a radius."""

    def __init__(self, program: Program, unit: float, charge: float, only_limits: bool = False) -> None:
        self.p, self.unit, self.charge, self.only_limits = program, unit, charge, only_limits
        self.q = program.openings.size
        self.terms = [] if only_limits else list(zip(program.factors, program.terms, strict=True))
        self.rows: list[np.ndarray] = []
        self.rights: list[float] = []
        self.of_limit: list[int] = []
        self.columns = self.q + len(self.terms) + 2
        self._sets()

    def _sets(self) -> None:
        """Add the half planes around discs, and the sides of sectors."""
        at = 0
        for w, _ in self.p.openings.parts(np.zeros(self.q)):
            if w.entries == 2:
                angles = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
                for a in angles:
                    self._row(-1, {at: math.cos(a), at + 1: math.sin(a)}, 1.0)
                if w.sector:
                    low, high = w.sector
                    self._row(-1, {at: math.sin(low), at + 1: -math.cos(low)}, 0.0)
                    self._row(-1, {at: -math.sin(high), at + 1: math.cos(high)}, 0.0)
                    if high - low > math.pi - 1e-9:
                        continue
            at += w.entries

    def _row(self, limit: int, entries: dict[int, float] | np.ndarray, right: float) -> None:
        row = np.zeros(self.columns)
        if isinstance(entries, dict):
            for k, v in entries.items():
                row[k] = v
        else:
            row[: len(entries)] = entries
        self.rows.append(row)
        self.rights.append(right)
        self.of_limit.append(limit)

    def look(self, x: np.ndarray) -> tuple[float, float, float]:
        """Add planes at x; charged value, value, excess."""
        value = 0.0
        for k, (factor, term) in enumerate(self.terms):
            planes = term.planes(x)
            value += factor * max(p[0] for p in planes) / self.unit
            for height, slope in planes:
                row = np.zeros(self.columns)
                row[: self.q], row[self.q + k] = slope / self.unit, -1.0
                self._row(-1, row, float(slope @ x - height) / self.unit)
        violation = -1.0
        for j, (limit, maximum) in enumerate(zip(self.p.limits, self.p.maximum, strict=True)):
            for height, slope in limit.planes(x):
                violation = max(violation, height / maximum - 1.0)
                row = np.zeros(self.columns)
                row[: self.q], row[-2] = slope / maximum, -1.0
                self._row(j, row, 1.0 + float(slope @ x - height) / maximum)
        at = 0
        for w, part in self.p.openings.parts(x):
            size = math.hypot(*part) if w.entries == 2 else 0.0
            if size > 1.0 - 1e-3:
                self._row(-1, {at: part[0] / size, at + 1: part[1] / size}, 1.0)
            at += w.entries
        charged = violation if self.only_limits else value + self.charge * max(violation, 0.0)
        return charged, value * self.unit, violation

    @property
    def cost(self) -> np.ndarray:
        cost = np.zeros(self.columns)
        cost[self.q : self.q + len(self.terms)] = [factor for factor, _ in self.terms]
        cost[-2] = self.charge
        return cost

    def _solve(self, cost: np.ndarray, extra: Sequence[tuple[np.ndarray, float]] = ()) -> Any:
        rows = np.array(self.rows + [r for r, _ in extra])
        rights = np.array(self.rights + [b for _, b in extra])
        bounds = [*self.p.openings.box.tolist(), *[(0.0, None)] * len(self.terms)]
        bounds += [(-1.0 if self.only_limits else 0.0, None), (0.0, None)]
        return linprog(cost, A_ub=rows, b_ub=rights, bounds=bounds, method="highs")

    def run(self, start: np.ndarray, accuracy: float, maximum: int, target: float) -> Optimum:
        x = best = self.p.openings.nearest(start.copy())
        charged, value, violation = self.look(x)
        bound, prices = -math.inf, tuple(0.0 for _ in self.p.limits)
        for _ in range(maximum):
            under = self._solve(self.cost)
            if under.status == 0:
                bound = max(bound, float(under.fun))
                prices = self._prices(under)
            if charged - bound <= accuracy * max(abs(charged), 1e-3) or bound > target:
                break
            self._forget(under)
            ahead = self._nearest_below(best, bound + LEVEL * (charged - bound))
            if ahead is None and under.status != 0:
                break
            x = self.p.openings.nearest(ahead if ahead is not None else under.x[: self.q])
            now = self.look(x)
            if now[0] < charged:
                best, (charged, value, violation) = x, now
        scale = 1.0 if self.only_limits else self.unit
        return Optimum(best, value, violation, bound * scale, prices)

    def _forget(self, solved: Any) -> None:
        """Leave out planes that lay far under the others, where there are many."""
        if solved.status != 0 or len(self.rows) < 400:
            return
        slack = solved.ineqlin.residual
        keep = [k for k, s in enumerate(slack) if s <= np.median(slack) or k >= len(slack) - 60]
        self.rows, self.rights, self.of_limit = (
            [rows[k] for k in keep] for rows in (self.rows, self.rights, self.of_limit)
        )

    def _nearest_below(self, centre: np.ndarray, level: float) -> np.ndarray | None:
        if not math.isfinite(level):
            return None
        extra = [(self.cost, level)]
        for k, c in enumerate(centre):
            for sign in (1.0, -1.0):
                row = np.zeros(self.columns)
                row[k], row[-1] = sign, -1.0
                extra.append((row, sign * float(c)))
        radius = np.zeros(self.columns)
        radius[-1] = 1.0
        point = self._solve(radius, extra)
        return point.x[: self.q] if point.status == 0 else None

    def _prices(self, solved: Any) -> tuple[float, ...]:
        """Return the fall of the objective per unit of each limit."""
        prices, of = -solved.ineqlin.marginals, np.array(self.of_limit)
        return tuple(
            float(prices[: len(of)][of == j].sum()) * self.unit / maximum for j, maximum in enumerate(self.p.maximum)
        )
