"""Local search over decisions scaled to 0..1: sequential quadratic programs from several starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self, TypeAlias

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import is_time_over, until_time_limit
from laufruhe.problem.decision import Domain, column_bounds, decision_vector, domains_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Side
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import ProofStrength, gap_tolerance_of
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, Design, ProofData, evaluate_design
from laufruhe.solvers.prices import Price, Slopes, bounds_of, edges_at, prices_of
from laufruhe.solvers.sampling_refinement import sampling_overestimate

# designs evaluated for each start; step of differences, margin of an active limit, and value of an infinite objective
POINTS_PER_START, STEP, ACTIVE_MARGIN, INFINITE_VALUE = 4, 1e-6, 1e-6, 1e3
# searches from the boxes with the smallest bound
ROUNDS = 2


@dataclass(frozen=True, eq=False)
class LocalProgram:
    """Objective and distances to all limits as functions of scaled decisions ("shares", 0 to 1, shape (n,)).

    An unbalance with an open angle has two columns, each between minus and plus its largest size.
    """

    problem: Problem
    lower: Array
    upper: Array

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Return the program of all open numbers of a problem."""
        return cls(problem, *column_bounds(domains_of(problem.decisions)))

    @cached_property
    def domains(self) -> tuple[Domain, ...]:
        """Domain of each decision."""
        return domains_of(self.problem.decisions)

    def shares(self, values: Sequence[Value] | Array) -> Array:
        """Return decision values as shares, shape (n,)."""
        columns = decision_vector(self.domains, values)
        return np.asarray(np.clip((columns - self.lower) / (self.upper - self.lower), 0.0, 1.0))

    def columns(self, shares: Array) -> Array:
        """Return the columns of all decisions at shares [SI], shape (n,)."""
        return np.clip(self.lower + shares * (self.upper - self.lower), self.lower, self.upper)

    def values(self, shares: Array) -> list[Value]:
        """Return decision values at shares, projected into their sets."""
        columns = self.columns(shares)
        inside = np.concatenate([domain.project(columns) for domain in self.domains])
        return [d.complex_value(inside) if d.decision.is_affine else float(inside[d.start]) for d in self.domains]

    def numbers(self, shares: Array) -> Array:
        """Return the objective [SI], then relative margins to limits, then margins to the edges of sets.

        `shares` are the decisions relative to their ranges, shape (n,). Only sets that are no intervals have edges
        here. The objective is infinite at an undamped resonance.
        """
        edges = self.edges(shares)
        try:
            evaluation = evaluate(self.problem.fixed_at(self.values(shares)))
            margins = [-evaluation.check_limit(limit).violation for limit in self.problem.limits]
            return np.array([objective_value(self.problem, evaluation), *margins, *edges])
        except ModelError:
            return np.array([math.inf, *(-1.0 for _ in self.problem.limits), *edges])

    def edges(self, shares: Array) -> list[float]:
        """Return the relative distances to the edges of sets that are no intervals."""
        columns = self.columns(shares)
        return [margin for domain in self.domains for margin in domain.set.margins(columns[domain.columns])]

    def place(self, values: Array) -> Array:
        """Return the start point of a search from decision values of a box."""
        return self.shares(values)

    def slopes(self, shares: Array) -> Array:
        """Return derivatives of `numbers` by central differences within the bounds, shape (1 + limits, n)."""
        rows = []
        for k in range(len(shares)):
            ends = [np.clip(shares + sign * STEP * np.eye(len(shares))[k], 0.0, 1.0) for sign in (-1.0, 1.0)]
            low, high = (self.numbers(end) for end in ends)
            # inf - inf is NaN where neither design can be evaluated
            with np.errstate(invalid="ignore"):
                rows.append((high - low) / (ends[1][k] - ends[0][k]))
        return np.ascontiguousarray(np.array(rows).T)

    def rank(self, shares: Array) -> tuple[float, float]:
        """Return the sort key at shares: violation above the tolerance first, then objective."""
        return _rank(self.numbers(shares))


def spread_starts(problem: Problem) -> list[Array]:
    """Return start points of local searches, relative to the ranges of the decisions, by Latin hypercube sampling."""
    rng, count = np.random.default_rng(problem.search.seed), POINTS_PER_START * problem.search.starts
    # one point in each of `count` equal intervals of every column
    columns = [
        (rng.permutation(count) + rng.random(count)) / count for d in problem.decisions for _ in range(d.set.width)
    ]
    return list(np.array(columns).T)


def best_local_optimum(program: LocalProgram, places: list[Array], starts: int) -> Array:
    """Return the best local optimum, shape (n,), of up to `starts` searches from the best start points `places`."""
    ranked = sorted(until_time_limit(places), key=program.rank)
    best = ranked[0]
    for place in ranked[: max(1, min(starts, POINTS_PER_START))]:
        if is_time_over():
            break
        best = min(best, _local_optimum(program, place), key=program.rank)
    return best


def _local_optimum(program: LocalProgram, place: Array) -> Array:
    """Return the local optimum that SLSQP reaches from the start point `place`, with derivatives by differences."""
    from scipy.optimize import minimize

    initial = program.numbers(place)
    unit = initial[0] if math.isfinite(initial[0]) and initial[0] > 0.0 else 1.0
    cache: dict[bytes, Array] = {}
    best = place, _rank(initial)

    def numbers(x: Array) -> Array:
        nonlocal best
        point = np.clip(x, 0.0, 1.0)
        if point.tobytes() not in cache:
            if is_time_over():
                raise _TimeOverError
            result = program.numbers(point)
            best = min(best, (point, _rank(result)), key=lambda pair: pair[1])
            cache[point.tobytes()] = np.append(min(result[0] / unit, INFINITE_VALUE), result[1:])
        return cache[point.tobytes()]

    def slopes(x: Array) -> Array:
        if is_time_over():
            raise _TimeOverError
        result = program.slopes(np.clip(x, 0.0, 1.0))
        result[0] /= unit
        return np.nan_to_num(result, posinf=INFINITE_VALUE, neginf=-INFINITE_VALUE)

    limits = len(initial) - 1
    inside: Any = [{"type": "ineq", "fun": lambda x: numbers(x)[1:], "jac": lambda x: slopes(x)[1:]}] if limits else []
    run: Any = minimize
    try:
        result = run(
            lambda x: numbers(x)[0], place, jac=lambda x: slopes(x)[0], method="SLSQP",
            bounds=[(0.0, 1.0)] * len(place), constraints=inside, options={"maxiter": 60, "ftol": 1e-10},
        )  # fmt: skip
    except _TimeOverError:
        return best[0]
    return np.asarray(np.clip(result.x, 0.0, 1.0))


class _TimeOverError(Exception):
    """Signal that the time limit is over; it ends a search between two evaluations."""


def _rank(numbers: Array) -> tuple[float, float]:
    # sort key: feasible designs by objective, others by violation
    value, *margins = numbers
    return max(-min(margins, default=0.0), FEASIBILITY_TOL), float(value)


BoundByBoxes: TypeAlias = Callable[[float, float, Design], BoxResult]
"""Function of objective, gap tolerance and design that returns a lower bound by boxes."""


@dataclass(frozen=True, eq=False)
class ProvenDesign:
    """Best design with its lower bound by boxes; its decisions are relative to their ranges (shares)."""

    shares: Array
    design: Design
    divided: BoxResult

    @property
    def excludes_all(self) -> bool:
        """True if boxes prove that no design meets the limits."""
        return self.design.violation > FEASIBILITY_TOL and self.divided.bound == math.inf

    @property
    def bound(self) -> float:
        """Lower bound of the objective; zero if the design violates a limit."""
        return self.divided.bound if self.design.violation <= FEASIBILITY_TOL else 0.0


def prove_design(program: LocalProgram, best: Array, bounded: BoundByBoxes) -> ProvenDesign:
    """Return the best design with its lower bound by boxes, which `bounded` computes.

    The first design has the shares `best`. While a gap is open, local searches start from the boxes
    with the smallest bound.
    """
    problem = program.problem
    result = ProvenDesign(best, evaluate_design(problem, program.values(best)), BoxResult(0.0, 0))
    for _ in range(ROUNDS):
        if is_time_over():
            break
        value, gap_tolerance = math.inf, 0.0
        if result.design.violation <= FEASIBILITY_TOL:
            value = result.design.value
            gap_tolerance = gap_tolerance_of(
                value, problem.tolerance, numerical_zero(problem, result.design.evaluation.engine)
            )
            # boxes cannot close the part of the gap that is a sampling error
            value -= sampling_overestimate(problem, result.design.evaluation)
        result = replace(result, divided=bounded(value, gap_tolerance, result.design))
        places = [program.place(x) for x in result.divided.places]
        if not places or result.divided.bound >= value - gap_tolerance:
            break
        retry = best_local_optimum(program, [result.shares, *places], len(places) + 1)
        if program.rank(retry) >= program.rank(result.shares):
            break
        result = ProvenDesign(retry, evaluate_design(problem, program.values(retry)), result.divided)
    return result


def proof_data(program: LocalProgram, design: Design, bound: float, strength: ProofStrength, method: str) -> ProofData:
    """Return a lower bound with shadow prices of active limits and bounds, and the residual of their balance."""
    from scipy.optimize import nnls

    problem, best = program.problem, program.shares(design.values)
    slopes = program.slopes(best)
    margins = program.numbers(best)[1:]
    largest = [float(np.abs(row).max()) or 1.0 for row in slopes]
    active_margins = [k for k, margin in enumerate(margins) if margin <= ACTIVE_MARGIN]
    low, high = best <= ACTIVE_MARGIN, best >= 1.0 - ACTIVE_MARGIN
    columns = [-slopes[1 + k] / largest[1 + k] for k in active_margins]
    columns += [sign * np.eye(len(best))[k] for mask, sign in ((low, -1.0), (high, 1.0)) for k in np.flatnonzero(mask)]
    scale = max(largest[0], design.value)
    no_shares = np.zeros(0), largest[0] / scale
    shares, residual = nnls(np.column_stack(columns), -slopes[0] / scale) if columns else no_shares
    prices: dict[Side, Price] = {}
    # gradient of the Lagrangian without the bounds of decisions
    gradient, sides = slopes[0].copy(), list[tuple[int, Side, float]]()
    for k, share in zip(active_margins, shares, strict=False):
        if k >= len(problem.limits):
            # an edge of a set, which is priced as a bound of its decision
            continue
        limit = problem.limits[k]
        _, edge, name = limit.slack(design.evaluation.check_limit(limit).value)
        # margins are relative to the limit
        unit = abs(edge) or 1.0
        sides.append((k, (limit, name), unit))
        prices[limit, name] = Price.both(float(share) * scale / (largest[1 + k] * unit))
        gradient = gradient - float(share) * scale / largest[1 + k] * slopes[1 + k]
    widths, values = program.upper - program.lower, program.columns(best)
    bounds, normals = dict[str, Price](), list[Array]()
    for domain in program.domains:
        column = values[domain.columns]
        bounds |= bounds_of(domain.decision, column, (gradient / widths)[domain.columns])
        for normal in edges_at(domain.decision, column).values():
            normals.append(np.zeros(len(best)))
            normals[-1][domain.columns] = normal
    edges = np.array(normals).reshape(-1, len(best)) * widths
    both_sides = prices_of([Slopes.smooth(slopes[0])], [Slopes.smooth(-slopes[1 + k]) for k, *_ in sides], edges)
    if both_sides is not None:
        for (_, side, unit), price in zip(sides, both_sides, strict=False):
            if not price.is_equal:
                prices[side] = Price(price.relaxed / unit, price.tightened / unit)
        bounds = dict(zip(bounds, both_sides[len(sides) :], strict=True))
    return ProofData(bound, strength, float(residual), method, prices, bounds)
