"""Leads of geared shafts: local searches, and boxes of leads that prove the best of them (P13).

What turns with a shaft loads earlier by as much as the shaft leads: of order h by e^{i h d}. On a box of leads with the
middle c and half sides r_s the loads are V(c) + sum_s d_s V_s' and a rest, and any dual rows Z of V(c) tell that

    N(V) >= <Z, V(c)> - sum_s r_s |<Z, V_s'>| - sum_s r_s^2 K_s / 2,                              (P13)

K_s no less than the norm of the second derivative of what shaft s brings, wherever it leads.
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine.leads import led
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import Spectrum, common_base
from laufruhe.problem.decision import LeadDrive
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Measure, load_rows
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.problem import Problem
from laufruhe.prove.best_first import divide
from laufruhe.prove.certificate import Reach, room_of
from laufruhe.solvers.conclusion import KEPT, Design, Shown, concluded, judged
from laufruhe.solvers.result import Result

Array = NDArray[np.float64]

MOST_BOXES = 20_000
GRID, POLISHED = 24, 3
"""Steps of every lead, of few at once, that searches start from, and how many of them end in one."""
MOST_STARTS = 600
SLACK = 1e-6


def solve_leads(problem: Problem) -> Result:
    """The best leads, proven as far as boxes go."""
    started = time.perf_counter()
    search = _Boxes(problem)
    initial = evaluate(problem)
    design = _searched(problem, search)
    value, kept = design.value, design.excess <= KEPT
    room = room_of(value, problem.tolerance, nothing_of(problem))
    most = MOST_BOXES if problem.search.boxes is None else problem.search.boxes
    divided = divide(search, search.lower, search.upper, value if kept else math.inf, room, most)
    bound = divided.bound if kept else 0.0
    shown = Shown(bound, Reach.WHOLE, math.inf, f"local searches; lower bound on {divided.boxes} boxes of leads")
    return concluded(design, initial, shown, {"solve": time.perf_counter() - started})


def _searched(problem: Problem, search: _Boxes) -> Design:
    """The best of the searches from the best points of a grid, and of the design as given, by the exact model."""
    from scipy.optimize import minimize

    count = min(GRID, max(int(MOST_STARTS ** (1.0 / len(search.lower))), 2))
    sides = [np.linspace(a, b, count) for a, b in zip(search.lower, search.upper, strict=True)]
    points = [np.array(point) for point in itertools.product(*sides)]
    points.sort(key=search.penalised)
    bounds: Any = list(zip(search.lower, search.upper, strict=True))
    found = []
    for point in points[:POLISHED]:
        step = 0.5 * (search.upper - search.lower) / count
        simplex = np.clip(np.vstack([point, point + np.diag(step)]), search.lower, search.upper)
        told: Any = {"initial_simplex": simplex, "xatol": 1e-10, "fatol": 1e-12, "maxiter": 2000}
        end = minimize(search.penalised, point, method="Nelder-Mead", bounds=bounds, options=told).x
        found.append(np.clip(end, search.lower, search.upper))
    designs = [judged(problem, [float(x) for x in each]) for each in found]
    designs.append(judged(problem, problem.start))
    return min(designs, key=lambda each: each.rank)


@dataclass(frozen=True, eq=False)
class _Term:
    """A measure as spectra: what stands, and what each shaft brings; per operating point."""

    measure: Measure
    still: list[Spectrum]
    shafts: list[list[Spectrum]]
    bent: Array

    def moved(self, leads: Array, derivative: int | None = None) -> list[Spectrum]:
        """Signals at some leads, or their derivative by one of these."""
        out = []
        for p, still in enumerate(self.still):
            total = still.coefficients if derivative is None else np.zeros_like(still.coefficients)
            for s, own in enumerate(self.shafts):
                if derivative in (None, s):
                    turn = np.exp(1j * own[p].orders * leads[s]) * (1.0 if derivative is None else 1j * own[p].orders)
                    total = total + own[p].coefficients * turn[:, None, None]
            out.append(Spectrum(still.base, total))
        return out


class _Boxes:
    """Bounds of boxes of leads."""

    what, at_once = "boxes of leads", 32

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.lower = np.array([d.lower for d in problem.decisions])
        self.upper = np.array([d.upper for d in problem.decisions])
        self._start = np.array([d.start_number for d in problem.decisions])
        self._samples = problem.fidelity.samples
        self._terms = [(term.weight, self._term(term.measure)) for term in problem.objective]
        self._limits: list[tuple[Limit, _Term]] = [(limit, self._term(limit.measure)) for limit in problem.limits]

    def _term(self, measure: Measure) -> _Term:
        engine = self.problem.engine
        names = [drive.shaft for d in self.problem.decisions for drive in d.drives if isinstance(drive, LeadDrive)]
        # where every lead is zero, each shaft alone, then what stands whatever they are
        bare = led(engine, dict(zip(names, -self._start, strict=True)))
        alone = [
            replace(bare, slider_cranks=tuple(p for p in bare.slider_cranks if p.shaft.name == name),
                    rotors=tuple(r for r in bare.rotors if r.shaft.name == name))
            for name in names
        ]  # fmt: skip
        rest = replace(bare, slider_cranks=tuple(p for p in bare.slider_cranks if p.shaft.name not in names),
                       rotors=tuple(r for r in bare.rotors if r.shaft.name not in names))  # fmt: skip
        found = [evaluate(self.problem, each).signals(measure.load) for each in (rest, *alone)]
        base = common_base([engine.cycle.base_order, *(signal.base for each in found for signal in each)])
        size = max(len(signal.rebased(base).coefficients) for each in found for signal in each)
        still, *shafts = ([_padded(signal.rebased(base), size) for signal in each] for each in found)
        shares = measure.shares(self.problem.points)
        bent = np.array([max((_bend(measure, signal) for signal, w in zip(own, shares, strict=True) if w), default=0.0)
                         for own in shafts])  # fmt: skip
        return _Term(measure, still, shafts, bent)

    def _rows(self, term: _Term, signals: list[Spectrum], averaged: bool = False) -> tuple[Grid, Array]:
        if averaged and term.measure.norm.averages:
            signals = [signal.averaged(signal.period / self._samples) for signal in signals]
        nowhere = [np.zeros(0)] * len(signals)
        rows = load_rows(term.measure, self.problem.points, signals, self.problem.engine, self._samples, nowhere)
        return rows.grid, rows.vectors

    def _value(self, term: _Term, leads: Array) -> float:
        grid, vectors = self._rows(term, term.moved(leads))
        return float(term.measure.norm.value(grid, vectors))

    def penalised(self, leads: Array) -> float:
        """The objective, and what limits are broken by, many times over."""
        inside = np.clip(leads, self.lower, self.upper)
        total = sum(weight * self._value(term, inside) for weight, term in self._terms)
        over = [max(self._value(term, inside) / (limit.maximum or 1.0) - 1.0, 0.0) for limit, term in self._limits]
        return float(total * (1.0 + 1e3 * sum(over)) + sum(over))

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Least objective on every box, infinite where no design is allowed; and the side worth halving."""
        found, sides = [], []
        for low, high in zip(lower, upper, strict=True):
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            total, pull = 0.0, np.zeros(len(low))
            for weight, term in self._terms:
                least, own = self._least(term, middle, half)
                total, pull = total + weight * max(least, 0.0), pull + weight * own
            broken = any(
                self._least(term, middle, half)[0] > limit.maximum * (1.0 + SLACK) for limit, term in self._limits
            )
            found.append(math.inf if broken else total)
            sides.append(int(np.argmax(pull + 1e-12 * half)))
        return np.array(found), np.array(sides, dtype=np.intp)

    def _least(self, term: _Term, middle: Array, half: Array) -> tuple[float, Array]:
        """What a measure does not go under on a box, and what every side takes of it (P13)."""
        norm = term.measure.norm
        grid, at = self._rows(term, term.moved(middle), averaged=True)
        z = norm.dual_feasible(grid, norm.subgradient(grid, at))
        slopes = np.array([
            abs(float(np.vdot(z, self._rows(term, term.moved(middle, s), averaged=True)[1]))) for s in range(len(half))
        ])  # fmt: skip
        taken = half * slopes + 0.5 * half**2 * term.bent
        return float(np.vdot(z, at)) - float(taken.sum()), taken


def _padded(signal: Spectrum, size: int) -> Spectrum:
    """With zeros for the orders that it does not have."""
    out = np.zeros((size, *signal.coefficients.shape[1:]), complex)
    out[: len(signal.coefficients)] = signal.coefficients
    return Spectrum(signal.base, out)


def _bend(measure: Measure, signal: Spectrum) -> float:
    """No less than the norm of the second derivative of a signal by its lead, whatever that is."""
    weights = np.array(measure.direction_weights or (1.0,) * signal.coefficients.shape[2])
    counted = measure.counted(signal.orders)[:, None, None]
    sizes = np.linalg.norm(signal.coefficients * weights * counted, axis=-1) * signal.orders[:, None] ** 2
    if measure.norm.is_euclidean or measure.norm.averages:
        # neither is more than the root mean square, at the place where that is largest
        return float(np.sqrt(np.square(sizes).sum(axis=0)).max(initial=0.0))
    return 2.0 * float(sizes.sum(axis=0).max(initial=0.0))
