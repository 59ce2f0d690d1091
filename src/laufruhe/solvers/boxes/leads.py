"""Solve for phase leads of geared shafts and coupled machines by branch and bound (P13, P14).

A cone program at the middle of every box optimises the unbalances. Its dual rows bound the objective in the whole box.
If only leads are open, simplex searches from the best points of a grid find the first design.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import AffineProblem
from laufruhe.load_models.phase_lead_model import PhaseLeadModel, PhaseLeadNorm
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Decision
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.boxes.leads import SLACK, LeadBound, LeadBoxes
from laufruhe.prove.branch_and_bound import INFEASIBLE_PART, Box, FathomedPart, halves
from laufruhe.prove.certificate import Multipliers, best_bound
from laufruhe.prove.witness import thin_box
from laufruhe.solvers.boxes.box_designs import SHARE, RebalancedDesign, RebalancedSearch, rebalance
from laufruhe.solvers.boxes.search import search_from_grid
from laufruhe.solvers.conclusion import evaluate_design
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.equations import refine_multipliers
from laufruhe.solvers.result import Result

MAX_BOXES, MAX_PROGRAMS = 20_000, 2_000
"""Largest number of boxes without and with cone programs."""
GRID, MAX_STARTS, MAX_STEPS = 24, 600, 300
"""Points of the start grid along a lead and in all, and iterations of a simplex search."""
COARSE, NEAR = 4, 10.0
"""Factor of coarser sampling in cone programs, and the multiple of the tolerance within which programs use all samples.
"""
PROBES, SAME = (0.0, 0.31, 0.67), 1e-6
"""Shares of the range at which a lead is tested for an effect, and the relative change that counts as none."""
EXACT = 0.02
"""Share of the tolerance by which splitting an exact box may still improve its bound."""


def solve_leads(problem: Problem) -> Result:
    """Return the best leads and unbalances, with a lower bound by branch and bound over leads."""
    search = LeadSearch(problem)
    search.check_acts()
    root, first = search.box(search.model.lower, search.model.upper), search.first()
    if search.model.domains:
        return search.solve(root, first, problem.search.boxes_or(MAX_PROGRAMS), "leads", "second-order cones over")
    return search.solve(root, first, problem.search.boxes_or(MAX_BOXES), "leads", "local searches; lower bound on")


@dataclass(frozen=True, eq=False)
class _Box:
    """Box of leads with lower bounds of the objective.

    Attributes
    ----------
    lower, upper
        Bounds of the leads [rad], shape (leads,) each.
    bound
        Lower bound of the objective in the box [SI].
    at_middle
        Lower bound of the objective at the middle of the box [SI].
    side
        Index of the lead to split.
    is_exact
        True if splitting the box cannot improve its bound by more than the tolerance.
    """

    lower: Array
    upper: Array
    bound: float
    at_middle: float
    side: int
    is_exact: bool


class LeadSearch(RebalancedSearch[_Box]):
    """Branch and bound search over the leads of a problem."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.model = PhaseLeadModel(problem)
        self.boxes = LeadBoxes(self.model)
        self.samples = max(problem.fidelity.samples // COARSE, 24) * COARSE

    def parts(self, box: _Box, value: float) -> Iterator[tuple[_Box | FathomedPart, RebalancedDesign | None]]:
        """Yield the halves of a box, each with the best design at its middle if that may be better than `value`."""
        for low, high in halves(Box(box.lower, box.upper, box.side)):
            half = self.box(low, high, box.bound, value)
            level = value * (1.0 - SHARE * self.problem.tolerance)
            may_improve = not isinstance(half, FathomedPart) and half.bound < value and half.at_middle < level
            yield half, self.rebalance_at(0.5 * (low + high)) if may_improve else None

    def box(self, lower: Array, upper: Array, floor: float = 0.0, value: float = math.inf) -> _Box | FathomedPart:
        """Bound the objective in a box; bounds close to `value` use all samples.

        Parameters
        ----------
        lower, upper
            Bounds of the leads [rad], shape (leads,) each.
        floor
            Known lower bound of the objective in the box [SI].
        value
            Objective of the incumbent [SI].

        Returns
        -------
        Box with its bound, or `INFEASIBLE_PART` if it has no feasible design.
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
        return _Box(lower, upper, bound, result.at_middle, side, result.at_middle - bound <= room < math.inf)

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
        # LeadBound with an infinite bound if the multipliers prove that the box has no feasible design, else None
        stripped = replace(program, terms=())
        bound = self.boxes.bound(middle, half, stripped, norms, Multipliers((), limits))
        if not math.isinf(bound.value):
            return None
        self.add_conflict([x.name for x, z in zip(self.problem.load_limits, limits, strict=True) if z.any()])
        return bound

    def around(self, design: RebalancedDesign) -> _Box | FathomedPart:
        """Return a thin box around the leads of a design, with its bound."""
        return self.box(*thin_box(self.place(design), self.model.lower, self.model.upper), 0.0, design.value)

    def check_acts(self) -> None:
        """Raise ModelError if a lead changes neither the objective nor a limit."""
        lower, upper = self.model.lower, self.model.upper
        for k, decision in enumerate(self.model.leads if not self.model.domains else ()):
            is_lead = np.arange(len(lower)) == k
            points = [np.where(is_lead, lower + share * (upper - lower), self.model.start) for share in PROBES]
            numbers = [self._numbers(point) for point in points]
            if np.ptp(numbers, axis=0).max() <= SAME * np.abs(numbers).max():
                reason = "is open, but no objective or limit depends on it; fix it, or add a measure of coupled shafts"
                raise ModelError(f"{decision.name} {reason}")

    def _numbers(self, leads: Array) -> Array:
        program, _ = self.model.at(leads, self.samples)
        norms = [norm.value(np.zeros(0)) for _, norm in (*program.terms, *program.limits)]
        return np.array([*norms, *self.boxes.numbers(leads)])

    def first(self) -> RebalancedDesign:
        """Return the best of the initial design, designs with optimal unbalances, and ends of simplex searches."""
        designs = [RebalancedDesign(evaluate_design(self.problem, self.problem.start))]
        if self.model.domains:
            designs += [
                self.rebalance_at(self.model.start),
                self.rebalance_at(0.5 * (self.model.lower + self.model.upper)),
            ]
        else:
            ends = search_from_grid(self._penalised, self.model.lower, self.model.upper, GRID, MAX_STARTS, MAX_STEPS)
            designs += [RebalancedDesign(evaluate_design(self.problem, end.tolist())) for end in ends]
        return min(designs, key=lambda design: design.rank)

    def rebalance_at(self, leads: Array) -> RebalancedDesign:
        """Return the best design with these leads [rad], shape (leads,)."""
        fixed_values: dict[str, Value] = {d.name: float(x) for d, x in zip(self.model.leads, leads, strict=True)}
        return rebalance(self.problem, self._with_fixed_leads(leads), fixed_values)

    def _with_fixed_leads(self, leads: Array) -> Problem:
        """Return the problem of the unbalances, with gains turned by the leads of their shafts."""
        turns = dict(zip(self.model.names, leads - self.model.start, strict=True))
        shafts = {rotor.name: rotor.shaft for rotor in self.problem.engine.rotors}

        def turn_drives(decision: Decision) -> Decision:
            drives = []
            for drive in decision.rotor_drives:
                shaft = shafts[drive.rotor]
                drives.append(replace(drive, gain=drive.gain * np.exp(1j * shaft.ratio * turns.get(shaft.name, 0.0))))
            return replace(decision, drives=tuple(drives))

        engine = self.problem.design([float(x) for x in leads], self.model.leads)
        return replace(self.problem, engine=engine, decisions=tuple(turn_drives(d) for d in self.problem.unbalances))

    def _penalised(self, leads: Array) -> float:
        leads_in_bounds = np.clip(leads, self.model.lower, self.model.upper)
        program, _ = self.model.at(leads_in_bounds, self.samples)
        (irregularity, violations), x = self.boxes.degrees(leads_in_bounds, np.zeros_like(leads_in_bounds)), np.zeros(0)
        total = program.objective(x) + irregularity
        excess = sum(max(norm.value(x) / (maximum or 1.0) - 1.0, 0.0) for maximum, norm in program.limits)
        excess += sum(violations.values())
        return float(total * (1.0 + 1e3 * excess) + excess)
