"""Loads on the block as CasADi expressions of open unbalances, or of open throws and unbalances (P1, S19)."""

from __future__ import annotations

from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from laufruhe.load_models.affine import AffineModel
from laufruhe.load_models.symbolic_spectrum import SymbolicSpectrum, relevant_orders
from laufruhe.load_models.uneven_model import UnevenModel
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import stacked_coefficients
from laufruhe.problem.decision import column_scales
from laufruhe.problem.measure import Measure


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
            relevant = relevant_orders(size, np.arange(len(size), dtype=float))
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


SymbolicLoads: TypeAlias = FixedCrankLoads | UnevenModel
"""Loads of a fixed crank, or of a crank with open angles, as expressions."""
