"""Semidefinite relaxation of a problem with open mounts and unbalances, to bound boxes (E42-E45, E52-E54)."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from laufruhe.extensions.mount_relaxation.box import BoxRelaxation
from laufruhe.extensions.mount_relaxation.constraints import mode_bases
from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts, open_mounts
from laufruhe.extensions.mount_relaxation.orders import (
    EpigraphVariable,
    Order,
    epigraph_variables,
    measure_orders,
)
from laufruhe.extensions.mount_relaxation.program import SdpProgram
from laufruhe.extensions.mount_relaxation.response import Response, ResponseBound, response_of
from laufruhe.extensions.mount_relaxation.symmetry_split import split_mounts
from laufruhe.extensions.mount_relaxation.unbalance_basis import unbalance_basis
from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.arrays import Array
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import real_bounds
from laufruhe.problem.dependence import depends
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import GAP_SAFETY
from laufruhe.prove.mounts.ranges import number_ranges
from laufruhe.prove.mounts.subdivision import StiffnessBoxes, is_stiffness_problem

# total work of the relaxations, each its number of moments to the power EFFORT, and the most relaxations
WORK, EFFORT, MAX_BOXES = 6e7, 5, 100
# largest share of the missing bound that omitted orders may carry
OMITTED = 0.3
# share of the unbalance ranges that enters the units of products, besides the best design
WIDE = 0.3
# share of a side within which a number counts as at its end
AT_END = 0.1


class SdpRelaxation:
    """Relaxation that bounds boxes, for designs with an objective up to `value` alone.

    Attributes
    ----------
    value
        Objective up to which bounds hold [SI].
    cutoff
        Bound from which a box is fathomed [SI].
    mount_numbers
        Count of open numbers of mounts.
    lower, upper
        Root box, shape (n,): open numbers of mounts, stiffness entries of planes (E63), and coordinates of modes.
    reference
        The best design as a point of the root box, without the coordinates of modes.
    modes, mode_sides
        Basis of each mode, shape (6, 6), and the slice of its coordinates in a box.
    """

    def __init__(self, problem: Problem, value: float, gap_tolerance: float, reference: Sequence[Value]) -> None:
        self.problem, self.value, self.cutoff = problem, value, value - GAP_SAFETY * gap_tolerance
        self.mount_numbers = len(problem.mount_decisions)
        lower, upper = real_bounds(problem.mount_decisions)
        self._reference = np.array(
            [v for v, d in zip(reference, problem.decisions, strict=True) if not d.is_affine], dtype=float
        )
        self._frames = number_ranges(problem, self._reference, self._reference)[0]
        self._planes = open_mounts(problem, lower, upper, self._frames).planes
        self.reference = np.concatenate(
            [self._reference, *(np.append(plane.reference, 0.0) for _, plane in self._planes.values())]
        )
        plane_ranges = np.concatenate([np.zeros((0, 2)), *(plane.full_box for _, plane in self._planes.values())])
        lower, upper = np.append(lower, plane_ranges[:, 0]), np.append(upper, plane_ranges[:, 1])
        self._parts = self.parts(lower, upper)
        self.modes = mode_bases(problem, self._parts[0])
        ones = np.ones(5 * len(self.modes))
        self.lower, self.upper = np.append(lower, -ones), np.append(upper, ones)
        self.mode_sides = [slice(len(lower) + 5 * k, len(lower) + 5 * (k + 1)) for k in range(len(self.modes))]
        self._stiffness_boxes = StiffnessBoxes(problem, 0.05 * gap_tolerance) if is_stiffness_problem(problem) else None
        self._model = AffineModel(off_resonance(problem))
        unbalances = [v for v, d in zip(reference, problem.decisions, strict=True) if d.is_affine]
        basis = unbalance_basis(self._model.domains, unbalances)
        evaluation = evaluate(problem, problem.design(list(reference)))
        mount_terms = [term for term in problem.load_terms if term.measure.on_mounts]
        # terms that no open number changes are constants
        kinds = {d.kind for d in problem.decisions}
        fixed_terms = [term for term in problem.load_terms if not depends(term.measure.channel, kinds, problem)]
        self._constant = sum(term.weight * evaluation.value(term.measure) for term in fixed_terms)

        queries = [
            (term.weight, measure_orders(problem, term.measure, self._model, evaluation, basis, self._parts))
            for term in mount_terms
        ]
        loads = [order.loads[1:] for _, query in queries for order in query.orders]
        self.basis, reduction = basis.reduced(loads)
        self._terms = [(weight, query.in_basis(reduction)) for weight, query in queries]
        self._variables = [epigraph_variables(query, self._parts) for _, query in self._terms]
        self._reset()

    def _reset(self) -> None:
        self._roots = [np.zeros(len(variables)) for variables in self._variables]
        self._last_box = self.lower, self.upper, self._roots[0]

    def parts(self, lower: Array, upper: Array) -> tuple[OpenMounts, ...]:
        """Return the model of the mounts over a box, for all motions of the block (E57).

        If the mounts are symmetric, models for symmetric and for antisymmetric motions follow.
        """
        count = self.mount_numbers
        boxes = {
            key: np.column_stack([lower, upper])[count + 3 * k : count + 3 * (k + 1)]
            for key, (k, _) in self._planes.items()
        }
        mounts = open_mounts(self.problem, lower[:count], upper[:count], self._frames, boxes)
        return (mounts, *split_mounts(mounts))

    def reference_numbers(self, mounts: OpenMounts, lower: Array, upper: Array) -> Array:
        """Return the numbers s, shape (numbers,), of that design in a box which is nearest to the best design.

        Numbers that are entries of matrices are zero.
        """
        s = np.zeros(mounts.numbers)
        for j, side in enumerate(mounts.single_decisions):
            if side is not None and upper[side] > lower[side]:
                s[j] = (2.0 * self.reference[side] - lower[side] - upper[side]) / (upper[side] - lower[side])
        return np.clip(s, -1.0, 1.0)

    def is_at_end(self, lower: Array, upper: Array, side: int, sign: float) -> bool:
        """Return True if the best design lies near the lower (sign 1) or upper (sign -1) end of a side."""
        if side >= len(self.reference):
            return False
        distance = self.reference[side] - lower[side] if sign > 0.0 else upper[side] - self.reference[side]
        return bool(abs(distance) < AT_END * (upper[side] - lower[side]))

    @property
    def has_loose_mean(self) -> bool:
        """True if odd multiples of orders loosen the bound of the first term, a mean (E58)."""
        if not any(variable.multiples for variable in self._variables[0]):
            return False
        return self._box(0, self.lower, self.upper).hides_mean(self._variables[0])

    @property
    def is_sampled_fully(self) -> bool:
        """True if bounds by orders are also bounds of the sampled norms."""
        plain = self._stiffness_boxes is None or self._stiffness_boxes.is_sampled_fully
        return plain and all(query.is_sampled_fully for _, query in self._terms)

    @property
    def max_boxes(self) -> int:
        """Budget of boxes: as many as take some tens of seconds."""
        parts = [order.part for variables in self._variables for variable in variables for order in variable.orders]
        cost = sum((1 + self.basis.count + 2 * self._parts[k].products) ** EFFORT for k in parts)
        return self.problem.search.boxes_or(int(min(WORK / max(cost, 1), MAX_BOXES)))

    def bound(self, lower: Array, upper: Array) -> tuple[float, Array]:
        """Return a lower bound of the objective on a box [SI], and branching scores of its sides, shape (n,)."""
        total, scores, stiffness_bound = self._constant, np.zeros(len(lower)), 0.0
        if self._stiffness_boxes is not None:
            count = self.mount_numbers
            stiffness_bound = float(self._stiffness_boxes.bounds(lower[None, :count], upper[None, :count])[0][0])
            if stiffness_bound >= self.cutoff:
                return stiffness_bound, scores
        for k, (weight, _) in enumerate(self._terms):
            box = self._box(k, lower, upper)
            bound, term_scores = box.bound(self._variables[k], self._roots[k])
            if k == 0:
                self._last_box = lower, upper, box.roots
            total += weight * bound
            scores += term_scores
        return max(stiffness_bound, total), scores * (upper > lower)

    def _box(self, term: int, lower: Array, upper: Array) -> BoxRelaxation:
        weight, query = self._terms[term]
        limits = (self.value - self._constant) / weight, (self.cutoff - self._constant) / weight
        return BoxRelaxation(self, query, limits, lower, upper)

    def cut_off(self, lower: Array, upper: Array) -> tuple[SdpProgram, OpenMounts]:
        """Return the semidefinite program of better designs in a box, and the model of its mounts.

        The first term of the objective is at most what the objective `value` leaves it.
        """
        box = self._box(0, lower, upper)
        # root bounds of the last box hold in each part of that box
        low, high, roots = self._last_box
        is_inside = bool(np.all(lower >= low) and np.all(upper <= high))
        return box.cut_off(self._variables[0], roots if is_inside else self._roots[0]), box.mounts

    def under(self, value: float) -> SdpRelaxation:
        """Return a cheaper relaxation for designs below `value`, without orders that add little to the proof."""

        def needed(variable: EpigraphVariable) -> tuple[Order, ...]:
            size = np.array([float(np.sum(np.abs(order.signal) ** 2)) for order in variable.orders])
            omitted = 1.0 - np.cumsum(size) / max(float(size.sum()), 1e-300)
            is_enough = omitted <= OMITTED * (1.0 - value / self.value)
            return variable.orders[: int(np.argmax(is_enough)) + 1] if is_enough.any() else variable.orders

        relaxation = copy(self)
        relaxation.value = relaxation.cutoff = value
        relaxation._variables = [
            [replace(variable, orders=needed(variable)) for variable in variables] for variables in self._variables
        ]
        relaxation._roots = [bounds.copy() for bounds in self._roots]
        relaxation._last_box = self.lower, self.upper, relaxation._roots[0]
        return relaxation

    def up_to(self, value: float) -> SdpRelaxation:
        """Return the relaxation for designs with an objective up to `value`, with the same orders and cutoff."""
        relaxation = copy(self)
        relaxation.value = value
        relaxation._reset()
        return relaxation

    def response(self, mounts: OpenMounts, order: Order, bound: ResponseBound, lower: Array, upper: Array) -> Response:
        """Return the response to an order over a box; the design of the box nearest to the best sets its units."""
        count = len(self._reference)
        design = [float(v) for v in np.clip(self._reference, lower[:count], upper[:count])]
        mounting = mounting_in(self.problem.design(design, self.problem.mount_decisions))
        parts = (mounting.springs, mounting.losses, mounting.dampers * order.omega)
        k, h, c = (mounts.root @ mounting.total(part) @ mounts.root.T for part in parts)
        load = order.loads[0] + self.basis.reference @ order.loads[1:]
        loads = np.column_stack([load, WIDE * order.loads[1:].T])
        reference_motions = np.linalg.solve(k + 1j * (h + c) - order.omega**2 * np.eye(mounts.size), loads)
        return response_of(mounts, order.loads, order.omega, reference_motions, bound)
