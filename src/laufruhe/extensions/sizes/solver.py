"""Deciding sizes of the running gear, and unbalances with them: local programs propose, boxes prove (Z12, Z14)."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.sizes.boxes import MOST_BOXES, SizeBoxes, divided_sizes
from laufruhe.extensions.sizes.model import SizeModel
from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.norms import Grid
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import Multipliers, ProofStrength
from laufruhe.solvers.boxes.box_designs import rebalance
from laufruhe.solvers.conclusion import Design, build_result, infeasible_result, known_of
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.conflicts import smallest_conflict
from laufruhe.solvers.result import Result
from laufruhe.solvers.smooth.local_programs import LocalProgram, best_local_optimum, proof_data, proven, spread_starts

MOST_WITH_ROD, MOST_PROGRAMS = 300, 400
"""Boxes where the length of the rod is open, which take ten times as long, and where each has cone programs."""
STARTS = 3
# angles at the least at which programs of boxes stand, roughly and where little is to be shown
FEW_STEPS, MANY_STEPS = 180, 720
# relative room that local programs leave inside limits, a part of what counts as kept
INSIDE = 1e-7


@dataclass(frozen=True, eq=False)
class SizeProgram(LocalProgram):
    """Objective and rooms by the model of sizes, which is the exact one at the angles of the results."""

    model: SizeModel

    @classmethod
    def from_model(cls, model: SizeModel) -> SizeProgram:
        """Over the bounds of all that is open."""
        program = LocalProgram.of(model.problem)
        return cls(program.problem, program.lower, program.upper, model)

    @cached_property
    def sized(self) -> Mask:
        """Which columns are sizes."""
        return np.concatenate([np.full(d.width, d.decision in self.model.sizes, dtype=bool) for d in self.domains])

    def numbers(self, shares: Array) -> Array:
        """The objective, then the relative room inside each limit, and inside each sector."""
        columns, problem = self.columns(shares), self.problem
        x, u = columns[self.sized], columns[~self.sized]
        value = sum(term.weight * self.model.value(term.measure, x, u) for term in problem.objective)
        rooms = [limit.room(self.model.value(limit.measure, x, u))[0] - INSIDE for limit in problem.limits]
        return np.array([value, *rooms, *self.edges(shares)])

    def place(self, values: Array) -> Array:
        """The best unbalances with sizes given."""
        return self.balanced(values)

    def balanced(self, sizes: Array) -> Array:
        """Shares with these sizes and the best unbalances there."""
        problem, named = self.problem, self.model.sizes
        if not self.model.domains:
            return self.shares(sizes)
        start_sizes = [float(x) for x in sizes]
        fixed = replace(problem, engine=problem.design(start_sizes, named), decisions=problem.unbalances)
        where: dict[str, Value] = dict(zip((d.name for d in named), start_sizes, strict=True))
        return self.shares(rebalance(problem, fixed, where).design.values)


def solve_sizes(problem: Problem, known: float = math.inf) -> Result:
    """The best sizes and unbalances, proven where bounds of boxes close; or the limits that no sizes keep.

    Parameters
    ----------
    known
        Value of another design: where one is allowed here, that none of them is better is enough.

    Raises
    ------
    ModelError
        If nothing that is asked hangs on a size that is open.
    """
    started = time.perf_counter()
    initial, model = evaluate(problem), SizeModel(problem)
    check_acts(model)
    program = SizeProgram.from_model(model)
    best = _proposed(program)
    boxes: SizeBoxes | None = None
    with suppress(ValueError):
        boxes = SizeBoxes(model, solve_cone_program)

    def bounded(value: float, room: float, design: Design) -> BoxResult:
        usual = MOST_WITH_ROD if model.moves_rod else MOST_PROGRAMS if model.domains else MOST_BOXES
        maximum = problem.search.boxes_or(usual)
        if boxes is None:
            return BoxResult(0.0, 0)
        if known < value < math.inf:
            # a room is a share of the value
            value, room = known, room * known / value
        place = program.columns(program.shares(design.values))[program.sized]
        return divided_sizes(boxes, value, room, maximum, known_of(design, place) if value < math.inf else None)

    outcome = proven(program, best, bounded)
    if boxes is not None and outcome.excludes_all:
        conflict = smallest_conflict(
            problem.limits, lambda limits: divided_sizes(boxes.keeping(limits), math.inf, 0.0, 64).bound == math.inf
        )
        return infeasible_result(problem, initial, conflict, {"solve": time.perf_counter() - started})
    if boxes is not None:
        words = f"local programs; lower bound on {outcome.divided.boxes} boxes of sizes"
    else:
        rod = "; nothing bounds what the length of the rod makes of a load"
        words = f"local programs{rod if model.moves_rod else ''}"
    strength = (
        ProofStrength.RELAXED if boxes is None else ProofStrength.EXACT if boxes.is_whole else ProofStrength.PARTIAL
    )
    proof = proof_data(program, outcome.design, outcome.bound, strength, words)
    return build_result(outcome.design, initial, proof, {"solve": time.perf_counter() - started})


def _proposed(program: SizeProgram) -> Array:
    problem = program.problem
    first = program.shares(problem.start)
    starts = [first, np.ones(len(first)), *spread_starts(problem)]
    if program.model.domains:
        sizes = [program.columns(start)[program.sized] for start in starts[:2]]
        starts = [*(program.balanced(one) for one in sizes), *starts]
    best = best_local_optimum(program, starts, min(problem.search.starts, STARTS))
    return min(best, program.balanced(program.columns(best)[program.sized]), key=program.rank)


def solve_cone_program(program: AffineProblem, exactly: bool = False) -> tuple[Array | None, Multipliers]:
    """A program's decision vector and dual rows, at few angles, or at as many as tell all but all."""
    steps = MANY_STEPS if exactly else FEW_STEPS
    fewer = replace(
        program,
        terms=tuple((weight, _thinned(norm, steps)) for weight, norm in program.terms),
        limits=tuple((maximum, _thinned(norm, steps)) for maximum, norm in program.limits),
    )
    solution = solve_cones(fewer)
    return solution.x, solution.multipliers


def _thinned(norm: AffineNorm, steps: int) -> AffineNorm:
    grid = norm.grid
    thin = max((n for n in range(1, grid.steps // steps + 1) if grid.steps % n == 0), default=1)
    if not norm.norm.averages or grid.bends or thin == 1:
        return norm
    weights = thin * grid.weights[::thin]
    return replace(
        norm, constant=norm.constant[::thin], slope=norm.slope[::thin], grid=Grid(weights, grid.steps // thin)
    )


def check_acts(model: SizeModel) -> None:
    """Refuse a size that nothing asked hangs on."""
    measures = dict.fromkeys(model.problem.measures)
    for k, decision in enumerate(model.sizes):
        middle = 0.5 * (model.lower + model.upper)
        ends = [np.where(np.arange(len(middle)) == k, edge, middle) for edge in (model.lower, model.upper)]
        if all(model.value(measure, ends[0]) == model.value(measure, ends[1]) for measure in measures):
            raise ModelError(f"{decision.name} is open, and nothing that is asked depends on it; fix it, or limit it")
