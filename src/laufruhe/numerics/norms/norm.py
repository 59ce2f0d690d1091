"""Base class of norms of signals (P1-P3).

Mean, peak and root mean square of a force over angle, mounts and operating points are
norms of the same kind: a norm over rows of the length of each row. So is a sum of masses
of unbalances. A class in a file of its own says how such a norm is computed, bounded,
stated as cones, made smooth, and how far samples can be off. Nothing else in the project
asks which norm it has before it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum, order_amplitude

# squares of numbers between these neither overflow nor lose digits
_LEAST, _MOST = 1e-140, 1e150


@dataclass(frozen=True, eq=False)
class Grid:
    """Weights and grouping of the rows of signals.

    Attributes
    ----------
    weights
        w_k, shape (k,).
    steps
        Rows of one signal; rows come in groups of as many.
    kinks
        The last rows of every signal, at angles where it bends; those before follow each other at equal steps of its
        period.
    points
        Operating points, each with as many rows, one behind the other.
    """

    weights: Array
    steps: int
    kinks: int = 0
    points: int = 1


LONGEST_TOL, ZERO_TOL, DUAL_TOL = 1e-5, 1e-6, 1e-4
"""Shares of the longest row that a row may lack and be as long, and up to which it is none; share of all dual rows
from which one counts."""
MOST_KINKS = 64
"""Dual rows of which a mixture is told."""


@dataclass(frozen=True, eq=False)
class Subdifferential:
    """Dual rows that touch a norm at a design (P19).

    Attributes
    ----------
    base
        One of them, shape (k, d).
    longest
        Rows of which each alone, along itself, would do in its place; none where the base is needed.
    vanishing
        Rows that are zero: anything no longer than their weight may be added.
    others
        Further dual rows of the shape of the base; any mixture of these and the base would do.
    """

    base: Array
    longest: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    vanishing: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    others: tuple[Array, ...] = ()


@dataclass(frozen=True, eq=False)
class Cones:
    """Norm as the least linear function of heads t_c >= |rows of cone c| (P1).

    Attributes
    ----------
    value
        The norm is value . heads, shape (heads,).
    head
        Of each cone the head that is over it, shape (cones,).
    factors
        What each row is multiplied by inside its cone, shape (k,).
    is_single
        Whether one cone holds all rows; else each row has its own.
    centred
        Whether the rows of every signal are counted from a vector that is free.
    linear_rows
        Linear functions of the heads that are at most zero: their numbers, heads and factors, shapes (n,).
    squares
        Heads a, b, c with t_a^2 <= t_b t_c, shapes (n,): rotated cones of heads alone.
    """

    value: Array
    head: NDArray[np.intp]
    factors: Array
    is_single: bool = False
    centred: bool = False
    linear_rows: tuple[NDArray[np.intp], NDArray[np.intp], Array] | None = None
    squares: tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]] | None = None


class EpigraphProgram(Protocol):
    """Program that a smooth form adds variables and constraints to (N3, E22)."""

    def head(self, value: Any) -> Any:
        """Return a nonnegative variable that starts at `value`."""

    def free(self, value: Any) -> Any:
        """Return a row of variables without bounds."""

    def hold(self, expression: Any) -> None:
        """Constrain every entry to be at most zero."""


_ONLY: dict[type[Norm], Norm] = {}


def norm_instance(kind: type[Norm]) -> Norm:
    """Return the single instance of a norm's class."""
    return _ONLY.setdefault(kind, kind())


class Norm(ABC):
    """Norm of rows v_k, shape (k, d), on a grid.

    A class claims what it is; a fact that it does not claim is used by no method and by no bound. One that claims
    nothing needs `value`, `above` and `sampling_bound` alone.

    Attributes
    ----------
    name
        As a problem file and a report say it.
    refinement
        Times as many samples, among which the value of a result is sought (M6).
    averages
        Whether rows may be averages about their angles, which bound the whole cycle (P7).
    is_euclidean
        Whether nothing but the sum of weighted squares of all rows matters (S12).
    sums_lengths
        Whether the norm is linear in the lengths of the rows.
    is_largest
        Whether it is the length of the longest row, so that under a limit each row keeps it by itself.
    is_largest_mean
        Whether it is the largest, over operating points, of the mean length of their rows.
    is_diameter
        Whether it is the largest diameter of the balls that hold the signals: at most twice the longest row.
    is_convex
        Whether its cones and its dual norm hold: it is at least <Z, V> for every Z of dual norm one.
    is_monotone_in_lengths
        Whether nothing but the lengths of the rows matters, wherever they stand, and it never falls with one of them.
    is_pointwise
        Whether it is a weighted sum, a root of weighted squares, or the largest of what rows or signals alone have:
        operating points do not count as groups.
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
    is_monotone_in_lengths: ClassVar[bool] = False
    is_pointwise: ClassVar[bool] = False

    def __repr__(self) -> str:
        return f"<{self.name}>"

    def __reduce__(self) -> tuple[Callable[[type[Norm]], Norm], tuple[type[Norm]]]:
        # a norm is one and the same in every process
        return norm_instance, (type(self),)

    @abstractmethod
    def value(self, grid: Grid, rows: Array) -> float:
        """Return the norm."""

    def values(self, grid: Grid, many: Array) -> Array:
        """Return the norm of many signals, shape (n, k, d)."""
        return np.array([self.value(grid, rows) for rows in many])

    def subgradient(self, grid: Grid, rows: Array) -> Array:
        """Return a Z with dual norm at most one and <Z, V> = norm(V); zero rows give zero (P2).

        The inner product is sum_k z_k . v_k; weights are part of Z.
        """
        raise self._unclaimed("subgradient")

    def second_derivative(self, grid: Grid, rows: Array) -> Array | None:
        """Return the second derivative across every row, shape (k,); None if the norm is no sum over rows (P10)."""
        return None

    def dual_norm(self, grid: Grid, z: Array) -> float:
        """Return the smallest t with <Z, V> <= t norm(V) for every V (P3); infinite where there is none."""
        raise self._unclaimed("dual norm")

    def dual_feasible(self, grid: Grid, z: Array) -> Array:
        """Return a simple projection of Z into the unit ball of the dual norm (P3)."""
        violation = self.dual_norm(grid, z)
        return z if violation <= 1.0 else z / violation

    def subdifferential(self, grid: Grid, rows: Array, z: Array) -> Subdifferential | None:
        """Return all dual rows that touch the norm here, with those given; None where they are not known (P19)."""
        return None

    def balanced_dual(self, grid: Grid, z: Array) -> Array:
        """Return nearby dual rows with a finite dual norm (P3)."""
        return z

    def aligned_dual(self, grid: Grid, rows: Array, z: Array) -> Array:
        """Return dual rows along the rows of a design where that is at least as good as a solver's Z (P6)."""
        raise self._unclaimed("dual norm")

    def refined_dual(self, z: Array, steps: int, times: int) -> Array:
        """Interpolate dual rows at `steps` angles of each signal to a grid `times` as fine (P6)."""
        return between(z, steps, times)

    def norm_from_lengths(self, lengths: Array, weights: Array) -> Array:
        """Return the norm of many designs from row lengths (..., k), shape (...); overwrites the lengths."""
        raise TypeError(f"{self.name} is not known from lengths alone")

    def majorant(self, grid: Grid, lengths: Array) -> tuple[Array, float] | None:
        """Return squares above the norm that touch it at these row lengths (R6).

        Returns
        -------
        a, shape (k,), and c of norm(V) <= c + sum_k a_k |v_k|^2 / 2 for every V; None where the norm has no such.
        """
        return None

    def cones(self, grid: Grid) -> Cones:
        """Return the norm as second-order cones."""
        raise self._unclaimed("cones")

    def smooth_expression(self, program: EpigraphProgram, grid: Grid, rows: Any, unit: Any, share: Any) -> Any:
        """Return a smooth expression to minimise, off by no more than the share of `unit` (N3, E22)."""
        raise self._unclaimed("smooth form")

    def smooth_limit(
        self, program: EpigraphProgram, grid: Grid, rows: Any, maximum: float, share: float
    ) -> tuple[Any, float, float]:
        """Return a smooth expression for norm <= `maximum`, its largest value, and the slope of that by `maximum`.

        Smooth where the rows are zero too, and off by no more than the share of one; that to minimise where it is so.
        """
        return self.smooth_expression(program, grid, rows, 1.0, share), maximum, 1.0

    @abstractmethod
    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:
        """Return an upper bound of the norm of signals (n, places, d), without samples (F6)."""

    @abstractmethod
    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return an upper bound of the sampling error of the norm at `steps` samples a cycle (F7, F8)."""

    def _unclaimed(self, what: str) -> TypeError:
        return TypeError(f"norm '{self.name}' claims no {what}, and a method asks for it")


def between(z: Array, steps: int, times: int) -> Array:
    """Interpolate dual rows to a finer grid, linearly by angle."""
    blocks = z.reshape(-1, steps, z.shape[-1])
    share = np.arange(times) / times
    following = np.roll(blocks, -1, axis=1)
    mixed = blocks[:, :, None] * (1.0 - share[:, None]) + following[:, :, None] * share[:, None]
    return np.asarray(mixed.reshape(-1, z.shape[-1]) / times)


def lengths(rows: Array) -> Array:
    """Return |v_k| of each row, shape (k, d) to (k,), safe from overflow and underflow."""
    # BLAS warns of nothing
    if not np.vdot(rows, rows) < _MOST**2:
        return _scaled_lengths(rows)
    size = np.sqrt((rows * rows) @ _ones(rows.shape[-1]))
    if np.minimum.reduce(size, axis=None, initial=_MOST) < _LEAST:
        small = size < _LEAST
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
    """Return sqrt(|v|^2 + e^2) - e of each row of a CasADi matrix (k, d), shape (k, 1) (N3)."""
    import casadi as ca

    return ca.sqrt(ca.sum2(rows * rows) + softness * softness) - softness


def mean_square(signal: Spectrum) -> Array:
    """Return the mean square over the cycle at every place, shape (places,), by Parseval's sum."""
    c = signal.coefficients
    power = 0.5 * np.sum(np.abs(c) ** 2, axis=(0, 2))
    # the steady part does not alternate
    own = power - 0.5 * np.sum(np.abs(c[0]) ** 2, axis=-1) + np.sum(c[0].real ** 2, axis=-1)
    if signal.kinks is None:
        return np.asarray(own)
    return np.asarray(own + lengths(signal.kinks.beyond(len(c), float(signal.base))[1]) ** 2)


def amplitudes(signal: Spectrum) -> Array:
    """Return the sum of the orders' amplitudes at every place, an upper bound of the signal, shape (places,)."""
    own = order_amplitude(signal.coefficients).sum(axis=0)
    if signal.kinks is None:
        return np.asarray(own)
    return np.asarray(own + lengths(signal.kinks.beyond(len(signal.coefficients), float(signal.base))[0]))


def curvature(signal: Spectrum) -> tuple[Array, Array]:
    """Bound the second derivative over crank angle between kinks, and its mean with them, shape (places,)."""
    smooth = signal.smooth
    bent = Spectrum(smooth.base, smooth.coefficients * (smooth.orders**2)[:, None, None])
    maximum, mean = amplitudes(bent), np.sqrt(mean_square(bent))
    if signal.kinks is None:
        return maximum, mean
    size = lengths(signal.kinks.curvature(signal.period))
    bends = lengths(np.abs(signal.kinks.jumps[:, 1]).sum(axis=0)) / signal.period
    return maximum + size.max(axis=0), mean + size.mean(axis=0) + bends


def jumped(signal: Spectrum) -> Array:
    """Return the sum of the signal's own jumps over its period, shape (places,)."""
    if signal.kinks is None:
        return np.zeros(signal.coefficients.shape[1])
    return lengths(np.abs(signal.kinks.jumps[:, 0]).sum(axis=0)) / signal.period


def fine_lengths(signal: Spectrum, steps: int, times: int) -> tuple[Array, float]:
    """Return lengths at `steps` samples from `times` first angles, (steps, times, places), and the step [rad]."""
    return lengths(signal.sample(steps * times)).reshape(steps, times, -1), signal.period / (steps * times)
