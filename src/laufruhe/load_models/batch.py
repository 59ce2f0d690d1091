"""Many designs of one problem in one call: decisions, and speeds (F12)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import FEASIBLE, AffineModel, AffineNorm
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.batch_norms import CACHE_BYTES, BatchNorm
from laufruhe.numerics.norms import Grid
from laufruhe.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class Designs:
    """A problem prepared for many designs; the features of its norms are 1 and the decision vector."""

    problem: Problem
    model: AffineModel
    terms: tuple[tuple[float, BatchNorm], ...]
    limits: tuple[tuple[float, BatchNorm], ...] = ()

    def objective(self, values: Array, threads: int = 1, cache_bytes: int = CACHE_BYTES) -> Array:
        """Objective of every design from its decisions u, complex, shape (designs, decisions) (C4)."""
        return self.of_columns(self._features(values), threads, cache_bytes)

    def within(self, values: Array) -> NDArray[np.bool_]:
        """Return which designs keep the limits on loads and masses, within the tolerance `FEASIBLE`."""
        features, kept = self._features(values), np.ones(len(values), dtype=bool)
        for maximum, norm in self.limits:
            kept &= norm.values(features) <= maximum + FEASIBLE * (maximum or 1.0)
        return kept

    def _features(self, values: Array) -> Array:
        columns = [
            (values[:, k] * direction.conjugate()).real
            for k, domain in enumerate(self.model.domains)
            for direction in domain.set.directions
        ]
        return np.stack([np.ones(len(values)), *columns], axis=1)

    def of_columns(self, features: Array, threads: int = 1, cache_bytes: int = CACHE_BYTES) -> Array:
        """Objective of 1 and the decision vector side by side, shape (designs, 1 + columns)."""
        total = np.zeros(len(features))
        for weight, norm in self.terms:
            total += weight * norm.values(features, threads, cache_bytes)
        return total

    def one(self, features: Array) -> float:
        """Objective of a single design, of 1 and the decision vector, shape (1 + columns,)."""
        return sum(weight * norm.value(features) for weight, norm in self.terms)

    @property
    def columns(self) -> int:
        """Length of the decision vector."""
        return sum(domain.width for domain in self.model.domains)

    @property
    def operations(self) -> int:
        """Additions and multiplications of the matrix products of one design."""
        return sum(norm.operations for _, norm in self.terms)


def prepare(problem: Problem, prune: bool = True) -> Designs:
    """Everything that does not depend on the decisions, once.

    What `prune` leaves out, what repeats within the cycle and what nothing drives, changes nothing but the time.

    Raises
    ------
    ModelError
        If anything but unbalances is open: loads are linear in these alone.
    """
    others = [d.name for d in problem.decisions if not d.is_affine]
    others += ["throws or firing order"] if problem.phasing is not None else []
    if others:
        raise ModelError(f"many designs at once differ in unbalances alone; fix {', '.join(others)}")
    model = AffineModel(problem, whole_cycle=not prune)
    affine = model.at(model.full_samples if prune else problem.fidelity.samples)
    terms, limits = (tuple((w, _batched(norm, prune)) for w, norm in of) for of in (affine.terms, affine.limits))
    return Designs(problem, model, terms, limits)


def by_feature(norm: AffineNorm) -> Array:
    """V0 and the columns of B as `BatchNorm` has them, shape (d, 1 + n, k)."""
    return np.concatenate([norm.constant[:, :, None], norm.slope], axis=2).transpose(1, 2, 0)


def _batched(norm: AffineNorm, prune: bool) -> BatchNorm:
    rows, grid = by_feature(norm), norm.grid
    if prune and norm.norm.is_monotone_in_lengths:
        rows, weights = _merged(rows, grid.weights)
        grid = Grid(weights, len(weights))
    return BatchNorm(norm.norm, np.ascontiguousarray(rows), grid)


def _merged(rows: Array, weights: Array) -> tuple[Array, Array]:
    flat = rows.reshape(-1, rows.shape[2]).T
    lead = np.take_along_axis(flat, np.argmax(flat != 0.0, axis=1)[:, None], axis=1)
    _, first, inverse = np.unique(
        flat * np.where(lead < 0.0, -1.0, 1.0), axis=0, return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    total: Array = np.bincount(rank[inverse.ravel()], weights=weights, minlength=len(order)).astype(float)
    return rows[:, :, first[order]], total
