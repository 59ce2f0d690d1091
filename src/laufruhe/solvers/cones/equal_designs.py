"""Designs that an objective does not tell apart: how far each unbalance may go and leave it least (P12)."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import passed
from laufruhe.numerics.norms import MEAN, Grid
from laufruhe.problem.decision import Domain
from laufruhe.problem.measure import Limit
from laufruhe.solvers.conclusion import FEASIBLE, unbalances_of
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.result import DecisionRange, Result

MOST_OPEN = 16
"""Decisions whose ranges are sought: each takes two programs, or some more where its angle is open."""
DIRECTIONS = 8
FEW, ROOM = 180, 1e-7
"""Angles at which designs are compared, and the share by which a limit is wider there for a solver to find them."""


def equal_designs(found: Result, limit: Limit) -> tuple[DecisionRange, ...]:
    """Ends of every unbalance among the designs that keep the limits and this one; none where they are not affine.

    Parameters
    ----------
    found
        The best design of an objective.
    limit
        That objective at its least value.
    """
    problem = found.problem
    affine = [decision for decision in problem.decisions if decision.is_affine]
    kinds = {decision.kind for decision in affine}
    moved = [bound for bound in (*problem.limits, limit) if bound.measure.channel.is_moved_by(kinds)]
    problem = replace(problem, phasing=None, objective=(), limits=tuple(moved))
    numbers = any(bound.measure.channel.is_number for bound in moved)
    if not affine or len(affine) < len(problem.decisions) or len(affine) > MOST_OPEN or numbers or passed():
        return ()
    model = AffineModel(problem)
    rows = model.at(min(model.full_samples, FEW))
    values = unbalances_of(found.problem, found)
    x = np.concatenate([d.columns_of(value) for d, value in zip(model.domains, values, strict=True)])
    # at few angles a mean is another one: the design found is to keep its limits there too
    limits = tuple((max(most, norm.value(x) * (1.0 + ROOM)) if most else 0.0, norm) for most, norm in rows.limits)
    rows = replace(rows, limits=limits)
    ends = [(domain, _ends(rows, domain)) for domain in model.domains]
    return tuple(
        DecisionRange(domain.decision.name, domain.decision.unit, *pair) for domain, pair in ends if pair is not None
    )


def _ends(rows: AffineProblem, domain: Domain) -> tuple[float, float] | None:
    """Least and largest size that are attained; of an open angle the largest along some directions."""
    own = domain.set
    if domain.width == 1:
        targets = [np.array([own.lower]), np.array([own.upper])]
    else:
        turns = (cmath.exp(2j * math.pi * k / DIRECTIONS) for k in range(DIRECTIONS))
        targets = [np.zeros(2), *(own.upper * np.array([turn.real, turn.imag]) for turn in turns)]
    sizes = []
    for target in targets:
        found = solve_cones(AffineProblem(((1.0, _apart(domain, target, rows.size)),), rows.limits, rows.domains,
                                          rows.samples))  # fmt: skip
        if found.x is None or rows.excess(found.x) > 10.0 * FEASIBLE:
            continue
        part = found.x[domain.columns]
        sizes.append(float(part[0]) if domain.width == 1 else float(np.hypot(*part)))
    return (min(sizes), max(sizes)) if len(sizes) > 1 else None


def _apart(domain: Domain, target: Array, columns: int) -> AffineNorm:
    """How far a decision is from a point of the plane."""
    slope = np.zeros((1, domain.width, columns))
    slope[0, :, domain.columns] = np.eye(domain.width)
    return AffineNorm(MEAN, -target[None], slope, Grid(np.ones(1), 1))
