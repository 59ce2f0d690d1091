"""Loads of throws as sums of waves of their angles, with coefficients from the exact model (S26).

Whatever turns with a throw loads by order h as c_h e^{i h theta}: its slider-cranks, their gas and the unbalances
that ride on it. A norm of loads is then one of rows that are affine in cos(h theta) and sin(h theta) of
every throw, and in the unbalances.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import MOST_NUMBERS, AffineModel, AffineNorm
from laufruhe.load_models.lone_parts import lone, motored, only_rotors, working
from laufruhe.machine import Engine
from laufruhe.machine.firing_windows import lateness
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.norms.norm import amplitudes, mean_square
from laufruhe.numerics.spectrum import Spectrum, as_order, common_base, orders_equal
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Measure, mass_rows, selected
from laufruhe.problem.problem import Problem

_NOTHING, _FEW = 1e-10, 24
_MANY = 96
_LISTED = 4096
PEAK_STEPS = 2
"""Parts of a step about which peaks are averaged: none is more than the peak, however short."""


@dataclass(frozen=True, eq=False)
class Moving:
    """What turns with one throw and fires once, or rides on it.

    Attributes
    ----------
    pin
        Its throw.
    cylinder
        Its number from 0; None of unbalances.
    angle, lap
        Angle of the throw and whole turns of the firing in the engine that its loads are taken from.
    """

    pin: int
    cylinder: int | None
    engine: Engine
    angle: float
    lap: int


@dataclass(frozen=True, eq=False)
class WaveNorm:
    """N(V0 + B x + sum_p Re sum_h W_ph e^{i h theta_p}), and how far orders left out may move it.

    Attributes
    ----------
    fixed
        V0 and B.
    waves
        W of every moving part, shape (parts, orders, k, d), at theta = 0 and no whole turns.
    left_out
        What the orders that are left out amount to at most [SI].
    """

    fixed: AffineNorm
    waves: ComplexArray
    left_out: float


def averages(problem: Problem, measure: Measure) -> bool:
    """Whether its rows are averages about angles: of means (P7), and of peaks that gas bends, which are no less."""
    bends = problem.has_gas and measure.feels_gas and measure.norm.refinement > 1
    return measure.is_load and (measure.norm.averages or bends)


def averaged(problem: Problem, measure: Measure, signal: Spectrum, samples: int) -> Spectrum:
    """A signal as its rows are taken at so many steps of its period."""
    if not averages(problem, measure):
        return signal
    return signal.averaged(signal.period / (samples if measure.norm.averages else PEAK_STEPS * samples))


class ThrowWaves:
    """Norms of a problem as waves of its throws.

    Attributes
    ----------
    orders
        Of the throw, and of every angle that is open beside throws, in each wave, shape (waves, 1 + open).

    Parameters
    ----------
    problem
        Nothing of its phasing open, its throws anywhere; unbalances that are open ride on no throw.
    layout
        Of its engine.
    rides
        Throw that every rotor turns with; rotors left out stand still.
    """

    share_left_out: tuple[float, float] = 1e-4, 1e-3
    """Of the moving parts' root mean square, that orders left out may hold, of the first few next to nothing; bounds
    are lowered by it. Of many orders more: inside the crankcase a pressure that jumps has no end of them."""
    _followed: tuple[float, float] = 1e-4, 3e-5

    def __init__(self, problem: Problem, layout: Layout, rides: dict[str, int]) -> None:
        self.problem, self.layout = problem, layout
        engine = problem.engine
        self.throws = len(layout.throw_positions)
        still = tuple(replace(rotor, unbalance=0.0j) if rotor.name in rides else rotor for rotor in engine.rotors)
        inside = any(measure.is_inside for measure in problem.measures)
        self.parts = _moving(engine, layout, rides, inside)
        self._alone = [evaluate(self._acting(part), part.engine) for part in self.parts]
        self.rest = AffineModel(replace(motored(problem), engine=only_rotors(engine, still, inside)), keep_all=True)
        self.times = self._kept()
        self.orders = np.array([[float(order)] for order in self.times])
        self._turning = [as_order(abs(rotor.shaft.ratio)) for rotor in still]
        self.base = common_base([order for order in (*self.times, *self._turning, Fraction(1)) if order])
        self.rest.base = self.base

    def _acting(self, part: Moving) -> Problem:
        """What acts on a part alone."""
        if part.cylinder is None:
            return motored(self.problem)
        return working(self.problem, self.problem.engine.slider_cranks[part.cylinder].name)

    @property
    def followed(self) -> float:
        """Of the heaviest order, that one is followed along an arc; others count as their size, more so in peaks."""
        return self._followed[any(map(self._is_bent_peak, self.problem.measures))]

    def _is_bent_peak(self, measure: Measure) -> bool:
        return averages(self.problem, measure) and not measure.norm.averages

    @property
    def _loads(self) -> list[Measure]:
        return [measure for measure in self.problem.measures if measure.is_load]

    def _signals(self, measure: Measure, k: int) -> list[Spectrum]:
        """What counts of one moving part's loads at every operating point that counts."""
        return self.counted(measure, self._alone[k])

    def counted(self, measure: Measure, found: Evaluation) -> list[Spectrum]:
        """What counts of loads at every operating point that counts."""
        engine = self.problem.engine
        shares = measure.shares(self.problem.points)
        return [
            selected(measure, signal, engine)
            for signal, share in zip(found.signals(measure.load), shares, strict=True)
            if share > 0.0
        ]

    def _kept(self) -> tuple[Fraction, ...]:
        """The lowest orders, up to where what follows is next to nothing for every measure."""
        # what rides on a throw turns once a turn
        kept = {Fraction(1)}
        for measure in self._loads:
            squares: dict[Fraction, float] = {}
            for signal in (one for k in range(len(self.parts)) for one in self._signals(measure, k)):
                sizes = np.square(np.abs(signal.coefficients)).reshape(len(signal.coefficients), -1).sum(axis=1)
                for j in np.flatnonzero(sizes):
                    order = int(j) * signal.base
                    squares[order] = squares.get(order, 0.0) + float(sizes[j])
            ordered = sorted(squares)
            tail = np.cumsum([squares[order] for order in ordered[::-1]])[::-1]
            few, many = self.share_left_out
            many = many if measure.is_inside and not self._is_bent_peak(measure) else few
            shares = [_NOTHING if k < _FEW else few if k < _MANY else many for k in range(len(ordered))]
            told = zip(ordered, tail, shares, strict=True)
            kept |= {order for order, rest, share in told if rest > share**2 * tail[0]}
        return tuple(sorted(kept))

    def left_out(self, measure: Measure, samples: int) -> float:
        """What the orders that are left out amount to at most, wherever the throws stand."""
        return sum(self._left_out(measure, k, samples) for k in range(len(self.parts))) if measure.is_load else 0.0

    def _left_out(self, measure: Measure, k: int, samples: int) -> float:
        """Of one part."""
        return self.tail(measure, self._signals(measure, k), samples)

    def tail(self, measure: Measure, signals: Sequence[Spectrum], samples: int) -> float:
        """What the orders that are left out of signals amount to at most, those beyond the last included."""
        total, kept = 0.0, np.array([float(order) for order in self.times])
        for one in signals:
            # of what bends at an angle so many orders are listed that those beyond are next to nothing
            signal = one if one.corners is None else one.extended(_LISTED)
            out = ~orders_equal(signal.orders, kept)
            rest = replace(signal, coefficients=np.where(out[:, None, None], signal.coefficients, 0.0))
            if measure.norm.is_euclidean or measure.norm.averages:
                # neither is more than the root mean square, nor rows of averages more than their lengths
                most = np.sqrt(mean_square(rest))
                if measure.norm.averages:
                    most = np.minimum(most, _averaged(signal, out, samples * float(self.base)))
                total = max(total, float(most.max(initial=0.0)))
                continue
            whole = amplitudes(rest)
            if averages(self.problem, measure):
                whole = _averaged(signal, out, PEAK_STEPS * samples * float(self.base))
            # no peak, nor any peak to peak, is more than twice the sum of the lengths
            total = max(total, 2.0 * float(whole.max(initial=0.0)))
        return total

    def norm(self, measure: Measure, samples: int) -> WaveNorm:
        """A measure at equal steps over the period, means averaged about them so that bounds hold between (P7)."""
        fixed = self.rest.norm(
            measure, samples, averaged=True, peaks=PEAK_STEPS if averages(self.problem, measure) else 0
        )
        count = len(self.parts) * len(self.orders) * fixed.constant.size
        if count > MOST_NUMBERS:
            raise ModelError(f"{2e-6 * count:.0f} million numbers at once")
        waves = np.zeros((len(self.parts), len(self.orders), *fixed.constant.shape), complex)
        for k in range(len(self.parts)):
            self.add(waves[k], measure, k, samples)
        return WaveNorm(fixed, waves, self.left_out(measure, samples))

    def add(self, waves: ComplexArray, measure: Measure, k: int, samples: int) -> None:
        """Rows of one part to those of its waves, shape (waves, k, d)."""
        if self.acts(measure, k):
            waves[:] = self.own_rows(measure, k, samples)

    def acts(self, measure: Measure, k: int) -> bool:
        """Whether a part has to do with a measure."""
        return measure.is_load or (measure.is_mass and self.parts[k].cylinder is None)

    def own_rows(self, measure: Measure, k: int, samples: int) -> ComplexArray:
        """Rows of every order of a part at theta = 0 and no whole turns, shape (orders, k, d)."""
        part = self.parts[k]
        if measure.is_load:
            rows = [self.coefficients(signal) for signal in self._alone[k].signals(measure.load)]
            return self.rows_of(measure, rows, samples) * self._turned(part)
        first = np.array([order == 1 for order in self.times])
        return np.asarray(first[:, None, None] * self._turned(part) * self._weights(measure, part))

    def _weights(self, measure: Measure, part: Moving) -> ComplexArray:
        """Rows of the masses that ride on a throw, which turn with it."""
        engine = self.problem.engine
        riding = {rotor.name: rotor.unbalance for rotor in part.engine.rotors}
        rows = [
            mass_rows(measure, [replace(r, unbalance=turn * riding.get(r.name, 0.0)) for r in engine.rotors]).vectors
            for turn in (1.0, 1.0j)
        ]
        return np.asarray(rows[0] - 1j * rows[1])

    def coefficients(self, signal: Spectrum) -> ComplexArray:
        """Of the orders that are kept, shape (orders, places, d)."""
        return np.array([signal.at(float(order)) for order in self.times])

    def rows_of(
        self, measure: Measure, own: Sequence[ComplexArray], samples: int
    ) -> ComplexArray:  # fmt: skip
        """Rows of every order of coefficients at the operating points, shape (orders, k, d)."""
        steps, times = [round(order / self.base) for order in self.times], np.array([float(t) for t in self.times])
        angles = math.tau / float(self.base) * np.arange(samples) / samples
        waves, blocks = np.exp(1j * np.outer(times, angles)), []
        for values, share in zip(own, measure.shares(self.problem.points), strict=True):
            series = np.zeros((max(steps) + 1, *values.shape[1:]), complex)
            series[steps] = values
            one = averaged(self.problem, measure, Spectrum(self.base, series), samples)
            # as load_rows has them: what counts of every place, at one angle after the other
            counted = selected(measure, one, self.problem.engine).coefficients[steps]
            if share > 0.0 and counted.shape[1]:
                rows = np.einsum("hpd,hs->hpsd", counted, waves)
                blocks.append(rows.reshape(len(steps), -1, counted.shape[-1]))
        return np.concatenate(blocks, axis=1) if blocks else np.zeros((len(steps), 1, 1), complex)

    def _turned(self, part: Moving) -> ComplexArray:
        """Every order back to theta = 0 and no whole turns, shape (orders, 1, 1)."""
        times = np.array([float(order) for order in self.times])
        return np.asarray(np.exp(-1j * times * (part.angle - math.tau * part.lap))[:, None, None])

    def arcs(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Bounds of the throws in a box of all angles, as the unbalances that ride on them know them [rad]."""
        return lower, upper

    def samples(self, measure: Measure, wanted: int) -> int:
        """Steps at which squares are exact, or as many as wanted."""
        turning = (*self.times, *self._turning)
        highest = max((order for order in turning if measure.counted([float(order)])[0]), default=Fraction(1))
        return 2 * int(highest / self.base) + 2 if measure.norm.is_euclidean else wanted


def _averaged(signal: Spectrum, out: Mask, steps: float) -> Array:
    """What averages, about so many angles a turn, have at most of some orders and of those beyond all listed."""
    sizes = np.linalg.norm(signal.coefficients[out], axis=-1)
    whole = np.sinc(signal.orders[out] / steps) ** 2 @ sizes
    if signal.corners is None:
        return np.asarray(whole)
    count, base = len(signal.coefficients), float(signal.base)
    further = signal.corners.beyond_averaged(count, base, steps / base)
    return np.asarray(whole + np.linalg.norm(further, axis=-1))


def _moving(engine: Engine, layout: Layout, rides: dict[str, int], inside: bool) -> list[Moving]:
    """Every cylinder, and what rides on every throw; for loads inside the crankcase with the places of the others."""
    out, angles, late = [], {}, lateness(layout)
    for k, (part, pin) in enumerate(zip(engine.slider_cranks, layout.pins, strict=True)):
        angles[pin] = part.throw - layout.pin_offsets[k]
        lap = round((part.firing_angle + late[k] + angles[pin]) / math.tau)
        out.append(Moving(pin, k, lone(engine, k, inside), angles[pin], lap))
    for pin in sorted(set(rides.values())):
        riding = tuple(rotor for rotor in engine.rotors if rides.get(rotor.name) == pin and rotor.unbalance)
        if riding:
            out.append(Moving(pin, None, only_rotors(engine, riding, inside), angles[pin], 0))
    return out
