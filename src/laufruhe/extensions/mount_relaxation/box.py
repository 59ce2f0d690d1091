"""Relaxation of one box of mounts by spring forces (E42-E45, E52-E54, E57, E58, E62)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from laufruhe.extensions.mount_relaxation.cone_program import ConeProgram, Solution
from laufruhe.extensions.mount_relaxation.constraints import MomentConstraint, mode_constraints, moment_constraints
from laufruhe.extensions.mount_relaxation.odd_multiples import (
    HighOrder,
    LinearUpperBound,
    MeanBound,
    constant_bound,
    mean_bound,
)
from laufruhe.extensions.mount_relaxation.orders import EpigraphVariable, MeasureOrders, Order
from laufruhe.extensions.mount_relaxation.program import (
    QuadraticBound,
    RootTerm,
    SdpProgram,
)
from laufruhe.extensions.mount_relaxation.response import Response, ResponseBound, squared
from laufruhe.numerics.arrays import Array

if TYPE_CHECKING:
    from laufruhe.extensions.mount_relaxation.search import SdpRelaxation

# smallest share of the mean of a root to bound by itself
SMALL = 0.03
# smallest share of a mean that counts as lost to loose bounds of odd multiples
LARGE = 0.03
# share of the missing bound, lost to loose bounds of odd multiples, that makes a branch worthwhile
WORTH = 0.25


class BoxRelaxation:
    """Relaxation of a norm of mount force or travel on a box, for designs with a norm up to `upper_norm` alone.

    Attributes
    ----------
    roots
        Lower bounds of the roots of the epigraph variables, shape (variables,).

    Parameters
    ----------
    search
        Relaxation of the whole problem, with its limits and root box.
    query
        Measure of force or travel, with its orders.
    ends
        Norm up to which bounds hold (`upper_norm`), and the bound from which the box is fathomed (`cutoff`).
    lower, upper
        Ends of the sides of the box, shape (n,) each.
    """

    roots: Array

    def __init__(
        self, search: SdpRelaxation, query: MeasureOrders, ends: tuple[float, float], lower: Array, upper: Array
    ) -> None:
        self.search, self.query, self.lower, self.upper = search, query, lower, upper
        self.upper_norm, self.cutoff = ends
        self.parts = search.parts(lower, upper)
        self.mounts = self.parts[0]
        self._solution_s = np.zeros(self.mounts.numbers)
        self._reference = search.reference_numbers(self.mounts, lower, upper)
        self._stated: dict[int, tuple[Response, list[MomentConstraint]]] = {}
        self._multiple_bounds: dict[tuple[int, ...], list[list[LinearUpperBound]]] = {}
        self.modes = tuple(
            mode_constraints(self.mounts, basis, lower[sides], upper[sides])
            for basis, sides in zip(search.modes, search.mode_sides, strict=True)
        )

    def bound(self, variables: Sequence[EpigraphVariable], root_bounds: Array) -> tuple[float, Array]:
        """Return a lower bound of the objective's norm over all designs of the box, and branching scores, shape (n,).

        Several epigraph variables are bounded one by one. The chords of their roots between lower and upper bounds are
        then bounded together (E54). `root_bounds`, shape (variables,), are lower bounds of the roots on the root box;
        if the box is the root box, its new bounds are written there.
        """
        scores = np.zeros(len(self.lower))
        self.roots = root_bounds
        if not variables:
            return 0.0, scores
        if _is_single(variables):
            squared_root, scores = self._solve(variables, np.ones(1))
            root = variables[0].unit * math.sqrt(max(squared_root, 0.0)) - variables[0].loss
            return max(root, 0.0), scores
        self.roots = root_bounds.copy()
        units = np.array([variable.unit for variable in variables])
        sizes = units * [variable.share for variable in variables]
        for k in np.flatnonzero(sizes > SMALL * sizes.sum()).tolist():
            squared_root = self._solve([variables[k]], np.ones(1))[0]
            self.roots[k] = max(self.roots[k], units[k] * math.sqrt(max(squared_root, 0.0)))
        result = self._bound_mean(variables, self.roots)
        is_root = np.array_equal(self.lower, self.search.lower) and np.array_equal(self.upper, self.search.upper)
        if result[0] < self.cutoff and is_root:
            root_bounds[:] = self.roots
        return result

    def _bound_mean(self, variables: Sequence[EpigraphVariable], roots: Array) -> tuple[float, Array]:
        """Return a lower bound of a mean by the sum of its roots (E58), and branching scores, shape (n,)."""
        mean = self._mean(variables, roots)
        if mean.floor >= self.cutoff:
            return mean.floor, np.zeros(len(self.lower))
        bound, scores = self._solve(variables, mean.prices, mean)
        bound = max(bound + mean.constant, mean.floor)
        # a branch may also tighten bounds of odd multiples (E62)
        multiple_scores = np.zeros(len(scores))
        for variable in variables:
            for order, multiple in variable.multiples:
                high_order = self._high_order(order)
                if high_order is not None:
                    weight = variable.share * variable.factor / multiple / len(self.query.mounts)
                    for j, looseness in enumerate(high_order.looseness(self._solution_s) * weight):
                        self._score(multiple_scores, [j], float(looseness))
        return bound, joint_scores(scores, multiple_scores, self.upper_norm - bound)

    def _mean(self, variables: Sequence[EpigraphVariable], roots: Array) -> MeanBound:
        key = tuple(map(id, variables))
        if key not in self._multiple_bounds:
            self._multiple_bounds[key] = [self._bounds_of(variable) for variable in variables]
        return mean_bound(variables, self._multiple_bounds[key], roots, self.upper_norm, self.mounts.numbers)

    def hides_mean(self, variables: Sequence[EpigraphVariable]) -> bool:
        """Return True if loose bounds of odd multiples of orders hide more of the mean than the share LARGE."""
        size = sum(variable.share * variable.unit for variable in variables)
        mean = self._mean(variables, np.array([variable.unit for variable in variables]))
        return float(mean.prices.sum()) + mean.constant < (1.0 - LARGE) * size

    def _high_order(self, order: Order) -> HighOrder | None:
        result = HighOrder(self.parts[order.part], order.loads[0], order.omega, self._reference)
        return None if self.query.is_travel or np.any(order.loads[1:]) or not result.is_above else result

    def _bounds_of(self, variable: EpigraphVariable) -> list[LinearUpperBound]:
        """Return upper bounds of the odd multiples of a variable, averaged over mounts (E62)."""
        bounds = []
        for order, _ in variable.multiples:
            high_order, upper = self._high_order(order), self.query.largest_sum(order, self.parts)
            bound = None if high_order is None else high_order.bound
            if bound is None:
                bound = constant_bound(upper, self._reference)
            else:
                bound = bound.times(float(self.query.factors.max()))
                bound = replace(bound, upper=min(upper, bound.largest))
            bounds.append(bound.times(1.0 / len(self.query.mounts)))
        return bounds

    def _state(self, order: Order, bound: ResponseBound) -> tuple[Response, list[MomentConstraint]]:
        if id(order) not in self._stated:
            mounts = self.parts[order.part]
            response = self.search.response(mounts, order, bound, self.lower, self.upper)
            self._stated[id(order)] = response, moment_constraints(mounts, response)
        return self._stated[id(order)]

    def _solve(
        self, variables: Sequence[EpigraphVariable], prices: Array, mean: MeanBound | None = None
    ) -> tuple[float, Array]:
        """Return the proven minimum of the sum of prices times variables or times roots, and branching scores."""
        # the solver works best if prices add up to one
        scale = float(prices.sum())
        program, responses = self._program(variables, prices / scale, mean)
        cones = ConeProgram(program)
        solution = cones.solve(cones.cost())
        self._solution_s = solution.s
        orders = [order for variable in variables for order in variable.orders]
        return scale * solution.bound, self._branching_scores(orders, responses, solution, cones.mode_scores(solution))

    def cut_off(self, variables: Sequence[EpigraphVariable], root_bounds: Array) -> SdpProgram:
        """Return the semidefinite program of designs in the box with a norm up to `upper_norm`."""
        if _is_single(variables):
            return self._program(variables, np.zeros(1))[0]
        mean = self._mean(variables, root_bounds)
        scale = float(mean.prices.sum())
        program, _ = self._program(variables, mean.prices / scale, mean)
        return replace(program, limit=(self.upper_norm - mean.constant) / scale)

    def _program(
        self, variables: Sequence[EpigraphVariable], prices: Array, mean: MeanBound | None = None
    ) -> tuple[SdpProgram, list[Response]]:
        """Return the semidefinite program of variables at prices, and the responses of all its orders."""
        quadratics: list[QuadraticBound] = []
        responses: list[Response] = []
        constraints: list[MomentConstraint] = []
        roots: list[RootTerm] = []
        for number, variable in enumerate(variables):
            stated = [self._state(o, self.query.bound(o, variable, self.upper_norm)) for o in variable.orders]
            numbers = range(len(responses), len(responses) + len(stated))
            for k, (_, order_constraints) in zip(numbers, stated, strict=True):
                constraints.extend(replace(constraint, order=k) for constraint in order_constraints)
            variable_responses = [response for response, _ in stated]
            responses += variable_responses
            quadratics += variable.quadratic_bounds(number, self.query, variable_responses, numbers)
            if mean is not None:
                lengths = variable.lengths(self.query, variable_responses, numbers)
                lower, upper = float(mean.lower[number]), float(mean.upper[number])
                roots.append(RootTerm(prices[number], lower, upper, lengths))
        if mean is None:
            uppers = np.array([(v.root_bound(self.upper_norm / v.share) / v.unit) ** 2 for v in variables])
        else:
            uppers = mean.upper**2
        program = SdpProgram(
            tuple(response.size for response in responses), tuple(response.reach for response in responses),
            self.mounts.numbers, responses[0].columns, 0.0 * prices if roots else prices, uppers,
            quadratics, constraints, self.search.basis.sets, roots, self.modes,
            np.zeros(self.mounts.numbers) if mean is None else mean.slopes / mean.prices.sum(),
        )  # fmt: skip
        return program, responses

    def _branching_scores(
        self, orders: Sequence[Order], responses: Sequence[Response], solution: Solution,
        mode_scores: Sequence[tuple[Array, Array]],
    ) -> Array:  # fmt: skip
        """Return a branching score of each side of the box, shape (n,).

        It adds up squared violations of the products with s at the optimum, over the squared signal in the norm. Sides
        of modes have priced violations.
        """
        scores, s = np.zeros(len(self.lower)), solution.s
        for order, response, moments in zip(orders, responses, solution.moments, strict=False):
            size = float(np.sum(squared(self.query.signal(response) / response.unit) * moments)) or 1.0
            mounts = self.parts[order.part]
            for spring, (deflection, force) in zip(mounts.springs, response.springs, strict=True):
                product = np.tensordot(s, spring.slopes(len(s)), 1) @ deflection
                violation = spring.force_scaled(force - product, order.omega)
                share = max(float(np.sum(squared(violation) * moments)), 0.0) / size
                self._score(scores, [j for j, _ in spring.terms], share)
            for place, (loads, shifted) in zip(mounts.places, response.places, strict=True):
                violation = place.force_scaled(shifted - s[place.number] * loads, order.omega)
                self._score(scores, [place.number], max(float(np.sum(squared(violation) * moments)), 0.0) / size)
        for (number_scores, side_scores), sides in zip(mode_scores, self.search.mode_sides, strict=True):
            scores[sides] += side_scores
            for j, share in enumerate(number_scores):
                self._score(scores, [j], float(share))
        return scores

    def _score(self, scores: Array, numbers: Sequence[int], share: float) -> None:
        sides = sorted({j for number in numbers for j in self.mounts.decisions[number]})
        lengths = (self.upper - self.lower) / np.maximum(self.search.upper - self.search.lower, 1e-300)
        scores[max(sides, key=lambda j: lengths[j])] += share


def _is_single(variables: Sequence[EpigraphVariable]) -> bool:
    return len(variables) == 1 and not variables[0].multiples


def joint_scores(scores: Array, multiple_scores: Array, missing_bound: float) -> Array:
    """Return the larger of two branching scores of each side of a box, shape (n,).

    Scores of the relaxation are over their largest, scores of odd multiples over a share of the missing bound.
    """
    unit = max(WORTH * missing_bound, 1e-100 * float(multiple_scores.max()), 1e-300)
    return np.maximum(scores / max(float(scores.max()), 1e-300), multiple_scores / unit)
