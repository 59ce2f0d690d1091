"""Loads on the block as CasADi expressions of open unbalances, or of open throws and unbalances (P1, S19)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineModel
from laufruhe.load_models.symbolic_spectrum import SymbolicSpectrum
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.load_models.uneven_model import UnevenModel, UnevenSymbols
from laufruhe.machine import OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import common_base
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

# relative size below which an order is left out
MIN_SHARE = 1e-4
# random designs at which sizes of orders are compared
PROBES = 6


class FixedCrankLoads:
    """Loads of a fixed crank, affine in the unbalances.

    Parameters
    ----------
    problem
        Problem with open unbalances.
    model
        Loads of the problem, affine in the decision vector.
    unbalances
        CasADi symbols of the decision vector, shape (n,).
    """

    def __init__(self, problem: Problem, model: AffineModel, unbalances: Any) -> None:
        self._problem, self._model, self._u = problem, model, unbalances
        self._bounds = np.concatenate([np.full(d.width, d.scale) for d in model.domains] or [np.zeros(0)])

    def wrenches(self, transform: Array) -> list[SymbolicSpectrum]:
        """Return the relevant orders of the wrench at every operating point, times a matrix of shape (6, 6)."""
        return [self._wrench(bare, slopes, transform) for bare, slopes in self._model.wrenches()]

    def _wrench(self, bare: Any, slopes: Sequence[Any], transform: Array) -> SymbolicSpectrum:
        base = common_base([bare.base, *(slope.base for slope in slopes)])
        spectra = [spectrum.with_finer_base(base).coefficients for spectrum in (bare, *slopes)]
        longest = max(len(c) for c in spectra)
        loads = np.array([np.pad(c, ((0, longest - len(c)), (0, 0))) for c in spectra]) @ transform.T
        size = np.abs(loads[0]).max(axis=1, initial=0.0)
        size += (np.abs(loads[1:]).max(axis=2, initial=0.0) * self._bounds[:, None]).sum(axis=0)
        relevant = _relevant_orders(size, np.arange(longest, dtype=float))
        real, imaginary = (self._expression(part[:, relevant]) for part in (loads.real, loads.imag))
        return SymbolicSpectrum(np.asarray(relevant, dtype=float) * float(base), real, imaginary)

    def _expression(self, loads: Array) -> Any:
        count = loads.shape[1]
        total = ca.MX(ca.DM(loads[0].T.copy()))
        if len(self._bounds):
            flat = loads[1:].transpose(1, 2, 0).reshape(6 * count, -1)
            total += ca.reshape(ca.DM(flat) @ self._u, 6, count)
        return total

    def rows(self, measure: Measure) -> tuple[Any, Grid]:
        """Return the rows of a measure that is not one of mounts, shape (k, d), and their grid (P1)."""
        affine = self._model.norm(measure, self._model.full_samples)
        k, d = affine.constant.shape
        rows = ca.MX(ca.DM(affine.constant))
        if len(self._bounds):
            rows += ca.reshape(ca.DM(affine.slope.transpose(1, 0, 2).reshape(k * d, -1)) @ self._u, k, d)
        return rows, affine.grid


class OpenCrankLoads:
    """Loads of a crank with open angles, smooth in throws, bank angle, split pin and unbalances (S19, S23).

    Parameters
    ----------
    problem
        Problem of the star from which angles are counted.
    moves
        Open angles and their bounds.
    model
        Loads as expressions of angles and unbalances.
    deviations, unbalances
        CasADi symbols of the open angles [rad], and of the decision vector of the unbalances.
    """

    def __init__(
        self, problem: Problem, moves: ThrowMoves, model: UnevenModel, deviations: Any, unbalances: Any
    ) -> None:
        self._problem, self._moves, self._model = problem, moves, model
        self._deviations, self._u = deviations, unbalances
        self._symbols = UnevenSymbols(*moves.angles(deviations), unbalances)

    def wrenches(self, transform: Array) -> list[SymbolicSpectrum]:
        """Return the orders of the wrench that matter at any of `PROBES` designs, times a matrix of shape (6, 6)."""
        return [self._wrench(point, transform) for point in self._problem.points]

    def _wrench(self, point: OperatingPoint, transform: Array) -> SymbolicSpectrum:
        wrench = self._model.wrench(point, self._symbols).mapped(transform)
        return wrench.select(_relevant_orders(self._sizes([wrench.real, wrench.imaginary]), wrench.orders))

    def _sizes(self, parts: Sequence[Any]) -> Array:
        function = ca.Function("sizes", [self._deviations, self._u], list(parts))
        generator = np.random.default_rng(0)
        bounds = np.concatenate([np.full(d.width, d.scale) for d in self._model.domains] or [np.zeros(0)])
        designs = [
            (
                generator.uniform(self._moves.lower, self._moves.upper),
                bounds * generator.uniform(-1.0, 1.0, len(bounds)),
            )
            for _ in range(PROBES)
        ]
        values = [np.abs(np.array(part, dtype=float)) for design in designs for part in function(*design)]
        return np.asarray(np.max(values, axis=(0, 1)))

    def rows(self, measure: Measure) -> tuple[Any, Grid]:
        """Return the rows of a measure and their grid, as `UnevenModel.rows` does."""
        return self._model.rows(measure, self._symbols)


SymbolicLoads: TypeAlias = FixedCrankLoads | OpenCrankLoads
"""Loads of a problem as expressions."""


def _relevant_orders(sizes: Array, orders: Array) -> NDArray[np.intp]:
    # above resonance the motion is the load over the square of the frequency
    motions = sizes / np.maximum(orders, 1.0) ** 2
    has_load = sizes > MIN_SHARE * sizes.max(initial=0.0)
    return np.flatnonzero(has_load & (motions > MIN_SHARE * motions.max(initial=0.0)))
