"""Base class of norms of signals (P1-P3).

A norm maps rows v_k, the vectors of a signal at sampled angles and places, to one number. Each norm has a class in a
file of its own: its value, dual norm, cones, smooth form and sampling error. Callers use these methods and never test
which norm they have.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum, order_amplitude

# squares of numbers between these neither overflow nor lose digits
_SMALLEST, _LARGEST = 1e-140, 1e150


@dataclass(frozen=True, eq=False)
class Grid:
    """Weights and grouping of the rows of signals; a row is a signal's vector at one sampled angle and place.

    Attributes
    ----------
    weights
        Weight w_k of each row, shape (k,).
    steps
        Number of rows of each signal; the rows of one signal are consecutive.
    kinks
        Number of rows at kinks, the last ones of each signal. The rows before them are samples at equal steps.
    points
        Number of operating points. All have the same number of rows, and the rows of one point are consecutive.
    """

    weights: Array
    steps: int
    kinks: int = 0
    points: int = 1


LONGEST_TOL, ZERO_TOL, DUAL_TOL = 1e-5, 1e-6, 1e-4
"""Relative tolerances: for rows as long as the longest, for rows that count as zero, and for dual rows in use."""
MAX_KINKS = 64
"""Largest number of dual rows of which mixtures are formed."""


@dataclass(frozen=True, eq=False)
class Subdifferential:
    """Subdifferential of a norm at the rows of a design: the set of its dual rows Z (P19).

    Attributes
    ----------
    base
        One subgradient Z, shape (k, d).
    longest
        Indices of the longest rows. A unit vector along each one alone is a subgradient too.
    vanishing
        Indices of zero rows. Any vector not longer than the weight of the row may be added to the base there.
    others
        Further subgradients, shape (k, d) each; every convex combination of these and the base is one.
    """

    base: Array
    longest: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    vanishing: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    others: tuple[Array, ...] = ()


def hull(subgradients: Sequence[Array]) -> Subdifferential | None:
    """Return all convex combinations of subgradients; None if there are none, or more than `MAX_KINKS`."""
    if not 0 < len(subgradients) <= MAX_KINKS:
        return None
    return Subdifferential(subgradients[0], others=tuple(subgradients[1:]))


@dataclass(frozen=True, eq=False)
class Cones:
    """Norm as a second-order cone program: the minimum of value . t over epigraph variables t, called heads (P1).

    Cone c requires that its head t[head[c]] is at least the length of its load rows, each times its factor.

    Attributes
    ----------
    value
        Coefficients of the heads in the norm, shape (heads,).
    head
        Index of the head of each cone, shape (cones,).
    factors
        Factor of each row inside its cone, shape (k,).
    is_single
        True if one cone contains all rows; otherwise each row has its own cone.
    centred
        True if a free vector is subtracted from all rows of a signal.
    linear_rows
        Linear constraints on heads as sparse triplets: constraint number, head, factor, shapes (n,). Each sum is at
        most zero.
    squares
        Indices of heads a, b, c with t_a^2 <= t_b t_c, shapes (n,): rotated cones.
    """

    value: Array
    head: NDArray[np.intp]
    factors: Array
    is_single: bool = False
    centred: bool = False
    linear_rows: tuple[NDArray[np.intp], NDArray[np.intp], Array] | None = None
    squares: tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]] | None = None


_ONLY: dict[type[Norm], Norm] = {}


def norm_instance(kind: type[Norm]) -> Norm:
    """Return the single instance of a norm's class."""
    return _ONLY.setdefault(kind, kind())


class Norm(ABC):
    """Norm of rows v_k, shape (k, d), on a grid.

    The flags state properties that methods and bounds may use; all are False by default. A class without flags needs
    `value`, `upper_bound` and `sampling_bound` only.

    Attributes
    ----------
    name
        Name in problem files and reports.
    refinement
        Factor on the number of samples for the value in a result (M6).
    averages
        True if the norm of rows averaged about their angles is a lower bound of the norm over the cycle (P7).
    is_euclidean
        True if it depends only on the weighted sum of squares of all rows (S12).
    sums_lengths
        True if it is linear in the lengths of the rows.
    is_largest
        True if it is the length of the longest row; a limit then holds for each row separately.
    is_largest_mean
        True if it is the maximum over operating points of the mean length of their rows.
    is_diameter
        True if it is the largest diameter of the enclosing balls of the signals, at most twice the longest row.
    is_convex
        True if it is convex, with cones and a dual norm: norm(V) >= <Z, V> for every Z with dual norm one.
    is_smooth
        True if it has a second derivative wherever no row vanishes.
    is_monotone_in_lengths
        True if it depends only on the lengths of the rows and their weights, and never falls when a row gets longer.
    is_pointwise
        True if it combines rows or signals separately, by a weighted sum, a root of weighted squares or a maximum, so
        that the grouping by operating points does not matter.
    """

    name: ClassVar[str]
    refinement: ClassVar[int] = 1
    averages: ClassVar[bool] = False
    is_euclidean: ClassVar[bool] = False
    sums_lengths: ClassVar[bool] = False
    is_largest: ClassVar[bool] = False
    is_largest_mean: ClassVar[bool] = False
    is_diameter: ClassVar[bool] = False
    is_convex: ClassVar[bool] = False
    is_smooth: ClassVar[bool] = False
    is_monotone_in_lengths: ClassVar[bool] = False
    is_pointwise: ClassVar[bool] = False

    @property
    def claim(self) -> str:
        """Property that only the author of the norm declares, in words for the certificate; empty without one."""
        return ""

    def __repr__(self) -> str:
        return f"<{self.name}>"

    def __reduce__(self) -> tuple[Callable[[type[Norm]], Norm], tuple[type[Norm]]]:
        # a norm is one and the same in every process
        return norm_instance, (type(self),)

    @abstractmethod
    def value(self, grid: Grid, rows: Array) -> float:
        """Return the norm of rows, shape (k, d)."""

    def values(self, grid: Grid, row_sets: Array) -> Array:
        """Return the norm of each of n sets of rows, shape (n, k, d) to (n,)."""
        return np.array([self.value(grid, rows) for rows in row_sets])

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return a subgradient Z at rows V, shape (k, d): dual norm at most one, <Z, V> = norm(V) (P2).

        The inner product is sum_k z_k . v_k; weights are part of Z. Zero rows of V give zero rows of Z.
        """
        raise self._unclaimed("subgradient")

    def second_derivative(self, grid: Grid, rows: Array) -> tuple[Array, Array, float]:
        """Return coefficients a and b, shape (k,), and c of the second derivative at rows V, shape (k, d) (P10).

        A change dV of the rows has the second derivative sum_k a_k |dv_k|^2 + b_k (v_k . dv_k)^2 - c <Z, dV>^2 with the
        subgradient Z at V.
        """
        raise self._unclaimed("second derivative")

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return the dual norm of Z, shape (k, d): the smallest t with <Z, V> <= t norm(V) for every V (P3).

        It is infinite if no such t exists.
        """
        raise self._unclaimed("dual norm")

    def dual_feasible(self, grid: Grid, z: Array) -> Array:
        """Return Z, shape (k, d), moved into the unit ball of the dual norm by a simple projection (P3)."""
        violation = self.dual_norm(grid, z)
        return z if violation <= 1.0 else z / violation

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential | None:
        """Return all subgradients at rows V, shape (k, d), starting from dual rows Z of a solver (P19).

        The result is None if they are unknown or too many.
        """
        return None

    def balanced_dual(self, grid: Grid, z: Array) -> Array:
        """Return dual rows near Z, shape (k, d), whose dual norm is finite (P3)."""
        return z

    def aligned_dual(self, grid: Grid, rows: Array, z: Array) -> Array:
        """Return dual rows, shape (k, d), for a lower bound at a design with rows V (P6).

        They point along V where this gives a bound at least as good as the solver's Z; elsewhere they are those of Z,
        as by default everywhere.
        """
        return z

    def refined_dual(self, z: Array, steps: int, times: int) -> Array:
        """Return dual rows on a grid `times` as fine, from Z at `steps` samples of each signal (P6).

        Between the samples they are linear, or zero if single rows determine the norm.
        """
        blocks = z.reshape(-1, steps, z.shape[-1])
        if self.is_largest or self.is_diameter:
            placed = np.zeros((len(blocks), steps * times, z.shape[-1]))
            placed[:, ::times] = blocks
            return placed.reshape(-1, z.shape[-1])
        share = np.arange(times) / times
        next_blocks = np.roll(blocks, -1, axis=1)
        mixed = blocks[:, :, None] * (1.0 - share[:, None]) + next_blocks[:, :, None] * share[:, None]
        return np.asarray(mixed.reshape(-1, z.shape[-1]) / times)

    def norm_from_lengths(self, lengths: Array, weights: Array) -> Array:
        """Return the norm of each design from its row lengths, shape (..., k) to (...).

        `weights` are those of the rows, shape (k,). The lengths are overwritten.
        """
        raise TypeError(f"{self.name} is not known from lengths alone")

    def majorant(self, grid: Grid, lengths: Array) -> tuple[Array, float] | None:
        """Return a quadratic upper bound of the norm that is exact at given row lengths, shape (k,) (R6).

        It has coefficients a, shape (k,), and a constant c with norm(V) <= c + sum_k a_k |v_k|^2 / 2 for every V. The
        result is None if the norm has no such bound.
        """
        return None

    def cones(self, grid: Grid) -> Cones:
        """Return the norm of rows on a grid as second-order cones (P1)."""
        raise self._unclaimed("cones")

    def smooth_expression(self, program: Any, grid: Grid, rows: Any, unit: Any, softness: Any) -> Any:
        """Return a smooth CasADi expression of the norm to minimise (N3, E22).

        Parameters
        ----------
        program
            Collector of epigraph variables (`head`, `free`) and of constraints at most zero (`hold`).
        rows
            CasADi matrix, shape (k, d).
        unit, softness
            Size of the norm in its unit, and rounding of its kink at zero relative to that size: the expression
            differs from the norm by at most softness x unit.
        """
        raise self._unclaimed("smooth form")

    def smooth_limit(
        self, program: Any, grid: Grid, rows: Any, maximum: float, softness: float
    ) -> tuple[Any, float, float]:
        """Return a smooth form of the limit norm(rows) <= maximum.

        It has a CasADi expression, its largest allowed value, and the derivative of that value by `maximum`. The
        expression is smooth at zero rows too, and as exact as `smooth_expression` with unit one, which is the default.
        """
        return self.smooth_expression(program, grid, rows, 1.0, softness), maximum, 1.0

    @abstractmethod
    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return an upper bound of the norm over the cycle, from coefficients alone (F6).

        Parameters
        ----------
        signals
            Signal at each operating point, shape (n, places, d).
        shares
            Weight of each operating point, shape (points,).
        """

    @abstractmethod
    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return an upper bound of the sampling error of the norm at `steps` samples over a period (F7, F8).

        The coarse samples are compared with at least `finest` samples; signals and shares are those of `upper_bound`.
        """

    def _unclaimed(self, what: str) -> TypeError:
        return TypeError(f"norm '{self.name}' has no {what}, which a method needs; implement it in its class")


def lengths(rows: Array) -> Array:
    """Return the Euclidean length of each row, shape (..., d) to (...), safe from overflow and underflow."""
    # BLAS warns of nothing
    if not np.vdot(rows, rows) < _LARGEST**2:
        return _scaled_lengths(rows)
    size = np.sqrt((rows * rows) @ _ones(rows.shape[-1]))
    if np.minimum.reduce(size, axis=None, initial=_LARGEST) < _SMALLEST:
        small = size < _SMALLEST
        if (short := rows[small]).any():
            size[small] = _scaled_lengths(short)
    return np.asarray(size)


@lru_cache(maxsize=16)
def _ones(count: int) -> Array:
    return np.ones(count)


def _scaled_lengths(rows: Array) -> Array:
    size = np.abs(rows).max(axis=-1, initial=0.0)
    safe = np.where(size > 0.0, size, 1.0)
    return np.asarray(size * np.sqrt(np.square(rows / safe[..., None]).sum(axis=-1)))


def softened_lengths(rows: Any, softness: Any) -> Any:
    """Return sqrt(|v|^2 + e^2) - e of each row of a CasADi matrix (k, d), with e = `softness`, shape (k, 1) (N3)."""
    import casadi as ca

    return ca.sqrt(ca.sum2(rows * rows) + softness * softness) - softness


def mean_square(signal: Spectrum) -> Array:
    """Return the mean square over the cycle at every place, shape (places,), by Parseval's sum."""
    c = signal.coefficients
    power = 0.5 * np.sum(np.abs(c) ** 2, axis=(0, 2))
    # the steady part does not alternate
    square = power - 0.5 * np.sum(np.abs(c[0]) ** 2, axis=-1) + np.sum(c[0].real ** 2, axis=-1)
    if signal.kinks is None:
        return np.asarray(square)
    return np.asarray(square + lengths(signal.kinks.beyond(len(c), float(signal.base))[1]) ** 2)


def amplitudes(signal: Spectrum) -> Array:
    """Return the sum of the orders' amplitudes at every place, an upper bound of the signal, shape (places,)."""
    total = order_amplitude(signal.coefficients).sum(axis=0)
    if signal.kinks is None:
        return np.asarray(total)
    return np.asarray(total + lengths(signal.kinks.beyond(len(signal.coefficients), float(signal.base))[0]))


def curvature(signal: Spectrum) -> Array:
    """Return an upper bound of the second derivative by crank angle between kinks at each place, shape (places,)."""
    smooth = signal.smooth
    maximum = amplitudes(Spectrum(smooth.base, smooth.coefficients * (smooth.orders**2)[:, None, None]))
    if signal.kinks is None:
        return np.asarray(maximum)
    return np.asarray(maximum + lengths(signal.kinks.curvature(signal.period)).max(axis=0))


def fine_lengths(signal: Spectrum, steps: int, times: int) -> tuple[Array, float]:
    """Return the lengths of a signal at `steps` samples for each of `times` shifted starts, and the fine step [rad].

    The lengths have the shape (steps, times, places).
    """
    return lengths(signal.sample(steps * times)).reshape(steps, times, -1), signal.period / (steps * times)
