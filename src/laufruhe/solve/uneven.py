"""Throws that leave the even steps within bounded firing intervals (S19-S21).

From every good even star a smooth program seeks a local optimum with its firing order
kept: intervals are then linear in the angles. The design returned is never worse than
the even star it started from, because the exact model compares the two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError, SolverError
from laufruhe.machine.firing import firing_turns, intervals_of
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.model import Problem
from laufruhe.problem.phasing import Candidate, Intervals, OrderCriterion, Phasing
from laufruhe.problem.quantity import Quantity
from laufruhe.solve.certificate import Certificate, Proof
from laufruhe.solve.domain import Domain
from laufruhe.solve.nonlinear import NonlinearProgram, solve_nonlinear
from laufruhe.solve.ranking import PhasingResult, RankedStar, TradePoint, ranked_orders, ranked_star
from laufruhe.solve.result import ObjectiveValue, Result, Status
from laufruhe.solve.unbalances import objective_name
from laufruhe.solve.uneven_model import Symbols, UnevenModel

Array = NDArray[np.float64]

STARTS = 6
SOFTNESS = (1e-2, 1e-4, 1e-6)
FLOOR = 1e-3
SOFT_LIMIT = 1e-6
REACH = math.radians(60.0)
FEASIBLE = 1e-6
TRADE_STEPS = (0.0, 0.125, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class Start:
    """A star and its firing order to start from."""

    candidate: Candidate


@dataclass(frozen=True, eq=False)
class Uneven:
    """A local optimum, its unbalances solved once more as a convex problem.

    Attributes
    ----------
    candidate
        Throws, order, bank and split pin.
    result
        Of the problem with these throws fixed.
    kkt_residual
        Of the nonlinear program; zero for a star that was not moved.
    moved
        Whether it is better than the star it started from.
    """

    candidate: Candidate
    result: Result
    kkt_residual: float
    moved: bool

    @property
    def value(self) -> float:
        """Objective by the exact model [SI]."""
        return self.result.objective.value if self.result.objective is not None else math.inf


def solve_uneven(problem: Problem, phasing: Phasing, even: Result | None) -> Result:
    """The best of the local optima that the even stars lead to.

    Parameters
    ----------
    problem, phasing
        What is open.
    even
        Result of the even stars, ranked; None where none exists or throws have bounds of
        their own.

    Raises
    ------
    SolverError
        If no start leads anywhere.
    """
    starts = _starts(phasing, even)
    if not starts:
        from laufruhe.solve.phasing import _none

        return _none(problem, "no star and firing order to start from keeps the firing intervals allowed")
    found = [answer for start in starts[:STARTS] if (answer := local_optimum(phasing, start, phasing.intervals))]
    if not found:
        raise SolverError("no start of the nonlinear program ended at a design that keeps the limits")
    found.sort(key=lambda answer: answer.value)
    trade = _trade(phasing, starts, found) if even is not None else ()
    return _result(problem, phasing, even, found, trade)


def local_optimum(phasing: Phasing, start: Start, intervals: Intervals) -> Uneven | None:
    """The local optimum that one star leads to; the star itself where nothing is better (S20)."""
    best = _evaluated(phasing, start.candidate, 0.0, moved=False)
    if best is not None and not intervals.holds(_intervals(phasing, start.candidate), 1e-7):
        best = None
    if intervals.forbid_unevenness and phasing.throw_bounds is None:
        return best
    problem = replace(phasing.realise(start.candidate), phasing=None)
    layout = phasing.layout(start.candidate.bank_angle, start.candidate.split_pin)
    model = UnevenModel(problem, layout, _rides(phasing, start.candidate))
    program = _Program(phasing, model, start.candidate, intervals, best)
    if program.is_fixed:
        return best
    for optimum in solve_nonlinear(program.nonlinear, program.starts, workers=1, max_seconds=30.0):
        if not optimum.usable:
            continue
        candidate = program.candidate(optimum.x)
        answer = _evaluated(phasing, candidate, optimum.kkt_residual, moved=True)
        if answer is None or not intervals.holds(_intervals(phasing, candidate), 1e-7):
            continue
        if best is None or answer.value < best.value * (1.0 - 1e-9):
            best = answer
    return best


def _evaluated(phasing: Phasing, candidate: Candidate, residual: float, moved: bool) -> Uneven | None:
    """A design by the exact model, its unbalances at their proven optimum; None if it breaks a limit."""
    from laufruhe.solve.phasing import solve_fixed

    try:
        result = solve_fixed(replace(phasing.realise(candidate), phasing=None))
    except ModelError:
        return None
    limits = result.problem.limits
    if result.objective is None or result.status in (Status.INFEASIBLE, Status.FAILED):
        return None
    if any(result.final.value(limit.quantity) > limit.maximum * (1.0 + FEASIBLE) for limit in limits):
        return None
    return Uneven(candidate, result, residual, moved)


def _intervals(phasing: Phasing, candidate: Candidate) -> tuple[float, ...]:
    layout = phasing.layout(candidate.bank_angle, candidate.split_pin)
    turns = firing_turns(layout, candidate.throws, candidate.firing_order or ())
    return intervals_of(phasing.cycle, turns)


def _rides(phasing: Phasing, candidate: Candidate) -> dict[str, int]:
    """The throw that each rotor turns with: found by moving one throw at a time."""
    out = {}
    still = replace(candidate, firing_order=None, motored=True)
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


class _Program:
    """The nonlinear program of one firing order, in deviations from the star that it starts from."""

    def __init__(
        self, phasing: Phasing, model: UnevenModel, start: Candidate, intervals: Intervals, even: Uneven | None
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

    def _bounds(self, columns: int, even: Uneven | None) -> tuple[Array, Array, Array]:
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
            x0[len(x0) - columns :] = _columns_of(self._model, even.result)
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


def _size(quantity: Quantity, even: Uneven | None, problem: Problem) -> float:
    """What a term is measured in: its value in the design as given, never far below it."""
    return (
        evaluate(problem).value(quantity)
        if even is None
        else max(even.result.final.value(quantity), FLOOR * even.result.initial.value(quantity))
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


def _starts(phasing: Phasing, even: Result | None) -> list[Start]:
    """Designs to start from: the ranked even stars, or the middle of the throws' own bounds."""
    if even is not None and even.phasing is not None:
        return [
            Start(
                Candidate(s.throws, s.firing_orders[0].order, s.bank_angle, s.split_pin, _left_out(phasing, s.shafts))
            )
            for s in even.phasing.ranking
            if s.firing_orders
        ]
    out = []
    free = replace(phasing, intervals=Intervals(0.0, math.inf), criteria=(OrderCriterion.ROLL_MOMENT,))
    for bank in _ends(phasing.bank):
        for split in _ends(phasing.split):
            layout = phasing.layout(bank, split)
            throws = tuple(0.5 * (low + high) for low, high in phasing.throw_bounds or ())
            if not throws:
                count = len(layout.throw_positions)
                throws = tuple(layout.banks[0] - layout.pin_offsets[0] + math.tau * k / count for k in range(count))
            orders, _ = ranked_orders(free, layout, throws, None)
            # the order whose intervals are nearest to those allowed
            orders = tuple(sorted(orders, key=lambda o: _outside(phasing.intervals, o.intervals)))
            out += [Start(Candidate(throws, o.order, bank, split)) for o in orders[:2]]
    return out


def _outside(allowed: Intervals, intervals: Sequence[float]) -> float:
    return round(sum(max(allowed.least - i, 0.0) + max(i - allowed.most, 0.0) for i in intervals), 9)


def _ends(bounds: tuple[float, float] | None) -> list[float | None]:
    if bounds is None:
        return [None]
    return [bounds[0]] if bounds[0] == bounds[1] else [bounds[0], 0.5 * (bounds[0] + bounds[1]), bounds[1]]


def _left_out(phasing: Phasing, shafts: Sequence[str]) -> tuple[str, ...]:
    return tuple(name for names in phasing.shafts.optional for name in names if name not in shafts)


def _trade(phasing: Phasing, starts: Sequence[Start], found: Sequence[Uneven]) -> tuple[TradePoint, ...]:
    """The least objective found for less and less unevenness; never worse for more of it."""
    even = phasing.even_interval
    allowed = max(even - phasing.intervals.least, phasing.intervals.most - even)
    if not math.isfinite(allowed):
        return ()
    out: list[TradePoint] = []
    for share in TRADE_STEPS:
        low = even - share * (even - phasing.intervals.least)
        high = even + share * (phasing.intervals.most - even)
        answers = (
            list(found)
            if share == 1.0
            else [answer for s in starts[:3] if (answer := local_optimum(phasing, s, Intervals(low, high))) is not None]
        )
        if not answers:
            continue
        best = min(answers, key=lambda answer: answer.value)
        if out and out[-1].value < best.value:
            out.append(replace(out[-1], allowed=share * allowed))
            continue
        intervals = _intervals(phasing, best.candidate)
        deviation = max(abs(i - even) for i in intervals)
        deviation = deviation if deviation > 1e-9 else 0.0
        out.append(TradePoint(share * allowed, deviation, best.value, best.candidate.throws, best.kkt_residual))
    return tuple(out)


def _result(
    problem: Problem, phasing: Phasing, even: Result | None, found: Sequence[Uneven], trade: tuple[TradePoint, ...]
) -> Result:
    from laufruhe.solve.phasing import phase_decisions

    best = found[0]
    layout = phasing.layout(best.candidate.bank_angle, best.candidate.split_pin)
    given = even.initial if even is not None else evaluate(problem)
    initial = objective_value(problem, given)
    measure = max(best.value, FLOOR * initial) or 1.0
    # no norm lies under zero: who reaches it is done
    gap = best.value / measure
    proven = gap <= problem.tolerance
    shafts = [n for names in phasing.shafts.optional for n in names if n not in best.candidate.left_out]
    method = f"IPOPT from {len(found)} star(s), firing orders kept; no norm lies under zero"
    certificate = Certificate(Proof.GLOBAL if proven else Proof.LOCAL, 0.0, gap, best.kkt_residual, method)
    details = PhasingResult(
        ranking=tuple(_entry(phasing, answer) for answer in found),
        places=layout.throw_positions,
        banks=layout.banks,
        designs=even.phasing.designs if even is not None and even.phasing is not None else len(found),
        looked_at=len(found),
        method=method,
        trade=trade,
        even_value=even.objective.value if even is not None and even.objective is not None else None,
    )
    result = best.result
    return replace(
        result,
        problem=replace(result.problem, phasing=phasing),
        status=Status.OPTIMAL if proven else Status.FEASIBLE,
        objective=ObjectiveValue(objective_name(problem), best.value, problem.objective[0].quantity.unit, initial),
        certificate=certificate,
        decisions=(*phase_decisions(problem, phasing, best.candidate, shafts), *result.decisions),
        initial=replace(given, samples=result.final.samples),
        phasing=details,
    )


def _entry(phasing: Phasing, answer: Uneven) -> RankedStar:
    c = answer.candidate
    layout = phasing.layout(c.bank_angle, c.split_pin)
    only = replace(phasing, firing_order=c.firing_order)
    shafts = tuple(n for names in phasing.shafts.optional for n in names if n not in c.left_out)
    return ranked_star(
        only, layout, c.throws, None, answer.value, 0.0, False, shafts, (c.bank_angle, c.split_pin)
    )  # fmt: skip
