"""Mount stiffness by convex programs, if objective and limits are convex in it (E16-E19)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import STIFFNESS, Decision, real_bounds
from laufruhe.problem.measure import Limit, Measure, Side
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import ProofStrength
from laufruhe.prove.mounts.convex_functions import (
    Compliance,
    ConvexDuals,
    ConvexFunction,
    ConvexLimit,
    ConvexProgram,
    Eigenvalue,
    LinearFunction,
    Residual,
    StiffnessMatrices,
    dual_bound,
)
from laufruhe.solvers.conclusion import (
    ProofData,
    better,
    build_result,
    evaluate_design,
    infeasible_result,
    initial_design,
)
from laufruhe.solvers.conflicts import smallest_conflict
from laufruhe.solvers.prices import Price, bounds_of
from laufruhe.solvers.result import Result

CONVEX = (channels.SAG, channels.TORQUE_ROLL, channels.RAW_TORQUE_ROLL, channels.TOTAL_STIFFNESS)


def is_convex(problem: Problem) -> bool:
    """Return whether only stiffnesses are open, and objective and limits are convex in them."""
    if problem.load_terms or problem.load_limits or not problem.objective:
        return False
    if not all(decision.is_stiffness for decision in problem.decisions):
        return False
    terms = all(term.measure.channel in CONVEX for term in problem.objective)
    return terms and all(_is_convex_limit(limit) for limit in problem.limits)


def _is_convex_limit(limit: Limit) -> bool:
    channel = limit.measure.channel
    if channel is channels.FREQUENCIES:
        return limit.outside is None
    if channel is channels.TOTAL_STIFFNESS:
        return True
    return channel in CONVEX and limit.minimum == -math.inf


def convex_program(problem: Problem) -> ConvexProgram:
    """Return the convex program of a problem that `is_convex`."""
    decisions = problem.decisions
    lower, upper = real_bounds(decisions)
    start = np.array([d.real_start for d in decisions])
    mounting = mounting_in(problem.design(start.tolist()))
    root = mass_root(mounting.block)
    slopes = np.array([root @ _slope(mounting, decision) @ root.T for decision in decisions]).reshape(-1, 6, 6)
    base = root @ mounting.stiffness @ root.T - np.tensordot(start, slopes, axes=1)
    matrices = StiffnessMatrices(base, slopes)
    terms = tuple((term.weight, _function(term.measure, matrices, mounting, problem)) for term in problem.objective)
    limits = [part for k, limit in enumerate(problem.limits) for part in _limits(limit, k, matrices, mounting, problem)]
    return ConvexProgram(matrices, lower, upper, terms, tuple(limits))


def _slope(mounting: ElasticMounting, decision: Decision) -> Array:
    # E3: derivative of K, shape (6, 6)
    total, springs = np.zeros((6, 6)), every_spring(mounting.mounts)
    for drive in decision.mount_drives:
        place, spring = springs[drive.mount]
        row = np.array(spring.orientation)[drive.number] @ mounting.motions[place]
        total += drive.gain * np.outer(row, row)
    return total


def _function(
    quantity: Measure, matrices: StiffnessMatrices, mounting: ElasticMounting, problem: Problem
) -> ConvexFunction:
    if quantity.channel is channels.SAG:
        weight = weight_wrench(mounting.block)
        return Compliance(matrices, mass_root(mounting.block) @ weight, 1.0 / -weight[2])
    if quantity.channel.axis_residual is not None:
        return Residual(matrices, quantity.channel.axis_residual(mounting.block, quantity.frequency))
    gradient = np.array([sum(drive.gain for drive in d.mount_drives) for d in problem.decisions])
    start = sum(sum(row[STIFFNESS]) for row in problem.mount_numbers)
    return LinearFunction(start - float(gradient @ [d.real_start for d in problem.decisions]), gradient)


def _limits(
    limit: Limit, k: int, matrices: StiffnessMatrices, mounting: ElasticMounting, problem: Problem
) -> list[ConvexLimit]:
    found = []
    if limit.measure.channel is channels.FREQUENCIES:
        if limit.maximum < math.inf:
            found.append(ConvexLimit(Eigenvalue(matrices, 1.0), (math.tau * limit.maximum) ** 2, k))
        if limit.minimum > -math.inf:
            found.append(ConvexLimit(Eigenvalue(matrices, -1.0), -((math.tau * limit.minimum) ** 2), k, "at least"))
        return found
    function = _function(limit.measure, matrices, mounting, problem)
    if limit.maximum < math.inf:
        found.append(ConvexLimit(function, limit.maximum, k))
    if limit.minimum > -math.inf and isinstance(function, LinearFunction):
        found.append(ConvexLimit(LinearFunction(-function.constant, -function.gradient), -limit.minimum, k, "at least"))
    return found


def solve_convex_mounts(problem: Problem) -> Result:
    """Return the global optimum of a problem that `is_convex`, with its certificate."""
    from laufruhe.solvers.mounts.cones import solve_cones

    started = time.perf_counter()
    program = convex_program(problem)
    initial = evaluate_start(problem)
    modelled = time.perf_counter()
    solution = solve_cones(program)
    solved = time.perf_counter()
    timing = {"model": modelled - started, "solve": solved - modelled}
    if solution is None:

        def excluded(kept: Sequence[Limit]) -> bool:
            limits = tuple(limit for limit in program.limits if problem.limits[limit.source] in kept)
            return solve_cones(replace(program, terms=(), limits=limits)) is None

        return infeasible_result(problem, initial, smallest_conflict(problem.limits, excluded), timing)
    x, duals = solution
    bound, gradient = dual_bound(program, x, duals)
    proof = ProofData(
        bound=bound,
        strength=ProofStrength.EXACT,
        kkt_residual=_residual(program, x, duals, gradient),
        method="linear matrix inequalities, dual bound over the box of stiffnesses",
        prices=_prices(problem, program, duals),
        bounds={
            name: price
            for k, (decision, value) in enumerate(zip(problem.decisions, x.tolist(), strict=True))
            for name, price in bounds_of(decision, np.array([value]), gradient[k : k + 1]).items()
        },
    )
    design = better(evaluate_design(problem, [float(v) for v in x]), initial_design(problem, initial))
    return build_result(design, initial, proof, {**timing, "evaluate": time.perf_counter() - solved})


def _prices(problem: Problem, program: ConvexProgram, duals: ConvexDuals) -> dict[Side, Price]:
    # fall of the objective per unit of relaxation
    prices: dict[Side, Price] = {}
    for limit, price in zip(program.limits, duals.prices, strict=True):
        source = problem.limits[limit.source]
        slope = 1.0
        if source.measure.channel is channels.FREQUENCIES:
            # the limit is on the square of 2 pi f
            slope = 2.0 * math.tau * math.sqrt(abs(limit.maximum))
        prices[source, limit.side] = Price.both(price * slope)
    return prices


def _residual(program: ConvexProgram, x: Array, duals: ConvexDuals, gradient: Array) -> float:
    # largest relative violation of the KKT conditions
    width = np.where(program.upper > program.lower, program.upper - program.lower, 1.0)
    whole = abs(program.objective(x)) or 1.0
    moved = np.clip(x - gradient * width**2 / whole, program.lower, program.upper)
    # possible decrease of the linear model inside the box
    decrease = float(np.abs(gradient * (moved - x)).max(initial=0.0)) / whole
    violations = [decrease]
    for limit, price in zip(program.limits, duals.prices, strict=True):
        room = limit.maximum - limit.function.value(x)
        violations += [max(-room, 0.0) / (abs(limit.maximum) or 1.0), abs(price * room) / whole]
    return max(violations)
