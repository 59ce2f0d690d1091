"""Evaluate objective and limits of many designs of one problem in one call (F12).

The feature vector of a design is 1 followed by its decision vector. The load rows of all norms are linear in it. The
work is one matrix product and two passes over its result. Designs are processed in blocks that fit in the cache. The
size of a block depends on the shapes only, so results do not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import FEASIBLE, AffineModel, AffineNorm
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.norms import Grid, Norm
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem

CACHE_BYTES = 1 << 19
"""Size of the block of rows that one thread works on [bytes]."""
_MIN_BLOCK = 16
CHECKED, FEW_DESIGNS = 32, 3000
"""Number of designs of a batch whose exact objectives decide how many samples an automatic fidelity takes, and number
of designs below which deciding takes longer than it saves."""
FEWEST, GROWTH, SHARE = 24, 1.5, 0.5
"""Fewest samples of a period, least factor between two numbers of samples, and share of the tolerance that the error
of checked designs may take."""
_PARTS_OF_COMPLEX = 2


@dataclass(frozen=True, eq=False)
class BatchNorm:
    """Norm of the load rows f . R of a design with the feature vector f = (1, open unbalances), for many designs.

    Attributes
    ----------
    rows
        Coefficients R of k load rows, shape (components, features, k).
    source
        Norm of the load rows; None if no samples may be left out.
    """

    norm: Norm
    rows: Array
    grid: Grid
    source: AffineNorm | None = None

    @cached_property
    def coarser(self) -> tuple[BatchNorm, ...]:
        """The same norm at fewer samples, fewest first."""
        if self.source is None or self.source.grid.kinks:
            return ()
        norms, count, steps = list[BatchNorm](), 0.0, self.source.grid.steps
        for samples in (n for n in range(FEWEST, steps) if steps % n == 0):
            if samples >= GROWTH * count:
                count, norm = samples, self.source.coarser(steps // samples)
                norms.append(BatchNorm(self.norm, np.ascontiguousarray(feature_rows(norm)), norm.grid))
        return tuple(norms)

    def values_within(self, tolerance: float, features: Array, threads: int = 1) -> Array:
        """Return the norm of each design as `values` does, to a relative error of `tolerance` (F11).

        Fewer samples are taken if designs spread over the batch, and the smallest norms, stay within the tolerance.
        """
        if len(features) < FEW_DESIGNS or not tolerance:
            return self.values(features, threads)
        spread = features[:: len(features) // CHECKED]
        exact = self.values(spread)
        for norm in self.coarser:
            if np.all(np.abs(norm.values(spread) - exact) <= SHARE * tolerance * exact):
                norms = norm.values(features, threads)
                smallest = np.argpartition(norms, CHECKED)[:CHECKED]
                exact_smallest = self.values(features[smallest])
                if np.all(np.abs(norms[smallest] - exact_smallest) <= SHARE * tolerance * exact_smallest):
                    return norms
        return self.values(features, threads)

    def values(self, features: Array, threads: int = 1) -> Array:
        """Return the norm of a load for many designs, shape (designs,).

        `features` has the vector (1, decision vector) of each design, shape (designs, features).
        """
        components, _, k = self.rows.shape
        block = max(CACHE_BYTES // (8 * (components + 1) * max(k, 1)), _MIN_BLOCK)
        norms = np.empty(len(features))
        starts = range(0, len(features), block)
        if not self.norm.is_monotone_in_lengths:
            for start in starts:
                part = slice(start, start + block)
                norms[part] = self.norm.values(self.grid, np.einsum("cfk,nf->nkc", self.rows, features[part]))
            return norms

        def work(block_starts: Sequence[int]) -> None:
            product, lengths = np.empty((block, components * k)), np.empty((block, k))
            for start in block_starts:
                part = features[start : start + block]
                products = np.matmul(part, self._matrix, out=product[: len(part)])
                size = self._lengths(products, lengths[: len(part)])
                norms[start : start + block] = self.norm.norm_from_lengths(size, self.grid.weights)

        if threads <= 1 or len(starts) <= 1:
            work(starts)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(work, (starts[k::threads] for k in range(threads))))
        return norms

    @cached_property
    def _matrix(self) -> Array:
        components, features, k = self.rows.shape
        order = (1, 2, 0) if components == _PARTS_OF_COMPLEX else (1, 0, 2)
        return np.ascontiguousarray(self.rows.transpose(order).reshape(features, components * k))

    def _lengths(self, product: Array, output: Array) -> Array:
        """Return the lengths of the load rows of every design, shape (designs, k).

        `product` has the rows of all designs: features times coefficients. It is overwritten.
        """
        components, _, k = self.rows.shape
        if components == 1:
            return np.absolute(product, out=output)
        if components == _PARTS_OF_COMPLEX:
            # one pass over the numbers, not four
            return np.absolute(product.view(np.complex128), out=output)
        np.multiply(product, product, out=product)
        total = np.add(product[:, :k], product[:, k : 2 * k], out=output)
        for j in range(2, components):
            np.add(total, product[:, j * k : (j + 1) * k], out=total)
        return np.sqrt(total, out=total)


@dataclass(frozen=True, eq=False)
class Designs:
    """Problem prepared for many designs: the norms of the loads and masses that it minimises or limits."""

    model: AffineModel
    norms: Mapping[Measure, BatchNorm]

    @property
    def tolerance(self) -> float:
        """Relative error that the objective may have: that of an automatic fidelity, or zero."""
        return self.model.problem.fidelity.tolerance or 0.0

    def objective(self, values: Array | ComplexArray, threads: int = 1) -> Array:
        """Return the objective of each design, shape (designs,), from complex values (designs, decisions) (C4)."""
        total, features = np.zeros(len(values)), self.features(values)
        for term in self.model.problem.objective:
            total += term.weight * self.values(term.measure, features, threads, self.tolerance)
        return total

    def are_feasible(self, values: Array | ComplexArray) -> Mask:
        """Return the mask of designs that keep all limits within `FEASIBLE`, shape (designs,)."""
        features = self.features(values)
        slack = [self.slack(limit, self.values(limit.measure, features)) for limit in self.model.problem.limits]
        return np.asarray(np.all(np.reshape(slack, (len(slack), len(values))) >= -FEASIBLE, axis=0))

    def features(self, values: Array | ComplexArray) -> Array:
        """Return the feature vectors of complex values (designs, decisions), shape (designs, 1 + columns)."""
        columns = [
            (values[:, k] * direction.conjugate()).real
            for k, domain in enumerate(self.model.domains)
            for direction in domain.set.directions
        ]
        return np.stack([np.ones(len(values)), *columns], axis=1)

    def values(self, measure: Measure, features: Array, threads: int = 1, tolerance: float = 0.0) -> Array:
        """Return a measure of each design [SI], shape (designs,), to a relative error of `tolerance`.

        Numbers of the mounting are equal for all.
        """
        if measure in self.norms:
            return self.norms[measure].values_within(tolerance, features, threads)
        return np.full(len(features), self.model.bare.value(measure))

    def slack(self, limit: Limit, values: Array) -> Array:
        """Return the relative slack of a limit from the values of its measure, shape (designs,) (E15)."""
        if limit.measure in self.norms:
            return limit.slacks(values)
        return np.full(len(values), -self.model.bare.check_limit(limit).violation)


def prepare(problem: Problem) -> Designs:
    """Return a fast evaluator of many designs: it keeps all parts of the loads that do not depend on the decisions.

    Samples that repeat within the cycle, and components that are zero, are left out to save time.

    Raises
    ------
    ModelError
        If anything but unbalances is open, because loads are linear only in unbalances.
    """
    nonlinear = [d.name for d in problem.decisions if not d.is_affine]
    nonlinear += ["throws or firing order"] if problem.phasing is not None else []
    if nonlinear:
        raise ModelError(
            f"designs that are evaluated together may differ in unbalances alone; fix {', '.join(nonlinear)}"
        )
    model = AffineModel(problem)

    def batched(measure: Measure) -> BatchNorm:
        # peaks have the finer samples of the exact evaluation (M6)
        norm = model.norm(measure, model.full_samples * (measure.norm.refinement if measure.is_load else 1))
        rows = np.ascontiguousarray(feature_rows(norm))
        return BatchNorm(norm.norm, rows, norm.grid, norm if norm.norm.is_monotone_in_lengths else None)

    measures = [term.measure for term in problem.load_terms] + [limit.measure for limit in problem.load_limits]
    return Designs(model, {measure: batched(measure) for measure in measures})


def feature_rows(norm: AffineNorm) -> Array:
    """Return the constant rows V0 and slopes B of a norm in the layout of `BatchNorm.rows`, shape (d, 1 + n, k)."""
    return np.concatenate([norm.constant[:, :, None], norm.slope], axis=2).transpose(1, 2, 0)
