"""Norms of many designs at once: rows that are linear in a few numbers per design (F12).

The work is one matrix product per component and a handful of passes over its result.
Designs go through in blocks that stay in the cache; what a block holds is fixed by the
shapes alone, so results do not depend on the number of threads.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from laufruhe.numerics.mixed_norms import Norm

Array = NDArray[np.float64]

CACHE_BYTES = 1 << 19
"""Of the block of rows that one thread works on."""
_LEAST_BLOCK = 16


@dataclass(frozen=True, eq=False)
class BatchNorm:
    """N(f . R) of many f.

    Attributes
    ----------
    norm
        How row lengths are put together.
    rows
        R, shape (components, features, k).
    weights
        Shape (k,).
    """

    norm: Norm
    rows: Array
    weights: Array

    def values(self, features: Array, threads: int = 1, cache_bytes: int = CACHE_BYTES) -> Array:
        """The norm of every design.

        Parameters
        ----------
        features
            Shape (designs, features).
        threads
            Blocks worked on at the same time.
        cache_bytes
            Memory of one block of rows; all threads together use `threads` times that
            and a little more.

        Returns
        -------
        Shape (designs,).
        """
        width = max(self.rows.shape[2], 1)
        block = max(cache_bytes // (8 * 2 * width), _LEAST_BLOCK)
        out = np.empty(len(features))
        starts = range(0, len(features), block)

        def work(own: Sequence[int]) -> None:
            scratch = np.empty((2, min(block, len(features)), width))
            for start in own:
                part = features[start : start + block]
                out[start : start + block] = self._block(part, scratch[:, : len(part)])

        if threads <= 1 or len(starts) <= 1:
            work(starts)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(work, (starts[k::threads] for k in range(threads))))
        return out

    def value(self, features: Array) -> float:
        """The norm of one design, features of shape (n,), in as few calls as there can be."""
        product = self._flat @ features
        components, _, k = self.rows.shape
        if components == 1 and self.norm is not Norm.RMS:
            return float(self._together(np.abs(product)[None])[0])
        np.multiply(product, product, out=product)
        total = product[:k]
        for j in range(1, components):
            total += product[j * k : (j + 1) * k]
        if self.norm is Norm.RMS:
            return math.sqrt(total @ self.weights)
        if self.norm is Norm.MAXIMUM:
            return math.sqrt(total.max())
        return float(np.sqrt(total, out=total) @ self.weights)

    @cached_property
    def _flat(self) -> Array:
        """R of all components under each other, shape (components k, features)."""
        return np.ascontiguousarray(self.rows.transpose(0, 2, 1).reshape(-1, self.rows.shape[1]))

    def _block(self, features: Array, scratch: Array) -> Array:
        total, product = scratch
        if len(self.rows) == 1 and self.norm is not Norm.RMS:
            # the length of one component is its size: no square, no root
            np.matmul(features, self.rows[0], out=total)
            np.abs(total, out=total)
            return self._together(total)
        for k, rows in enumerate(self.rows):
            target = total if k == 0 else product
            np.matmul(features, rows, out=target)
            np.multiply(target, target, out=target)
            if k > 0:
                np.add(total, target, out=total)
        if self.norm is Norm.RMS:
            return np.asarray(np.sqrt(total @ self.weights))
        if self.norm is Norm.MAXIMUM:
            return np.asarray(np.sqrt(total.max(axis=1)))
        np.sqrt(total, out=total)
        return self._together(total)

    def _together(self, size: Array) -> Array:
        return np.asarray(size.max(axis=1) if self.norm is Norm.MAXIMUM else size @ self.weights)

    @property
    def operations(self) -> int:
        """Additions and multiplications of the matrix products of one design."""
        components, features, k = (int(n) for n in self.rows.shape)
        return 2 * components * features * k
