"""Loads on the block as expressions of what is open: unbalances alone, or throws as well (P1, S19)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineModel
from laufruhe.load_models.lines import Lines
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.load_models.uneven_model import UnevenModel, UnevenSymbols
from laufruhe.machine import OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import common_base
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

KEPT_SHARE = 1e-4
PROBES = 6


class FixedThrows:
    """Affine in the unbalances, the crank as given."""

    def __init__(self, problem: Problem, model: AffineModel, unbalances: Any) -> None:
        self._problem, self._model, self._u = problem, model, unbalances
        self._reach = np.concatenate([np.full(d.width, d.scale) for d in model.domains] or [np.zeros(0)])

    def wrenches(self, moved: Array) -> list[Lines]:
        """Per operating point, times a matrix of shape (6, 6): bare design and every column, the orders that matter."""
        return [self._at(bare, slopes, moved) for bare, slopes in self._model.wrenches()]

    def _at(self, bare: Any, slopes: Sequence[Any], moved: Array) -> Lines:
        base = common_base([bare.base, *(slope.base for slope in slopes)])
        spectra = [spectrum.with_finer_base(base).coefficients for spectrum in (bare, *slopes)]
        longest = max(len(c) for c in spectra)
        loads = np.array([np.pad(c, ((0, longest - len(c)), (0, 0))) for c in spectra]) @ moved.T
        size = np.abs(loads[0]).max(axis=1, initial=0.0)
        size += (np.abs(loads[1:]).max(axis=2, initial=0.0) * self._reach[:, None]).sum(axis=0)
        kept = _felt(size, np.arange(longest, dtype=float))
        real, imaginary = (self._expression(part[:, kept]) for part in (loads.real, loads.imag))
        return Lines(np.asarray(kept, dtype=float) * float(base), real, imaginary)

    def _expression(self, loads: Array) -> Any:
        count = loads.shape[1]
        total = ca.MX(ca.DM(loads[0].T.copy()))
        if len(self._reach):
            flat = loads[1:].transpose(1, 2, 0).reshape(6 * count, -1)
            total += ca.reshape(ca.DM(flat) @ self._u, 6, count)
        return total

    def rows(self, quantity: Measure) -> tuple[Any, Grid]:
        """Vectors whose norm a quantity is that is not one of mounts, shape (k, d), and their weights (P1)."""
        affine = self._model.norm(quantity, self._model.full_samples)
        k, d = affine.constant.shape
        rows = ca.MX(ca.DM(affine.constant))
        if len(self._reach):
            rows += ca.reshape(ca.DM(affine.slope.transpose(1, 0, 2).reshape(k * d, -1)) @ self._u, k, d)
        return rows, affine.grid


class MovedThrows:
    """Smooth in throws, bank and split pin as well (S19, S23)."""

    def __init__(self, problem: Problem, moves: ThrowMoves, model: UnevenModel, turns: Any, unbalances: Any) -> None:
        self._problem, self._moves, self._model = problem, moves, model
        self._turns, self._u = turns, unbalances
        self._at = UnevenSymbols(*moves.angles(turns), unbalances)

    def wrenches(self, moved: Array) -> list[Lines]:
        """Orders that matter at any of a few designs."""
        return [self._wrenches_at(point, moved) for point in self._problem.points]

    def _wrenches_at(self, point: OperatingPoint, moved: Array) -> Lines:
        found = self._model.wrench(point, self._at).mapped(moved)
        return found.select(_felt(self._sizes([found.real, found.imaginary]), found.orders))

    def _sizes(self, parts: Sequence[Any]) -> Array:
        sized = ca.Function("sizes", [self._turns, self._u], list(parts))
        generator = np.random.default_rng(0)
        reach = np.concatenate([np.full(d.width, d.scale) for d in self._model.domains] or [np.zeros(0)])
        drawn = [
            (generator.uniform(self._moves.lower, self._moves.upper), reach * generator.uniform(-1.0, 1.0, len(reach)))
            for _ in range(PROBES)
        ]
        values = [np.abs(np.array(part, dtype=float)) for pair in drawn for part in sized(*pair)]
        return np.asarray(np.max(values, axis=(0, 1)))

    def rows(self, quantity: Measure) -> tuple[Any, Grid]:
        """Return the rows of a measure and their grid, as `UnevenModel.rows` does."""
        return self._model.rows(quantity, self._at)


Loads: TypeAlias = FixedThrows | MovedThrows
"""Loads of a problem in symbols."""


def _felt(sizes: Array, orders: Array) -> NDArray[np.intp]:
    # above resonance an order counts by its load over the square of its frequency
    felt = sizes / np.maximum(orders, 1.0) ** 2
    return np.flatnonzero((sizes > KEPT_SHARE * sizes.max(initial=0.0)) & (felt > KEPT_SHARE * felt.max(initial=0.0)))
