"""Designs at places of a search of mounts, by the exact model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import domains_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import Design, judged

Place: TypeAlias = tuple[list[float], Array | None]
"""Mounts, and columns of the unbalances."""


def judged_at(problem: Problem, values: Sequence[Value]) -> Design | None:
    """A design by the exact model; none on a resonance that nothing damps."""
    try:
        return judged(problem, values)
    except ModelError:
        return None


def started_at(problem: Problem, place: tuple[list[float], Array]) -> Design | None:
    """The design that a start is."""
    mounts, columns = place
    own, sizes = iter(mounts), iter(d.complex_value(columns) for d in domains_of(problem.unbalances))
    return judged_at(problem, [next(sizes) if d.is_affine else next(own) for d in problem.decisions])
