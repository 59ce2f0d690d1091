"""Optimum of sizes of the running gear, and of unbalances with them: local programs propose, boxes prove (Z12, Z14)."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.sizes.boxes import MAX_BOXES, SizeBoxes, divided_sizes
from laufruhe.extensions.sizes.model import SizeModel
from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import Multipliers, ProofStrength
from laufruhe.solvers.boxes.search import rebalance
from laufruhe.solvers.conclusion import Design, build_result, infeasible_result, smallest_conflict, witness_of
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import (
    LocalProgram,
    best_local_optimum,
    proof_data,
    prove_design,
    spread_starts,
)

MAX_WITH_ROD, MAX_PROGRAMS = 300, 400
"""Most boxes if the rod length is open, which takes ten times as long, and if each box has cone programs."""
STARTS = 3
"""Most local searches."""
# fewest samples of the programs of boxes: rough, and for a small gap
FEW_STEPS, MANY_STEPS = 180, 720
# relative margin of local programs inside limits, below the feasibility tolerance
MARGIN = 1e-7


@dataclass(frozen=True, eq=False)
class SizeProgram(LocalProgram):
    """Local program of the size model, which is exact at the samples of the results."""

    model: SizeModel

    @classmethod
    def from_model(cls, model: SizeModel) -> SizeProgram:
        """Return the program over the bounds of all open numbers."""
        program = LocalProgram.of(model.problem)
        return cls(program.problem, program.lower, program.upper, model)

    @cached_property
    def sized(self) -> Mask:
        """Mask of the columns that are sizes, shape (columns,)."""
        return np.concatenate([np.full(d.width, d.decision in self.model.sizes, dtype=bool) for d in self.domains])

    def numbers(self, shares: Array) -> Array:
        """Return the objective, then the relative margin of each limit and of each unbalance's sector."""
        columns, problem = self.columns(shares), self.problem
        sizes, unbalances = columns[self.sized], columns[~self.sized]
        value = sum(term.weight * self.model.value(term.measure, sizes, unbalances) for term in problem.objective)
        margins = [
            limit.slack(self.model.value(limit.measure, sizes, unbalances))[0] - MARGIN for limit in problem.limits
        ]
        return np.array([value, *margins, *self.edges(shares)])

    def place(self, values: Array) -> Array:
        """Return the start point of a search for sizes `values` [m], with the best unbalances for them."""
        problem, decisions = self.problem, self.model.sizes
        if not self.model.domains:
            return self.shares(values)
        sizes: dict[str, Value] = {d.name: float(x) for d, x in zip(decisions, values, strict=True)}
        engine = problem.design(list(sizes.values()), decisions)
        fixed = replace(problem, engine=engine, decisions=problem.unbalances)
        return self.shares(rebalance(problem, fixed, sizes).design.values)


def solve_sizes(problem: Problem) -> Result:
    """Return the optimal sizes and unbalances with their proof, or the limits that no sizes satisfy."""
    started = time.perf_counter()
    initial, model = evaluate(problem), SizeModel(problem)
    check_acts(model)
    program = SizeProgram.from_model(model)
    starts = [program.shares(problem.start), np.ones(len(program.lower)), *spread_starts(problem)]
    if model.domains:
        starts = [*(program.place(program.columns(start)[program.sized]) for start in starts[:2]), *starts]
    optimum = best_local_optimum(program, starts, min(problem.search.starts, STARTS))
    optimum = min(optimum, program.place(program.columns(optimum)[program.sized]), key=program.rank)
    boxes: SizeBoxes | None = None
    with suppress(ValueError):
        boxes = SizeBoxes(model, solve_cone_program)

    def bounded(value: float, gap_tolerance: float, design: Design) -> BoxResult:
        default_budget = MAX_WITH_ROD if model.moves_rod else MAX_PROGRAMS if model.domains else MAX_BOXES
        maximum = problem.search.boxes_or(default_budget)
        if boxes is None:
            return BoxResult(0.0, 0)
        place = program.columns(program.shares(design.values))[program.sized]
        return divided_sizes(
            boxes, value, gap_tolerance, maximum, witness_of(design, place) if value < math.inf else None
        )

    outcome = prove_design(program, optimum, bounded)
    if boxes is not None and outcome.excludes_all:
        conflict = smallest_conflict(
            problem.limits, lambda limits: divided_sizes(boxes.with_limits(limits), math.inf, 0.0, 64).bound == math.inf
        )
        return infeasible_result(problem, initial, conflict, {"solve": time.perf_counter() - started})
    if boxes is not None:
        words = f"local programs; lower bound on {outcome.divided.boxes} boxes of sizes"
    else:
        rod = "; no bound, because kinks of a load move with the rod length"
        words = f"local programs{rod if model.moves_rod else ''}"
    strength = (
        ProofStrength.RELAXED if boxes is None else ProofStrength.EXACT if boxes.is_whole else ProofStrength.PARTIAL
    )
    proof = proof_data(program, outcome.design, outcome.bound, strength, words)
    return build_result(outcome.design, initial, proof, {"solve": time.perf_counter() - started})


def solve_cone_program(program: AffineProblem, exactly: bool = False) -> tuple[Array | None, Multipliers]:
    """Return the optimum of a cone program, or None, and multipliers, at few samples or `exactly` at many."""
    steps = MANY_STEPS if exactly else FEW_STEPS
    coarse = replace(
        program,
        terms=tuple((weight, _coarser(norm, steps)) for weight, norm in program.terms),
        limits=tuple((maximum, _coarser(norm, steps)) for maximum, norm in program.limits),
    )
    solution = solve_cones(coarse)
    return solution.x, solution.multipliers


def _coarser(norm: AffineNorm, steps: int) -> AffineNorm:
    grid = norm.grid
    stride = max((n for n in range(1, grid.steps // steps + 1) if grid.steps % n == 0), default=1)
    return norm.coarser(stride) if norm.norm.averages and not grid.kinks and stride > 1 else norm


def check_acts(model: SizeModel) -> None:
    """Raise ModelError for a size that no measure depends on."""
    measures = dict.fromkeys(model.problem.measures)
    for k, decision in enumerate(model.sizes):
        middle = 0.5 * (model.lower + model.upper)
        ends = [np.where(np.arange(len(middle)) == k, edge, middle) for edge in (model.lower, model.upper)]
        if all(model.value(measure, ends[0]) == model.value(measure, ends[1]) for measure in measures):
            raise ModelError(
                f"{decision.name} is open, but no objective or limit depends on this size; fix it, or limit a stress"
            )
