"""Solve for flywheel sizes by branch and bound: objective and limits are monotone in each size (T9)."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.extensions.flywheel.channels import FlywheelChannel
from laufruhe.extensions.flywheel.machine import FLYWHEEL, Flywheel
from laufruhe.extensions.flywheel.monotone import Monotone, MonotoneProblem, bisect_monotone
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Numbers, apply_decisions, real_bounds
from laufruhe.problem.dependence import falls_with
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import ProofStrength
from laufruhe.solvers.conclusion import Design, build_result, infeasible_result, smallest_conflict, witness_of
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import (
    LocalProgram,
    best_local_optimum,
    proof_data,
    prove_design,
    spread_starts,
)

WIDTH = "flywheel.width"
# share of the tolerance for a monotone objective, whose gap closes fast
MONOTONE_SHARE = 1e-3
# relative distance that local programs keep from limits
MARGIN = 1e-9
# largest number of boxes to test a set of limits for a contradiction
FEW_BOXES = 64


@dataclass(frozen=True, eq=False)
class _Coordinates:
    """Coordinates of boxes: the decisions, or the decisions with the rim's mass in place of its width.

    Mass, inertia and stress depend on diameter, height and mass alone. In these coordinates, fewer boxes cover designs
    of equal mass. `width` is the index of the width among the decisions, or None if the coordinates are the decisions.
    """

    problem: Problem
    initial: Flywheel
    width: int | None

    @classmethod
    def from_problem(cls, problem: Problem, by_mass: bool) -> _Coordinates:
        """Return the coordinates of a flywheel's open rim sizes; if `by_mass`, the rim's mass replaces its width."""
        initial = problem.engine.extra(Flywheel)
        assert initial is not None
        names = [decision.name for decision in problem.decisions]
        has_mass = by_mass and len(names) > 1 and WIDTH in names
        return cls(problem, initial, names.index(WIDTH) if has_mass else None)

    def wheel(self, x: Array) -> Flywheel:
        """Return the flywheel at coordinates x, shape (n,)."""
        decisions = self.problem.decisions
        values = x if self.width is None else np.insert(x[:-1], self.width, decisions[self.width].real_start)
        changes = apply_decisions(Numbers(), decisions, values.tolist()).changes
        wheel = self.initial.moved({key: change for (_, key), change in changes.items()}, (), ())
        return wheel if self.width is None else wheel.weighing(float(x[-1]))

    def decisions(self, x: Array) -> Array:
        """Return the values of the decisions at coordinates x, shape (n,) [SI]."""
        if self.width is None:
            return x
        return np.clip(np.insert(x[:-1], self.width, self.wheel(x).ring.width), *self.bounds)

    def place(self, values: Sequence[Value]) -> Array:
        """Return the coordinates of a flywheel, shape (n,), from the values of the decisions."""
        x = np.array([float(value.real) for value in values])
        if self.width is None:
            return x
        mass = replace(self, width=None).wheel(x).ring.mass
        return np.append(np.delete(x, self.width), mass)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the decisions, shape (n,) each."""
        return real_bounds(self.problem.decisions)

    def monotone_problem(self, initial: Evaluation, limits: Sequence[Limit]) -> MonotoneProblem:
        """Return objective and limits as functions that rise or fall steadily with each coordinate.

        At constant speed the flywheel changes no load, so the loads are those of the evaluation `initial`.
        """
        lower, upper = self.bounds
        width: list[tuple[float, Monotone]] = []
        if self.width is not None:
            signs = np.array([*(-1.0 for _ in lower[1:]), 1.0])
            for sign, bound in ((1.0, upper), (-1.0, lower)):
                function = Monotone(lambda x, sign=sign: sign * self.wheel(x).ring.width, sign * signs)  # type: ignore[misc]
                width.append((sign * bound[self.width], function))
            masses = (replace(self, width=None).wheel(bound).ring.mass for bound in (lower, upper))
            lower, upper = (
                np.append(np.delete(b, self.width), mass) for b, mass in zip((lower, upper), masses, strict=True)
            )

        def monotone(measure: Measure) -> Monotone:
            assert isinstance(measure.channel, FlywheelChannel)
            flywheel_value = measure.channel.flywheel_value(measure, initial)
            sign = -1.0 if falls_with(measure.channel, FLYWHEEL) else 1.0
            return Monotone(lambda x: flywheel_value(self.wheel(x)), np.full(len(lower), sign))

        return MonotoneProblem(
            tuple((term.weight, monotone(term.measure)) for term in self.problem.objective),
            (*((limit.maximum, monotone(limit.measure)) for limit in limits), *width),
            lower,
            upper,
        )


@dataclass(frozen=True, eq=False)
class _WheelProgram(LocalProgram):
    """Local program of the flywheel, with objective and limits as monotone functions of the decisions."""

    functions: MonotoneProblem

    def numbers(self, shares: Array) -> Array:
        """Return objective [SI] and relative distance to each limit; `shares` are scaled decisions, shape (n,)."""
        x, problem = np.array(self.values(shares)), self.functions
        distances = (1.0 - function.value(x) / maximum - MARGIN for maximum, function in problem.limits)
        return np.array([problem.value(x), *distances])


def solve_flywheel(problem: Problem) -> Result:
    """Return the best flywheel with its certificate, or an infeasible result with limits that contradict each other."""
    started = time.perf_counter()
    initial = evaluate(problem)
    coordinates, decision_coordinates = (_Coordinates.from_problem(problem, by_mass) for by_mass in (True, False))
    functions = coordinates.monotone_problem(initial, problem.limits)
    program = _WheelProgram(
        problem, *decision_coordinates.bounds, decision_coordinates.monotone_problem(initial, problem.limits)
    )
    best = best_local_optimum(program, [program.shares(problem.start), *spread_starts(problem)], problem.search.starts)

    def bounded(value: float, gap_tolerance: float, design: Design) -> BoxResult:
        witness = None if math.isinf(value) else witness_of(design, coordinates.place(design.values), violation=0.0)
        result = bisect_monotone(
            functions, value, (MONOTONE_SHARE if functions.is_monotone else 1.0) * gap_tolerance, witness=witness
        )
        return replace(result, places=tuple(coordinates.decisions(x) for x in result.places))

    def is_infeasible(limits: Sequence[Limit]) -> bool:
        feasibility = replace(coordinates.monotone_problem(initial, limits), terms=())
        return bisect_monotone(feasibility, math.inf, 0.0, FEW_BOXES).bound == math.inf

    outcome = prove_design(program, best, bounded)
    timing = {"solve": time.perf_counter() - started}
    if outcome.excludes_all:
        return infeasible_result(problem, initial, smallest_conflict(problem.limits, is_infeasible), timing)
    method = f"monotone quantities, bounded on {outcome.divided.boxes} boxes of flywheel sizes"
    proof = proof_data(program, outcome.design, outcome.bound, ProofStrength.EXACT, method)
    return build_result(outcome.design, initial, proof, timing)
