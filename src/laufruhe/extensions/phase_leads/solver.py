"""Solve for phase leads of shafts, coupled machines (P13, P14) and cranks with shared gas (P15) by branch and bound.

A cone program at the middle of every box optimises the unbalances. Its dual rows bound the objective in the whole box.
If only leads are open, simplex searches from the best points of a grid find the first design.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from laufruhe.errors import ModelError, counted
from laufruhe.extensions.phase_leads.bounds import SLACK, LeadBound, LeadBoxes
from laufruhe.extensions.phase_leads.model import PhaseLeadModel, PhaseLeadNorm
from laufruhe.extensions.phase_leads.shared_gas import SharedGasBoxes
from laufruhe.load_models.affine import AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import RotorDrive, real_bounds
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import INFEASIBLE_PART, Box, FathomedPart, bisect_box, halves
from laufruhe.prove.certificate import Multipliers, ProofStrength, best_bound
from laufruhe.prove.witness import thin_box
from laufruhe.solvers.boxes.search import SHARE, BoundedBox, RebalancedDesign, RebalancedSearch, rebalance
from laufruhe.solvers.conclusion import (
    FEASIBILITY_TOL,
    Design,
    ProofData,
    build_result,
    evaluate_design,
    infeasible_result,
    witness_of,
)
from laufruhe.solvers.cones.conic import refine_multipliers, solve_cones
from laufruhe.solvers.result import Result

MAX_BOXES, MAX_PROGRAMS = 20_000, 2_000
"""Largest number of boxes without and with cone programs."""
GRID, GRID_OF_SHARED_GAS, SEARCHES = (24, 600, 300), (48, 400, 80), 3
"""Largest numbers: points of a start grid along a lead and in all, iterations of a simplex search; simplex searches."""
COARSE, NEAR = 4, 10.0
"""Factor of coarser sampling in cone programs, and the multiple of the tolerance within which programs use all samples.
"""
PROBES, SAME = (0.0, 0.31, 0.67), 1e-6
"""Shares of the range at which a lead is tested for an effect, and the relative change that counts as none."""
EXACT, SHARE_OF_SHARED_GAS = 0.02, 0.5
"""Shares of the tolerance: improvement by splitting up to which a box counts as exact, and gap at which the boxes of
cranks that share gas end."""


def solve_leads(problem: Problem) -> Result:
    """Return the best lead angles of geared shafts and their unbalances, with a bound by branch and bound."""
    search = LeadSearch(problem)
    search.check_acts()
    root, first = search.box(search.model.lower, search.model.upper), search.first()
    if search.model.domains:
        return search.solve(root, first, problem.search.boxes_or(MAX_PROGRAMS), "leads", "second-order cones over")
    return search.solve(root, first, problem.search.boxes_or(MAX_BOXES), "leads", "local searches; lower bound on")


@dataclass(frozen=True, eq=False)
class _Box(BoundedBox):
    """Box of leads [rad]; `at_middle` bounds the objective at its middle [SI], and `side` is the lead to split."""

    at_middle: float
    side: int


class LeadSearch(RebalancedSearch[_Box]):
    """Branch and bound search over the open lead angles of geared shafts."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.model = PhaseLeadModel(problem)
        self.boxes = LeadBoxes(self.model)
        self.samples = max(problem.fidelity.samples // COARSE, 24) * COARSE

    def parts(self, box: _Box, value: float) -> Iterator[tuple[_Box | FathomedPart, RebalancedDesign | None]]:
        """Yield the halves of a box of lead angles, each with the design at its middle if that may beat `value`."""
        for low, high in halves(Box(box.lower, box.upper, box.side)):
            half = self.box(low, high, box.bound, value)
            level = value * (1.0 - SHARE * self.problem.tolerance)
            may_improve = not isinstance(half, FathomedPart) and half.bound < value and half.at_middle < level
            yield half, self.rebalance_at(0.5 * (low + high)) if may_improve else None

    def box(self, lower: Array, upper: Array, floor: float = 0.0, value: float = math.inf) -> _Box | FathomedPart:
        """Return a box of lead angles [rad] with a lower bound of the objective, at least the known bound `floor` [SI].

        Bounds close to the objective of the incumbent, `value` [SI], use all samples. A box without a feasible design
        is an `INFEASIBLE_PART`.
        """
        middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        result = self._bound(middle, half, COARSE)
        if self.model.domains and value * (1.0 - NEAR * self.problem.tolerance) < result.value < value:
            result = self._bound(middle, half, 1)
        if math.isinf(result.value):
            self.add_conflict(result.broken)
            return INFEASIBLE_PART
        side = int(np.argmax(result.pull + 1e-12 * half))
        bound, room = max(result.value, floor), EXACT * self.problem.tolerance * result.at_middle
        return _Box(bound, result.at_middle - bound <= room < math.inf, lower, upper, result.at_middle, side)

    def _bound(self, middle: Array, half: Array, factor: int) -> LeadBound:
        fine, norms = self.model.at(middle, self.samples, averaged=True)
        if not self.model.domains:
            return self._bound_without_unbalances(middle, half, fine, norms)
        coarse, coarse_norms = self.model.at(middle, self.samples // factor, averaged=True)
        solution = solve_cones(coarse)
        if solution.x is None:
            limits = solution.multipliers.limits
            infeasible = self._prove_infeasible(middle, half, coarse, coarse_norms[len(coarse.terms) :], limits)
            # the middle has no feasible design, but the halves may have one
            return infeasible or LeadBound(0.0, math.inf, half)
        bound = best_bound(fine, solution.x, refine_multipliers(coarse, fine, solution.multipliers))
        return self.boxes.bound(middle, half, fine, norms, bound.multipliers)

    def _bound_without_unbalances(
        self, middle: Array, half: Array, program: AffineProblem, norms: tuple[PhaseLeadNorm, ...]
    ) -> LeadBound:  # fmt: skip
        zeros = tuple(np.zeros_like(norm.constant) for _, norm in program.limits)
        for k, (maximum, norm) in enumerate(program.limits):
            if norm.value(np.zeros(0)) > maximum * (1.0 + SLACK):
                dual_rows = tuple(norm.subgradient(np.zeros(0)) if j == k else z for j, z in enumerate(zeros))
                infeasible = self._prove_infeasible(middle, half, program, norms[len(program.terms) :], dual_rows)
                if infeasible is not None:
                    return infeasible
        rows = tuple(norm.subgradient(np.zeros(0)) for _, norm in program.terms)
        return self.boxes.bound(middle, half, program, norms, Multipliers(rows, zeros))

    def _prove_infeasible(
        self, middle: Array, half: Array, program: AffineProblem, norms: tuple[PhaseLeadNorm, ...],
        limits: tuple[Array, ...],
    ) -> LeadBound | None:  # fmt: skip
        # return an infinite bound if the multipliers prove that the box has no feasible design, else None
        stripped = replace(program, terms=())
        bound = self.boxes.bound(middle, half, stripped, norms, Multipliers((), limits))
        if not math.isinf(bound.value):
            return None
        self.add_conflict([x.name for x, z in zip(self.problem.load_limits, limits, strict=True) if z.any()])
        return bound

    def around(self, design: RebalancedDesign) -> _Box | FathomedPart:
        """Return a thin box around the leads of a design, with its bound."""
        return self.box(*thin_box(self.place(design), self.model.lower, self.model.upper), 0.0, self.value)

    def check_acts(self) -> None:
        """Raise ModelError if an open lead angle changes neither the objective nor a limit."""
        lower, upper = self.model.lower, self.model.upper
        for k, decision in enumerate(self.model.leads if not self.model.domains else ()):
            is_lead = np.arange(len(lower)) == k
            points = [np.where(is_lead, lower + share * (upper - lower), self.model.start) for share in PROBES]
            numbers = []
            for point in points:
                program, _ = self.model.at(point, self.samples)
                norms = [norm.value(np.zeros(0)) for _, norm in (*program.terms, *program.limits)]
                numbers.append(np.array([*norms, *self.boxes.numbers(point)]))
            if np.ptp(numbers, axis=0).max() <= SAME * np.abs(numbers).max():
                reason = "is open, but no objective or limit depends on it; fix it, or add a measure of coupled shafts"
                raise ModelError(f"{decision.name} {reason}")

    def first(self) -> RebalancedDesign:
        """Return the first incumbent of the branch and bound search.

        It is the best of the initial design, designs with optimal unbalances, and ends of simplex searches.
        """
        designs = [RebalancedDesign(evaluate_design(self.problem, self.problem.start))]
        if self.model.domains:
            middle = 0.5 * (self.model.lower + self.model.upper)
            designs += [self.rebalance_at(self.model.start), self.rebalance_at(middle)]
        else:
            ends = _search_from_grid(self._penalised, self.model.lower, self.model.upper, *GRID)
            designs += [RebalancedDesign(evaluate_design(self.problem, end.tolist())) for end in ends]
        return min(designs, key=self.rank)

    def rebalance_at(self, leads: Array) -> RebalancedDesign:
        """Return the best design with these lead angles [rad], shape (leads,): its unbalances are optimal."""
        fixed_values: dict[str, Value] = {d.name: float(x) for d, x in zip(self.model.leads, leads, strict=True)}
        turns = dict(zip(self.model.names, leads - self.model.start, strict=True))
        shafts = {rotor.name: rotor.shaft for rotor in self.problem.engine.rotors}

        def turned(drive: RotorDrive) -> RotorDrive:
            # the gain turns by the lead of its shaft
            shaft = shafts[drive.rotor]
            return replace(drive, gain=drive.gain * np.exp(1j * shaft.ratio * turns.get(shaft.name, 0.0)))

        unbalances = tuple(replace(d, drives=tuple(map(turned, d.rotor_drives))) for d in self.problem.unbalances)
        engine = self.problem.design(list(fixed_values.values()), self.model.leads)
        return rebalance(self.problem, replace(self.problem, engine=engine, decisions=unbalances), fixed_values)

    def _penalised(self, leads: Array) -> float:
        leads_in_bounds = np.clip(leads, self.model.lower, self.model.upper)
        program, _ = self.model.at(leads_in_bounds, self.samples)
        (irregularity, violations), x = self.boxes.degrees(leads_in_bounds, np.zeros_like(leads_in_bounds)), np.zeros(0)
        total = program.objective(x) + irregularity
        excess = sum(max(norm.value(x) / (maximum or 1.0) - 1.0, 0.0) for maximum, norm in program.limits)
        excess += sum(violations.values())
        return float(total * (1.0 + 1e3 * excess) + excess)


def solve_shared_leads(problem: Problem) -> Result:
    """Return the best lead angles between cranks that share gas chambers, with a proven lower bound (P15)."""
    started, initial = time.perf_counter(), evaluate(problem)
    lower, upper = real_bounds(problem.decisions)
    boxes, best = SharedGasBoxes(problem), _best_design(problem, lower, upper)
    value, gap_tolerance, witness = math.inf, 0.0, None
    if best is not None and best.violation <= FEASIBILITY_TOL:
        value = best.value
        gap_tolerance = SHARE_OF_SHARED_GAS * problem.tolerance * max(value, numerical_zero(problem))
        witness = witness_of(best, np.array([float(x.real) for x in best.values]))
    division = bisect_box(boxes, lower, upper, value, gap_tolerance, problem.search.boxes_or(MAX_BOXES), witness)
    timing = {"solve": time.perf_counter() - started}
    if best is None or (witness is None and math.isinf(division.bound)):
        return infeasible_result(problem, initial, tuple(limit.name for limit in problem.limits), timing)
    method = f"local searches; lower bound on {counted(division.boxes, 'box')} of leads"
    return build_result(best, initial, ProofData(division.bound, ProofStrength.EXACT, math.inf, method), timing)


def _best_design(problem: Problem, lower: Array, upper: Array) -> Design | None:
    """Return the best of the initial design and the ends of simplex searches from a grid of lead angles."""

    def design(leads: Array) -> Design | None:
        try:
            return evaluate_design(problem, [float(x) for x in np.clip(leads, lower, upper)])
        except ModelError:
            return None

    def penalised(leads: Array) -> float:
        candidate = design(leads)
        return math.inf if candidate is None else candidate.value * (1.0 + 1e3 * max(candidate.violation, 0.0))

    start = np.array([d.real_start for d in problem.decisions])
    # the last of equal ends wins
    ends = [*reversed(_search_from_grid(penalised, lower, upper, *GRID_OF_SHARED_GAS)), start]
    return min(filter(None, map(design, ends)), key=lambda design: design.rank, default=None)


def _search_from_grid(
    penalised: Callable[[Array], float], lower: Array, upper: Array, steps: int, maximum: int, most_steps: int
) -> list[Array]:
    """Return the ends of simplex (Nelder-Mead) searches from the best points of a grid of lead angles, shape (n,) each.

    The grid has at most `steps` points along a lead angle and `maximum` in all. A search has at most `most_steps`
    iterations.
    """
    from scipy.optimize import minimize

    count = min(steps, max(int(maximum ** (1.0 / len(lower))), 2))
    sides = [np.linspace(a, b, count) for a, b in zip(lower, upper, strict=True)]
    points = sorted((np.array(point) for point in itertools.product(*sides)), key=penalised)
    bounds: Any = list(zip(lower, upper, strict=True))
    ends = []
    for point in points[:SEARCHES]:
        simplex = np.clip(np.vstack([point, point + np.diag(0.5 * (upper - lower) / count)]), lower, upper)
        tolerance = 1e-12 * max(penalised(point), 1e-300)
        options: Any = {"initial_simplex": simplex, "xatol": 1e-8, "fatol": tolerance, "maxiter": most_steps}
        end = minimize(penalised, point, method="Nelder-Mead", bounds=bounds, options=options).x
        ends.append(np.clip(end, lower, upper))
    return ends
