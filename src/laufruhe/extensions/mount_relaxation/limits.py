"""Limits of norms of force and travel, and of transmissibility, in the relaxation (E61).

A norm is at least its epigraph variables (E45, E54), so that its limit bounds them above. Transmissibility of an order
is an inequality between the squares of its forces and of the forces at rest under the same load.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from laufruhe.extensions.mount_relaxation.constraints import MomentConstraint
from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.orders import (
    MAX_ORDERS,
    EpigraphVariable,
    MeasureOrders,
    Order,
    epigraph_variables,
)
from laufruhe.extensions.mount_relaxation.program import LinearLimit, QuadraticBound
from laufruhe.extensions.mount_relaxation.response import Response, ResponseBound, squared
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.norms import RMS
from laufruhe.numerics.spectrum import orders_equal
from laufruhe.problem import channels
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.ranges import SLACK

# a limit enters only if the best design has more than this share of it
NEAR_LIMIT = 0.7
UNBOUNDED = ResponseBound((), math.inf, False)

Stated = tuple[Response, list[MomentConstraint]]
"""Response to an order, and the constraints on its moments."""


@dataclass(frozen=True, eq=False)
class NormLimit:
    """Upper bound of a norm."""

    query: MeasureOrders
    variables: tuple[EpigraphVariable, ...]
    upper: float


@dataclass(frozen=True, eq=False)
class RatioLimit:
    """Upper bound of the root sum of squares of forces in some orders, over the same at rest."""

    orders: tuple[Order, ...]
    upper: float


@dataclass(eq=False)
class LimitTerms:
    """Terms that limits add to a program.

    Attributes
    ----------
    responses
        Responses to orders that the objective lacks.
    constraints
        Constraints on the moments of these orders.
    quadratics, uppers
        Quadratic bounds of further epigraph variables, and the upper bounds of these variables.
    linear
        Limits of transmissibility.
    """

    responses: list[Response] = field(default_factory=list)
    constraints: list[MomentConstraint] = field(default_factory=list)
    quadratics: list[QuadraticBound] = field(default_factory=list)
    uppers: list[float] = field(default_factory=list)
    linear: list[LinearLimit] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits that the best design comes near."""

    norms: tuple[NormLimit, ...]
    ratios: tuple[RatioLimit, ...]

    @property
    def loads(self) -> list[ComplexArray]:
        """Loads of all orders per column of the unbalances, shape (columns, k) each."""
        orders = [order for limit in self.norms for order in limit.query.orders]
        orders += [order for limit in self.ratios for order in limit.orders]
        return [order.loads[1:] for order in orders]

    def in_basis(self, basis: Array, parts: Sequence[OpenMounts]) -> Limits:
        """Return the limits in another basis of the unbalances, `basis` of shape (fewer, columns)."""
        norms = []
        for limit in self.norms:
            query = limit.query.in_basis(basis)
            norms.append(NormLimit(query, tuple(epigraph_variables(query, parts)), limit.upper))
        ratios = (
            RatioLimit(tuple(order.in_basis(basis) for order in ratio.orders), ratio.upper) for ratio in self.ratios
        )
        return Limits(tuple(norms), tuple(ratios))

    def terms(
        self, variables: Sequence[EpigraphVariable], state: Callable[[Order, ResponseBound], Stated],
        responses: Sequence[Response],
    ) -> LimitTerms:  # fmt: skip
        """Return the terms that limits add to a program.

        Parameters
        ----------
        variables, responses
            Epigraph variables of the objective, and the responses to their orders.
        state
            Return the response to an order, and the constraints on its moments.
        """
        terms, numbers_of_orders = (
            LimitTerms(),
            {_key(o): k for k, o in enumerate(o for v in variables for o in v.orders)},
        )
        all_responses = list(responses)

        def order_number(order: Order, bound: ResponseBound) -> int:
            if _key(order) not in numbers_of_orders:
                response, constraints = state(order, bound)
                numbers_of_orders[_key(order)] = len(all_responses)
                terms.constraints += [replace(constraint, order=len(all_responses)) for constraint in constraints]
                terms.responses.append(response)
                all_responses.append(response)
            return numbers_of_orders[_key(order)]

        for limit in self.norms:
            for variable in limit.variables:
                numbers = [
                    order_number(order, limit.query.bound(order, variable, limit.upper)) for order in variable.orders
                ]
                norm_responses = [all_responses[k] for k in numbers]
                terms.quadratics += variable.quadratic_bounds(
                    len(variables) + len(terms.uppers), limit.query, norm_responses, numbers
                )
                terms.uppers.append((variable.root_bound(limit.upper / variable.share) / variable.unit) ** 2)
        for ratio in self.ratios:
            moving = [order_number(order, UNBOUNDED) for order in ratio.orders]
            resting = [order_number(replace(order, omega=0.0), UNBOUNDED) for order in ratio.orders]
            forces = {k: all_responses[k].forces * all_responses[k].unit for k in (*moving, *resting)}
            size = max(float(np.linalg.norm(force[..., 0])) for force in forces.values()) or 1.0
            matrices = [(k, squared(forces[k] / size)) for k in moving]
            matrices += [(k, -(ratio.upper**2) * squared(forces[k] / size)) for k in resting]
            terms.linear.append(LinearLimit(tuple(matrices), 0.0))
        return terms


def _key(order: Order) -> tuple[int, int, int, bool]:
    return order.point, order.index, order.part, order.omega > 0.0


def limits_of(
    problem: Problem, evaluation: Evaluation, in_parts: Callable[[Measure], MeasureOrders],
    of_all_motions: Callable[[Measure], MeasureOrders],
) -> Limits:  # fmt: skip
    """Return the limits that the best design comes near.

    Parameters
    ----------
    evaluation
        The best design.
    in_parts
        Return the orders of a measure, each in the symmetric parts of the motions if there are such (E57).
    of_all_motions
        Return the orders of a measure in all motions.
    """
    norms: list[NormLimit] = []
    for limit in problem.limits:
        if limit.measure.on_mounts and NEAR_LIMIT * limit.maximum <= evaluation.value(limit.measure) < math.inf:
            query = in_parts(limit.measure)
            if query.orders and query.is_sampled_fully:
                norms.append(NormLimit(query, (), limit.maximum * (1.0 + SLACK)))
    ratios: list[RatioLimit] = []
    for limit in problem.mount_limits:
        measure = limit.measure
        if not measure.channel.depends_on_loads or evaluation.value(measure) < NEAR_LIMIT * limit.maximum:
            continue
        query = of_all_motions(Measure(channels.MOUNT_FORCE, RMS, points=measure.points, orders=measure.orders))
        for point in query.points:
            speed, orders = problem.points[point].speed, [o for o in query.orders if o.point == point]
            groups = [tuple(orders)]
            if measure.orders is not None:
                groups = [tuple(o for o in orders if orders_equal(o.omega / speed, h)) for h in measure.orders]
            upper = limit.maximum * (1.0 + SLACK)
            ratios += [RatioLimit(group, upper) for group in groups if 0 < len(group) <= MAX_ORDERS]
    return Limits(tuple(norms), tuple(ratios))
