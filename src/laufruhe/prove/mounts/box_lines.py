"""Linear lower bounds of objective and limits over boxes, and the lower bound that they give (P4, E39)."""

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
    """Linear lower bounds of objective and limits on boxes, as functions of the position s in a box.

    s_j runs from -1 to 1 as open number j runs from its lower to its upper bound in the box.

    Attributes
    ----------
    value, slopes
        Lower bound of the objective: value + slopes . s, shapes (boxes,) and (boxes, open numbers).
    limits
        Lower bounds of relative violations of limits: pairs (value, slopes) in the same shapes.
    pulls
        Branching scores from each limit, shape (boxes, open numbers): the side with the largest score is halved.
    """

    value: Array
    slopes: Array
    limits: list[tuple[Array, Array]] = field(default_factory=list)
    pulls: list[Array] = field(default_factory=list)

    @classmethod
    def zero(cls, lower: Array) -> LinearRelaxation:
        """Return the relaxation with a zero objective and no limits; `lower` has the shape (boxes, open numbers)."""
        return cls(np.zeros(len(lower)), np.zeros_like(lower))

    def subset(self, indices: NDArray[np.intp]) -> LinearRelaxation:
        """Return the relaxation on the boxes at these indices."""
        limits = [(value[indices], slopes[indices]) for value, slopes in self.limits]
        pulls = [pull[indices] for pull in self.pulls]
        return LinearRelaxation(self.value[indices], self.slopes[indices], limits, pulls)

    def add(self, weight: float, minimum: LinearBound, left_out: float = 0.0) -> None:
        """Add the linear bound of a weighted objective term, or zero on boxes where that bound is not positive.

        The largest effect of omitted orders on the term is `left_out` [SI].
        """
        value = minimum.value - minimum.remainder - left_out
        is_positive = np.isfinite(value) & (value > 0.0)
        self.value = self.value + weight * np.where(is_positive, value, 0.0)
        self.slopes = self.slopes + weight * np.where(is_positive[:, None], minimum.slopes, 0.0)

    def add_limit(self, minimum: LinearBound, left_out: float, maximum: float) -> None:
        """Add a limit by the linear bound of its measure and the largest allowed value `maximum` [SI].

        The largest effect of omitted orders on the measure is `left_out` [SI].
        """
        unit = maximum or 1.0
        violation = (minimum.value - minimum.remainder - left_out - maximum) / unit
        is_finite = np.isfinite(violation) & np.all(np.isfinite(minimum.slopes), axis=1)
        slopes = np.where(is_finite[:, None], minimum.slopes / unit, 0.0)
        self.limits.append((np.where(is_finite, violation, -1.0), slopes))
        self.pulls.append(np.where(is_finite[:, None], np.nan_to_num(minimum.scores) / unit, 0.0))

    @property
    def violation(self) -> Array:
        """Lower bound, in each box, of the relative violation of the worst limit, shape (boxes,); -1 without limits.

        Every weighted mean of the limits is a lower bound (P4). The method starts with the most violated limit and
        mixes in the others one by one. The minimum of the mean over the box is concave in the weight of a limit, with
        kinks where a slope changes its sign. The kink with the largest bound is taken.
        """
        none = (np.full(len(self.value), -1.0), np.zeros_like(self.slopes))
        values, gradients = (np.array(parts) for parts in zip(*(self.limits or [none]), strict=True))
        boxes = np.arange(len(self.value))
        first = (values - np.abs(gradients).sum(axis=2)).argmax(axis=0)
        value, slope = values[first, boxes], gradients[first, boxes]
        bound = value - np.abs(slope).sum(axis=1)
        for limit, slopes in zip(values, gradients, strict=True) if len(values) > 1 else ():
            difference = slope - slopes
            shares = np.where(slope * slopes < 0.0, slope / np.where(difference != 0.0, difference, 1.0), 0.0)[
                ..., None
            ]
            mixed = (1.0 - shares) * slope[:, None] + shares * slopes[:, None]
            bounds = (
                (1.0 - shares[..., 0]) * value[:, None] + shares[..., 0] * limit[:, None] - np.abs(mixed).sum(axis=2)
            )
            best = bounds.argmax(axis=1)
            share = np.where(bounds[boxes, best] > bound, shares[boxes, best, 0], 0.0)
            value, slope = (1.0 - share) * value + share * limit, slope - share[:, None] * difference
            bound = np.maximum(bound, bounds[boxes, best])
        return np.asarray(bound)

    @property
    def pull(self) -> Array:
        """Largest branching score of each open number from any limit, shape (boxes, open numbers)."""
        return np.asarray(np.max([np.zeros_like(self.slopes), *self.pulls], axis=0))

    @property
    def minimum(self) -> Array:
        """Lower bound of the objective of feasible designs in each box, (boxes,); infinite where none is feasible.

        Multipliers of the limits (P4) are set one by one. The bound is piecewise linear in a multiplier, with kinks
        where a slope changes its sign. The kink with the largest bound is taken.
        """
        value, slopes = self.value, self.slopes
        bound, broken = value - np.abs(slopes).sum(axis=1), self.violation > 0.0
        for violation, gradient in self.limits * (ROUNDS if len(self.limits) > 1 else 1):
            prices = np.where(slopes * gradient < 0.0, -slopes / np.where(gradient != 0.0, gradient, 1.0), 0.0)
            loss = np.abs(slopes[:, None] + prices[:, :, None] * gradient[:, None]).sum(axis=2)
            bounds = value[:, None] + prices * violation[:, None] - loss
            best = bounds.argmax(axis=1)[:, None]
            highest = np.take_along_axis(bounds, best, axis=1)[:, 0]
            price = np.where(highest > bound, np.take_along_axis(prices, best, axis=1)[:, 0], 0.0)
            value = value + price * violation
            slopes = slopes + price[:, None] * gradient
            bound = np.maximum(bound, highest)
        return np.asarray(np.maximum(np.where(broken, np.inf, bound), 0.0))
