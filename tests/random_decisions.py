"""Decisions that are drawn at random."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from laufruhe.problem.problem import Problem


def random_decisions(problem: Problem, count: int, seed: int = 0) -> NDArray[np.complex128]:
    """Return the decisions spread evenly over their bounds, shape (count, decisions)."""
    rng = np.random.default_rng(seed)
    columns: Sequence[NDArray[np.complex128]] = [
        rng.uniform(d.lower, d.upper, count) * np.exp(1j * rng.uniform(*d.set.angles, count))
        for d in problem.unbalances
    ]
    return np.stack(columns, axis=1) if columns else np.zeros((count, 0), dtype=complex)
