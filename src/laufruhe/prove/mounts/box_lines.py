"""Linear lower bounds of objective and limits over boxes, and the least feasible objective by them (P4, E39)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array
from laufruhe.prove.mounts.box_norms import LinearBound

# passes over the limits to find their multipliers
ROUNDS = 2


@dataclass(eq=False)
class LinearRelaxation:
    """Linear functions of s nowhere above objective and limits, s from -1 to 1 in each number of a box.

    Attributes
    ----------
    value, slopes
        Lower bound of the objective: value + slopes . s, shapes (boxes,) and (boxes, open numbers).
    limits
        Lower bounds of relative violations of limits, pairs in the same shapes.
    pulls
        Branching scores of each limit, shape (boxes, open numbers).
    """

    value: Array
    slopes: Array
    limits: list[tuple[Array, Array]] = field(default_factory=list)
    pulls: list[Array] = field(default_factory=list)

    @classmethod
    def zero(cls, lower: Array) -> LinearRelaxation:
        """Return zero objective without limits, for boxes of this shape."""
        return cls(np.zeros(len(lower)), np.zeros_like(lower))

    def subset(self, which: NDArray[np.intp]) -> LinearRelaxation:
        """Return some of the boxes."""
        limits = [(over[which], by[which]) for over, by in self.limits]
        return LinearRelaxation(self.value[which], self.slopes[which], limits, [pull[which] for pull in self.pulls])

    def add(self, weight: float, minimum: LinearBound, left_out: float = 0.0) -> None:
        """Add a term to the objective, or zero where its bound is not positive."""
        value = minimum.value - minimum.rest - left_out
        known = np.isfinite(value) & (value > 0.0)
        self.value = self.value + weight * np.where(known, value, 0.0)
        self.slopes = self.slopes + weight * np.where(known[:, None], minimum.slopes, 0.0)

    def add_limit(self, minimum: LinearBound, left_out: float, maximum: float) -> None:
        """Add a limit."""
        unit = maximum or 1.0
        over = (minimum.value - minimum.rest - left_out - maximum) / unit
        known = np.isfinite(over) & np.all(np.isfinite(minimum.slopes), axis=1)
        self.limits.append((np.where(known, over, -1.0), np.where(known[:, None], minimum.slopes / unit, 0.0)))
        self.pulls.append(np.where(known[:, None], np.nan_to_num(minimum.bends) / unit, 0.0))

    @property
    def violation(self) -> Array:
        """Lower bound of the largest relative violation of limits in each box, shape (boxes,); -1 without limits.

        Every weighted mean of the limits is a lower bound (P4). The method starts with the most violated limit and
        mixes in the others one by one. The minimum of the mean over the box is concave in the share of a limit, with
        kinks where a slope changes its sign: the best kink is taken.
        """
        none = (np.full(len(self.value), -1.0), np.zeros_like(self.slopes))
        overs, by = (np.array(each) for each in zip(*(self.limits or [none]), strict=True))
        boxes = np.arange(len(self.value))
        first = (overs - np.abs(by).sum(axis=2)).argmax(axis=0)
        over, slope = overs[first, boxes], by[first, boxes]
        bound = over - np.abs(slope).sum(axis=1)
        for other, slopes in zip(overs, by, strict=True) if len(overs) > 1 else ():
            difference = slope - slopes
            shares = np.where(slope * slopes < 0.0, slope / np.where(difference != 0.0, difference, 1.0), 0.0)[
                ..., None
            ]
            mixed = (1.0 - shares) * slope[:, None] + shares * slopes[:, None]
            bounds = (
                (1.0 - shares[..., 0]) * over[:, None] + shares[..., 0] * other[:, None] - np.abs(mixed).sum(axis=2)
            )
            best = bounds.argmax(axis=1)
            share = np.where(bounds[boxes, best] > bound, shares[boxes, best, 0], 0.0)
            over, slope = (1.0 - share) * over + share * other, slope - share[:, None] * difference
            bound = np.maximum(bound, bounds[boxes, best])
        return np.asarray(bound)

    @property
    def pull(self) -> Array:
        """Branching scores of the limits, shape (boxes, open numbers)."""
        return np.asarray(np.max([np.zeros_like(self.slopes), *self.pulls], axis=0))

    @property
    def minimum(self) -> Array:
        """Lower bound of the feasible objective in each box, shape (boxes,); infinite where limits are violated.

        Multipliers of the limits (P4) are set one by one. The bound is piecewise linear in a multiplier, with kinks
        where a slope changes its sign: the best kink is taken.
        """
        value, slopes = self.value, self.slopes
        bound, broken = value - np.abs(slopes).sum(axis=1), self.violation > 0.0
        for over, by in self.limits * (ROUNDS if len(self.limits) > 1 else 1):
            prices = np.where(slopes * by < 0.0, -slopes / np.where(by != 0.0, by, 1.0), 0.0)
            loss = np.abs(slopes[:, None] + prices[:, :, None] * by[:, None]).sum(axis=2)
            bounds = value[:, None] + prices * over[:, None] - loss
            best = bounds.argmax(axis=1)[:, None]
            highest = np.take_along_axis(bounds, best, axis=1)[:, 0]
            price = np.where(highest > bound, np.take_along_axis(prices, best, axis=1)[:, 0], 0.0)
            value, slopes, bound = value + price * over, slopes + price[:, None] * by, np.maximum(bound, highest)
        return np.asarray(np.maximum(np.where(broken, np.inf, bound), 0.0))
