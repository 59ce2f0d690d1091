"""Rows and columns of a cone program as they are put together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Cones


@dataclass(frozen=True, eq=False)
class Block:
    """One norm: its columns of heads and its rows in the program.

    Attributes
    ----------
    cones
        Its form.
    unit
        Rows are counted in it.
    first
        First column of its heads.
    """

    norm: AffineNorm
    cones: Cones
    unit: float
    first: int

    @property
    def heads(self) -> slice:
        """Columns of the heads."""
        return slice(self.first, self.first + len(self.cones.value))

    @property
    def centres(self) -> NDArray[np.int64]:
        """Column of the free vector that each number of the rows is counted from, shape (k, d); none, (0, 0)."""
        if not self.cones.centred:
            return np.zeros((0, 0), dtype=int)
        k, d = self.norm.constant.shape
        signal = np.arange(k) // self.norm.grid.steps
        return np.asarray(self.heads.stop + signal[:, None] * d + np.arange(d))


@dataclass(frozen=True, eq=False)
class Sparse:
    """A matrix column by column, as Clarabel takes it: what SciPy calls so takes a tenth of a second to import.

    Attributes
    ----------
    data, indices, indptr, shape
        As in `scipy.sparse.csc_array`; each place once, row after row.
    """

    data: Array
    indices: NDArray[np.int64]
    indptr: NDArray[np.int64]
    shape: tuple[int, int]
    has_canonical_format: ClassVar[bool] = True

    @classmethod
    def of(cls, rows: NDArray[np.int64], columns: NDArray[np.int64], values: Array, shape: tuple[int, int]) -> Sparse:
        """Of its entries, in any order; those of one place are added up."""
        used = values != 0.0
        keys = (columns * shape[0] + rows)[used]
        order = np.argsort(keys, kind="stable")
        keys, data = keys[order], values[used][order]
        first = np.flatnonzero(np.diff(keys, prepend=-1))
        if len(first) < len(keys):
            keys, data = keys[first], np.add.reduceat(data, first)
        starts = np.searchsorted(keys, shape[0] * np.arange(shape[1] + 1))
        return cls(data, keys % max(shape[0], 1), starts, shape)

    @property
    def nnz(self) -> int:
        """Number of entries."""
        return len(self.data)


class Rows:
    """A x + s = b, s in a product of cones: blocks of rows as they are added."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.entries: list[tuple[NDArray[np.int64], NDArray[np.int64], Array]] = []
        self.right: list[Array] = []
        self.cones: list[Any] = []
        self.count = 0

    def add(self, rows: Any, columns: Any, values: Any, right: Array) -> None:
        """Entries, their rows counted from the block's first."""
        at, across, numbers = np.broadcast_arrays(rows, columns, values)
        self.entries.append((at.ravel() + self.count, across.ravel(), numbers.ravel()))
        self.right.append(right)
        self.count += len(right)

    def matrix(self) -> Sparse:
        """A."""
        rows, columns, values = (np.concatenate([entry[k] for entry in self.entries]) for k in range(3))
        return Sparse.of(rows, columns, values, (self.count, self.columns))
