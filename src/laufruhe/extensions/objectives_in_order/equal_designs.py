"""Ranges of unbalances over which an objective stays at its optimum (P12, P17)."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.norms import MEAN, Grid
from laufruhe.problem.decision import Domain, decision_vector, projected_vector
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, FEASIBLE, evaluate_design, unbalance_values
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.tie_break import distance
from laufruhe.solvers.methods import Decide, Diagnosis
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.values import DecisionRange

MAX_OPEN = 16
"""Largest number of decisions; each takes two cone programs, or more if its angle is open."""
DIRECTIONS = 8
"""Directions in which the largest size of an unbalance with open angle is computed."""
COARSE, SLACK = 180, 1e-7
"""Samples per cycle for the ranges, and relative increase of limits so that the solver finds an interior."""
COARSEST = 48
"""Samples per cycle of the first test for other optimal designs."""
FAINT, WEAK = 1e-8, 1e-7
"""Weights of the distance from a target, relative to the objective: in the first test, and for the ends of ranges."""
FAR = 10.0
"""Distance of the target points from the optimum, in units of the decisions."""
NEGLIGIBLE = 1e-2
"""Size of a decision that counts as zero, in its unit."""
SHARES = (1.0, 0.99, 0.9, 0.5)
"""Shares of the distance to an end of a range that the exact model tests, because programs sample peaks coarsely."""
FREE = 0.2
"""Smallest change of a free decision: relative to the largest size, or of its angle [rad]."""


def equal_designs(result: Result, limit: Limit) -> tuple[DecisionRange, ...]:
    """Return the range of every unbalance over all designs that keep the limits and stay optimal.

    `limit` keeps the objective at its optimum. The tuple is empty if the method does not apply: a decision
    is not affine, more than `MAX_OPEN` are open, or a measure has no cones. It is also empty if no time is left.
    """
    problem = result.problem
    affine = [decision for decision in problem.decisions if decision.is_affine]
    kinds = {decision.kind for decision in affine}
    limits = [x for x in (*problem.limits, limit) if depends(x.measure.channel, kinds, problem)]
    problem = replace(problem, phasing=None, objective=(), limits=tuple(limits))
    has_numbers = any(_has_no_cones(x.measure) for x in limits)
    if not affine or len(affine) < len(problem.decisions) or len(affine) > MAX_OPEN or has_numbers or is_time_over():
        return ()
    model = AffineModel(problem)
    x = decision_vector(model.domains, unbalance_values(result.problem, result))
    rows = _widen_limits(model.at(min(model.full_samples, COARSE)), x)
    ranges = []
    for domain in model.domains:
        bounds = domain.set
        # smallest and largest size; with an open angle, the largest along several directions
        if domain.width == 1:
            targets = [np.array([bounds.lower]), np.array([bounds.upper])]
        else:
            turns = (cmath.exp(2j * math.pi * k / DIRECTIONS) for k in range(DIRECTIONS))
            targets = [np.zeros(2), *(bounds.upper * np.array([turn.real, turn.imag]) for turn in turns)]
        ends = [end for target in targets for end in _approach(rows, distance(domain, target, rows.size), 1.0)]
        sizes = [_size(domain, end) for end in ends]
        if len(sizes) > 1:
            ranges.append(DecisionRange(domain.decision.name, domain.decision.unit, min(sizes), max(sizes)))
    return tuple(ranges)


def free_decisions(result: Result) -> tuple[DecisionRange, ...] | None:
    """Return decisions that an optimum leaves free, each with a range of equally good values (P17).

    The exact model confirms the designs at both ends within the tolerance. Designs between them are as good, because
    objective and limits are convex. Wider ranges may exist.

    Returns
    -------
    One range per free decision; None if the method does not apply or no time is left.
    """
    problem = replace(result.problem, phasing=None)
    is_plain = not problem.extras and not problem.ranks and not any(map(_has_no_cones, problem.measures))
    is_affine = all(decision.is_affine for decision in problem.decisions)
    if not (is_plain and is_affine and 0 < len(problem.decisions) <= MAX_OPEN) or is_time_over():
        return None
    model = AffineModel(problem)
    x = projected_vector(model.domains, unbalance_values(problem, result))
    rows = _widen_limits(model.at(min(model.full_samples, COARSEST)), x)
    ends = [] if rows.groups else _ends(rows, x, FAINT)
    if not ends:
        return None
    if not _free_domains(rows, [x, *ends]):
        return ()
    rows = _widen_limits(model.at(min(model.full_samples, COARSE)), x)
    maximum = objective_value(problem, result.final) * (1.0 + problem.tolerance)
    maximum += numerical_zero(problem, result.final.engine)
    designs = [x]
    for end in _ends(rows, x, WEAK):
        # the farthest design towards the end that the exact model confirms
        for share in SHARES:
            candidate = x + share * (end - x)
            values = [domain.complex_value(candidate) for domain in model.domains]
            design = evaluate_design(problem, values, result.final.samples)
            if design.value <= maximum and design.violation <= FEASIBILITY_TOL:
                designs.append(candidate)
                break
    return tuple(entry for domain in _free_domains(rows, designs) for entry in ranges_of(domain, designs))


def _has_no_cones(measure: Measure) -> bool:
    return measure.channel.is_number or not measure.norm.is_convex


def _widen_limits(rows: AffineProblem, x: Array) -> AffineProblem:
    # a mean over few samples may exceed a limit that the full mean keeps
    limits = tuple(
        (max(maximum, norm.value(x) * (1.0 + SLACK)) if maximum else 0.0, norm) for maximum, norm in rows.limits
    )
    return replace(rows, limits=limits)


def _ends(rows: AffineProblem, x: Array, share: float) -> list[Array]:
    direction = np.random.default_rng(1964).standard_normal(rows.size)
    slope = np.diag(1.0 / rows.units)[None]
    targets = (x / rows.units + sign * FAR * direction for sign in (-1.0, 1.0))
    norms = (AffineNorm(MEAN, -target[None], slope, Grid(np.ones(1), 1)) for target in targets)
    weight = share * (rows.objective(x) or 1.0)
    return [end for norm in norms for end in _approach(rows, norm, weight)]


def _approach(rows: AffineProblem, goal: AffineNorm, weight: float) -> list[Array]:
    x = solve_cones(replace(rows, terms=(*rows.terms, (weight, goal)))).x
    return [] if x is None or rows.violation(x) > 10.0 * FEASIBLE else [x]


def _free_domains(rows: AffineProblem, designs: Sequence[Array]) -> list[Domain]:
    spans = np.ptp(designs, axis=0)
    maximum = {d.decision.unit: 0.0 for d in rows.domains}
    for domain in rows.domains:
        sizes = [abs(_size(domain, design)) for design in designs]
        maximum[domain.decision.unit] = max(
            maximum[domain.decision.unit], *sizes, NEGLIGIBLE * rows.units[domain.start]
        )
    return [d for d in rows.domains if np.hypot.reduce(spans[d.columns]) > FREE * maximum[d.decision.unit]]


def ranges_of(domain: Domain, designs: Sequence[Array]) -> list[DecisionRange]:
    """Return the ranges of a decision's size and angle [rad] over several designs, shape (n,) each, if these vary."""
    sizes = [_size(domain, design) for design in designs]
    smallest, largest = min(sizes), max(sizes)
    decision = domain.decision
    ranges = []
    if largest - smallest > FREE * max(abs(smallest), abs(largest)):
        ranges.append(DecisionRange(decision.name, decision.unit, smallest, largest))
    if domain.width > 1 and smallest > FREE * largest:
        first = domain.complex_value(designs[0])
        turns = [cmath.phase(domain.complex_value(design) / first) for design in designs]
        if max(turns) - min(turns) > FREE:
            angle = cmath.phase(first)
            ranges.append(DecisionRange(decision.angle_name, "rad", angle + min(turns), angle + max(turns)))
    return ranges


def _size(domain: Domain, x: Array) -> float:
    part = x[domain.columns]
    return float(part[0]) if domain.width == 1 else float(np.hypot(*part))


def _with_free_decisions(result: Result, _: Problem, __: float, ___: Decide) -> Result:
    return replace(result, free=free_decisions(result)) if result.status is Status.OPTIMAL else result


FREE_DECISIONS = Diagnosis("free decisions", _with_free_decisions)
