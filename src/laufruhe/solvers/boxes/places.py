"""Positions of unbalances by branch and bound; a relaxed program bounds every box of positions (P8, P20)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from typing import TypeAlias

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import real_bounds
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Side
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.branch_and_bound import INFEASIBLE_PART, Box, FathomedPart, halves
from laufruhe.prove.witness import thin_box
from laufruhe.solvers.boxes.box_designs import SHARE, RebalancedDesign, RebalancedSearch, rebalance
from laufruhe.solvers.boxes.place_boxes import Relaxation
from laufruhe.solvers.boxes.search import divided
from laufruhe.solvers.conclusion import Design, evaluate_design, infeasible_result, values_of
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.prices import ACTIVE, Price, Slopes, edges_at, prices_of
from laufruhe.solvers.relaxation import with_bound
from laufruhe.solvers.result import Result, Status

Solve: TypeAlias = Callable[[Problem], Result]
Propose: TypeAlias = Callable[[Problem, Sequence[Sequence[Value]]], Result]
MOST_BOXES, MOST_OTHERS = 300, 500
"""Largest number of boxes of positions, and of boxes of the method for other decisions."""
HALF = 0.5
"""Share of the tolerance for the method of other decisions."""
# [m]
EXACT = 1e-6
# share of the range of a position by which finite differences move it
STEP = 1e-3
# [m] tolerance of limits on distances, and margin where positions are moved into them
REACH, INSIDE = 1e-9, 1e-7
# bisections of the slice that is cut off a side
HALVINGS = 10
# corners of a box from which feasible positions are sought
MOST_CORNERS = 16


@dataclass(frozen=True, eq=False)
class _Box:
    """Positions between bounds, the lower bound there, and the positions of its relaxation.

    Attributes
    ----------
    lower, upper, middle
        Positions [m], shape (places,) each.
    spread
        Distance by which the relaxation spreads the unbalances of each position [m]; zero if it is exact.
    near
        Values of all decisions of the problem about the solution of the relaxation.
    """

    lower: Array
    upper: Array
    bound: float
    middle: Array
    spread: Array
    near: tuple[Value, ...] = ()

    @property
    def is_exact(self) -> bool:
        """Tell if the relaxation is exact."""
        return bool(self.spread.max() <= EXACT)


def solve_places(problem: Problem) -> Result:
    """Return the best positions and unbalances, with a bound by boxes of positions."""
    search = PlaceSearch(problem)
    root = search.box(*search.bounds)
    first = None if isinstance(root, FathomedPart) else search.rebalance_at(root.middle)
    return search.solved(root, first, problem.search.boxes_or(MOST_BOXES), "places", "second-order cones over")


def solve_places_with(problem: Problem, prove: Solve, how: str, propose: Propose) -> Result:
    """Return a proposed design, with the bound of the relaxation over all positions (P20).

    Parameters
    ----------
    prove, how
        Method for the problem without open positions, and its name.
    propose
        Local search that starts from given values of the decisions.
    """
    started, maximum = time.perf_counter(), problem.search.boxes_or(MOST_OTHERS)

    def prove_roughly(part: Problem) -> Result:
        return prove(replace(part, tolerance=HALF * problem.tolerance, search=replace(part.search, boxes=maximum)))

    search = _PlaceSearchByMethod(problem, prove_roughly)
    root = search.box(*search.bounds)
    if isinstance(root, FathomedPart):
        return infeasible_result(problem, evaluate(problem), search.conflict, {"solve": time.perf_counter() - started})
    result = propose(problem, [root.near])
    if not result.status.has_design or not problem.search.proves:
        return result
    first = RebalancedDesign(evaluate_design(problem, values_of(problem, result), result.final.samples), result)
    _, bound, _ = divided(search, root, first, numerical_zero(problem), problem.tolerance, 1, "boxes of places")
    return with_bound(result, bound, f"{how} with places at the corners of their bounds")


class PlaceSearch(RebalancedSearch[_Box]):
    """Boxes of the open positions of a problem."""

    is_shared = True

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.relaxation = Relaxation(problem, SHARE)
        self._envelope = [limit for limit in problem.limits if limit.measure.channel.is_placing]
        self.places = self.relaxation.places

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of all positions [m]."""
        return real_bounds(self.places)

    def parts(self, box: _Box, value: float) -> Iterator[tuple[_Box | FathomedPart, RebalancedDesign | None]]:
        """Yield the halves of a box, each with the best design at its middle if that may be better than a value."""
        width, whole = box.upper - box.lower, self.bounds[1] - self.bounds[0]
        pulled = box.spread if box.spread.max(initial=0.0) > 1e-9 * whole.max() else width / whole
        side = int(np.argmax(pulled))
        for bounds in halves(Box(box.lower, box.upper, side), float(box.middle[side])):
            half = self.box(*bounds, box.bound)
            yield (
                half,
                None if isinstance(half, FathomedPart) or half.bound >= value else self.rebalance_at(half.middle),
            )

    def box(self, lower: Array, upper: Array, floor: float = 0.0) -> _Box | FathomedPart:
        """Return a box with the bound and the positions of its relaxation, or that it has no feasible design."""
        violated = self._violated(lower, upper)
        if violated:
            self.add_conflict(violated)
            return INFEASIBLE_PART
        lower, upper = self._shrunk(lower, upper)
        relaxed = self.relaxation.program(lower, upper)
        result = self._solve(relaxed)
        if result.status is Status.INFEASIBLE:
            self.add_conflict(result.conflict)
            return INFEASIBLE_PART
        bound = result.certificate.lower_bound if result.certificate is not None else 0.0
        middle, spread = self.relaxation.placing(relaxed, result, lower, upper)
        feasible = self._move_into_limits(middle, lower, upper)
        # limits on distances are not in the relaxation
        moved = upper - lower if feasible is None else np.abs(feasible - middle)
        spread, middle = np.maximum(spread, moved), middle if feasible is None else feasible
        near = self.relaxation.values(relaxed, result, middle)
        return _Box(lower, upper, max(bound, floor), middle, spread, near)

    def place(self, design: RebalancedDesign) -> Array:
        """Return the positions of a design [m], shape (places,)."""
        values = dict(zip((d.name for d in self.problem.decisions), design.design.values, strict=True))
        return np.array([float(np.real(values[place.name])) for place in self.places])

    def around(self, design: RebalancedDesign) -> _Box | FathomedPart:
        """Return a thin box around the positions of a design, with its bound by few angles."""
        few = PlaceSearch(self.problem.changed(search=replace(self.problem.search, proves=False)))
        return few.box(*thin_box(self.place(design), *self.bounds))

    def _solve(self, relaxed: Problem) -> Result:
        result = solve_unbalances(relaxed, angles=self.angles)
        # halves need as many angles as the first box
        self.angles = self.angles or result.final.samples // 2
        return result

    def _spans(self, lower: Array, upper: Array) -> Iterator[tuple[Limit, float, float]]:
        if not self._envelope:
            return
        low = self.problem.design(lower.tolist(), self.places)
        high = low if np.array_equal(lower, upper) else self.problem.design(upper.tolist(), self.places)
        for limit in self._envelope:
            for minimum, maximum in limit.measure.channel.span(limit.measure, low, high):
                yield limit, minimum, maximum

    def _violated(self, lower: Array, upper: Array) -> tuple[str, ...]:
        for limit, minimum, maximum in self._spans(lower, upper):
            if minimum > limit.maximum + REACH or maximum < limit.minimum - REACH:
                return (limit.name,)
        return ()

    def _shrunk(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return a box without slices at its sides that violate a limit on distances everywhere."""
        lower, upper = lower.copy(), upper.copy()
        for side, at_top in product(range(len(lower)) if self._envelope else (), (True, False)):
            low, high, width = 0.0, 1.0, upper[side] - lower[side]
            for _ in range(HALVINGS):
                share = 0.5 * (low + high)
                first, last = lower.copy(), upper.copy()
                if at_top:
                    first[side] = upper[side] - share * width
                else:
                    last[side] = lower[side] + share * width
                low, high = (share, high) if self._violated(first, last) else (low, share)
            if at_top:
                upper[side] -= low * width
            else:
                lower[side] += low * width
        return lower, upper

    def _move_into_limits(self, middle: Array, lower: Array, upper: Array) -> Array | None:
        """Return positions in a box close to `middle` that keep the limits on distances, or None."""

        def room(places: Array) -> Array:
            spans = self._spans(places, places)
            sides = [(limit.maximum - at, at - limit.minimum) for limit, at, _ in spans]
            return np.asarray(np.minimum(np.array(sides).ravel(), 1.0))

        if not self._envelope or room(middle).min() >= -REACH:
            return middle
        from scipy.optimize import NonlinearConstraint, minimize

        limits = NonlinearConstraint(room, INSIDE, np.inf)
        width, sides = np.where(upper > lower, upper - lower, 1.0), list(zip(lower, upper, strict=True))

        def distance(places: Array) -> float:
            return float(np.square((places - middle) / width).sum())

        def slope(places: Array) -> Array:
            return np.asarray(2.0 * (places - middle) / width**2)

        corners = [np.array(corner) for corner in islice(product(*sides), MOST_CORNERS)]
        feasible = []
        for start in (middle, *corners):
            end = minimize(distance, start, jac=slope, method="SLSQP", bounds=sides, constraints=[limits])
            feasible += [at for at in (np.clip(end.x, lower, upper), start) if room(at).min() >= -REACH]
        return min(feasible, key=distance, default=None)

    def prices(self, design: Design) -> dict[Side, Price]:
        """Return prices of limits on distances, by finite differences of the objective and the distances (P19)."""
        places = self.place(RebalancedDesign(design))
        # every shaft at a limit has its own distance
        active = [
            (limit, k, side)
            for limit in self._envelope for k, value in enumerate(design.evaluation.values(limit.measure))
            for room, _, side in (limit.slack(value),) if room <= ACTIVE
        ]  # fmt: skip
        if not active:
            return {}
        width = self.bounds[1] - self.bounds[0]
        ends = [(self.rebalance_at(places - step), self.rebalance_at(places + step)) for step in np.diag(STEP * width)]

        def slope(number: Callable[[Design], float]) -> Array:
            return np.array([(number(high.design) - number(low.design)) / (2.0 * STEP) for low, high in ends])

        signs = {"at most": 1.0, "at least": -1.0}
        gradients = [
            signs[side] * slope(lambda at, limit=limit, k=k: at.evaluation.values(limit.measure)[k])  # type: ignore[misc]
            for limit, k, side in active
        ]  # fmt: skip
        edges = [
            normal * width[k] * np.eye(len(places))[k]
            for k, place in enumerate(self.places) for normal in edges_at(place, places[k : k + 1]).values()
        ]  # fmt: skip
        objective = [Slopes.smooth(slope(lambda at: at.value))]
        prices = prices_of(objective, [Slopes.smooth(row) for row in gradients], np.reshape(edges, (-1, len(places))))
        by_side: dict[Side, Price] = {}
        for (limit, _, side), price in zip(active, prices or (), strict=False):
            by_side[limit, side] = price + by_side.get((limit, side), Price(0.0, 0.0))
        return by_side

    def rebalance_at(self, places: Array) -> RebalancedDesign:
        """Return the best design with these positions [m]."""
        where: dict[str, Value] = {p.name: float(x) for p, x in zip(self.places, places, strict=True)}
        engine = self.problem.design(list(where.values()), self.places)
        fixed = replace(self.relaxation.problem, engine=engine, decisions=self.relaxation.others)
        return rebalance(self.problem, fixed, where, self.angles)


class _PlaceSearchByMethod(PlaceSearch):
    """Boxes of positions of a problem whose other decisions need another method than cones."""

    is_shared = False

    def __init__(self, problem: Problem, prove: Solve) -> None:
        super().__init__(problem)
        self._prove = prove

    def around(self, design: RebalancedDesign) -> _Box | FathomedPart:
        """Return a thin box around the positions of a design with its bound."""
        return self.box(*thin_box(self.place(design), *self.bounds))

    def _solve(self, relaxed: Problem) -> Result:
        return self._prove(relaxed)
