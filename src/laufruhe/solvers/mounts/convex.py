"""Solve for mount stiffness by convex programs, if objective and limits are convex in it (E16-E19)."""

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
from laufruhe.problem.decision import STIFFNESS, real_bounds
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
    build_result,
    evaluate_design,
    infeasible_result,
    smallest_conflict,
)
from laufruhe.solvers.prices import Price, bounds_of
from laufruhe.solvers.result import Result

CONVEX = (channels.SAG, channels.TORQUE_ROLL, channels.RAW_TORQUE_ROLL, channels.TOTAL_STIFFNESS)


def is_convex(problem: Problem) -> bool:
    """Return True if only stiffnesses are open, and objective and limits are convex in them."""
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
    """Build the convex program of a problem that `is_convex` accepts."""
    decisions = problem.decisions
    lower, upper = real_bounds(decisions)
    start = np.array([d.real_start for d in decisions])
    mounting = mounting_in(problem.design(start.tolist()))
    root = mass_root(mounting.block)
    slopes, springs = np.zeros((len(decisions), 6, 6)), every_spring(mounting.mounts)
    for slope, decision in zip(slopes, decisions, strict=True):
        # derivative of the stiffness matrix (E3)
        for drive in decision.mount_drives:
            place, spring = springs[drive.mount]
            row = np.array(spring.orientation)[drive.number] @ mounting.motions[place]
            slope += drive.gain * np.outer(row, row)
    slopes = np.array([root @ slope @ root.T for slope in slopes]).reshape(-1, 6, 6)
    base = root @ mounting.stiffness @ root.T - np.tensordot(start, slopes, axes=1)
    matrices = StiffnessMatrices(base, slopes)
    terms = tuple((term.weight, _function(term.measure, matrices, mounting, problem)) for term in problem.objective)
    limits = [part for k, limit in enumerate(problem.limits) for part in _limits(limit, k, matrices, mounting, problem)]
    return ConvexProgram(matrices, lower, upper, terms, tuple(limits))


def _function(
    measure: Measure, matrices: StiffnessMatrices, mounting: ElasticMounting, problem: Problem
) -> ConvexFunction:
    if measure.channel is channels.SAG:
        weight = weight_wrench(mounting.block)
        return Compliance(matrices, mass_root(mounting.block) @ weight, 1.0 / -weight[2])
    if measure.channel.axis_residual is not None:
        return Residual(matrices, measure.channel.axis_residual(mounting.block, measure.frequency))
    gradient = np.array([sum(drive.gain for drive in d.mount_drives) for d in problem.decisions])
    start = sum(sum(row[STIFFNESS]) for row in problem.mount_numbers)
    return LinearFunction(start - float(gradient @ [d.real_start for d in problem.decisions]), gradient)


def _limits(
    limit: Limit, source: int, matrices: StiffnessMatrices, mounting: ElasticMounting, problem: Problem
) -> list[ConvexLimit]:
    upper: ConvexFunction
    lower: ConvexFunction | None = None
    if limit.measure.channel is channels.FREQUENCIES:
        upper, lower = Eigenvalue(matrices, 1.0), Eigenvalue(matrices, -1.0)
        maximum, minimum = ((math.tau * edge) ** 2 for edge in (limit.maximum, limit.minimum))
    else:
        upper, maximum, minimum = _function(limit.measure, matrices, mounting, problem), limit.maximum, limit.minimum
        if isinstance(upper, LinearFunction):
            lower = LinearFunction(-upper.constant, -upper.gradient)
    limits = [ConvexLimit(upper, maximum, source)] if limit.maximum < math.inf else []
    if lower is not None and limit.minimum > -math.inf:
        limits.append(ConvexLimit(lower, -minimum, source, "at least"))
    return limits


def solve_convex_mounts(problem: Problem) -> Result:
    """Return the global optimum of a problem that `is_convex` accepts, with its certificate."""
    from laufruhe.solvers.mounts.cones import solve_cones

    started = time.perf_counter()
    program = convex_program(problem)
    initial = evaluate_start(problem)
    model_time = time.perf_counter()
    solution = solve_cones(program)
    solved = time.perf_counter()
    timing = {"model": model_time - started, "solve": solved - model_time}
    if solution is None:

        def is_infeasible(subset: Sequence[Limit]) -> bool:
            limits = tuple(limit for limit in program.limits if problem.limits[limit.source] in subset)
            return solve_cones(replace(program, terms=(), limits=limits)) is None

        return infeasible_result(problem, initial, smallest_conflict(problem.limits, is_infeasible), timing)
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
    design = evaluate_design(problem, [float(v) for v in x])
    return build_result(design, initial, proof, {**timing, "evaluate": time.perf_counter() - solved})


def _prices(problem: Problem, program: ConvexProgram, duals: ConvexDuals) -> dict[Side, Price]:
    # decrease of the objective per unit of a limit
    prices: dict[Side, Price] = {}
    for limit, price in zip(program.limits, duals.prices, strict=True):
        source = problem.limits[limit.source]
        slope = 1.0
        if source.measure.channel is channels.FREQUENCIES:
            # the program limits the square of 2 pi f
            slope = 2.0 * math.tau * math.sqrt(abs(limit.maximum))
        prices[source, limit.side] = Price.both(price * slope)
    return prices


def _residual(program: ConvexProgram, x: Array, duals: ConvexDuals, gradient: Array) -> float:
    # largest relative violation of the KKT conditions
    width = np.where(program.upper > program.lower, program.upper - program.lower, 1.0)
    scale = abs(program.objective(x)) or 1.0
    step_end = np.clip(x - gradient * width**2 / scale, program.lower, program.upper)
    # possible decrease of the linear model inside the box
    decrease = float(np.abs(gradient * (step_end - x)).max(initial=0.0)) / scale
    violations = [decrease]
    for limit, price in zip(program.limits, duals.prices, strict=True):
        slack = limit.maximum - limit.function.value(x)
        violations += [max(-slack, 0.0) / (abs(limit.maximum) or 1.0), abs(price * slack) / scale]
    return max(violations)
