"""The nonlinear program of one firing order (S20)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.domain import Domain
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.load_models.uneven_model import Symbols, UnevenModel
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Quantity
from laufruhe.problem.phasing import Candidate, Intervals, Phasing
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import FLOOR
from laufruhe.solvers.nonlinear import NonlinearProgram
from laufruhe.solvers.result import Result

Array = NDArray[np.float64]

SOFTNESS = (1e-2, 1e-4, 1e-6)
SOFT_LIMIT = 1e-6


class UnevenProgram:
    """The nonlinear program of one firing order, in deviations from the star that it starts from."""

    def __init__(
        self, phasing: Phasing, model: UnevenModel, start: Candidate, intervals: Intervals, even: Result | None
    ) -> None:
        self._moves, self._model = ThrowMoves(phasing, model.layout, start, intervals), model
        columns = sum(domain.width for domain in model.domains)
        size = self._moves.size + columns
        self._x = ca.SX.sym("x", size)
        lower, upper, x0 = self._bounds(columns, even)
        unbalances = self._x[self._moves.size :]
        symbols = Symbols(*self._moves.angles(self._x), unbalances)
        softness = ca.SX.sym("e")
        problem = model.problem
        given = [max(term.weight * _size(term.quantity, even, problem), 1e-300) for term in problem.objective]
        objective = sum(
            term.weight * model.norm(term.quantity, symbols, softness * size_of / term.weight)
            for term, size_of in zip(problem.objective, given, strict=True)
        )
        rows, names = self._moves.firing(self._x)
        low, high = [intervals.least] * len(rows), [intervals.most] * len(rows)
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
        return self._moves.size == 0

    def candidate(self, x: Array) -> Candidate:
        """The design of a decision vector."""
        return self._moves.candidate(x)

    def _bounds(self, columns: int, even: Result | None) -> tuple[Array, Array, Array]:
        low, high = self._moves.lower.tolist(), self._moves.upper.tolist()
        x0 = np.zeros(len(low) + columns)
        for domain in self._model.domains:
            low += [domain.decision.lower] if domain.width == 1 else [-domain.scale] * 2
            high += [domain.decision.upper] if domain.width == 1 else [domain.scale] * 2
        if even is not None and columns:
            x0[len(x0) - columns :] = _columns_of(self._model, even)
        lower, upper = np.array(low), np.array(high)
        return lower, upper, np.clip(x0, lower, upper)


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
