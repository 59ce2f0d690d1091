"""Norms of a list of vectors, their subgradients and dual norms (P1-P3).

Mean, peak and root-mean-square of a force over angle, mounts and operating points are
norms of the same kind: a norm over rows of the length of each row. So is a sum of
masses of unbalances. What minimises and what proves needs no more than this file.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Norm(StrEnum):
    """How row lengths are put together, with weights w_k."""

    SUM = "sum"
    """sum_k w_k |v_k|; a mean where the weights add up to one."""
    MAXIMUM = "maximum"
    """max_k |v_k|."""
    RMS = "rms"
    """sqrt(sum_k w_k |v_k|^2)."""


# squares of numbers between these neither overflow nor lose digits
_LEAST, _MOST = 1e-140, 1e150


def lengths(rows: Array) -> Array:
    """|v_k| of each row, shape (k, d) to (k,), safe from overflow and underflow."""
    if not np.abs(rows).max(initial=0.0) < _MOST:
        return _scaled_lengths(rows)
    size = np.sqrt(np.einsum("...d,...d->...", rows, rows))
    small = size < _LEAST
    if small.any():
        size[small] = _scaled_lengths(rows[small])
    return np.asarray(size)


def _scaled_lengths(rows: Array) -> Array:
    size = np.abs(rows).max(axis=-1, initial=0.0)
    safe = np.where(size > 0.0, size, 1.0)
    return np.asarray(size * np.sqrt(np.square(rows / safe[..., None]).sum(axis=-1)))


def value(norm: Norm, weights: Array, rows: Array) -> float:
    """The norm of rows (k, d) with weights (k,)."""
    size = lengths(rows)
    if norm is Norm.SUM:
        return float(weights @ size)
    largest = float(size.max(initial=0.0))
    if norm is Norm.MAXIMUM or largest == 0.0:
        return largest
    return largest * float(np.sqrt(weights @ np.square(size / largest)))


def subgradient(norm: Norm, weights: Array, rows: Array) -> Array:
    """A Z with dual norm at most one and <Z, V> = norm(V); zero rows give zero (P2).

    The inner product is sum_k z_k . v_k; weights are part of Z.
    """
    size = lengths(rows)
    if norm is Norm.MAXIMUM:
        z = np.zeros_like(rows)
        k = int(np.argmax(size)) if len(size) else 0
        if len(size) and size[k] > 0.0:
            z[k] = rows[k] / size[k]
        return z
    if norm is Norm.SUM:
        return np.asarray(weights[:, None] * rows / np.where(size > 0.0, size, 1.0)[:, None])
    total = value(norm, weights, rows)
    return np.asarray(weights[:, None] * rows / total) if total > 0.0 else np.zeros_like(rows)


def dual_norm(norm: Norm, weights: Array, z: Array) -> float:
    """Smallest t with <Z, V> <= t norm(V) for every V (P3); infinite where a weightless row is used."""
    size = lengths(z)
    if norm is Norm.MAXIMUM:
        return float(size.sum())
    if np.any((weights == 0.0) & (size > 0.0)):
        return float("inf")
    safe = np.where(weights > 0.0, weights, 1.0)
    if norm is Norm.SUM:
        return float((size / safe).max(initial=0.0))
    largest = float(size.max(initial=0.0))
    return largest * float(np.sqrt((np.square(size / largest) / safe).sum())) if largest > 0.0 else 0.0


def dual_feasible(norm: Norm, weights: Array, z: Array) -> Array:
    """The nearest simple scaling of Z into the unit ball of the dual norm (P3)."""
    if norm is Norm.SUM:
        size = lengths(z)
        shrink = np.where(size > weights, weights / np.where(size > 0.0, size, 1.0), 1.0)
        return np.asarray(z * shrink[:, None])
    excess = dual_norm(norm, weights, z)
    return z if excess <= 1.0 else z / excess
