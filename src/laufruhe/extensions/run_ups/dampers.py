"""Maps of a block on its mounts in time over boxes of stiffness, with the viscous damping of E26 (E65).

A signal of the motion y is P y + (L S + D) y', with P, L and D linear in the stiffnesses. S = A^{-1/2} is the inverse
square root of the stiffness A of the block at rest: 2/pi times the integral of (A + s^2)^{-1} over s from zero to
infinity. In the modes of the middle of a box, with E the difference of A from its value there and w the natural
frequencies,

    S_ab = 1/w (a = b) + f[a,b] E_ab + sum_c f[a,c,b] E_ac E_cb - ...                              (E65)

with divided differences f of k^{-1/2} at the squares of w. With R = (w^2 + s^2)^{-1}, the remainder after the first
order is 2/pi times the integral of R E (A + s^2)^{-1} E R, and after the second that of -R E R E (A + s^2)^{-1} E R.
As A >= (1 - t) w^2 with some t < 1 on the box, Cauchy-Schwarz bounds their entries by products of two lengths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array


@dataclass(frozen=True, eq=False)
class Linear:
    """Matrix that is linear in the open numbers, with its value at their lower bounds, shape (r, n).

    Its slopes by the open numbers have the shape (open numbers, r, n).
    """

    lowest: Array
    slopes: Array

    def at(self, above: Array) -> Array:
        """Return the matrices at distances above the lower bounds: (boxes, open numbers) to (boxes, r, n)."""
        return np.asarray(self.lowest + np.tensordot(above, self.slopes, axes=1))


@dataclass(frozen=True, eq=False)
class LinearMaps:
    """Matrices P (`position`), L (`lossy`) and D (`damping`) of a signal P y + (L S + D) y' of the motion y."""

    position: Linear
    lossy: Linear
    damping: Linear


@dataclass(frozen=True, eq=False)
class Roots:
    """Inverse square roots S of the stiffness over boxes, in the modes at their middles; open numbers from -1 to 1.

    Attributes
    ----------
    middle, first, second
        Coefficients by order: shapes (boxes, n, n), (boxes, open numbers, n, n), and (boxes, pairs, n, n) for j <= l.
    after_first, after_second
        Bounds of the remainder of entries after these orders, shape (boxes, n, n); NaN if unknown.
    """

    middle: Array
    first: Array
    second: Array
    after_first: Array
    after_second: Array


@dataclass(frozen=True, eq=False)
class Maps:
    """Signal P y + Q y' of the motion y over boxes, by open numbers from -1 to 1.

    Attributes
    ----------
    position, positions
        Matrix P at the middle and its slopes, shapes (boxes, r, n) and (boxes, open numbers, r, n).
    rate, rates, bends
        Matrix Q at the middle, its slopes, and its second-order terms by pairs j <= l, shape (boxes, pairs, r, n).
    remainder
        Bound of the remainder of the entries of Q, shape (boxes, r, n).
    """

    position: Array
    positions: Array
    rate: Array
    rates: Array
    bends: Array
    remainder: Array

    @property
    def beyond_linear(self) -> Array:
        """Upper bounds of the entries of all terms beyond the linear one, shape (boxes, r, n)."""
        return np.asarray(np.abs(self.bends).sum(axis=1) + self.remainder)

    @property
    def is_constant(self) -> bool:
        """True if the maps depend on no open number."""
        return not (self.positions.any() or self.rates.any() or self.beyond_linear.any())


def pairs_of(count: int) -> list[tuple[int, int]]:
    """Return the pairs (j, l) with j <= l of `count` open numbers."""
    return [(j, k) for j in range(count) for k in range(j, count)]


def roots(squares: Array, slopes: Array, size: int) -> Roots:
    """Return the inverse square roots S = A^(-1/2) of the stiffness over boxes, as series with errors (E65).

    Parameters
    ----------
    squares
        Squared natural frequencies at the middles, shape (boxes, 6), positive.
    slopes
        Change of the stiffness by half of each side, shape (boxes, open numbers, 6, 6), positive semidefinite.
    size
        Number of coordinates; those after the six of the block, of fluid tracks, have no S.
    """
    w = np.sqrt(squares)
    a, b, c = w[:, :, None, None], w[:, None, None, :], w[:, None, :, None]
    second_difference = (a + b + c) / (a * b * c * (a + b) * (b + c) * (a + c))
    diagonal = np.einsum("baca->bac", second_difference)
    first_difference = 1.0 / (w[:, :, None] * w[:, None] * (w[:, :, None] + w[:, None]))
    products = [
        np.einsum("bac,bcd,bacd->bad", slopes[:, j], slopes[:, k], second_difference, optimize=True)
        for j, k in pairs_of(slopes.shape[1])
    ]
    second = [
        product if j == k else product + np.swapaxes(product, 1, 2)
        for product, (j, k) in zip(products, pairs_of(slopes.shape[1]), strict=True)
    ]
    maximum = np.abs(slopes).sum(axis=1)
    share = np.linalg.eigvalsh(slopes.sum(axis=1) / (w[:, :, None] * w[:, None]))[:, -1]
    margin = 1.0 - share
    second_change = (maximum / squares[:, None]) @ maximum
    first_length, second_length = (
        np.sqrt(np.einsum("bac,bac->ba", change**2, diagonal)) for change in (maximum, second_change)
    )
    # unknown if the stiffness may vanish in the box
    margin = np.where(margin > 0.0, margin, np.nan)[:, None, None]
    after_first, product_bound = (
        change[:, :, None] * first_length[:, None] / margin for change in (first_length, second_length)
    )
    after_second = np.minimum(product_bound, np.swapaxes(product_bound, 1, 2))
    padding = [(0, size - 6), (0, size - 6)]
    eye = np.eye(6) / w[:, None]
    parts = (eye, -slopes * first_difference[:, None], np.stack(second, axis=1), after_first, after_second)
    return Roots(*(np.pad(change, [(0, 0)] * (change.ndim - 2) + padding) for change in parts))


def mapped(parts: LinearMaps, above: Array, halves: Array, turn: Array, s: Roots, of_motion: bool = False) -> Maps:
    """Return the matrices from motion to a signal, such as force, over boxes, in the modes of their middles.

    Parameters
    ----------
    parts
        Matrices P, L and D.
    above, halves
        Middles above the lower bounds, and half widths, shape (boxes, open numbers).
    turn
        Matrix from coordinates of the modes to those of the motion, shape (boxes, n, n).
    s
        Roots S of the boxes.
    of_motion
        True if the rows are also coordinates of the motion.
    """

    def in_modes(matrices: Array) -> Array:
        modes = turn if matrices.ndim == 3 else turn[:, None]
        rows = matrices @ modes
        return np.asarray(np.swapaxes(modes, -1, -2) @ rows if of_motion else rows)

    scale = halves[:, :, None, None]
    (position, position_slopes), (lossy, lossy_slopes), (damping, damping_slopes) = (
        (in_modes(part.at(above)), in_modes(scale * part.slopes))
        for part in (parts.position, parts.lossy, parts.damping)
    )
    rate_slopes = lossy_slopes @ s.middle[:, None] + lossy[:, None] @ s.first + damping_slopes
    bends = []
    for number, (j, k) in enumerate(pairs_of(halves.shape[1])):
        bend = lossy @ s.second[:, number] + lossy_slopes[:, j] @ s.first[:, k]
        bends.append(bend if j == k else bend + lossy_slopes[:, k] @ s.first[:, j])
    remainder = np.abs(lossy) @ s.after_second + np.abs(lossy_slopes).sum(axis=1) @ s.after_first
    return Maps(position, position_slopes, lossy @ s.middle + damping, rate_slopes, np.stack(bends, axis=1), remainder)
