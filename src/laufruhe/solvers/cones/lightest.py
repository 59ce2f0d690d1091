"""Of designs that no load can tell apart the lightest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN, Grid
from laufruhe.problem.decision import Domain
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.program import projected

SAME_LOAD = 1e-10
"""Share of what a load turns to by all decisions, under which a direction does not move it."""


def lightest(problem: AffineProblem, x: Array, still: Array, weights: Sequence[float]) -> Array:
    """Among x + still z, the decisions of least weighted size that stay in their sets and under mass limits.

    Parameters
    ----------
    problem
        Domains and limits.
    x
        An optimal decision vector.
    still
        Shape (n, m): directions that no load can tell apart.
    weights
        Of every decision's size.
    """
    sizes = [float(np.hypot.reduce(x[domain.columns])) for domain in problem.domains]
    total = sum(w * size for w, size in zip(weights, sizes, strict=True))
    if total == 0.0:
        return x
    # nothing lighter is larger than all of this together, whatever the bounds
    domains = tuple(
        replace(d, decision=replace(d.decision, set=d.set.within(total / w if w else size)))
        for d, w, size in zip(problem.domains, weights, sizes, strict=True)
    )
    limits = tuple((max(most, norm.value(x)), norm) for most, norm in problem.limits if _is_moved(norm, still))
    terms = tuple((w, distance(d, np.zeros(d.width), problem.size)) for w, d in zip(weights, domains, strict=True) if w)
    scales = np.concatenate([np.full(d.width, d.scale) for d in domains])
    # across the directions, in units of the sizes, nothing moves
    base, values, _ = np.linalg.svd(still / scales[:, None], full_matrices=True)
    across = base[:, len(values) :].T / scales
    found = solve_cones(AffineProblem(terms, limits, domains, problem.samples), (across, across @ x))
    if found.x is None:
        return x
    steps, *_ = np.linalg.lstsq(still / scales[:, None], (found.x - x) / scales)
    lighter = x + still @ steps
    return projected(problem, lighter)


def _is_moved(norm: AffineNorm, still: Array) -> bool:
    """Whether some of the directions move what is limited by more than a rounding."""
    moved = np.abs(np.einsum("kdn,nm->kdm", norm.slope, still)).max(initial=0.0)
    return bool(moved > SAME_LOAD * np.abs(norm.slope * np.abs(still).max(axis=1)).max(initial=0.0))


def distance(domain: Domain, target: Array, columns: int) -> AffineNorm:
    """How far a decision is from a point of its own columns."""
    slope = np.zeros((1, domain.width, columns))
    slope[0, :, domain.columns] = np.eye(domain.width)
    return AffineNorm(MEAN, -target[None], slope, Grid(np.ones(1), 1))
