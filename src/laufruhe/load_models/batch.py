"""Evaluate the objective of many designs of one problem in one call (F12)."""

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
    """Problem prepared for the evaluation of many designs.

    The features of a design are 1 and its decision vector, side by side.

    Attributes
    ----------
    problem
        Problem with open unbalances.
    model
        Loads of the problem, affine in the decision vector.
    terms
        Pairs (weight, norm) of the objective.
    limits
        Pairs (maximum, norm).
    """

    problem: Problem
    model: AffineModel
    terms: tuple[tuple[float, BatchNorm], ...]
    limits: tuple[tuple[float, BatchNorm], ...] = ()

    def objective(self, values: Array, threads: int = 1, cache_bytes: int = CACHE_BYTES) -> Array:
        """Return the objective of every design, shape (designs,) (C4).

        Parameters
        ----------
        values
            Decisions of every design, complex, shape (designs, decisions).
        threads
            Number of threads.
        cache_bytes
            Memory for one block of designs.
        """
        return self.objective_from_features(self._features(values), threads, cache_bytes)

    def are_feasible(self, values: Array) -> NDArray[np.bool_]:
        """Return which designs keep the limits on loads and masses within `FEASIBLE`, shape (designs,)."""
        features, feasible = self._features(values), np.ones(len(values), dtype=bool)
        for maximum, norm in self.limits:
            feasible &= norm.values(features) <= maximum + FEASIBLE * (maximum or 1.0)
        return feasible

    def _features(self, values: Array) -> Array:
        columns = [
            (values[:, k] * direction.conjugate()).real
            for k, domain in enumerate(self.model.domains)
            for direction in domain.set.directions
        ]
        return np.stack([np.ones(len(values)), *columns], axis=1)

    def objective_from_features(self, features: Array, threads: int = 1, cache_bytes: int = CACHE_BYTES) -> Array:
        """Return the objective of every design from its features, shape (designs, 1 + columns)."""
        total = np.zeros(len(features))
        for weight, norm in self.terms:
            total += weight * norm.values(features, threads, cache_bytes)
        return total

    def objective_of_one(self, features: Array) -> float:
        """Return the objective of one design from its features, shape (1 + columns,)."""
        return sum(weight * norm.value(features) for weight, norm in self.terms)

    @property
    def columns(self) -> int:
        """Length of the decision vector."""
        return sum(domain.width for domain in self.model.domains)

    @property
    def operations(self) -> int:
        """Number of floating-point operations in the matrix products of one design."""
        return sum(norm.operations for _, norm in self.terms)


def prepare(problem: Problem, prune: bool = True) -> Designs:
    """Compute all that does not depend on the decisions.

    Parameters
    ----------
    problem
        Problem with open unbalances.
    prune
        Whether samples that repeat within the cycle, and components that are zero, are left out to save time.

    Raises
    ------
    ModelError
        If anything but unbalances is open, because loads are linear only in unbalances.
    """
    nonlinear = [d.name for d in problem.decisions if not d.is_affine]
    nonlinear += ["throws or firing order"] if problem.phasing is not None else []
    if nonlinear:
        raise ModelError(f"many designs at once differ in unbalances alone; fix {', '.join(nonlinear)}")
    model = AffineModel(problem, whole_cycle=not prune)
    affine = model.at(model.full_samples if prune else problem.fidelity.samples)
    terms, limits = (
        tuple((number, _batched(norm, prune)) for number, norm in pairs) for pairs in (affine.terms, affine.limits)
    )
    return Designs(problem, model, terms, limits)


def feature_rows(norm: AffineNorm) -> Array:
    """Return V0 and the columns of B in the layout of `BatchNorm`, shape (d, 1 + n, k)."""
    return np.concatenate([norm.constant[:, :, None], norm.slope], axis=2).transpose(1, 2, 0)


def _batched(norm: AffineNorm, prune: bool) -> BatchNorm:
    rows, grid = feature_rows(norm), norm.grid
    if prune and norm.norm.is_monotone_in_lengths:
        rows, weights = _merged(rows, grid.weights)
        grid = Grid(weights, len(weights))
    return BatchNorm(norm.norm, np.ascontiguousarray(rows), grid)


def _merged(rows: Array, weights: Array) -> tuple[Array, Array]:
    # rows that are equal up to sign have equal lengths: each once, with the sum of the weights
    flat = rows.reshape(-1, rows.shape[2]).T
    leading = np.take_along_axis(flat, np.argmax(flat != 0.0, axis=1)[:, None], axis=1)
    _, first, inverse = np.unique(
        flat * np.where(leading < 0.0, -1.0, 1.0), axis=0, return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    total: Array = np.bincount(rank[inverse.ravel()], weights=weights, minlength=len(order)).astype(float)
    return rows[:, :, first[order]], total
