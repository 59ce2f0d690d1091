"""The relaxation of one box of mounts by the forces of their springs (E42-E45, E52-E54, E57, E58, E62)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from laufruhe.extensions.mount_relaxation.cone_program import ConeProgram
from laufruhe.extensions.mount_relaxation.constraints import (
    MomentConstraint,
    moment_constraints,
    stiffness_constraints,
)
from laufruhe.extensions.mount_relaxation.modes import mode_constraints
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
    Solution,
    mode_scores,
    proven_bound,
)
from laufruhe.extensions.mount_relaxation.response import Response, ResponseBound, squared
from laufruhe.extensions.mount_relaxation.speculation import Objectives
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.budget import rounds

if TYPE_CHECKING:
    from laufruhe.extensions.mount_relaxation.search import SdpRelaxation

# rounds in which the roots of a mean narrow each other, and share of the mean from which a root is narrowed
ROUNDS, SMALL = 2, 0.03
# share of a mean that loose bounds of odd multiples have to hide to be narrowed
LARGE = 0.03
# share of the missing bound that loose bounds of odd multiples have to hide to be worth a branch
WORTH = 0.25


class BoxRelaxation:
    """Relaxation of a box, for designs whose norm is not over a number: its bounds hold for these alone.

    Attributes
    ----------
    roots
        Lower bounds of the roots of the epigraph variables, as known last.

    Parameters
    ----------
    search
        The relaxation of the whole problem.
    query
        The norm.
    upper_norm, cutoff
        The number that the norm is not over, and the bound at which no better one is sought.
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
        self._near = search.near_numbers(self.mounts, lower, upper)
        self._stated: dict[int, tuple[Response, list[MomentConstraint]]] = {}
        self._multiple_bounds: dict[tuple[int, ...], list[list[LinearUpperBound]]] = {}
        self.modes = tuple(
            mode_constraints(self.mounts, basis, lower[own], upper[own])
            for basis, own in zip(search.modes, search.mode_sides, strict=True)
        )

    def bound(self, variables: Sequence[EpigraphVariable], known: Array) -> tuple[float, Array, Array | None]:
        """Return a lower bound of the norm on the box, branching scores by side, and open numbers at the optimum.

        Several variables are bounded one by one. The roots of all are then at least chords between their lower and
        upper bounds, and the chords are bounded together (E54). Lower bounds of the roots of the whole search are
        written to `known`.
        """
        scores = np.zeros(len(self.lower))
        self.roots = known
        if not variables:
            return 0.0, scores, None
        if _is_single(variables):
            squared_root, scores, middle = self._solve(variables, np.ones(1))
            root = variables[0].unit * math.sqrt(max(squared_root, 0.0)) - variables[0].loss
            return max(root, 0.0), scores, middle
        self.roots = known.copy()
        units = np.array([variable.unit for variable in variables])
        for k in np.flatnonzero(_matters(units * [variable.share for variable in variables])).tolist():
            squared_root = self._solve([variables[k]], np.ones(1))[0]
            self.roots[k] = max(self.roots[k], units[k] * math.sqrt(max(squared_root, 0.0)))
        result = self._bound_mean(variables, self.roots)
        is_all = np.array_equal(self.lower, self.search.lower) and np.array_equal(self.upper, self.search.upper)
        if result[0] < self.cutoff and is_all:
            if self.hides_mean(variables):
                self.roots = self._narrow_roots(variables, self.roots)
                result = max(result, self._bound_mean(variables, self.roots), key=lambda each: each[0])
            known[:] = self.roots
        return result

    def _bound_mean(self, variables: Sequence[EpigraphVariable], roots: Array) -> tuple[float, Array, Array | None]:
        mean = self._mean(variables, roots)
        if mean.floor >= self.cutoff:
            return mean.floor, np.zeros(len(self.lower)), None
        bound, scores, middle = self._solve(variables, mean.prices, mean)
        bound = max(bound + mean.constant, mean.floor)
        # halving may also tighten bounds of odd multiples (E62)
        loose = np.zeros(len(scores))
        for variable in variables:
            for order, multiple in variable.multiples:
                high = self._high_order(order)
                if high is not None:
                    weight = variable.share * variable.factor / multiple / len(self.query.mounts)
                    for j, violation in enumerate(high.looseness(self._solution_s) * weight):
                        self._score(loose, [j], float(violation))
        return bound, joint_scores(scores, loose, self.upper_norm - bound), middle

    def _narrow_roots(self, variables: Sequence[EpigraphVariable], known: Array) -> Array:
        """Return lower bounds of every root with the others in the rest of the norm (E58).

        Odd multiples of designs that are no worse than the best known are narrowed too. All of a round follow from the
        same constraints, so that they may be solved side by side.
        """
        lower, units = known.copy(), np.array([variable.unit for variable in variables])
        none = np.zeros(5 * len(self.modes))
        for _ in rounds(ROUNDS):
            mean = self._mean(variables, lower)
            if mean.floor >= self.upper_norm:
                break
            chosen = np.flatnonzero(_matters(mean.prices)).tolist()
            multiples = [
                (id(order), bound)
                for k in chosen
                for (order, _), bound in zip(variables[k].multiples, self._bounds_of(variables[k]), strict=True)
                if np.any(bound.slopes)
            ]
            objectives = Objectives(self.cut_off(variables, lower), self.search.ahead)
            bounds = objectives.all_bounds([*chosen, *(np.append(-bound.slopes, none) for _, bound in multiples)])
            lower[chosen] = np.maximum(lower[chosen], units[chosen] * bounds[: len(chosen)])
            for (order, multiple), bound in zip(multiples, bounds[len(chosen) :], strict=True):
                uppers = self.search.multiple_uppers
                uppers[order] = min(uppers.get(order, math.inf), multiple.constant - bound)
            self._multiple_bounds.clear()
        return lower

    def _mean(self, variables: Sequence[EpigraphVariable], roots: Array) -> MeanBound:
        key = tuple(map(id, variables))
        if key not in self._multiple_bounds:
            self._multiple_bounds[key] = [self._bounds_of(variable) for variable in variables]
        return mean_bound(variables, self._multiple_bounds[key], roots, self.upper_norm, self.mounts.numbers)

    def hides_mean(self, variables: Sequence[EpigraphVariable]) -> bool:
        """Return whether odd multiples may hide so much of the mean that narrowing them is worth it."""
        size = sum(variable.share * variable.unit for variable in variables)
        mean = self._mean(variables, np.array([variable.unit for variable in variables]))
        return float(mean.prices.sum()) + mean.constant < (1.0 - LARGE) * size

    def _high_order(self, order: Order) -> HighOrder | None:
        high = HighOrder(self.parts[order.part], order.loads[0], order.omega, self._near)
        return None if self.query.is_travel or np.any(order.loads[1:]) or not high.is_above else high

    def _bounds_of(self, variable: EpigraphVariable) -> list[LinearUpperBound]:
        """Return the bounds of odd multiples in the mean over mounts (E62)."""
        bounds = []
        for order, _ in variable.multiples:
            known, high = self.search.multiple_uppers.get(id(order), math.inf), self._high_order(order)
            upper = min(self.query.largest_sum(order, self.parts), len(self.query.mounts) * known)
            bound = None if high is None else high.bound
            if bound is None:
                bound = constant_bound(upper, self._near)
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
    ) -> tuple[float, Array, Array | None]:
        """Return the least sum of variables at these prices, or of their roots; scores, and numbers at the optimum."""
        # a solver works best where its objective is of size one
        size = float(prices.sum())
        program, responses = self._program(variables, prices / size, mean)
        if mean is not None:
            program = replace(program, objective=np.append(mean.slopes / size, np.zeros(5 * len(self.modes))))
        solution = ConeProgram(program).solve(program)
        self._solution_s = solution.s
        middle = None
        if self.search.stiffness_alone:
            middle = 0.5 * (self.lower + self.upper)[: self.search.mount_numbers]
            for j, decisions in enumerate(self.mounts.decisions):
                middle[decisions[0]] += 0.5 * (self.upper - self.lower)[decisions[0]] * solution.s[j]
        orders = [order for variable in variables for order in variable.orders]
        scores = self._branching_scores(orders, responses, solution)
        return size * proven_bound(program, solution.multipliers), scores, middle

    def cut_off(self, variables: Sequence[EpigraphVariable], known: Array) -> SdpProgram:
        """Return the constraints of designs whose norm is not over its upper bound."""
        if _is_single(variables):
            uppers = [(v.root_bound(self.upper_norm / v.share) / v.unit) ** 2 for v in variables]
            program, _ = self._program(variables, np.zeros(len(variables)))
            return replace(program, uppers=np.append(uppers, program.uppers[len(uppers) :]))
        mean = self._mean(variables, known)
        size = float(mean.prices.sum())
        program, _ = self._program(variables, mean.prices / size, mean)
        return replace(program, limit=mean.limit(size, self.upper_norm))

    def _program(
        self, variables: Sequence[EpigraphVariable], prices: Array, mean: MeanBound | None = None
    ) -> tuple[SdpProgram, list[Response]]:
        """Return the program of these variables at these prices, and the responses to its orders."""
        quadratics: list[QuadraticBound] = []
        responses: list[Response] = []
        constraints: list[MomentConstraint] = []
        roots: list[RootTerm] = []
        for number, variable in enumerate(variables):
            first = len(responses)
            for k, order in enumerate(variable.orders, first):
                response, own = self._state(order, self.query.bound(order, variable, self.upper_norm))
                responses.append(response)
                constraints += [replace(constraint, order=k) for constraint in own]
            at = range(first, len(responses))
            quadratics += variable.quadratic_bounds(number, self.query, responses[first:], at)
            if mean is not None:
                lengths = variable.lengths(self.query, responses[first:], at)
                lower, upper = float(mean.lower[number]), float(mean.upper[number])
                roots.append(RootTerm(prices[number], lower, upper, lengths))
        # stiffness in motions of a symmetry that no order is followed in (E57)
        parts = {order.part for variable in variables for order in variable.orders}
        for k, mounts in enumerate(self.parts):
            if k and k not in parts and 0 not in parts:
                constraints += stiffness_constraints(mounts, responses[0].size)
        terms = self.search.limits.terms(variables, self._state, responses)
        responses += terms.responses
        program = SdpProgram(
            tuple(response.size for response in responses), tuple(response.reaches for response in responses),
            self.mounts.numbers, responses[0].columns,
            np.append(0.0 * prices if roots else prices, np.zeros(len(terms.uppers))),
            [*quadratics, *terms.quadratics], [*constraints, *terms.constraints], terms.linear,
            self.search.basis.sets, roots, self.modes,
            np.append(np.full(len(variables), math.inf), terms.uppers),
        )  # fmt: skip
        return program, responses

    def _branching_scores(self, orders: Sequence[Order], responses: Sequence[Response], solution: Solution) -> Array:
        """Return by side the violation of products by s of the optimum, as a share of the forces that count."""
        scores, s = np.zeros(len(self.lower)), solution.s
        for order, response, moments in zip(orders, responses, solution.moments, strict=False):
            size = float(np.sum(squared(self.query.signal(response) / response.unit) * moments)) or 1.0
            mounts = self.parts[order.part]
            for spring, (deflection, added) in zip(mounts.springs, response.springs, strict=True):
                product = np.tensordot(s, spring.slopes(len(s)), 1) @ deflection
                violation = spring.force_scaled(added - product, order.omega)
                share = max(float(np.sum(squared(violation) * moments)), 0.0) / size
                self._score(scores, [j for j, _ in spring.terms], share)
            for place, (loads, moved) in zip(mounts.places, response.places, strict=True):
                violation = place.force_scaled(moved - s[place.number] * loads, order.omega)
                self._score(scores, [place.number], max(float(np.sum(squared(violation) * moments)), 0.0) / size)
        for mode, priced, own, moments in zip(
            self.modes, solution.multipliers.modes, self.search.mode_sides, solution.modes, strict=True
        ):
            of_numbers, of_mode = mode_scores(mode, priced, s, moments)
            scores[own] += of_mode
            for j, share in enumerate(of_numbers):
                self._score(scores, [j], float(share))
        return scores

    def _score(self, scores: Array, numbers: Sequence[int], share: float) -> None:
        sides = sorted({j for number in numbers for j in self.mounts.decisions[number]})
        lengths = (self.upper - self.lower) / np.maximum(self.search.upper - self.search.lower, 1e-300)
        scores[max(sides, key=lambda j: lengths[j])] += share


def _is_single(variables: Sequence[EpigraphVariable]) -> bool:
    return len(variables) == 1 and not variables[0].multiples


def joint_scores(scores: Array, loose: Array, missing: float) -> Array:
    """Return the larger of two shares by side: of the largest score, and of the missing bound."""
    minimum = max(WORTH * missing, 1e-100 * float(loose.max()), 1e-300)
    return np.maximum(scores / max(float(scores.max()), 1e-300), loose / minimum)


def _matters(shares: Array) -> Mask:
    return np.asarray(shares > SMALL * shares.sum())
