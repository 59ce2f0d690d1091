"""Deciding discs, shafts and absorbers of the crankshaft: local programs from many starts, and boxes (V13)."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, nnls

from laufruhe.errors import ModelError
from laufruhe.numerics.budget import passed
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Side
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Reach, room_of
from laufruhe.prove.subdivision import Divided, divide
from laufruhe.prove.twist_boxes import TwistBoxes
from laufruhe.solvers.conclusion import KEPT, Design, Shown, concluded, judged, none_within
from laufruhe.solvers.result import Result

Array = NDArray[np.float64]

# designs looked at for each start of the search, open numbers that are divided, and boxes that this may take
LOOKS, MOST_OPEN, MOST_BOXES = 4, 3, 3000
STEP, HELD, FAR = 1e-6, 1e-6, 1e3


@dataclass(frozen=True, eq=False)
class _Program:
    """Objective and room of every limit over the shares of the bounds, 0 to 1."""

    problem: Problem
    lower: Array
    upper: Array

    def values(self, shares: Array) -> list[float]:
        """Decisions."""
        return list(np.clip(self.lower + shares * (self.upper - self.lower), self.lower, self.upper).tolist())

    def numbers(self, shares: Array) -> Array:
        """The objective, then the least relative room inside each limit; an objective far off on a resonance."""
        try:
            evaluation = evaluate(self.problem, self.problem.design(self.values(shares)))
            rooms = [-evaluation.standing(limit).excess for limit in self.problem.limits]
            return np.array([objective_value(self.problem, evaluation), *rooms])
        except ModelError:
            return np.array([math.inf, *(-1.0 for _ in self.problem.limits)])

    def slopes(self, shares: Array) -> Array:
        """Of these numbers, by central differences inside the bounds, shape (1 + limits, n)."""
        found = []
        for k in range(len(shares)):
            ends = [np.clip(shares + sign * STEP * np.eye(len(shares))[k], 0.0, 1.0) for sign in (-1.0, 1.0)]
            low, high = (self.numbers(end) for end in ends)
            found.append((high - low) / (ends[1][k] - ends[0][k]))
        return np.ascontiguousarray(np.array(found).T)

    def rank(self, shares: Array) -> tuple[float, float]:
        """Designs within their limits by their objective, others by what they exceed these by."""
        value, *rooms = self.numbers(shares)
        return max(-min(rooms, default=0.0), KEPT), float(value)


def solve_torsion(problem: Problem) -> Result:
    """The best discs, shafts and absorbers found, with what boxes prove; or the limits that none keeps.

    Root mean squares, inertia and irregularity are decided to a proven optimum of up to three numbers. What else
    is asked has a bound by these in it alone.
    """
    started = time.perf_counter()
    initial = evaluate(problem)
    ends = (np.array([getattr(decision, end) for decision in problem.decisions]) for end in ("lower", "upper"))
    program = _Program(problem, *ends)
    start = (np.array([d.start_number for d in problem.decisions]) - program.lower) / (program.upper - program.lower)
    best = _searched(program, [np.clip(start, 0.0, 1.0), *_looks(problem)], problem.search.starts)
    design = judged(problem, program.values(best))
    boxes, divided = TwistBoxes(problem, initial), Divided(0.0, 0)
    most = _most_boxes(problem) if boxes.coordinates.is_exact and boxes.is_sampled_fully else 0
    for _ in range(2):
        if not most or passed():
            break
        met = design.excess <= KEPT
        if met and not boxes.has_terms:
            break
        value = design.value if met else math.inf
        room = room_of(value, problem.tolerance, nothing_of(problem)) if met else 0.0
        divided = divide(boxes, boxes.coordinates.lower, boxes.coordinates.upper, value, room, most)
        if not met and divided.bound == math.inf:
            names = tuple(limit.name for limit in problem.limits)
            return none_within(problem, initial, names, {"solve": time.perf_counter() - started})
        places = [(boxes.coordinates.decisions(x) - program.lower) / (program.upper - program.lower)
                  for x in divided.places]  # fmt: skip
        again = judged(problem, program.values(_searched(program, [best, *places], 3)))
        if again.rank >= design.rank or again.value > value * (1.0 - 0.1 * problem.tolerance):
            break
        design, best = again, np.array([
            (v - low) / (high - low) for v, low, high in zip(again.values, program.lower, program.upper, strict=True)
        ], dtype=float)  # fmt: skip
    shown = _shown(program, boxes, divided, design, best)
    return concluded(design, initial, shown, {"solve": time.perf_counter() - started})


def _most_boxes(problem: Problem) -> int:
    if problem.search.boxes is not None:
        return problem.search.boxes
    return MOST_BOXES if len(problem.decisions) <= MOST_OPEN else 0


def _looks(problem: Problem) -> list[Array]:
    """Designs spread evenly over the bounds."""
    rng, many = np.random.default_rng(problem.search.seed), LOOKS * problem.search.starts
    # of each number one in every share of its bounds
    columns = [(rng.permutation(many) + rng.random(many)) / many for _ in problem.decisions]
    return list(np.array(columns).T)


def _searched(program: _Program, places: list[Array], starts: int) -> Array:
    """The best design of local programs from the best of some places."""
    ranked = sorted(places, key=program.rank)
    best = ranked[0]
    for place in ranked[: max(1, min(starts, LOOKS))]:
        if passed():
            break
        best = min(best, _local(program, place), key=program.rank)
    return best


def _local(program: _Program, place: Array) -> Array:
    """A local optimum by sequential quadratic programs, its slopes by differences."""
    first = program.numbers(place)
    unit = first[0] if math.isfinite(first[0]) and first[0] > 0.0 else 1.0
    known: dict[bytes, Array] = {}

    def numbers(x: Array) -> Array:
        key = np.clip(x, 0.0, 1.0).tobytes()
        if key not in known:
            found = program.numbers(np.clip(x, 0.0, 1.0))
            known[key] = np.append(min(found[0] / unit, FAR), found[1:])
        return known[key]

    def slopes(x: Array) -> Array:
        found = program.slopes(np.clip(x, 0.0, 1.0))
        found[0] /= unit
        return np.nan_to_num(found, posinf=FAR, neginf=-FAR)

    limits = len(program.problem.limits)
    inside: Any = [{"type": "ineq", "fun": lambda x: numbers(x)[1:], "jac": lambda x: slopes(x)[1:]}] if limits else []
    run: Any = minimize
    found = run(
        lambda x: numbers(x)[0], place, jac=lambda x: slopes(x)[0], method="SLSQP", bounds=[(0.0, 1.0)] * len(place),
        constraints=inside, options={"maxiter": 60, "ftol": 1e-10},
    )  # fmt: skip
    return np.asarray(np.clip(found.x, 0.0, 1.0))


def _shown(program: _Program, boxes: TwistBoxes, divided: Divided, design: Design, best: Array) -> Shown:
    """Bound, multipliers, and how far the slopes are from balance."""
    problem = program.problem
    slopes = program.slopes(best)
    rooms = program.numbers(best)[1:]
    size = float(np.abs(slopes[0]).max()) or 1.0
    held = [k for k, room in enumerate(rooms) if room <= HELD]
    low, high = best <= HELD, best >= 1.0 - HELD
    columns = [-slopes[1 + k] / (float(np.abs(slopes[1 + k]).max()) or 1.0) for k in held]
    columns += [sign * np.eye(len(best))[k] for mask, sign in ((low, -1.0), (high, 1.0)) for k in np.flatnonzero(mask)]
    scale = max(size, design.value)
    shares, rest = nnls(np.column_stack(columns), -slopes[0] / scale) if columns else (np.zeros(0), size / scale)
    prices: dict[Side, float] = {}
    left = slopes[0].copy()
    for k, share in zip(held, shares, strict=False):
        limit = problem.limits[k]
        steep = float(np.abs(slopes[1 + k]).max()) or 1.0
        _, edge, side = limit.room(design.evaluation.standing(limit).value)
        # rooms are relative to the edge of their limit
        prices[limit, side] = float(share) * scale / (steep * (abs(edge) or 1.0))
        left = left - float(share) * scale / steep * slopes[1 + k]
    widths = program.upper - program.lower
    by_name = {d.name: np.array([left[k] / widths[k]]) for k, d in enumerate(problem.decisions)}
    exact = boxes.coordinates.is_exact and boxes.knows_all
    method = f"local programs; lower bound on {divided.boxes} boxes of discs and shafts"
    # of a design that breaks a limit nothing is proven
    is_bounded = design.excess <= KEPT and boxes.coordinates.is_exact
    bound = divided.bound if is_bounded else 0.0
    return Shown(bound, Reach.NEAR if exact and is_bounded else Reach.ASIDE, float(rest), method, prices, by_name)
