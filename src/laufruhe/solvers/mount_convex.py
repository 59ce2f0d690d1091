"""Mount stiffness to a proven optimum: what is convex in it (E16-E19).

K is linear in the stiffnesses, and in coordinates in which the mass is one it is called A.
Then, x the stiffnesses and any of y, V >= 0 with trace one, z with |z| <= 1 given,

    w' A^-1 w    >= 2 y' w - y' A(x) y          sag                                     (E16)
    lambda_max A >= <V, A(x)>                   highest natural frequency               (E17)
   -lambda_min A >= -<V, A(x)>                  lowest natural frequency                (E18)
    |A t / W2 - t| >= z' (A(x) t / W2 - t)      torque-roll residual                    (E19)

with equality at the right y, V, z. Right sides are linear in x, so a weighted sum of them,
limits included, is bounded over the box of x in closed form: a lower bound of the
objective that holds whatever a solver says.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.mount_numbers import torque_roll_rows
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import STIFFNESS, Decision
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Certificate, Proof, gap_unit
from laufruhe.solvers.mount_result import FEASIBLE, infeasible_mounts, mount_result
from laufruhe.solvers.result import Result

Array = NDArray[np.float64]

CONVEX = (channels.SAG, channels.TORQUE_ROLL, channels.TOTAL_STIFFNESS)


class ConvexFunction(Protocol):
    """A convex function of the stiffnesses."""

    def value(self, x: Array) -> float:
        """At x."""

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:
        """Constant and gradient of a linear function nowhere above this one, best at x."""


@dataclass(frozen=True, eq=False)
class Matrices:
    """A(x) = base + sum_j x_j slopes_j, shapes (6, 6) and (n, 6, 6) (E16)."""

    base: Array
    slopes: Array

    def at(self, x: Array) -> Array:
        """A(x), shape (6, 6)."""
        return np.asarray(self.base + np.tensordot(x, self.slopes, axes=1))

    def between(self, left: Array, right: Array) -> tuple[float, Array]:
        """Constant and gradient of left' A(x) right."""
        return float(left @ self.base @ right), np.asarray(np.einsum("i,nij,j->n", left, self.slopes, right))


@dataclass(frozen=True, eq=False)
class Linear:
    """constant + gradient . x."""

    constant: float
    gradient: Array

    def value(self, x: Array) -> float:
        """At x."""
        return self.constant + float(self.gradient @ x)

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:  # noqa: ARG002
        """Itself."""
        return self.constant, self.gradient


@dataclass(frozen=True, eq=False)
class Compliance:
    """factor w' A(x)^-1 w (E16)."""

    matrices: Matrices
    load: Array
    factor: float

    def value(self, x: Array) -> float:
        """At x; infinite where a mode is free."""
        matrix = self.matrices.at(x)
        if np.linalg.eigvalsh(matrix)[0] <= 0.0:
            return math.inf
        return self.factor * float(self.load @ np.linalg.solve(matrix, self.load))

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:  # noqa: ARG002
        """The tangent at x, which lies under it everywhere (E16)."""
        y = np.asarray(np.linalg.solve(self.matrices.at(x), self.load), dtype=np.float64)
        constant, gradient = self.matrices.between(y, y)
        return self.factor * (2.0 * float(y @ self.load) - constant), -self.factor * gradient


@dataclass(frozen=True, eq=False)
class Eigenvalue:
    """sign x the largest of sign x the eigenvalues of A(x) (E17, E18): sign 1 the highest, -1 the lowest negated."""

    matrices: Matrices
    sign: float

    def value(self, x: Array) -> float:
        """At x."""
        return float(np.linalg.eigvalsh(self.sign * self.matrices.at(x))[-1])

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:
        """sign <V, A(x)> with V from the dual matrix, or from the eigenvector at x."""
        _, vectors = np.linalg.eigh(self.sign * self.matrices.at(x))
        weights, columns = np.eye(6)[-1], vectors
        if dual is not None:
            found, columns = np.linalg.eigh(0.5 * (dual + dual.T))
            clipped = np.maximum(found, 0.0)
            weights = clipped / clipped.sum() if clipped.sum() > 0.0 else weights
        pairs = [self.matrices.between(v, v) for v in columns.T]
        constant = sum(w * c for w, (c, _) in zip(weights, pairs, strict=True))
        gradient = np.sum([w * g for w, (_, g) in zip(weights, pairs, strict=True)], axis=0)
        return self.sign * constant, self.sign * gradient


@dataclass(frozen=True, eq=False)
class Residual:
    """|A(x) t / square - t| (E19)."""

    matrices: Matrices
    along: Array
    square: float

    def rows(self, x: Array) -> Array:
        """A(x) t / square - t."""
        return np.asarray(self.matrices.at(x) @ self.along / self.square - self.along)

    def value(self, x: Array) -> float:
        """At x."""
        return float(np.linalg.norm(self.rows(x)))

    def minorant(self, x: Array, dual: Array | None) -> tuple[float, Array]:
        """The linear function of a z of length one at most: the dual vector's, or along the residual."""
        z = self.rows(x) if dual is None else dual
        size = float(np.linalg.norm(z))
        z = z / max(size, 1.0) if dual is not None else z / (size or 1.0)
        constant, gradient = self.matrices.between(z, self.along)
        return constant / self.square - float(z @ self.along), gradient / self.square


@dataclass(frozen=True, eq=False)
class ConvexLimit:
    """function <= maximum, and the limit of the problem that it comes from."""

    function: ConvexFunction
    maximum: float
    source: int


@dataclass(frozen=True, eq=False)
class ConvexProgram:
    """Least weighted sum of convex functions in a box, some limited."""

    matrices: Matrices
    lower: Array
    upper: Array
    terms: tuple[tuple[float, ConvexFunction], ...]
    limits: tuple[ConvexLimit, ...]

    def objective(self, x: Array) -> float:
        """Weighted sum at x."""
        return sum(weight * term.value(x) for weight, term in self.terms)


@dataclass(frozen=True, eq=False)
class ConvexDuals:
    """What a solver proposes: dual vectors of the terms, prices and dual arrays of the limits."""

    terms: tuple[Array | None, ...]
    prices: tuple[float, ...]
    limits: tuple[Array | None, ...]


def is_convex(problem: Problem) -> bool:
    """Whether stiffness alone is open, and all that is asked is convex in it."""
    if problem.load_terms or problem.load_limits or not problem.objective:
        return False
    if not all(decision.is_stiffness for decision in problem.decisions):
        return False
    asked = all(term.measure.channel in CONVEX for term in problem.objective)
    return asked and all(_convex_sides(limit) for limit in problem.limits)


def _convex_sides(limit: Limit) -> bool:
    channel = limit.measure.channel
    if channel is channels.FREQUENCIES:
        return limit.outside is None
    if channel is channels.TOTAL_STIFFNESS:
        return True
    return channel in CONVEX and limit.minimum == -math.inf


def convex_program(problem: Problem) -> ConvexProgram:
    """The functions of a problem that `is_convex`."""
    decisions = problem.decisions
    lower, upper = (np.array([getattr(d, side) for d in decisions]) for side in ("lower", "upper"))
    start = np.array([d.start_number for d in decisions])
    given = mounting_in(problem.design(start.tolist()))
    _, root = torque_roll_rows(given)
    slopes = np.array([root @ _slope(given, decision) @ root.T for decision in decisions]).reshape(-1, 6, 6)
    base = root @ given.stiffness @ root.T - np.tensordot(start, slopes, axes=1)
    matrices = Matrices(base, slopes)
    terms = tuple((term.weight, _function(term.measure, matrices, given, problem)) for term in problem.objective)
    limits = [part for k, limit in enumerate(problem.limits) for part in _limits(limit, k, matrices, given, problem)]
    return ConvexProgram(matrices, lower, upper, terms, tuple(limits))


def _slope(mounting: ElasticMounting, decision: Decision) -> Array:
    """dK of one decision: exact, for K is linear in it (E3)."""
    total = np.zeros((6, 6))
    for drive in decision.mount_drives:
        axis = np.array(mounting.mounts[drive.mount].orientation)[drive.number]
        row = axis @ mounting.motions[drive.mount]
        total += drive.gain * np.outer(row, row)
    return total


def _function(quantity: Measure, matrices: Matrices, mounting: ElasticMounting, problem: Problem) -> ConvexFunction:
    along, root = torque_roll_rows(mounting)
    if quantity.channel is channels.SAG:
        weight = weight_wrench(mounting.block)
        return Compliance(matrices, root @ weight, 1.0 / -weight[2])
    if quantity.channel is channels.TORQUE_ROLL:
        return Residual(matrices, along, (math.tau * quantity.frequency) ** 2)
    gradient = np.array([sum(drive.gain for drive in d.mount_drives) for d in problem.decisions])
    given = sum(sum(row[STIFFNESS]) for row in problem.mount_numbers)
    return Linear(given - float(gradient @ [d.start_number for d in problem.decisions]), gradient)


def _limits(limit: Limit, k: int, matrices: Matrices, mounting: ElasticMounting, problem: Problem) -> list[ConvexLimit]:
    found = []
    if limit.measure.channel is channels.FREQUENCIES:
        if limit.maximum < math.inf:
            found.append(ConvexLimit(Eigenvalue(matrices, 1.0), (math.tau * limit.maximum) ** 2, k))
        if limit.minimum > -math.inf:
            found.append(ConvexLimit(Eigenvalue(matrices, -1.0), -((math.tau * limit.minimum) ** 2), k))
        return found
    function = _function(limit.measure, matrices, mounting, problem)
    if limit.maximum < math.inf:
        found.append(ConvexLimit(function, limit.maximum, k))
    if limit.minimum > -math.inf and isinstance(function, Linear):
        found.append(ConvexLimit(Linear(-function.constant, -function.gradient), -limit.minimum, k))
    return found


def dual_bound(program: ConvexProgram, x: Array, duals: ConvexDuals) -> tuple[float, Array]:
    """Least objective that these duals leave possible, and the gradient of the bound's function (E16-E19)."""
    constant, gradient = 0.0, np.zeros(len(x))
    for (weight, term), dual in zip(program.terms, duals.terms, strict=True):
        c, g = term.minorant(x, dual)
        constant, gradient = constant + weight * c, gradient + weight * g
    for limit, price, dual in zip(program.limits, duals.prices, duals.limits, strict=True):
        c, g = limit.function.minorant(x, dual)
        constant, gradient = constant + price * (c - limit.maximum), gradient + price * g
    least = np.minimum(gradient * program.lower, gradient * program.upper)
    return constant + float(least.sum()), gradient


def solve_convex_mounts(problem: Problem) -> Result:
    """Global optimum of a problem that `is_convex`, with a certificate from the exact model."""
    from laufruhe.solvers.mount_cones import solve_cones

    started = time.perf_counter()
    program = convex_program(problem)
    initial = evaluate_start(problem)
    modelled = time.perf_counter()
    found = solve_cones(program)
    solved = time.perf_counter()
    timing = {"model": modelled - started, "solve": solved - modelled}
    if found is None:
        return infeasible_mounts(problem, initial, _conflict(program, problem), timing)
    x, duals = found
    bound, gradient = dual_bound(program, x, duals)
    final = evaluate(problem, problem.design([float(v) for v in x]))
    value, given = objective_value(problem, final), objective_value(problem, initial)
    bound = float(max(bound, 0.0))
    gap = float(max(value - bound, 0.0) / gap_unit(value, given))
    worst = final.excess(problem.limits)
    proven = gap <= problem.tolerance and worst <= FEASIBLE
    certificate = Certificate(
        Proof.GLOBAL if proven else Proof.WITHIN_GAP, bound, gap, _residual(program, x, duals, gradient),
        "linear matrix inequalities, dual bound over the box of stiffnesses",
    )  # fmt: skip
    prices = _prices(problem, program, duals)
    result = mount_result(problem, initial, final, certificate, [float(v) for v in x], gradient, prices, proven)
    return replace(result, timing={**timing, "evaluate": time.perf_counter() - solved})


def _prices(problem: Problem, program: ConvexProgram, duals: ConvexDuals) -> list[float]:
    """Fall of the objective per unit by which each limit is relaxed, in the limit's own unit."""
    prices = [0.0] * len(problem.mount_limits)
    for limit, price in zip(program.limits, duals.prices, strict=True):
        source = problem.mount_limits[limit.source]
        slope = 1.0
        if source.measure.channel is channels.FREQUENCIES:
            # the limit is on the square of 2 pi f
            slope = 2.0 * math.tau * math.sqrt(abs(limit.maximum))
        prices[limit.source] += price * slope
    return prices


def _residual(program: ConvexProgram, x: Array, duals: ConvexDuals, gradient: Array) -> float:
    """Largest violation of stationarity, feasibility and complementarity, each over its own scale."""
    width = np.where(program.upper > program.lower, program.upper - program.lower, 1.0)
    whole = abs(program.objective(x)) or 1.0
    moved = np.clip(x - gradient * width**2 / whole, program.lower, program.upper)
    # how much the objective's linear model could still fall inside the box
    still = float(np.abs(gradient * (moved - x)).max(initial=0.0)) / whole
    violations = [still]
    for limit, price in zip(program.limits, duals.prices, strict=True):
        room = limit.maximum - limit.function.value(x)
        violations += [max(-room, 0.0) / (abs(limit.maximum) or 1.0), abs(price * room) / whole]
    return max(violations)


def _conflict(program: ConvexProgram, problem: Problem) -> tuple[str, ...]:
    """A smallest set of limits that no stiffness within the bounds meets together."""
    from laufruhe.solvers.mount_cones import solve_cones

    kept: Sequence[int] = range(len(problem.mount_limits))
    for k in range(len(problem.mount_limits)):
        without = [j for j in kept if j != k]
        fewer = replace(program, terms=(), limits=tuple(limit for limit in program.limits if limit.source in without))
        if solve_cones(fewer) is None:
            kept = without
    return tuple(problem.mount_limits[k].name for k in kept)
