"""Open numbers from measured orders by weighted least squares, with their uncertainty (J1-J4)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import ndtri, stdtrit
from scipy.stats import qmc

from laufruhe.errors import ModelError
from laufruhe.extensions.identification.measurement import Measurement
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.budget import is_time_over
from laufruhe.problem.decision import Domain, column_bounds, decision_vector, domains_of
from laufruhe.problem.dependence import is_affine, open_kinds
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.sets import Value

CONFIDENCE = 0.95
_AT_EDGE = 1e-6
"""Distance from a bound, as a share of the range, at which a number is at this bound."""
_ROUNDS, _SAME = 10, 1e-4
"""Largest number of fits in which unknown deviations are estimated, and relative change that ends them (J2)."""
LARGE = 0.1
"""Least part of a direction for a number to be named with it."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Numbers that were estimated from measurements.

    Attributes
    ----------
    domains
        Open numbers with their columns.
    values
        Estimated columns, shape (n,).
    covariance
        Covariance of the columns, shape (n, n); infinite for those that the measurement does not determine (J3).
    at_bounds
        Mask of the columns at a bound of their set, whose uncertainty is not computed.
    directions
        Directions of columns, in shares of their ranges, that the measurement does not determine, shape (m, n) (J4).
    freedom
        Degrees of freedom of the deviations; infinite if these are known.
    deviations
        Standard deviation of real and imaginary parts, by measurement [SI].
    unexplained
        Root mean square of measured less computed amplitudes, as a share of the measured ones, by measurement.
    residuals
        Computed less measured amplitudes of each measurement, shape (rows, places, d) [SI]; nan if not measured.
    misfit
        Sum of squares over its expectation, if the deviations are known; None otherwise.
    is_linear
        True if all columns act linearly, so that the least squares have one minimum.
    """

    domains: tuple[Domain, ...]
    values: Array
    covariance: Array
    at_bounds: NDArray[np.bool_]
    directions: Array
    freedom: float
    deviations: tuple[float, ...]
    unexplained: tuple[float, ...]
    residuals: tuple[ComplexArray, ...]
    misfit: float | None
    is_linear: bool

    @property
    def half_width(self) -> float:
        """Half-width of a confidence interval in standard deviations."""
        if math.isinf(self.freedom):
            return float(ndtri(0.5 + 0.5 * CONFIDENCE))
        return float(stdtrit(self.freedom, 0.5 + 0.5 * CONFIDENCE))

    def polar(self, domain: Domain) -> tuple[tuple[float, float], ...]:
        """Return estimate and standard deviation of a number; of an unbalance with an open angle size and angle."""
        x, covariance = self.values[domain.columns], self.covariance[domain.columns, domain.columns]
        if domain.width == 1:
            return ((float(x[0]), math.sqrt(covariance[0, 0])),)
        size = float(np.hypot(*x))
        along = x / size if size else np.array([1.0, 0.0])
        across = np.array([-along[1], along[0]])
        parts = [
            math.sqrt(max(float(direction @ covariance @ direction), 0.0))
            if np.isfinite(covariance).all()
            else math.inf
            for direction in (along, across)
        ]
        return (size, parts[0]), (math.atan2(x[1], x[0]) % math.tau, parts[1] / size if size else math.inf)


def estimate(measurements: Sequence[Measurement], say: Callable[[str], None] = lambda _: None) -> Estimate:
    """Return the numbers with the least squares of measured less computed orders (J1).

    Parameters
    ----------
    measurements
        Measurements, whose problems have the same open numbers.
    say
        Function that reports steps.

    Raises
    ------
    ModelError
        If nothing is open, if there are fewer measured numbers than open ones, or if no start can be computed.
    """
    problem = measurements[0].problem
    domains = domains_of(problem.decisions)
    if not domains:
        raise ModelError("has no open number to estimate; write for example unbalance = { between = [...] }")
    low, high = column_bounds(domains)
    count = 2 * sum(int(m.mask.sum()) for m in measurements)
    # files of one quantity that state no deviation share an estimated one (J2)
    unstated = {
        name: [k for k, m in enumerate(measurements) if m.channel.name == name and m.deviation is None]
        for name in dict.fromkeys(m.channel.name for m in measurements if m.deviation is None)
    }
    if count < len(low) + bool(unstated):
        raise ModelError(
            f"has {count} measured numbers for {len(low)} open ones; measure more orders, or open fewer numbers"
        )
    deviations = np.array([m.deviation or 0.0 for m in measurements])
    for members in unstated.values():
        deviations[members] = 0.01 * _rms([measurements[k].values[measurements[k].mask] for k in members]) or 1.0
    is_linear = all(decision.is_affine for decision in problem.decisions) and all(
        is_affine(m.channel, open_kinds(m.problem), m.problem) for m in measurements
    )
    starts = _starts(domains, low, high, 1 if is_linear else problem.search.starts, problem.search.seed)
    model = (_LinearModel if is_linear else _Model)(measurements, domains)
    say(f"fitting {len(low)} numbers to {count} measured ones")
    best, spare = starts[0], 1.0 - len(low) / count
    for _ in range(_ROUNDS):
        best = _fitted(model, deviations, starts, low, high)
        starts, before = [best], deviations.copy()
        parts = model.split(best)
        for members in unstated.values():
            deviations[members] = _rms([parts[k] for k in members]) / math.sqrt(2.0 * spare) or deviations[members]
        if np.allclose(deviations, before, rtol=_SAME, atol=0.0):
            break
    weights = model.weights(deviations)
    jacobian = weights[:, None] * model.jacobian(best, low, high)
    span = high - low
    at_bounds = (best <= low + _AT_EDGE * span) | (best >= high - _AT_EDGE * span)
    for domain in domains:
        if domain.width > 1:
            at_bounds[domain.columns] = min(domain.set.margins(best[domain.columns])) <= _AT_EDGE
    covariance, directions = _uncertainty(jacobian, span, at_bounds)
    shares = [_rms([part]) / (_rms([m.values[m.mask]]) or 1.0) for part, m in zip(parts, measurements, strict=True)]
    residuals = []
    for part, m in zip(parts, measurements, strict=True):
        residuals.append(np.full(m.values.shape, complex(math.nan, math.nan)))
        residuals[-1][m.mask] = part
    misfit = float(np.sum((weights * stacked(parts)) ** 2)) / (count - len(low)) if not unstated else None
    estimated = 2 * sum(int(measurements[k].mask.sum()) for members in unstated.values() for k in members)
    return Estimate(
        domains, best, covariance, at_bounds, directions, spare * estimated if unstated else math.inf,
        tuple(deviations.tolist()), tuple(shares), tuple(residuals), misfit, is_linear,
    )  # fmt: skip


def value_of(domain: Domain, x: Array) -> Value:
    """Return the value of a number from all columns; real, unless all loads are affine in it."""
    value = domain.complex_value(x)
    return value if domain.decision.is_affine else value.real


def stacked(parts: Sequence[ComplexArray]) -> Array:
    """Return real and imaginary parts of all measurements, one after the other."""
    return np.concatenate([part for c in parts for part in (c.real, c.imag)])


class _Model:
    """Differences of computed and measured orders as a function of the columns of the open numbers."""

    def __init__(self, measurements: Sequence[Measurement], domains: Sequence[Domain]) -> None:
        self.measurements, self.domains = measurements, domains

    def projected(self, x: Array) -> Array:
        """Return the nearest columns within the sets of all numbers; bounds of columns are wider than a disc."""
        return np.concatenate([domain.project(x) for domain in self.domains])

    def split(self, x: Array) -> list[ComplexArray]:
        """Return computed less measured amplitudes of each measurement [SI]."""
        values = [value_of(domain, x) for domain in self.domains]
        evaluations: dict[int, Evaluation] = {}
        parts = []
        for m in self.measurements:
            if id(m.problem) not in evaluations:
                evaluations[id(m.problem)] = evaluate(m.problem.fixed_at(values))
            parts.append((m.predicted(evaluations[id(m.problem)]) - m.values)[m.mask])
        return parts

    def residual(self, x: Array) -> Array:
        """Return all differences at the nearest allowed columns [SI]."""
        return stacked(self.split(self.projected(x)))

    def weights(self, deviations: Sequence[float] | Array) -> Array:
        """Return the inverse of the deviation of each residual [1/SI]."""
        return np.repeat(1.0 / np.asarray(deviations), [2 * int(m.mask.sum()) for m in self.measurements])

    def jacobian(self, x: Array, low: Array, high: Array) -> Array:
        """Return central differences, within the bounds, shape (rows, columns)."""
        columns = []
        for k, span in enumerate(high - low):
            step = np.zeros(len(x))
            step[k] = 1e-5 * span
            ends = np.minimum(x + step, high), np.maximum(x - step, low)
            columns.append((self.residual(ends[0]) - self.residual(ends[1])) / (ends[0] - ends[1])[k])
        return np.column_stack(columns)


class _LinearModel(_Model):
    """Model of orders that are affine in all columns, from two evaluations for each column."""

    def __init__(self, measurements: Sequence[Measurement], domains: Sequence[Domain]) -> None:
        super().__init__(measurements, domains)
        low, high = column_bounds(domains)
        self._middle, exact = 0.5 * (low + high), super().split
        rest = exact(self._middle)
        steps = [(exact(self._middle + step), exact(self._middle - step)) for step in np.diag(0.5 * (high - low))]
        slopes = [
            [(a - b) / span for a, b in zip(*ends, strict=True)] for ends, span in zip(steps, high - low, strict=True)
        ]
        self._parts = [(part, np.column_stack(columns)) for part, *columns in zip(rest, *slopes, strict=True)]

    def split(self, x: Array) -> list[ComplexArray]:
        return [part + slope @ (x - self._middle) for part, slope in self._parts]


def _fitted(model: _Model, deviations: Array, starts: Sequence[Array], low: Array, high: Array) -> Array:
    """Return the columns with the least squares of all starts."""
    span = high - low
    weights = model.weights(deviations)

    # columns as shares of their ranges, so that all have one scale
    def residual(u: Array) -> Array:
        return weights * model.residual(low + span * u)

    def jacobian(u: Array) -> Array:
        return weights[:, None] * model.jacobian(low + span * u, low, high) * span

    fits: list[Any] = []
    failure = ""
    for start in starts:
        if fits and is_time_over():
            break
        first = np.clip((start - low) / span, 1e-6, 1.0 - 1e-6)
        try:
            fits.append(least_squares(residual, first, jacobian, bounds=(0.0, 1.0), xtol=1e-12))
        except ModelError as error:
            failure = str(error)
    if not fits:
        raise ModelError(f"has no start that can be computed ({failure}); give other starts")
    return model.projected(low + span * min(fits, key=lambda fit: float(fit.cost)).x)


def _starts(domains: Sequence[Domain], low: Array, high: Array, count: int, seed: int) -> list[Array]:
    first = np.clip(decision_vector(domains), low, high)
    if count == 1:
        return [first]
    return [first, *qmc.scale(qmc.Halton(len(low), seed=seed).random(count - 1), low, high)]


def _uncertainty(jacobian: Array, span: Array, at_bounds: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the covariance of the columns, and the directions whose deviation is above their range (J3, J4)."""
    n = len(span)
    inside = np.flatnonzero(np.logical_not(at_bounds))
    covariance = np.zeros((n, n))
    if not inside.size:
        return covariance, np.zeros((0, n))
    _, sizes, rows = np.linalg.svd(jacobian[:, inside] * span[inside], full_matrices=False)
    weak = sizes < 1.0
    known = rows[~weak] / np.maximum(sizes[~weak, None], 1e-300)
    block = known.T @ known * np.outer(span[inside], span[inside])
    # a number with a part in an undetermined direction has no finite deviation
    lost = np.any(np.abs(rows[weak]) > LARGE, axis=0)
    block[lost, :], block[:, lost] = 0.0, 0.0
    block[lost, lost] = math.inf
    covariance[np.ix_(inside, inside)] = block
    directions = np.zeros((int(weak.sum()), n))
    directions[:, inside] = rows[weak]
    return covariance, directions


def _rms(parts: Sequence[ComplexArray]) -> float:
    values = np.concatenate([np.ravel(part) for part in parts])
    return float(np.sqrt(np.mean(np.abs(values) ** 2))) if values.size else 0.0
