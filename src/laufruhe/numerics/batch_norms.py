"""Norms of many designs at once, from rows that are linear in a few numbers per design (F12).

The work is one matrix product and two passes over its result.
Designs go through in blocks that stay in the cache; what a block holds is fixed by the
shapes alone, so results do not depend on the number of threads.
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
"""Of the block of rows that one thread works on."""
_LEAST_BLOCK = 16
_PARTS_OF_COMPLEX = 2


@dataclass(frozen=True, eq=False)
class BatchNorm:
    """Norm N(f . R) for many f, R of shape (components, features, k)."""

    norm: Norm
    rows: Array
    grid: Grid

    def values(self, features: Array, threads: int = 1, cache_bytes: int = CACHE_BYTES) -> Array:
        """Return the norm of every design from features (designs, features).

        One block of rows takes `cache_bytes`; `threads` are worked on at the same time.
        """
        components, _, k = self.rows.shape
        block = max(cache_bytes // (8 * (components + 1) * max(k, 1)), _LEAST_BLOCK)
        out = np.empty(len(features))
        starts = range(0, len(features), block)
        if not self.norm.is_monotone_in_lengths:
            for start in starts:
                own = slice(start, start + block)
                out[own] = self.norm.values(self.grid, np.einsum("cfk,nf->nkc", self.rows, features[own]))
            return out

        def work(own: Sequence[int]) -> None:
            product, lengths = np.empty((block, components * k)), np.empty((block, k))
            for start in own:
                part = features[start : start + block]
                found = np.matmul(part, self._matrix, out=product[: len(part)])
                size = self._lengths(found, lengths[: len(part)])
                out[start : start + block] = self.norm.norm_from_lengths(size, self.grid.weights)

        if threads <= 1 or len(starts) <= 1:
            work(starts)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(work, (starts[k::threads] for k in range(threads))))
        return out

    def value(self, features: Array) -> float:
        """Return the norm of one design from features (n,)."""
        if not self.norm.is_monotone_in_lengths:
            return self.norm.value(self.grid, np.einsum("cfk,f->kc", self.rows, features))
        return float(self.norm.norm_from_lengths(self._lengths(np.dot(features, self._matrix)), self.grid.weights))

    @cached_property
    def _matrix(self) -> Array:
        components, features, k = self.rows.shape
        order = (1, 2, 0) if components == _PARTS_OF_COMPLEX else (1, 0, 2)
        return np.ascontiguousarray(self.rows.transpose(order).reshape(features, components * k))

    def _lengths(self, product: Array, out: Array | None = None) -> Array:
        """Return the row lengths of every design, shape (..., k); overwrites the products."""
        components, _, k = self.rows.shape
        if components == 1:
            return np.absolute(product, out=out)
        if components == _PARTS_OF_COMPLEX:
            # one pass over the numbers in place of four
            return np.absolute(product.view(np.complex128), out=out)
        np.multiply(product, product, out=product)
        total = np.add(product[..., :k], product[..., k : 2 * k], out=out)
        for j in range(2, components):
            np.add(total, product[..., j * k : (j + 1) * k], out=total)
        return np.sqrt(total, out=total)

    @property
    def operations(self) -> int:
        """Number of additions and multiplications of the matrix product of one design."""
        components, features, k = (int(n) for n in self.rows.shape)
        return 2 * components * features * k
