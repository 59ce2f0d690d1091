"""Norms of many designs at once, from rows that are linear in a few numbers of each design (F12).

The work is one matrix product and two passes over its result. Designs are processed in blocks that fit in the cache.
The size of a block depends on the shapes only, so results do not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid, Norm

CACHE_BYTES = 1 << 19
"""Size of the block of rows that one thread works on [bytes]."""
_MIN_BLOCK = 16
_PARTS_OF_COMPLEX = 2


@dataclass(frozen=True, eq=False)
class BatchNorm:
    """Norm of the rows f . R of many designs.

    Attributes
    ----------
    norm
        Norm of rows.
    rows
        Matrix R, shape (components, features, k); the features f of a design have the shape (features,).
    grid
        Weights and grouping of the k rows.
    """

    norm: Norm
    rows: Array
    grid: Grid

    def values(self, features: Array, threads: int = 1, cache_bytes: int = CACHE_BYTES) -> Array:
        """Return the norm of each design, shape (designs,), from features, shape (designs, features).

        Parameters
        ----------
        features
            Features of each design.
        threads
            Number of threads, each with one block of rows.
        cache_bytes
            Size of a block.
        """
        components, _, k = self.rows.shape
        block = max(cache_bytes // (8 * (components + 1) * max(k, 1)), _MIN_BLOCK)
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

    def value(self, features: Array) -> float:
        """Return the norm of one design from its features, shape (features,)."""
        if not self.norm.is_monotone_in_lengths:
            return self.norm.value(self.grid, np.einsum("cfk,f->kc", self.rows, features))
        return float(self.norm.norm_from_lengths(self._lengths(np.dot(features, self._matrix)), self.grid.weights))

    @cached_property
    def _matrix(self) -> Array:
        components, features, k = self.rows.shape
        order = (1, 2, 0) if components == _PARTS_OF_COMPLEX else (1, 0, 2)
        return np.ascontiguousarray(self.rows.transpose(order).reshape(features, components * k))

    def _lengths(self, product: Array, output: Array | None = None) -> Array:
        """Return the row lengths of every design, shape (..., k); overwrites the products."""
        components, _, k = self.rows.shape
        if components == 1:
            return np.absolute(product, out=output)
        if components == _PARTS_OF_COMPLEX:
            # one pass over the numbers, not four
            return np.absolute(product.view(np.complex128), out=output)
        np.multiply(product, product, out=product)
        total = np.add(product[..., :k], product[..., k : 2 * k], out=output)
        for j in range(2, components):
            np.add(total, product[..., j * k : (j + 1) * k], out=total)
        return np.sqrt(total, out=total)

    @property
    def operations(self) -> int:
        """Number of additions and multiplications of the matrix product of one design."""
        components, features, k = (int(n) for n in self.rows.shape)
        return 2 * components * features * k
