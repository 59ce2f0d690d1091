"""Designs that an objective does not tell apart: how far each unbalance may go and leave it least (P12)."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import passed
from laufruhe.numerics.norms import MEAN, Grid
from laufruhe.problem.decision import Domain, columns_of, vector_of
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import FEASIBLE, KEPT, judged, unbalances_of
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.lightest import distance
from laufruhe.solvers.prices import angle_name
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import DecisionRange

MOST_OPEN = 16
"""Decisions whose ranges are sought: each takes two programs, or some more where its angle is open."""
DIRECTIONS = 8
FEW, ROOM = 180, 1e-7
"""Angles at which designs are compared, and the share by which a limit is wider there for a solver to find them."""
GLANCE, LEAST, LITTLE, FAR, NEGLIGIBLE = 48, 1e-8, 1e-7, 10.0, 1e-2
"""Angles at which is found out whether there are others at all; shares of the objective that a decision's whole size is
worth in that, and where ends are sought; how many sizes off both aim; share of a size that is none."""
SHARES = (1.0, 0.99, 0.9, 0.5)
"""Of the way to an end at which a design is tried: what a program knows of a peak is not its last digit."""
FREE = 0.2
"""Least share of the largest decision, and least turn of an angle [rad], by which one is free."""


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
    moved = [bound for bound in (*problem.limits, limit) if depends(bound.measure.channel, kinds, problem)]
    problem = replace(problem, phasing=None, objective=(), limits=tuple(moved))
    numbers = any(_has_no_cones(bound.measure) for bound in moved)
    if not affine or len(affine) < len(problem.decisions) or len(affine) > MOST_OPEN or numbers or passed():
        return ()
    model = AffineModel(problem)
    rows = model.at(min(model.full_samples, FEW))
    values = unbalances_of(found.problem, found)
    x = vector_of(model.domains, values)
    rows = _kept_by(rows, x)
    sizes = [(domain, [_size(domain, end) for end in _ends(rows, domain)]) for domain in model.domains]
    return tuple(
        DecisionRange(domain.decision.name, domain.decision.unit, min(own), max(own))
        for domain, own in sizes
        if len(own) > 1
    )


def free_decisions(found: Result) -> tuple[DecisionRange, ...] | None:
    """Decisions that an optimum leaves free, and values between which each may lie at no loss (P17).

    Both are of designs that the exact model shows to be as good within the tolerance, and all between two of them are:
    objective and limits are convex. There may be designs beyond. None where it is not looked at.
    """
    problem = replace(found.problem, phasing=None)
    of_numbers = any(_has_no_cones(measure) for measure in problem.measures)
    plain = not problem.extras and not problem.ranks and not of_numbers
    affine = all(decision.is_affine for decision in problem.decisions)
    if not (plain and affine and 0 < len(problem.decisions) <= MOST_OPEN) or passed():
        return None
    model = AffineModel(problem)
    x = columns_of(model.domains, unbalances_of(problem, found))
    rows = _kept_by(model.at(min(model.full_samples, GLANCE)), x)
    others = [] if rows.groups else _around(rows, x, LEAST)
    if not others:
        return None
    if not _moving(rows, [x, *others]):
        return ()
    rows = _kept_by(model.at(min(model.full_samples, FEW)), x)
    designs = [x, *(good for end in _around(rows, x, LITTLE) for good in _good(found, problem, model, x, end))]
    return tuple(told for domain in _moving(rows, designs) for told in _ranges(domain, designs))


def _has_no_cones(measure: Measure) -> bool:
    return measure.channel.is_number or not measure.norm.is_convex


def _kept_by(rows: AffineProblem, x: Array) -> AffineProblem:
    """With limits that a design keeps: at few angles a mean is another one."""
    limits = tuple((max(most, norm.value(x) * (1.0 + ROOM)) if most else 0.0, norm) for most, norm in rows.limits)
    return replace(rows, limits=limits)


def _around(rows: AffineProblem, x: Array, share: float) -> list[Array]:
    """Designs on either side of all that are as good."""
    aim = np.random.default_rng(1964).standard_normal(rows.size)
    slope = np.diag(1.0 / rows.units)[None]
    targets = (x / rows.units + sign * FAR * aim for sign in (-1.0, 1.0))
    far = (AffineNorm(MEAN, -target[None], slope, Grid(np.ones(1), 1)) for target in targets)
    weight = share * (rows.objective(x) or 1.0)
    return [end for norm in far for end in _toward(rows, norm, weight)]


def _moving(rows: AffineProblem, designs: Sequence[Array]) -> list[Domain]:
    """Decisions that designs have apart, beside the largest of their unit and what they could be."""
    apart = np.ptp(designs, axis=0)
    most = {d.decision.unit: 0.0 for d in rows.domains}
    for domain in rows.domains:
        sizes = [abs(_size(domain, found)) for found in designs]
        most[domain.decision.unit] = max(most[domain.decision.unit], *sizes, NEGLIGIBLE * rows.units[domain.start])
    return [d for d in rows.domains if np.hypot.reduce(apart[d.columns]) > FREE * most[d.decision.unit]]


def _good(found: Result, problem: Problem, model: AffineModel, x: Array, end: Array) -> list[Array]:
    """The design farthest from the optimum towards an end that the exact model shows to be as good."""
    most = objective_value(problem, found.final) * (1.0 + problem.tolerance) + numerical_zero(
        problem, found.final.engine
    )
    for share in SHARES:
        there = x + share * (end - x)
        values = [domain.complex_value(there) for domain in model.domains]
        design = judged(problem, values, found.final.samples)
        if design.value <= most and design.excess <= KEPT:
            return [there]
    return []


def _ranges(domain: Domain, designs: Sequence[Array]) -> list[DecisionRange]:
    """Of the size, and of the angle where that is open and turns."""
    sizes = [_size(domain, found) for found in designs]
    least, largest = min(sizes), max(sizes)
    decision = domain.decision
    told = []
    if largest - least > FREE * max(abs(least), abs(largest)):
        told.append(DecisionRange(decision.name, decision.unit, least, largest))
    if domain.width > 1 and least > FREE * largest:
        first = domain.complex_value(designs[0])
        turns = [cmath.phase(domain.complex_value(found) / first) for found in designs]
        if max(turns) - min(turns) > FREE:
            at = cmath.phase(first)
            told.append(DecisionRange(angle_name(decision), "rad", at + min(turns), at + max(turns)))
    return told


def _ends(rows: AffineProblem, domain: Domain) -> list[Array]:
    """Designs of least and largest size that are attained; of an open angle the largest along some directions."""
    own = domain.set
    if domain.width == 1:
        targets = [np.array([own.lower]), np.array([own.upper])]
    else:
        turns = (cmath.exp(2j * math.pi * k / DIRECTIONS) for k in range(DIRECTIONS))
        targets = [np.zeros(2), *(own.upper * np.array([turn.real, turn.imag]) for turn in turns)]
    return [end for target in targets for end in _toward(rows, distance(domain, target, rows.size), 1.0)]


def _toward(rows: AffineProblem, far: AffineNorm, weight: float) -> list[Array]:
    """The design that comes nearest to something, beside what is minimised."""
    found = solve_cones(replace(rows, terms=(*rows.terms, (weight, far))))
    return [] if found.x is None or rows.excess(found.x) > 10.0 * FEASIBLE else [found.x]


def _size(domain: Domain, x: Array) -> float:
    part = x[domain.columns]
    return float(part[0]) if domain.width == 1 else float(np.hypot(*part))
