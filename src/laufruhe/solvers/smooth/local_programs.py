"""Local programs over the shares of the bounds, 0 to 1: sequential quadratic programs from several starts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self, TypeAlias

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import in_time, passed
from laufruhe.problem.decision import Domain, domains_of, ends_of, vector_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Side
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import ProofStrength, gap_tolerance_of
from laufruhe.solvers.conclusion import KEPT, Design, ProofData, evaluate_design
from laufruhe.solvers.prices import Price, Slopes, bounds_of, edges_at, prices_of
from laufruhe.solvers.sampling_refinement import over_read

# designs looked at for each start of the search; step of a slope, room that is none, and an objective that is far off
LOOKS, STEP, HELD, FAR = 4, 1e-6, 1e-6, 1e3
# searches from where boxes are least
TRIES = 2


@dataclass(frozen=True, eq=False)
class LocalProgram:
    """Objective and room of every limit over the shares of the bounds, 0 to 1, of every column of a decision.

    A column of an unbalance whose angle is open lies between its sizes in both senses.
    """

    problem: Problem
    lower: Array
    upper: Array

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Over the bounds of all that is open."""
        return cls(problem, *ends_of(domains_of(problem.decisions)))

    @cached_property
    def domains(self) -> tuple[Domain, ...]:
        """Domains of all decisions."""
        return domains_of(self.problem.decisions)

    def shares(self, values: Sequence[Value] | Array) -> Array:
        """Return decision values as shares of their bounds, from 0 to 1."""
        own = vector_of(self.domains, values)
        return np.asarray(np.clip((own - self.lower) / (self.upper - self.lower), 0.0, 1.0))

    def columns(self, shares: Array) -> Array:
        """Return the columns of all decisions at these shares of their bounds."""
        return np.clip(self.lower + shares * (self.upper - self.lower), self.lower, self.upper)

    def values(self, shares: Array) -> list[Value]:
        """Decisions, inside their sets."""
        own = self.columns(shares)
        inside = np.concatenate([domain.project(own) for domain in self.domains])
        return [d.complex_value(inside) if d.decision.is_affine else float(inside[d.start]) for d in self.domains]

    def numbers(self, shares: Array) -> Array:
        """The objective, then the least relative room inside each limit, and inside each set that is no interval.

        On a resonance the objective is far off.
        """
        edges = self.edges(shares)
        try:
            evaluation = evaluate(self.problem.fixed_at(self.values(shares)))
            rooms = [-evaluation.standing(limit).violation for limit in self.problem.limits]
            return np.array([objective_value(self.problem, evaluation), *rooms, *edges])
        except ModelError:
            return np.array([math.inf, *(-1.0 for _ in self.problem.limits), *edges])

    def edges(self, shares: Array) -> list[float]:
        """Relative rooms inside the sets that are no intervals."""
        own = self.columns(shares)
        return [room for domain in self.domains for room in domain.set.margins(own[domain.columns])]

    def place(self, values: Array) -> Array:
        """Shares to seek a design from where boxes are least."""
        return self.shares(values)

    def by_decision(self, values: Array) -> dict[str, Array]:
        """Return the entries of each decision by its name."""
        return {domain.decision.name: values[domain.columns] for domain in self.domains}

    def slopes(self, shares: Array) -> Array:
        """Return derivatives of `numbers` by central differences within the bounds, shape (1 + limits, n)."""
        found = []
        for k in range(len(shares)):
            ends = [np.clip(shares + sign * STEP * np.eye(len(shares))[k], 0.0, 1.0) for sign in (-1.0, 1.0)]
            low, high = (self.numbers(end) for end in ends)
            # no engine on either side says nothing of a slope
            with np.errstate(invalid="ignore"):
                found.append((high - low) / (ends[1][k] - ends[0][k]))
        return np.ascontiguousarray(np.array(found).T)

    def rank(self, shares: Array) -> tuple[float, float]:
        """Designs within their limits by their objective, others by what they exceed these by."""
        return _rank(self.numbers(shares))


def spread_starts(problem: Problem) -> list[Array]:
    """Designs spread evenly over the bounds of every column."""
    rng, many = np.random.default_rng(problem.search.seed), LOOKS * problem.search.starts
    # of each number one in every share of its bounds
    columns = [(rng.permutation(many) + rng.random(many)) / many for d in problem.decisions for _ in range(d.set.width)]
    return list(np.array(columns).T)


def best_local_optimum(program: LocalProgram, places: list[Array], starts: int) -> Array:
    """The best design of local programs from the best of some places."""
    ranked = sorted(in_time(places), key=program.rank)
    best = ranked[0]
    for place in ranked[: max(1, min(starts, LOOKS))]:
        if passed():
            break
        best = min(best, _local(program, place), key=program.rank)
    return best


def _local(program: LocalProgram, place: Array) -> Array:
    """A local optimum by sequential quadratic programs, its slopes by differences."""
    from scipy.optimize import minimize

    first = program.numbers(place)
    unit = first[0] if math.isfinite(first[0]) and first[0] > 0.0 else 1.0
    known: dict[bytes, Array] = {}
    best = place, _rank(first)

    def numbers(x: Array) -> Array:
        nonlocal best
        own = np.clip(x, 0.0, 1.0)
        if own.tobytes() not in known:
            if passed():
                raise _OverError
            found = program.numbers(own)
            best = min(best, (own, _rank(found)), key=lambda pair: pair[1])
            known[own.tobytes()] = np.append(min(found[0] / unit, FAR), found[1:])
        return known[own.tobytes()]

    def slopes(x: Array) -> Array:
        if passed():
            raise _OverError
        found = program.slopes(np.clip(x, 0.0, 1.0))
        found[0] /= unit
        return np.nan_to_num(found, posinf=FAR, neginf=-FAR)

    limits = len(first) - 1
    inside: Any = [{"type": "ineq", "fun": lambda x: numbers(x)[1:], "jac": lambda x: slopes(x)[1:]}] if limits else []
    run: Any = minimize
    try:
        found = run(
            lambda x: numbers(x)[0], place, jac=lambda x: slopes(x)[0], method="SLSQP",
            bounds=[(0.0, 1.0)] * len(place), constraints=inside, options={"maxiter": 60, "ftol": 1e-10},
        )  # fmt: skip
    except _OverError:
        return best[0]
    return np.asarray(np.clip(found.x, 0.0, 1.0))


class _OverError(Exception):
    """Ends a program between two evaluations when time is over."""


def _rank(numbers: Array) -> tuple[float, float]:
    # sort key: feasible designs by objective, others by violation
    value, *rooms = numbers
    return max(-min(rooms, default=0.0), KEPT), float(value)


BoundedBoxes: TypeAlias = Callable[[float, float, Design], BoxResult]
"""What no design goes under, where one of this value is known and another by less than this room no better; the one."""


@dataclass(frozen=True, eq=False)
class Proven:
    """The best design, as shares of its bounds and by the exact model, and what boxes tell of all others."""

    shares: Array
    design: Design
    divided: BoxResult

    @property
    def excludes_all(self) -> bool:
        """Tell if no design keeps the limits."""
        return self.design.violation > KEPT and self.divided.bound == math.inf

    @property
    def bound(self) -> float:
        """Lower bound of the objective; zero if the design breaks a limit."""
        return self.divided.bound if self.design.violation <= KEPT else 0.0


def proven(program: LocalProgram, best: Array, bounded: BoundedBoxes) -> Proven:
    """A design and its bound, sought once more where boxes promise more than what was found."""
    problem = program.problem
    found = Proven(best, evaluate_design(problem, program.values(best)), BoxResult(0.0, 0))
    for _ in range(TRIES):
        if passed():
            break
        value, room = math.inf, 0.0
        if found.design.violation <= KEPT:
            value = found.design.value
            room = gap_tolerance_of(value, problem.tolerance, numerical_zero(problem, found.design.evaluation.engine))
            # boxes do not make good what few angles read too much
            value -= over_read(problem, found.design.evaluation)
        found = replace(found, divided=bounded(value, room, found.design))
        places = [program.place(x) for x in found.divided.places]
        if not places or found.divided.bound >= value - room:
            break
        again = best_local_optimum(program, [found.shares, *places], len(places) + 1)
        if program.rank(again) >= program.rank(found.shares):
            break
        found = Proven(again, evaluate_design(problem, program.values(again)), found.divided)
    return found


def proof_data(program: LocalProgram, design: Design, bound: float, strength: ProofStrength, method: str) -> ProofData:
    """A bound, with multipliers of the limits and bounds that hold a design, and how far these are from balance."""
    from scipy.optimize import nnls

    problem, best = program.problem, program.shares(design.values)
    slopes = program.slopes(best)
    rooms = program.numbers(best)[1:]
    size = float(np.abs(slopes[0]).max()) or 1.0
    held = [k for k, room in enumerate(rooms) if room <= HELD]
    low, high = best <= HELD, best >= 1.0 - HELD
    columns = [-slopes[1 + k] / (float(np.abs(slopes[1 + k]).max()) or 1.0) for k in held]
    columns += [sign * np.eye(len(best))[k] for mask, sign in ((low, -1.0), (high, 1.0)) for k in np.flatnonzero(mask)]
    scale = max(size, design.value)
    shares, rest = nnls(np.column_stack(columns), -slopes[0] / scale) if columns else (np.zeros(0), size / scale)
    prices: dict[Side, Price] = {}
    left, sides = slopes[0].copy(), list[tuple[int, Side, float]]()
    for k, share in zip(held, shares, strict=False):
        if k >= len(problem.limits):
            # a set's own edge, which its decision has a price for
            continue
        limit = problem.limits[k]
        steep = float(np.abs(slopes[1 + k]).max()) or 1.0
        _, edge, side = limit.room(design.evaluation.standing(limit).value)
        # rooms are relative to the edge of their limit
        sides.append((k, (limit, side), abs(edge) or 1.0))
        prices[limit, side] = Price.both(float(share) * scale / (steep * (abs(edge) or 1.0)))
        left = left - float(share) * scale / steep * slopes[1 + k]
    bounds = _both_sides(program, best, slopes, left, sides, prices)
    return ProofData(bound, strength, float(rest), method, prices, bounds)


def _both_sides(
    program: LocalProgram, shares: Array, slopes: Array, left: Array, sides: Sequence[tuple[int, Side, float]],
    prices: dict[Side, Price],
) -> dict[str, Price]:  # fmt: skip
    """Prices of bounds, and of limits where their two sides differ."""
    widths, columns = program.upper - program.lower, program.columns(shares)
    rest = program.by_decision(left / widths)
    found, normals = dict[str, Price](), list[Array]()
    for domain in program.domains:
        at = columns[domain.columns]
        found |= bounds_of(domain.decision, at, rest[domain.decision.name])
        for normal in edges_at(domain.decision, at).values():
            normals.append(np.zeros(len(shares)))
            normals[-1][domain.columns] = normal
    held = [Slopes.smooth(-slopes[1 + k]) for k, *_ in sides]
    told = prices_of([Slopes.smooth(slopes[0])], held, np.array(normals).reshape(-1, len(shares)) * widths)
    if told is None:
        return found
    for (_, side, edge), price in zip(sides, told, strict=False):
        if not price.is_one:
            prices[side] = Price(price.relaxed / edge, price.tightened / edge)
    return dict(zip(found, told[len(sides) :], strict=True))
