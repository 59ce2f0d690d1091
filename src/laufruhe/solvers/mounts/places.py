"""Designs at points of a search of mounts, evaluated by the exact model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import domains_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import Design, evaluate_design

Place: TypeAlias = tuple[list[float], Array | None]
"""Numbers of the mounts, and columns of the unbalances or None."""


def evaluate_design_at(problem: Problem, values: Sequence[Value]) -> Design | None:
    """Return a design by the exact model, or None on an undamped resonance."""
    try:
        return evaluate_design(problem, values)
    except ModelError:
        return None


def started_at(problem: Problem, place: tuple[list[float], Array]) -> Design | None:
    """Return the design at mounts and columns of unbalances, or None on an undamped resonance."""
    mounts, columns = iter(place[0]), place[1]
    unbalances = iter(domain.complex_value(columns) for domain in domains_of(problem.unbalances))
    return evaluate_design_at(problem, [next(unbalances) if d.is_affine else next(mounts) for d in problem.decisions])
