"""The nonlinear program of one firing order (S20)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.machine.firing import firing_turns
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.model import Problem
from laufruhe.problem.phasing import Candidate, Intervals, Phasing
from laufruhe.problem.quantity import Quantity
from laufruhe.solvers.domain import Domain
from laufruhe.solvers.nonlinear import NonlinearProgram
from laufruhe.solvers.result import Result
from laufruhe.solvers.uneven_model import Symbols, UnevenModel

Array = NDArray[np.float64]

SOFTNESS = (1e-2, 1e-4, 1e-6)
REACH = math.radians(60.0)
FLOOR = 1e-3
SOFT_LIMIT = 1e-6


class UnevenProgram:
    """The nonlinear program of one firing order, in deviations from the star that it starts from."""

    def __init__(
        self, phasing: Phasing, model: UnevenModel, start: Candidate, intervals: Intervals, even: Result | None
    ) -> None:
        self._phasing, self._start, self._model = phasing, start, model
        self._throws = range(0 if phasing.throw_bounds else 1, len(start.throws))
        self._open_bank = _is_open(phasing.bank)
        self._open_split = _is_open(phasing.split)
        columns = sum(domain.width for domain in model.domains)
        size = len(self._throws) + self._open_bank + self._open_split + columns
        self._x = ca.SX.sym("x", size)
        lower, upper, x0 = self._bounds(columns, even)
        bank, split, throws, unbalances = self._unpacked(self._x)
        symbols = Symbols(throws, bank, split, unbalances)
        softness = ca.SX.sym("e")
        problem = model.problem
        given = [max(term.weight * _size(term.quantity, even, problem), 1e-300) for term in problem.objective]
        objective = sum(
            term.weight * model.norm(term.quantity, symbols, softness * size_of / term.weight)
            for term, size_of in zip(problem.objective, given, strict=True)
        )
        rows, low, high, names = self._firing(symbols, intervals)
        for limit in problem.limits:
            unit = limit.maximum or 1.0
            squares = model.squares(limit.quantity, symbols)
            if squares is None:
                row = model.norm(limit.quantity, symbols, SOFT_LIMIT * unit) / unit
            else:
                row = squares / unit**2
            rows.append(row)
            low += [-math.inf] * row.numel()
            # the slack keeps a design that stands on a limit from breaking it by a rounding
            high += [(limit.maximum / unit) * (1.0 - SOFT_LIMIT)] * row.numel()
            names += [limit.name] * row.numel()
        for domain in model.domains:
            for row, most in _membership(domain, unbalances[domain.columns]):
                rows.append(row)
                low.append(-math.inf)
                high.append(most)
                names.append(domain.decision.name)
        self.nonlinear = NonlinearProgram(
            x=self._x,
            objective=objective,
            lower=lower,
            upper=upper,
            constraints=ca.vertcat(*rows),
            constraint_lower=np.array(low),
            constraint_upper=np.array(high),
            constraint_names=tuple(names),
            scales=np.array([0.1] * (size - columns) + [d.scale for d in model.domains for _ in range(d.width)]),
            objective_scale=max(sum(given), 1e-300),
            parameters=softness,
            stages=tuple((e,) for e in SOFTNESS),
        )
        rng = np.random.default_rng(1964)
        nudges = 0.02 * self.nonlinear.variable_scales * rng.standard_normal((2, size))
        # a star that is its own mirror image may be a saddle: two starts stand beside it
        self.starts = [x0, *(np.clip(x0 + nudge, lower, upper) for nudge in nudges)]

    @property
    def is_fixed(self) -> bool:
        """Whether nothing but unbalances can move."""
        return len(self._throws) + self._open_bank + self._open_split == 0

    def candidate(self, x: Array) -> Candidate:
        """The design of a decision vector."""
        bank, split, throws, _ = self._unpacked(ca.DM(x))
        angles = tuple(float(angle) % math.tau for angle in throws)
        number = None if bank is None else float(bank), None if split is None else float(split)
        return replace(self._start, throws=angles, bank_angle=number[0], split_pin=number[1])

    def _unpacked(self, x: Any) -> tuple[Any, Any, list[Any], Any]:
        count, start = len(self._throws), self._start
        bank, split = start.bank_angle, start.split_pin
        position = count
        if self._open_bank:
            bank = bank + x[position]
            position += 1
        if self._open_split:
            split = split + x[position]
            position += 1
        first = start.throws[0]
        if bank is not None and start.bank_angle is not None:
            # cylinder 1 stays at its dead centre when phi = 0
            first = first + 0.5 * (bank - start.bank_angle)
        if split is not None and start.split_pin is not None:
            first = first + 0.5 * (split - start.split_pin)
        throws = [first] if not self._phasing.throw_bounds else []
        throws += [start.throws[k] + x[j] for j, k in enumerate(self._throws)]
        return bank, split, throws, x[position:]

    def _bounds(self, columns: int, even: Result | None) -> tuple[Array, Array, Array]:
        low, high = [], []
        start, phasing = self._start, self._phasing
        for k in self._throws:
            pair = phasing.throw_bounds[k] if phasing.throw_bounds else None
            low.append(-REACH if pair is None else pair[0] - start.throws[k])
            high.append(REACH if pair is None else pair[1] - start.throws[k])
        for is_open, bounds, given in (
            (self._open_bank, phasing.bank, start.bank_angle),
            (self._open_split, phasing.split, start.split_pin),
        ):
            if is_open and bounds is not None and given is not None:
                low.append(bounds[0] - given)
                high.append(bounds[1] - given)
        x0 = np.zeros(len(low) + columns)
        for domain in self._model.domains:
            low += [domain.decision.lower] if domain.width == 1 else [-domain.scale] * 2
            high += [domain.decision.upper] if domain.width == 1 else [domain.scale] * 2
        if even is not None and columns:
            x0[len(x0) - columns :] = _columns_of(self._model, even)
        lower, upper = np.array(low), np.array(high)
        return lower, upper, np.clip(x0, lower, upper)

    def _firing(self, at: Symbols, intervals: Intervals) -> tuple[list[Any], list[float], list[float], list[str]]:
        """Firing intervals, linear in throws, bank and split pin (S20)."""
        layout, start, cycle = self._model.layout, self._start, self._phasing.cycle
        order = start.firing_order or ()
        turns = firing_turns(layout, start.throws, order)
        moments = []
        for turn, number in zip(turns, order, strict=True):
            k = number - 1
            side = 0.5 if 2 * k < len(layout.pins) else -0.5
            moved = start.throws[layout.pins[k]] - at.throws[layout.pins[k]]
            if at.bank is not None and start.bank_angle is not None:
                moved = moved + side * (at.bank - start.bank_angle)
            if at.split is not None and start.split_pin is not None:
                moved = moved + side * (at.split - start.split_pin)
            moments.append(math.tau * turn + moved)
        following = [*moments[1:], moments[0] + cycle.angle]
        rows = [b - a for a, b in zip(moments, following, strict=True)]
        names = [f"firing interval after cylinder {number}" for number in order]
        return rows, [intervals.least] * len(rows), [intervals.most] * len(rows), names


def _membership(domain: Domain, columns: Any) -> list[tuple[Any, float]]:
    """Smooth rows that keep a complex decision in its disc or sector."""
    if domain.width == 1:
        return []
    rows: list[tuple[Any, float]] = [(ca.sumsqr(columns) / domain.scale**2, 1.0)]
    if len(domain.edges):
        (ax, ay), (bx, by) = domain.edges
        rows.append(((ay * columns[0] - ax * columns[1]) / domain.scale, 0.0))
        rows.append(((bx * columns[1] - by * columns[0]) / domain.scale, 0.0))
    return rows


def _is_open(bounds: tuple[float, float] | None) -> bool:
    return bounds is not None and bounds[0] < bounds[1]


def _size(quantity: Quantity, even: Result | None, problem: Problem) -> float:
    """What a term is measured in: its value in the design as given, never far below it."""
    return (
        evaluate(problem).value(quantity)
        if even is None
        else max(even.final.value(quantity), FLOOR * even.initial.value(quantity))
    )


def _columns_of(model: UnevenModel, result: Result) -> Array:
    """Decision vector of a result of unbalances."""
    entries = iter(result.decisions)
    out = np.zeros(sum(domain.width for domain in model.domains))
    for domain in model.domains:
        size = next(entries).value
        angle = domain.decision.angle[0] if domain.decision.fixed_angle else next(entries).value
        out[domain.columns] = domain.columns_of(size * complex(math.cos(angle), math.sin(angle)))
    return out


def rides_of(phasing: Phasing, candidate: Candidate) -> dict[str, int]:
    """The throw that each rotor turns with: found by moving one throw at a time."""
    out = {}
    still = replace(candidate, firing_order=None, without_gas=True)
    before = _rotor_states(phasing.realise(still))
    for k in range(len(candidate.throws)):
        throws = tuple(angle + (0.1 if j == k else 0.0) for j, angle in enumerate(candidate.throws))
        after = _rotor_states(phasing.realise(replace(still, throws=throws)))
        out.update({name: k for name, state in after.items() if state != before[name]})
    return out


def _rotor_states(problem: Problem) -> dict[str, tuple[complex, ...]]:
    gains: dict[str, list[complex]] = {rotor.name: [] for rotor in problem.engine.rotors}
    for decision in problem.decisions:
        for drive in decision.drives:
            gains[drive.rotor].append(drive.gain)
    return {rotor.name: (rotor.unbalance, *gains[rotor.name]) for rotor in problem.engine.rotors}
