"""Lower bounds over the lead angle of a crank that shares gas chambers with another crank (P15).

In the mixed cycle the pressure p is the same function of v, the volume over the displacement, for every lead d. Only v
depends on d. x_1 and x_2 are the travels of the fixed and the leading piston, both towards their cranks, and
X = x_1 + x_2. A is the piston area, p_c the crankcase pressure, and gamma the crank angle. The torque T is

    T = A (p - p_c) X'(gamma),       dT/dd = A p'(v) v_d X' + A (p - p_c) x_2'',
    v_d = (x_2' - x_2'(top) - v (x_2'(bottom) - x_2'(top))) / H,       H = X(bottom) - X(top),

because the minimum of X over angles moves by no more than X itself. p jumps at dead centres alone, where X' = 0, so
that the change of T follows from dT/dd. d and gamma are divided into cells. The value in the middle of a cell and the
next derivative bound every factor. A norm then changes by at most the norm of the changes of mass loads and torques.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.extensions.phase_leads.model import PhaseLeadModel
from laufruhe.machine import Cycle, Engine, OperatingPoint, Seiliger, SliderCrank, kinematics
from laufruhe.machine.facing import Facing
from laufruhe.machine.gas.seiliger import seiliger_cut_off
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid, lengths
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.mounting import mounting_of
from laufruhe.physics.rigid_body import ROLL
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Measure, load_rows, narrow_signal
from laufruhe.problem.problem import Problem

CELLS = 1440
"""Cells of one turn of the crank."""
_STEPS = 256


def _travel(radius: float, ratio: float, angle: Array | float) -> tuple[Array, Array, Array]:
    # travel of a piston towards its crank [m], and its first two derivatives by the crank angle
    shape = np, np.asarray(angle), ratio
    laws = kinematics.travel, kinematics.piston_velocity, kinematics.piston_acceleration
    travel, velocity, acceleration = (np.asarray(radius * law(*shape)) for law in laws)
    return travel, -velocity, -acceleration


def _largest_derivatives(radius: float, ratio: float) -> list[float]:
    # upper bounds of the first three derivatives of the travel [m]: sums of amplitudes of orders
    travel, _, _ = _travel(radius, ratio, math.tau * np.arange(_STEPS) / _STEPS)
    orders = np.abs(np.fft.rfft(travel))[1:] * (2.0 / _STEPS)
    return [float(np.arange(1, len(orders) + 1) ** power @ orders) for power in (1, 2, 3)]


def torque_change(gas: Seiliger, part: SliderCrank, cycle: Cycle, half: float) -> Array:
    """Return an upper bound of the change of gas torque of two pistons that share a chamber [N m], shape (cells,).

    The cells are equal parts of a cycle from the dead centre of `part`. The crank of `part` is fixed, and the lead
    angle of the other piston's crank changes by at most `half` [rad].
    """
    facing, chamber, ratio = part.facing, part.swept.chamber, part.shaft.ratio
    assert isinstance(facing, Facing)
    count = CELLS * cycle.turns
    near, ahead = (part.crank_radius, part.rod_ratio), facing.ahead
    far = facing.crank_radius, facing.crank_radius / facing.rod_length
    gamma, g = cycle.angle * (np.arange(count) + 0.5) / count, 0.5 * cycle.angle / count
    (m1, m2, _), (n1, n2, n3) = _largest_derivatives(*near), _largest_derivatives(*far)
    ends = np.array([ratio * angle for angle in chamber.dead_centres])
    (top, bottom), (at_near, *_), (at_far, (first, last), _) = ends, _travel(*near, ends), _travel(*far, ends + ahead)
    minimum, stroke = float(at_near[0] + at_far[0]), float(np.diff(at_near + at_far)[0])
    # both dead centres move by no more than the lead
    grows, loose = last - first, 4.0 * half * n2
    narrow = stroke - half * (abs(grows) + loose)
    if narrow <= 0.0:
        return np.full(count, math.inf)
    (travel, slope, _), (far_travel, rate, bend) = _travel(*near, gamma), _travel(*far, gamma + ahead)
    swept = (travel + far_travel - minimum) / stroke
    rough = (half * 4.0 * n1 + g * (m1 + n1)) / narrow
    off = (g + half) * n2 + 2.0 * half * n2 + rough * (abs(grows) + loose) + loose
    moved = (np.abs(rate - first - swept * grows) + off) / narrow
    opening = np.abs(slope + rate) + g * (m2 + n2) + half * n2
    wide = half * moved + g * opening / narrow
    small = 1.0 / (gas.compression_ratio - 1.0)
    over, steep = _pressed(gas, cycle, np.maximum(swept - wide, 0.0) + small, swept + wide + small,
                           _strokes(gamma, top, bottom, g + half, cycle))  # fmt: skip
    change = steep * moved * opening + over * (np.abs(bend) + (g + half) * n3)
    return np.asarray(half * part.piston_area * change)


def _strokes(gamma: Array, top: float, bottom: float, margin: float, cycle: Cycle) -> tuple[NDArray[np.bool_], ...]:
    # cells in which a chamber may compress, expand, or be open
    since = np.mod(gamma - (bottom - math.tau) + margin, cycle.angle) - margin
    up, down = top - bottom + math.tau, math.tau
    ends = cycle.angle - margin
    compressing = (since <= up + margin) | (since >= ends)
    expanding = (since >= up - margin) & (since <= down + margin)
    is_open = (since >= down - margin) | (since <= margin)
    return compressing, expanding | ((since <= margin) | (since >= ends)) & (cycle.turns == 1), is_open


def _pressed(
    gas: Seiliger, cycle: Cycle, low: Array, high: Array, strokes: Sequence[NDArray[np.bool_]]
) -> tuple[Array, Array]:
    """Return upper bounds of the pressure difference at the pistons [Pa], and of its slope by relative volume.

    The relative volumes lie between `low` and `high`, shape (cells,). `strokes` are the masks of `_strokes`.
    """
    small = 1.0 / (gas.compression_ratio - 1.0)
    n1, n2, cut = gas.compression_exponent, gas.expansion_exponent, small * seiliger_cut_off(gas, cycle)
    squeezed, later = (gas.intake_pressure * ((1.0 + small) / v) ** n1 for v in (low, high))
    burnt = np.maximum(low, cut)
    spent, last = (gas.peak_pressure * np.minimum(1.0, cut / v) ** n2 for v in (burnt, high))
    constant = np.full_like(low, gas.intake_pressure), np.full_like(low, gas.exhaust_pressure)
    ends = ((squeezed, later), (spent, last), constant)
    slopes = (n1 * squeezed / low, np.where(high > cut, n2 * spent / burnt, 0.0), np.zeros_like(low))
    over, steep = np.zeros_like(low), np.zeros_like(low)
    for is_in_stroke, pair, slope in zip(strokes, ends, slopes, strict=True):
        maximum = np.maximum(*(np.abs(pressure - gas.crankcase_pressure) for pressure in pair))
        over = np.maximum(over, np.where(is_in_stroke, maximum, 0.0))
        steep = np.maximum(steep, np.where(is_in_stroke, slope, 0.0))
    return over, steep


class SharedGasBoxes:
    """Lower bounds of the objective on boxes of lead angles between cranks that share gas chambers."""

    what = "boxes of leads"
    batch_size = 1

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        motored = replace(problem, points=tuple(replace(point, gas=None) for point in problem.points))
        self._model = PhaseLeadModel(motored)
        self._names = self._model.names
        if not all(isinstance(model, Seiliger) for point in problem.points for model in point.gas_models):
            raise ModelError(
                "an open lead angle between two cranks that share gas chambers needs the gas model seiliger"
            )
        self._fixed = self._fixed_pistons(problem.engine)
        self._masses = {m: [self._slope(m, s) for s in range(len(self._names))] for m in self._measures}
        self._gains = {m: [self._gain(m, point) for point in problem.points] for m in self._measures}

    @property
    def _measures(self) -> list[Measure]:
        return list(dict.fromkeys(measure for measure in self.problem.measures if measure.is_load))

    def _fixed_pistons(self, engine: Engine) -> list[str]:
        """Return the name of the piston whose crank has no open lead angle, for every chamber of two pistons."""
        fixed = []
        for part in engine.slider_cranks:
            for other in engine.slider_cranks:
                if other is not part and part.faces(other):
                    have_leads = part.shaft.name in self._names, other.shaft.name in self._names
                    if have_leads == (True, True):
                        names = f"{part.shaft.name} and {other.shaft.name}"
                        raise ModelError(
                            f"{names} share a gas chamber, and the lead angles of both cranks are open; fix one of them"
                        )
                    if have_leads[1]:
                        fixed.append(part.name)
        parts_with_leads = (part for part in engine.slider_cranks if part.shaft.name in self._names)
        for part in parts_with_leads:
            if not any(part.faces(other) for other in engine.slider_cranks if other is not part):
                why = "has an open lead and gas of its own, while other chambers are shared; fix its lead"
                raise ModelError(f"{part.shaft.name} {why}")
        return fixed

    def _slope(self, measure: Measure, shaft: int) -> float:
        # upper bound of the slope of a norm by the lead of the masses on a shaft [1/rad]
        shares = measure.shares(self.problem.points)
        derivatives = [signal.derivative for signal in self._model.counted(measure, shaft)]
        return float(measure.norm.upper_bound(derivatives, shares[shares > 0.0]))

    def _gain(self, measure: Measure, point: OperatingPoint) -> Array:
        # load of a unit roll moment at every counted place, shape (places,)
        engine, fidelity = self.problem.engine, self.problem.fidelity
        wrench = Spectrum(engine.cycle.base_order, np.stack([0.0 * ROLL, ROLL]).astype(complex))
        mounting = mounting_of(engine, fidelity) if engine.mounts else None
        forces = mounting.forces(wrench, point.speed) if mounting is not None else None
        loads = PointLoads(point, wrench, forces, None, engine, fidelity)
        signal = narrow_signal(measure.with_all_orders, measure.load.signal(loads), engine)
        return lengths(signal.coefficients[1].real)

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Return lower bounds of boxes of leads [rad], shape (boxes, leads), and the sides to halve.

        A bound is infinite if no design of its box is feasible.
        """
        bounds = [self._bound(0.5 * (a + b), 0.5 * (b - a)) for a, b in zip(lower, upper, strict=True)]
        return np.array(bounds), np.argmax(upper - lower, axis=1)

    def _bound(self, middle: Array, half: Array) -> float:
        try:
            evaluation = evaluate(self.problem, self.problem.design([float(x) for x in middle]))
        except ModelError:
            # the middle has no evaluation, but other leads may have one
            return 0.0
        changes = self._torques(evaluation.engine, float(half.sum()))

        def minimum(measure: Measure) -> float:
            if not measure.is_load:
                return evaluation.value(measure)
            signals = evaluation.signals(measure.load)
            if measure.norm.averages:
                signals = [signal.averaged(signal.period / evaluation.samples) for signal in signals]
            rows = load_rows(measure, self.problem.points, signals, evaluation.engine, evaluation.samples)
            mass_change = float(half @ np.array(self._masses[measure]))
            return rows.value - mass_change - self._gas_change(measure, changes)

        limits = [limit for limit in self.problem.limits if limit.measure.is_load or limit.measure.is_mass]
        if any(minimum(limit.measure) > limit.maximum * (1.0 + 1e-6) for limit in limits):
            return math.inf
        return max(sum(term.weight * minimum(term.measure) for term in self.problem.objective), 0.0)

    def _torques(self, engine: Engine, half: float) -> list[Array]:
        """Return upper bounds of the change of gas torque of shared chambers [N m], (cells,) per operating point."""
        torques = []
        for point in self.problem.points:
            total = np.zeros(CELLS * engine.cycle.turns)
            gas = self.problem.fidelity.gas_of(point)
            for part in engine.slider_cranks:
                model = gas and gas.of_cylinder(part.name)
                if part.name in self._fixed and isinstance(model, Seiliger):
                    change = torque_change(model, part, engine.cycle, half)
                    place = math.floor(part.firing_angle / engine.cycle.angle * len(total))
                    total = total + np.maximum(np.roll(change, place), np.roll(change, place + 1))
            torques.append(total)
        return torques

    def _gas_change(self, measure: Measure, changes: Sequence[Array]) -> float:
        """Return an upper bound of the change of a measure [SI] by torque changes, (cells,) per operating point."""
        shares, gains, norm = measure.shares(self.problem.points), self._gains[measure], measure.norm
        squares = [float(np.mean(change**2)) for change in changes]
        if norm.refinement == 1:
            return math.sqrt(
                sum(w * float(np.mean(k**2)) * s for w, k, s in zip(shares, gains, squares, strict=True) if w)
            )
        # a change less its mean is at most its largest value and its mean together
        tops = [float(change.max() + measure.alternating * change.mean()) for change in changes]
        if measure.orders is not None:
            tops = [math.sqrt(2.0 * len(measure.orders) * square) for square in squares]
        twice = norm.value(Grid(np.ones(2), 2), np.array([[1.0], [-1.0]]))
        return twice * max((float(k.max()) * t for w, k, t in zip(shares, gains, tops, strict=True) if w), default=0.0)
