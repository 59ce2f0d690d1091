"""Evaluate designs at points of a search of mounts by the exact model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import domains_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import Design, evaluate_design

StartPoint: TypeAlias = tuple[list[float], Array | None]
"""Numbers of the mounts [SI], and columns of the unbalances [kg m], or None for those of the best design."""


def evaluate_design_at(problem: Problem, values: Sequence[Value]) -> Design | None:
    """Evaluate the design with these values of its decisions; None on an undamped resonance."""
    try:
        return evaluate_design(problem, values)
    except ModelError:
        return None


def design_at_start(problem: Problem, start: tuple[list[float], Array]) -> Design | None:
    """Evaluate the design with these mounts and columns of unbalances; None on an undamped resonance."""
    mounts, columns = iter(start[0]), start[1]
    unbalances = iter(domain.complex_value(columns) for domain in domains_of(problem.unbalances))
    return evaluate_design_at(problem, [next(unbalances) if d.is_affine else next(mounts) for d in problem.decisions])
