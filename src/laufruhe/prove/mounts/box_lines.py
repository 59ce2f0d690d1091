"""What linear functions under objective and limits tell of boxes together: the least of what is allowed (P4, E39)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array
from laufruhe.prove.mounts.box_norms import Under

# times that prices of several limits are sought in turn
ROUNDS = 2


@dataclass(eq=False)
class BoxLines:
    """What linear functions tell of boxes, half a box being one: objective, and limits on which it stands.

    Attributes
    ----------
    value, slopes
        Under the objective, shapes (boxes,) and (boxes, open numbers).
    limits
        Under what is limited, less its limit and as a share of it, in the same shapes.
    pulls
        What is added to each of these by the size of a side, shape (boxes, open numbers).
    """

    value: Array
    slopes: Array
    limits: list[tuple[Array, Array]] = field(default_factory=list)
    pulls: list[Array] = field(default_factory=list)

    @classmethod
    def of(cls, lower: Array) -> BoxLines:
        """Of which nothing is known."""
        return cls(np.zeros(len(lower)), np.zeros_like(lower))

    def kept(self, which: NDArray[np.intp]) -> BoxLines:
        """Some of them."""
        limits = [(over[which], by[which]) for over, by in self.limits]
        return BoxLines(self.value[which], self.slopes[which], limits, [pull[which] for pull in self.pulls])

    def add(self, weight: float, least: Under, left_out: float = 0.0) -> None:
        """To the objective, where anything is known of it: no norm goes under zero."""
        value = least.value - least.rest - left_out
        tells = np.isfinite(value) & (value > 0.0)
        self.value = self.value + weight * np.where(tells, value, 0.0)
        self.slopes = self.slopes + weight * np.where(tells[:, None], least.slopes, 0.0)

    def hold(self, least: Under, left_out: float, maximum: float) -> None:
        """A limit."""
        unit = maximum or 1.0
        over = (least.value - least.rest - left_out - maximum) / unit
        known = np.isfinite(over) & np.all(np.isfinite(least.slopes), axis=1)
        self.limits.append((np.where(known, over, -1.0), np.where(known[:, None], least.slopes / unit, 0.0)))
        self.pulls.append(np.where(known[:, None], np.nan_to_num(least.bends) / unit, 0.0))

    @property
    def excess(self) -> Array:
        """What the largest relative excess over the limits is not under, anywhere in a box; -1 without limits.

        It is not under any mean of the limits (P4): from the one that is over most, the others are mixed in one after
        the other, each with the share that raises the least of the mean over the box, which is concave in it and has
        its corners where a side changes its end.
        """
        nothing = (np.full(len(self.value), -1.0), np.zeros_like(self.slopes))
        overs, by = (np.array(each) for each in zip(*(self.limits or [nothing]), strict=True))
        boxes = np.arange(len(self.value))
        first = (overs - np.abs(by).sum(axis=2)).argmax(axis=0)
        over, leaning = overs[first, boxes], by[first, boxes]
        found = over - np.abs(leaning).sum(axis=1)
        for other, slopes in zip(overs, by, strict=True) if len(overs) > 1 else ():
            apart = leaning - slopes
            shares = np.where(leaning * slopes < 0.0, leaning / np.where(apart != 0.0, apart, 1.0), 0.0)[..., None]
            mixed = (1.0 - shares) * leaning[:, None] + shares * slopes[:, None]
            held = (1.0 - shares[..., 0]) * over[:, None] + shares[..., 0] * other[:, None] - np.abs(mixed).sum(axis=2)
            best = held.argmax(axis=1)
            share = np.where(held[boxes, best] > found, shares[boxes, best, 0], 0.0)
            over, leaning = (1.0 - share) * over + share * other, leaning - share[:, None] * apart
            found = np.maximum(found, held[boxes, best])
        return np.asarray(found)

    @property
    def pull(self) -> Array:
        """Of the sides of a box, the most that any limit has."""
        return np.asarray(np.max([np.zeros_like(self.slopes), *self.pulls], axis=0))

    @property
    def least(self) -> Array:
        """Least objective where limits are kept; infinite where one is not.

        By prices of the limits (P4), of one after the other, each at which a side of the box changes its end: the least
        over the box is linear in a price between these.
        """
        value, slopes = self.value, self.slopes
        found, broken = value - np.abs(slopes).sum(axis=1), self.excess > 0.0
        for over, by in self.limits * (ROUNDS if len(self.limits) > 1 else 1):
            prices = np.where(slopes * by < 0.0, -slopes / np.where(by != 0.0, by, 1.0), 0.0)
            leaning = np.abs(slopes[:, None] + prices[:, :, None] * by[:, None]).sum(axis=2)
            held = value[:, None] + prices * over[:, None] - leaning
            best = held.argmax(axis=1)[:, None]
            gain = np.take_along_axis(held, best, axis=1)[:, 0]
            price = np.where(gain > found, np.take_along_axis(prices, best, axis=1)[:, 0], 0.0)
            value, slopes, found = value + price * over, slopes + price[:, None] * by, np.maximum(found, gain)
        found = np.where(broken, np.inf, found)
        return np.asarray(np.maximum(found, 0.0))
