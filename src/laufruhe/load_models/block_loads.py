"""Loads on the block as CasADi expressions of open unbalances, or of open throws and unbalances (P1, S19)."""

from __future__ import annotations

from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineModel
from laufruhe.load_models.symbolic_spectrum import SymbolicSpectrum
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.load_models.uneven_model import UnevenModel, UnevenSymbols, rotor_throws_of
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import stacked_coefficients
from laufruhe.problem.decision import column_scales
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

# size below which an order is left out, relative to the largest order
MIN_SHARE = 1e-4
# random designs at which sizes of orders are compared
PROBES = 6


class FixedCrankLoads:
    """Loads of a fixed crank, affine in the unbalances; `unbalances` are CasADi symbols of the decision vector."""

    def __init__(self, model: AffineModel, unbalances: Any) -> None:
        self._model, self._unbalances = model, unbalances

    def wrenches(self, transform: Array) -> list[SymbolicSpectrum]:
        """Return the symbolic wrench on the block at every operating point, multiplied by a 6 x 6 `transform`.

        Negligible orders are left out.
        """
        wrenches, bounds = [], column_scales(self._model.domains)
        for bare, slopes in self._model.wrenches():
            base, spectra = stacked_coefficients([bare, *slopes])
            loads = spectra @ transform.T
            size = np.abs(loads[0]).max(axis=1, initial=0.0)
            size += (np.abs(loads[1:]).max(axis=2, initial=0.0) * bounds[:, None]).sum(axis=0)
            relevant = _relevant_orders(size, np.arange(len(size), dtype=float))
            parts = loads[:, relevant].transpose(0, 2, 1)
            real, imaginary = (self._affine(part[0], part[1:]) for part in (parts.real, parts.imag))
            wrenches.append(SymbolicSpectrum(np.asarray(relevant, dtype=float) * float(base), real, imaginary))
        return wrenches

    def rows(self, measure: Measure) -> tuple[Any, Grid]:
        """Return the load rows of a measure that does not depend on the mounts, shape (k, d), and their grid (P1)."""
        norm = self._model.norm(measure, self._model.full_samples)
        return self._affine(norm.constant, np.moveaxis(norm.slope, -1, 0)), norm.grid

    def _affine(self, constant: Array, slopes: Array) -> Any:
        # matrix of shape (k, d) from its derivatives by every column, shape (n, k, d)
        total, (n, k, d) = ca.MX(ca.DM(constant.copy())), slopes.shape
        if n:
            total += ca.reshape(ca.DM(slopes.transpose(2, 1, 0).reshape(k * d, n)) @ self._unbalances, k, d)
        return total


class OpenCrankLoads(UnevenModel):
    """Loads of a crank with open angles, smooth in throws, bank angle, split pin and unbalances (S19, S23).

    Parameters
    ----------
    problem
        Problem with the crank star from which the open angles are counted.
    moves
        Open angles and their bounds.
    deviations, unbalances
        CasADi symbols of the open angles [rad], and of the decision vector of the unbalances.
    """

    def __init__(self, problem: Problem, moves: ThrowMoves, deviations: Any, unbalances: Any) -> None:
        symbols = UnevenSymbols(*moves.angles(deviations), unbalances)
        super().__init__(problem, moves.layout, rotor_throws_of(moves.phasing, moves.start), symbols)
        self._moves, self._variables = moves, [deviations, unbalances]

    def wrenches(self, transform: Array) -> list[SymbolicSpectrum]:
        """Return the symbolic wrench on the block at every operating point, multiplied by a 6 x 6 `transform`.

        Orders that are small at all of `PROBES` random designs are left out.
        """
        relevant, bounds = [], column_scales(self.domains)
        for point in self.problem.points:
            wrench = self.wrench(point).mapped(transform)
            function = ca.Function("sizes", self._variables, [wrench.real, wrench.imaginary])
            generator = np.random.default_rng(0)
            designs = [
                (
                    generator.uniform(self._moves.lower, self._moves.upper),
                    bounds * generator.uniform(-1.0, 1.0, len(bounds)),
                )
                for _ in range(PROBES)
            ]
            values = [np.abs(np.array(part, dtype=float)) for design in designs for part in function(*design)]
            relevant.append(wrench.select(_relevant_orders(np.max(values, axis=(0, 1)), wrench.orders)))
        return relevant


SymbolicLoads: TypeAlias = FixedCrankLoads | OpenCrankLoads
"""Loads of a fixed crank, or of a crank with open angles, as expressions."""


def _relevant_orders(sizes: Array, orders: Array) -> NDArray[np.intp]:
    # above resonance the motion is the load over the square of the frequency
    motions = sizes / np.maximum(orders, 1.0) ** 2
    has_load = sizes > MIN_SHARE * sizes.max(initial=0.0)
    return np.flatnonzero(has_load & (motions > MIN_SHARE * motions.max(initial=0.0)))
