"""Loads of a design as numbers that a page adds up: constant + slope x per order, and kinks (P1, L5a)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.norms import NORMS
from laufruhe.numerics.spectrum import Spectrum, common_base
from laufruhe.problem.evaluation import with_common_base
from laufruhe.problem.measure import Measure, kinks_of, narrow_signal

PEAK = NORMS["maximum"]
NORMS_OF_PAGE = frozenset({"mean", "maximum", "rms", "peak to peak", "worst mean"})
"""Norms that the page's scripts know; a measure with another norm does not follow the sliders."""
ZERO = 1e-13
"""Largest sum of the omitted orders, relative to the largest order."""


@dataclass(frozen=True, eq=False)
class Waves:
    """Non-zero orders of a series, multiples `orders` of the lowest, shape (orders, ...)."""

    orders: NDArray[np.intp]
    coefficients: ComplexArray

    @classmethod
    def from_series(cls, coefficients: ComplexArray) -> Waves:
        """Return a Fourier series, shape (n, ...), without its negligible orders."""
        size = np.abs(coefficients).reshape(len(coefficients), -1).max(axis=1, initial=0.0)
        smallest = np.argsort(size, kind="stable")
        left_out = smallest[np.cumsum(size[smallest]) <= ZERO * size.max(initial=0.0)]
        used = np.delete(np.arange(len(size)), left_out)
        return cls(used, coefficients[used])


@dataclass(frozen=True, eq=False)
class PiecewiseSignal:
    """Kinks of a signal: a smooth series and polynomials between the corners [rad], shape (k,) (L5a).

    Attributes
    ----------
    pieces
        Coefficients by power of (share of the period after a kink - 1/2), shape (powers, k, places, d).
    at
        Angles at which a peak may stand [rad].
    """

    smooth: Waves
    corners: Array
    pieces: Array
    at: Array


@dataclass(frozen=True, eq=False)
class PointSignal:
    """A signal at one operating point, with its share in a mean over operating points.

    Attributes
    ----------
    series
        Series at a decision vector of zero, shape (orders, places, d).
    bends
        Kinks of the series, or None.
    slope
        Change per unit of every column, shape (orders, places, d, columns).
    bent
        Columns of the decision vector with kinks of their own, and these kinks.
    """

    share: float
    series: Waves
    bends: PiecewiseSignal | None
    slope: Waves
    bent: tuple[tuple[int, PiecewiseSignal], ...] = ()


@dataclass(frozen=True, eq=False)
class Signal:
    """Load over one period, affine in the decision vector, with the name and SI unit of its channel.

    Attributes
    ----------
    places
        Names along the second axis.
    base
        Lowest order.
    samples
        Steps over the period at which means are taken; a peak is sought among
        these steps times the refinement of its norm.
    adds
        True if the values are masses to add, not samples of a load.
    """

    name: str
    unit: str
    places: tuple[str, ...]
    base: float
    samples: int
    points: tuple[PointSignal, ...]
    adds: bool = False


def signal_of(model: AffineModel, measure: Measure) -> Signal:
    """Return the signal of a measure for a live page: constant, and slope of each column of the decision vector.

    The page adds slope times value of its sliders to the constant. Masses are added up, and have no orders.
    """
    if not measure.is_load:
        rows, first = model.norm(measure, 1), np.zeros(1, dtype=np.intp)
        constant, slope = (Waves(first, part[None].astype(complex)) for part in (rows.constant, rows.slope))
        names = tuple(str(k + 1) for k in range(len(rows.constant)))
        point = PointSignal(1.0, constant, None, slope)
        return Signal(measure.channel.name, measure.unit, names, 1.0, 1, (point,), adds=True)
    problem, channel = model.problem, measure.load
    pairs = model.spectra(channel)
    every = [signal for constant_signal, by in pairs for signal in (constant_signal, *by)]
    # means and peaks are sought in steps of the period of one evaluation
    base = common_base([problem.engine.cycle.base_order, *(signal.base for signal in every)])
    constants = with_common_base(base, [constant_signal for constant_signal, _ in pairs])
    columns = [with_common_base(base, by) for _, by in pairs]
    # kinks are those of all signals, for every norm
    signals = [reduce(add, by, constant_signal) for constant_signal, by in zip(constants, columns, strict=True)]
    bends = kinks_of(replace(measure, norm=PEAK), signals, problem.engine)
    points = []
    for share, constant_signal, by, at in zip(measure.shares(problem.points), constants, columns, bends, strict=True):
        counted = [narrow_signal(measure, signal, problem.engine) for signal in (constant_signal, *by)]
        points.append(_point(float(share), counted[0], counted[1:], at))
    every_place = channel.places(problem.engine)
    places = tuple(every_place[k] for k in measure.places(every_place)) or ("block",)
    return Signal(channel.name, channel.unit, places, float(base), problem.fidelity.samples, tuple(points))


def _point(share: float, constant: Spectrum, columns: Sequence[Spectrum], at: Array) -> PointSignal:
    shape = constant.coefficients.shape[1:]
    maximum = max((len(column.coefficients) for column in columns), default=1)
    slope = np.zeros((maximum, *shape, len(columns)), dtype=complex)
    for k, column in enumerate(columns):
        slope[: len(column.coefficients), ..., k] = column.coefficients
    bent = tuple((k, _piecewise(column, at)) for k, column in enumerate(columns) if column.kinks is not None)
    bends = _piecewise(constant, at) if bent or constant.kinks is not None else None
    return PointSignal(share, Waves.from_series(constant.coefficients), bends, Waves.from_series(slope), bent)


def _piecewise(signal: Spectrum, at: Array) -> PiecewiseSignal:
    smooth, corners = Waves.from_series(signal.smooth.coefficients), signal.kinks
    if corners is None:
        return PiecewiseSignal(smooth, np.zeros(0), np.zeros((1, 0, *signal.coefficients.shape[1:])), at)
    return PiecewiseSignal(smooth, corners.angles, corners.pieces(signal.period), at)
