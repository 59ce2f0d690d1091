"""Solve for positions of unbalances by branch and bound; a relaxation bounds every box of positions (P8, P20)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import islice, product
from typing import TypeAlias

import numpy as np

from laufruhe.extensions.open_positions.channels import ShaftChannel
from laufruhe.extensions.open_positions.relaxation import Relaxation, without_places
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import Kind, real_bounds
from laufruhe.problem.dependence import open_kinds
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Side
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import INFEASIBLE_PART, Box, FathomedPart, halves
from laufruhe.prove.certificate import ProofStrength
from laufruhe.prove.witness import thin_box
from laufruhe.solvers.boxes.search import SHARE, BoundedBox, RebalancedDesign, RebalancedSearch, rebalance
from laufruhe.solvers.conclusion import Design, evaluate_design, infeasible_result, values_of
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.methods import method_of, solve_all_numbers
from laufruhe.solvers.prices import ACTIVE, Price, Slopes, edges_at, prices_of
from laufruhe.solvers.relaxation import with_better_bound
from laufruhe.solvers.result import Result, Status

Solve: TypeAlias = Callable[[Problem], Result]
MAX_BOXES, MAX_OTHERS = 300, 500
"""Largest number of boxes of positions, and of boxes of the method for the other decisions."""
OTHER_SHARE = 0.5
"""Share of the problem's tolerance that the method for the other decisions may use."""
# spread of unbalances up to which a relaxation counts as exact [m]
EXACT_SPREAD = 1e-6
# share of the range of a position by which finite differences move it
STEP_SHARE = 1e-3
# tolerance of limits on distances, and margin when positions move into these limits [m]
DISTANCE_TOLERANCE, MARGIN = 1e-9, 1e-7
# corners of a box from which local searches for feasible positions start
MAX_CORNERS = 16


@dataclass(frozen=True, eq=False)
class _Box(BoundedBox):
    """Box of positions [m], and the positions of its relaxation.

    Attributes
    ----------
    middle
        Positions of the relaxed solution [m], shape (places,).
    spread
        Distance by which the relaxation spreads the unbalances of each position [m], shape (places,).
    start
        Values of all decisions from the relaxed solution, to start a local search.
    """

    middle: Array
    spread: Array
    start: tuple[Value, ...] = ()


def solve_places(problem: Problem) -> Result:
    """Return the best positions of rotors and their unbalances, with a lower bound by branch and bound."""
    search = PlaceSearch(problem)
    root = search.box(*search.bounds)
    first = None if isinstance(root, FathomedPart) else search.rebalance_at(root.middle)
    return search.solve(root, first, problem.search.boxes_or(MAX_BOXES), "places", "second-order cones over")


def is_exact_at_corners(problem: Problem) -> bool:
    """Return True if a method proves the optimum of all other numbers, with places at the corners of their bounds."""
    return Kind.PLACE in open_kinds(problem) and method_of(without_places(problem)).strength is ProofStrength.EXACT


def solve_at_corners(problem: Problem) -> Result:
    """Return the best design of local searches over positions and other decisions, with a lower bound (P20).

    The bound is that of the relaxation over all positions, by the method that decides all other numbers.
    """
    started, method = time.perf_counter(), method_of(without_places(problem))
    maximum = problem.search.boxes_or(MAX_OTHERS)

    def prove_roughly(relaxed: Problem) -> Result:
        search = replace(relaxed.search, boxes=maximum)
        # `Method.solve` refines the fidelity, so this solver does not
        return method.solver(replace(relaxed, tolerance=OTHER_SHARE * problem.tolerance, search=search))

    search = _PlaceSearchByMethod(problem, prove_roughly)
    root = search.box(*search.bounds)
    if isinstance(root, FathomedPart):
        return infeasible_result(problem, evaluate(problem), search.conflict, {"solve": time.perf_counter() - started})
    result = solve_all_numbers(problem, [root.start])
    if not result.status.has_design or not problem.search.proves:
        return result
    first = RebalancedDesign(evaluate_design(problem, values_of(problem, result), result.final.samples), result)
    search.what = "boxes of places"
    _, bound, _ = search.search(root, first, numerical_zero(problem), problem.tolerance, 1)
    return with_better_bound(result, bound, f"{method.name} with places at the corners of their bounds")


class PlaceSearch(RebalancedSearch[_Box]):
    """Branch and bound search over the open positions of a problem."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.relaxation = Relaxation(problem, SHARE)
        self._envelope = [
            (limit, limit.measure.channel)
            for limit in problem.limits
            if isinstance(limit.measure.channel, ShaftChannel)
        ]
        self.places = self.relaxation.places

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of all positions [m], shape (places,) each."""
        return real_bounds(self.places)

    def parts(self, box: _Box, value: float) -> Iterator[tuple[_Box | FathomedPart, RebalancedDesign | None]]:
        """Yield the halves of a box of positions, each with the design at its middle if that may beat `value` [SI]."""
        width, root_width = box.upper - box.lower, self.bounds[1] - self.bounds[0]
        scores = box.spread if box.spread.max(initial=0.0) > 1e-9 * root_width.max() else width / root_width
        side = int(np.argmax(scores))
        for bounds in halves(Box(box.lower, box.upper, side), float(box.middle[side])):
            half = self.box(*bounds, box.bound)
            yield half, self.rebalance_at(half.middle) if isinstance(half, _Box) and half.bound < value else None

    def box(self, lower: Array, upper: Array, floor: float = 0.0) -> _Box | FathomedPart:
        """Return a box of positions [m] with the bound of its relaxation, at least the known bound `floor` [SI].

        A box without a feasible design is an `INFEASIBLE_PART`.
        """
        for limit, minimum, maximum in self._spans(lower, upper):
            if minimum > limit.maximum + DISTANCE_TOLERANCE or maximum < limit.minimum - DISTANCE_TOLERANCE:
                self.add_conflict([limit.name])
                return INFEASIBLE_PART
        relaxed = self.relaxation.program(lower, upper)
        result = self._solve(relaxed)
        if result.status is Status.INFEASIBLE:
            self.add_conflict(result.conflict)
            return INFEASIBLE_PART
        bound = result.certificate.lower_bound if result.certificate is not None else 0.0
        middle, spread = self.relaxation.recover_places(relaxed, result, lower, upper)
        feasible = self._move_into_limits(middle, lower, upper)
        # the relaxation ignores limits on distances
        shift = upper - lower if feasible is None else np.abs(feasible - middle)
        spread, middle = np.maximum(spread, shift), middle if feasible is None else feasible
        start, is_exact = self.relaxation.values(relaxed, result, middle), bool(spread.max() <= EXACT_SPREAD)
        return _Box(max(bound, floor), is_exact, lower, upper, middle, spread, start)

    def place(self, design: RebalancedDesign) -> Array:
        """Return the positions of a design [m], shape (places,)."""
        values = dict(zip((d.name for d in self.problem.decisions), design.design.values, strict=True))
        return np.array([float(np.real(values[place.name])) for place in self.places])

    def around(self, design: RebalancedDesign) -> _Box | FathomedPart:
        """Return a thin box around the positions of a design, with its bound at few samples."""
        coarse = PlaceSearch(self.problem.changed(search=replace(self.problem.search, proves=False)))
        return coarse.box(*thin_box(self.place(design), *self.bounds))

    def _solve(self, relaxed: Problem) -> Result:
        result = solve_unbalances(relaxed, angles=self.angles)
        # all boxes start at the samples of the first box
        self.angles = self.angles or result.final.samples // 2
        return result

    def _spans(self, lower: Array, upper: Array) -> Iterator[tuple[Limit, float, float]]:
        # limits on distances, with the smallest and largest distance in a box
        if not self._envelope:
            return
        low = self.problem.design(lower.tolist(), self.places)
        high = low if np.array_equal(lower, upper) else self.problem.design(upper.tolist(), self.places)
        for limit, channel in self._envelope:
            for minimum, maximum in channel.span(limit.measure, low, high):
                yield limit, minimum, maximum

    def _move_into_limits(self, middle: Array, lower: Array, upper: Array) -> Array | None:
        """Return positions in a box close to `middle` that keep the limits on distances [m], or None."""

        def slacks(places: Array) -> Array:
            spans = self._spans(places, places)
            sides = [(limit.maximum - value, value - limit.minimum) for limit, value, _ in spans]
            return np.asarray(np.minimum(np.array(sides).ravel(), 1.0))

        if not self._envelope or slacks(middle).min() >= -DISTANCE_TOLERANCE:
            return middle
        from scipy.optimize import NonlinearConstraint, minimize

        limits = NonlinearConstraint(slacks, MARGIN, np.inf)
        width, sides = np.where(upper > lower, upper - lower, 1.0), list(zip(lower, upper, strict=True))

        def distance(places: Array) -> float:
            return float(np.square((places - middle) / width).sum())

        def slope(places: Array) -> Array:
            return np.asarray(2.0 * (places - middle) / width**2)

        corners = [np.array(corner) for corner in islice(product(*sides), MAX_CORNERS)]
        feasible = []
        for start in (middle, *corners):
            end = minimize(distance, start, jac=slope, method="SLSQP", bounds=sides, constraints=[limits])
            points = np.clip(end.x, lower, upper), start
            feasible += [point for point in points if slacks(point).min() >= -DISTANCE_TOLERANCE]
        return min(feasible, key=distance, default=None)

    def prices(self, design: Design) -> dict[Side, Price]:
        """Return shadow prices of limits on distances, from finite differences of objective and distances (P19)."""
        places = self.place(RebalancedDesign(design))
        # a limit has one distance per shaft
        active = [
            (limit, k, side)
            for limit, _ in self._envelope for k, value in enumerate(design.evaluation.values(limit.measure))
            for slack, _, side in (limit.slack(value),) if slack <= ACTIVE
        ]  # fmt: skip
        if not active:
            return {}
        width = self.bounds[1] - self.bounds[0]
        ends = [
            (self.rebalance_at(places - step), self.rebalance_at(places + step)) for step in np.diag(STEP_SHARE * width)
        ]

        def slope(number: Callable[[Design], float]) -> Array:
            return np.array([(number(high.design) - number(low.design)) / (2.0 * STEP_SHARE) for low, high in ends])

        signs = {"at most": 1.0, "at least": -1.0}
        gradients = [
            signs[side] * slope(lambda x, limit=limit, k=k: x.evaluation.values(limit.measure)[k])  # type: ignore[misc]
            for limit, k, side in active
        ]  # fmt: skip
        edges = [
            normal * width[k] * np.eye(len(places))[k]
            for k, place in enumerate(self.places) for normal in edges_at(place, places[k : k + 1]).values()
        ]  # fmt: skip
        objective = [Slopes.smooth(slope(lambda x: x.value))]
        prices = prices_of(objective, [Slopes.smooth(row) for row in gradients], np.reshape(edges, (-1, len(places))))
        by_side: dict[Side, Price] = {}
        for (limit, _, side), price in zip(active, prices or (), strict=False):
            by_side[limit, side] = price + by_side.get((limit, side), Price(0.0, 0.0))
        return by_side

    def rebalance_at(self, places: Array) -> RebalancedDesign:
        """Return the best design with these positions [m], shape (places,): its unbalances are optimal."""
        fixed_values: dict[str, Value] = {p.name: float(x) for p, x in zip(self.places, places, strict=True)}
        engine = self.problem.design(list(fixed_values.values()), self.places)
        balance = replace(self.relaxation.problem, engine=engine, decisions=self.relaxation.other_decisions)
        return rebalance(self.problem, balance, fixed_values, self.angles)


class _PlaceSearchByMethod(PlaceSearch):
    """Branch and bound search over positions, with a general solver for the other decisions."""

    def __init__(self, problem: Problem, prove: Solve) -> None:
        super().__init__(problem)
        self._prove = prove

    def around(self, design: RebalancedDesign) -> _Box | FathomedPart:
        """Return a thin box around the positions of a design, with its bound."""
        return self.box(*thin_box(self.place(design), *self.bounds))

    def _solve(self, relaxed: Problem) -> Result:
        return self._prove(relaxed)
