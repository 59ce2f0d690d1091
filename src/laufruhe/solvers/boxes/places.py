"""Places of unbalances, and what is open with them: boxes of places, each bounded by its program (P8, P20)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from typing import TypeAlias

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Side
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.best_first import EMPTY, Box, Over, halves
from laufruhe.prove.witness import thin
from laufruhe.solvers.boxes.held_designs import SHARE, HeldDesign, HeldDesigns, best_with
from laufruhe.solvers.boxes.place_boxes import Relaxation
from laufruhe.solvers.boxes.search import divided
from laufruhe.solvers.conclusion import Design, judged, none_within, values_of
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.prices import ACTIVE, Price, Slopes, edges_at, prices_of
from laufruhe.solvers.relaxed import with_bound
from laufruhe.solvers.result import Result, Status

Solve: TypeAlias = Callable[[Problem], Result]
Propose: TypeAlias = Callable[[Problem, Sequence[Sequence[Value]]], Result]
MOST_BOXES, MOST_OTHERS = 300, 500
"""Boxes of places, and those of a method that decides what else is open."""
HALF = 0.5
"""Share of the tolerance that such a method may use up."""
# [m]
EXACT = 1e-6
# share of the bounds of a place by which it is moved to see what that is worth
STEP = 1e-3
# [m], by which a limit on a distance may be missed, and by which it is kept where places are moved for it
REACH, INSIDE = 1e-9, 1e-7
# of the part of a side that is cut away
HALVINGS = 10
# of a box, from which allowed places are sought
MOST_CORNERS = 16


@dataclass(frozen=True, eq=False)
class _Box:
    """Places between bounds, shape (places,) each, what bounds the objective there, and where it looks best.

    Attributes
    ----------
    spread
        By how much what was left out pulls each place apart [m]; next to nothing where it made no difference.
    near
        Decisions of the problem that are about those of its program.
    """

    lower: Array
    upper: Array
    bound: float
    middle: Array
    spread: Array
    near: tuple[Value, ...] = ()

    @property
    def is_exact(self) -> bool:
        """Whether it left nothing out: no part of it has more than a bound as near as its program came."""
        return bool(self.spread.max() <= EXACT)


def solve_places(problem: Problem) -> Result:
    """Places and unbalances, proven as far as dividing the boxes of places goes."""
    search = _Search(problem)
    root = search.box(*search.bounds)
    first = None if isinstance(root, Over) else search.at(root.middle)
    return search.solved(root, first, problem.search.boxes_or(MOST_BOXES), "places", "second-order cones over")


def solve_places_with(problem: Problem, prove: Solve, how: str, propose: Propose) -> Result:
    """Places and whatever else is open by a proposal, with the bound of the box of all places (P20).

    Parameters
    ----------
    prove, how
        Decides the same without places, and its name.
    propose
        Seeks a design near some.
    """
    started, most = time.perf_counter(), problem.search.boxes_or(MOST_OTHERS)

    def prove_roughly(part: Problem) -> Result:
        return prove(replace(part, tolerance=HALF * problem.tolerance, search=replace(part.search, boxes=most)))

    search = _Others(problem, prove_roughly)
    root = search.box(*search.bounds)
    if isinstance(root, Over):
        return none_within(problem, evaluate(problem), search.conflict, {"solve": time.perf_counter() - started})
    found = propose(problem, [root.near])
    if not found.status.has_design or not problem.search.proves:
        return found
    first = HeldDesign(judged(problem, values_of(problem, found), found.final.samples), found)
    _, bound, _ = divided(search, root, first, nothing_of(problem), problem.tolerance, 1, "boxes of places")
    return with_bound(found, bound, f"{how} with places at the corners of their bounds")


class _Search(HeldDesigns[_Box]):
    """Boxes of the places of a problem."""

    is_shared = True

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.relaxation = Relaxation(problem, SHARE)
        self._envelope = [limit for limit in problem.limits if limit.measure.channel.is_placing]
        self.places = self.relaxation.places

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Of all places."""
        return np.array([p.lower for p in self.places]), np.array([p.upper for p in self.places])

    def parts(self, box: _Box, value: float) -> Iterator[tuple[_Box | Over, HeldDesign | None]]:
        """Halves of a box, each with the best design at its middle if it may be better than a value."""
        for half in self._halves(box):
            yield half, None if isinstance(half, Over) or half.bound >= value else self.at(half.middle)

    def _halves(self, box: _Box) -> Iterator[_Box | Over]:
        width, whole = box.upper - box.lower, self.bounds[1] - self.bounds[0]
        pulled = box.spread if box.spread.max(initial=0.0) > 1e-9 * whole.max() else width / whole
        side = int(np.argmax(pulled))
        for half in halves(Box(box.lower, box.upper, side), float(box.middle[side])):
            yield self.box(*half, box.bound)

    def box(self, lower: Array, upper: Array, floor: float = 0.0) -> _Box | Over:
        """The bound of a box, and where its program puts the places; or that no design is allowed."""
        beyond = self._beyond(lower, upper)
        if beyond:
            self.told(beyond)
            return EMPTY
        lower, upper = self._shrunk(lower, upper)
        relaxed = self.relaxation.program(lower, upper)
        result = self._solve(relaxed)
        if result.status is Status.INFEASIBLE:
            self.told(result.conflict)
            return EMPTY
        bound = result.certificate.lower_bound if result.certificate is not None else 0.0
        middle, spread = self.relaxation.placing(relaxed, result, lower, upper)
        allowed = self._pushed(middle, lower, upper)
        # what the program does not know of moves the places too
        moved = upper - lower if allowed is None else np.abs(allowed - middle)
        spread, middle = np.maximum(spread, moved), middle if allowed is None else allowed
        near = self.relaxation.values(relaxed, result, middle)
        return _Box(lower, upper, max(bound, floor), middle, spread, near)

    def place(self, found: HeldDesign) -> Array:
        """Return the places of a design."""
        values = dict(zip((d.name for d in self.problem.decisions), found.design.values, strict=True))
        return np.array([float(np.real(values[place.name])) for place in self.places])

    def around(self, found: HeldDesign) -> _Box | Over:
        """Return a thin box around the places of a design, and its bound at the first angles that are tried."""
        few = _Search(self.problem.changed(search=replace(self.problem.search, proves=False)))
        return few.box(*thin(self.place(found), *self.bounds))

    def _solve(self, relaxed: Problem) -> Result:
        result = solve_unbalances(relaxed, angles=self.angles)
        # what all places needed, their parts need too
        self.angles = self.angles or result.final.samples // 2
        return result

    def _spans(self, lower: Array, upper: Array) -> Iterator[tuple[Limit, float, float]]:
        """Least and largest of each distance that is limited, with its places in a box."""
        if not self._envelope:
            return
        low = self.problem.design(lower.tolist(), self.places)
        high = low if np.array_equal(lower, upper) else self.problem.design(upper.tolist(), self.places)
        for limit in self._envelope:
            for least, most in limit.measure.channel.span(limit.measure, low, high):
                yield limit, least, most

    def _beyond(self, lower: Array, upper: Array) -> tuple[str, ...]:
        """A limit on distances that is broken all over a box; none where there is no such."""
        for limit, least, most in self._spans(lower, upper):
            if least > limit.maximum + REACH or most < limit.minimum - REACH:
                return (limit.name,)
        return ()

    def _shrunk(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """A box without slices at its sides in which a limit on distances is broken everywhere."""
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
                low, high = (share, high) if self._beyond(first, last) else (low, share)
            if at_top:
                upper[side] -= low * width
            else:
                lower[side] += low * width
        return lower, upper

    def _pushed(self, middle: Array, lower: Array, upper: Array) -> Array | None:
        """Places in a box that keep the limits on distances, near its middle; None where none are found."""

        def room(places: Array) -> Array:
            spans = self._spans(places, places)
            sides = [(limit.maximum - at, at - limit.minimum) for limit, at, _ in spans]
            return np.asarray(np.minimum(np.array(sides).ravel(), 1.0))

        if not self._envelope or room(middle).min() >= -REACH:
            return middle
        from scipy.optimize import NonlinearConstraint, minimize

        kept = NonlinearConstraint(room, INSIDE, np.inf)
        width, sides = np.where(upper > lower, upper - lower, 1.0), list(zip(lower, upper, strict=True))

        def away(places: Array) -> float:
            return float(np.square((places - middle) / width).sum())

        def slope(places: Array) -> Array:
            return np.asarray(2.0 * (places - middle) / width**2)

        corners = [np.array(corner) for corner in islice(product(*sides), MOST_CORNERS)]
        found = []
        for start in (middle, *corners):
            pushed = minimize(away, start, jac=slope, method="SLSQP", bounds=sides, constraints=[kept])
            found += [at for at in (np.clip(pushed.x, lower, upper), start) if room(at).min() >= -REACH]
        return min(found, key=away, default=None)

    def prices(self, design: Design) -> dict[Side, Price]:
        """Prices of limits on distances: what the least objective loses and they gain as places move (P19)."""
        places = self.place(HeldDesign(design))
        # every shaft that stands at a limit has a distance of its own
        held = [
            (limit, k, side)
            for limit in self._envelope for k, value in enumerate(design.evaluation.values(limit.measure))
            for room, _, side in (limit.room(value),) if room <= ACTIVE
        ]  # fmt: skip
        if not held:
            return {}
        width = self.bounds[1] - self.bounds[0]
        ends = [(self.at(places - step), self.at(places + step)) for step in np.diag(STEP * width)]

        def slope(number: Callable[[Design], float]) -> Array:
            return np.array([(number(high.design) - number(low.design)) / (2.0 * STEP) for low, high in ends])

        signs = {"at most": 1.0, "at least": -1.0}
        bends = [
            signs[side] * slope(lambda own, limit=limit, k=k: own.evaluation.values(limit.measure)[k])  # type: ignore[misc]
            for limit, k, side in held
        ]  # fmt: skip
        edges = [
            normal * width[k] * np.eye(len(places))[k]
            for k, place in enumerate(self.places) for normal in edges_at(place, places[k : k + 1]).values()
        ]  # fmt: skip
        objective = [Slopes.smooth(slope(lambda own: own.value))]
        told = prices_of(objective, [Slopes.smooth(own) for own in bends], np.reshape(edges, (-1, len(places))))
        found: dict[Side, Price] = {}
        for (limit, _, side), price in zip(held, told or (), strict=False):
            found[limit, side] = price + found.get((limit, side), Price(0.0, 0.0))
        return found

    def at(self, places: Array) -> HeldDesign:
        """The best design with its places given."""
        where: dict[str, Value] = {p.name: float(x) for p, x in zip(self.places, places, strict=True)}
        engine, own = self.problem.design(list(where.values()), self.places), self.relaxation
        held = replace(own.problem, engine=engine, decisions=own.others)
        return best_with(self.problem, held, where, self.angles)


class _Others(_Search):
    """Boxes of the places of a problem whose other decisions have a method of their own."""

    is_shared = False

    def __init__(self, problem: Problem, prove: Solve) -> None:
        super().__init__(problem)
        self._prove = prove

    def around(self, found: HeldDesign) -> _Box | Over:
        """Return a thin box around the places of a design, and its bound."""
        return self.box(*thin(self.place(found), *self.bounds))

    def _solve(self, relaxed: Problem) -> Result:
        return self._prove(relaxed)
