"""Maps of a block on its mounts in time over boxes of stiffness, with the viscous damping of E26 (E65).

What moves is felt as P y + (L S + D) y', with P, L and D linear in the stiffnesses, and S = A^{-1/2} of the stiffness A
of the block at rest: 2/pi times the integral of (A + s^2)^{-1} over s from zero on. In the modes of the middle of a
box, with E what A differs by there and w the natural frequencies,

    S_ab = 1/w (a = b) + f[a,b] E_ab + sum_c f[a,c,b] E_ac E_cb - ...                              (E65)

with divided differences f of k^{-1/2} at the squares of w. With R = (w^2 + s^2)^{-1}, what is left after the first
order is 2/pi times the integral of R E (A + s^2)^{-1} E R, and after the second that of -R E R E (A + s^2)^{-1} E R.
As A >= (1 - t) w^2, Cauchy and Schwarz bound their entries by products of two lengths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array


@dataclass(frozen=True, eq=False)
class Linear:
    """A matrix that is linear in the open numbers.

    Attributes
    ----------
    lowest
        Matrix with all of these at their lower bounds, shape (r, n).
    slopes
        Derivatives by every open number, shape (open numbers, r, n).
    """

    lowest: Array
    slopes: Array

    def at(self, above: Array) -> Array:
        """Return the matrices so far above the lower bounds, shape (boxes, open numbers) to (boxes, r, n)."""
        return np.asarray(self.lowest + np.tensordot(above, self.slopes, axes=1))


@dataclass(frozen=True, eq=False)
class LinearMaps:
    """P, L and D."""

    position: Linear
    lossy: Linear
    drag: Linear


@dataclass(frozen=True, eq=False)
class Roots:
    """S over boxes, in the modes of their middles; half a box is one.

    Attributes
    ----------
    middle, first, second
        Shapes (boxes, n, n), (boxes, open numbers, n, n), and (boxes, pairs, n, n) of j <= l.
    after_first, after_second
        Bounds of the rest of entries after these orders, shape (boxes, n, n); not numbers where none is known.
    """

    middle: Array
    first: Array
    second: Array
    after_first: Array
    after_second: Array


@dataclass(frozen=True, eq=False)
class Maps:
    """P y + Q y' over boxes, in shares of half a box.

    Attributes
    ----------
    position, positions
        P at the middle and by side, shapes (boxes, r, n) and (boxes, open numbers, r, n).
    rate, rates, bends
        Q at the middle, by side, and by pairs of sides j <= l, (boxes, pairs, r, n).
    rest
        Bound of the rest of the entries of Q, shape (boxes, r, n).
    """

    position: Array
    positions: Array
    rate: Array
    rates: Array
    bends: Array
    rest: Array

    @property
    def bent(self) -> Array:
        """Largest entries of what is beyond the first order, shape (boxes, r, n)."""
        return np.asarray(np.abs(self.bends).sum(axis=1) + self.rest)

    @property
    def is_constant(self) -> bool:
        """Return whether they depend on no open number."""
        return not (self.positions.any() or self.rates.any() or self.bent.any())


def pairs_of(count: int) -> list[tuple[int, int]]:
    """Return the pairs of sides j <= l."""
    return [(j, k) for j in range(count) for k in range(j, count)]


def roots(squares: Array, slopes: Array, size: int) -> Roots:
    """S of boxes from the squares at their middles and the stiffness over half a box there, all in their modes (E65).

    Parameters
    ----------
    squares, slopes
        Shapes (boxes, 6), above zero, and (boxes, open numbers, 6, 6), none of them negative.
    size
        Number of coordinates; those beside the block have no S.
    """
    w = np.sqrt(squares)
    a, b, c = w[:, :, None, None], w[:, None, None, :], w[:, None, :, None]
    third = (a + b + c) / (a * b * c * (a + b) * (b + c) * (a + c))
    diagonal = np.einsum("baca->bac", third)
    pair = 1.0 / (w[:, :, None] * w[:, None] * (w[:, :, None] + w[:, None]))
    products = [
        np.einsum("bac,bcd,bacd->bad", slopes[:, j], slopes[:, k], third, optimize=True)
        for j, k in pairs_of(slopes.shape[1])
    ]
    second = [
        one if j == k else one + np.swapaxes(one, 1, 2)
        for one, (j, k) in zip(products, pairs_of(slopes.shape[1]), strict=True)
    ]
    maximum = np.abs(slopes).sum(axis=1)
    share = np.linalg.eigvalsh(slopes.sum(axis=1) / (w[:, :, None] * w[:, None]))[:, -1]
    left = 1.0 - share
    twice = (maximum / squares[:, None]) @ maximum
    near, far = (np.sqrt(np.einsum("bac,bac->ba", change**2, diagonal)) for change in (maximum, twice))
    # half a box that reaches to nothing is not known
    left = np.where(left > 0.0, left, np.nan)[:, None, None]
    after_first, crossed = (change[:, :, None] * near[:, None] / left for change in (near, far))
    after_second = np.minimum(crossed, np.swapaxes(crossed, 1, 2))
    wider = [(0, size - 6), (0, size - 6)]
    eye = np.eye(6) / w[:, None]
    parts = (eye, -slopes * pair[:, None], np.stack(second, axis=1), after_first, after_second)
    return Roots(*(np.pad(change, [(0, 0)] * (change.ndim - 2) + wider) for change in parts))


def mapped(parts: LinearMaps, above: Array, halves: Array, turn: Array, s: Roots, of_motion: bool = False) -> Maps:
    """Maps of boxes, in the modes of their middles.

    Parameters
    ----------
    above, halves
        Middles above the lower bounds, and half widths, shape (boxes, open numbers).
    turn
        Matrix from the coordinates of the modes, shape (boxes, n, n).
    of_motion
        True if the rows are in coordinates of the motion too.
    """

    def seen(matrices: Array) -> Array:
        modes = turn if matrices.ndim == 3 else turn[:, None]
        out = matrices @ modes
        return np.asarray(np.swapaxes(modes, -1, -2) @ out if of_motion else out)

    scale = halves[:, :, None, None]
    (p, p_by), (lossy, lossy_by), (drag, drag_by) = (
        (seen(part.at(above)), seen(scale * part.slopes)) for part in (parts.position, parts.lossy, parts.drag)
    )
    by_side = lossy_by @ s.middle[:, None] + lossy[:, None] @ s.first + drag_by
    bends = []
    for number, (j, k) in enumerate(pairs_of(halves.shape[1])):
        bend = lossy @ s.second[:, number] + lossy_by[:, j] @ s.first[:, k]
        bends.append(bend if j == k else bend + lossy_by[:, k] @ s.first[:, j])
    rest = np.abs(lossy) @ s.after_second + np.abs(lossy_by).sum(axis=1) @ s.after_first
    return Maps(p, p_by, lossy @ s.middle + drag, by_side, np.stack(bends, axis=1), rest)
