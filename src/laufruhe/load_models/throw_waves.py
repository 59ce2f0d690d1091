"""Loads of throws as sums of waves of their angles, with coefficients from the exact model (S26, S30).

Whatever turns with a throw loads by order h as c_h e^{i h theta}: its slider-cranks, their gas and the unbalances
that ride on it. A norm of loads is then one of rows that are affine in cos(h theta) and sin(h theta) of
every throw, and in the unbalances.

Where the bank angle is open, a cylinder alone with its axis upright loads by A, with the axis a quarter turn further by
B, and in roll by C. On the bank b = s beta its axis leans by b, and it is later by b: order h is e^{i h (theta - b)}
times A_h cos b + B_h sin b + C_h, waves of b of the orders h - 1, h and h + 1. A split pin makes it later alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import MOST_NUMBERS, AffineModel, AffineNorm
from laufruhe.load_models.isolated_cylinders import QUARTERS, isolate, leaning, motored, only_rotors, working
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.norms.norm import amplitudes, mean_square
from laufruhe.numerics.spectrum import Spectrum, as_order, common_base, orders_equal
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Measure, mass_rows, narrow_signal
from laufruhe.problem.problem import Problem

_NOTHING, _FEW = 1e-10, 24
_MANY = 96
_LISTED = 4096
Wave = tuple[Fraction, ...]
PEAK_STEPS = 2
"""Parts of a step about which peaks are averaged: none is more than the peak, however short."""


@dataclass(frozen=True, eq=False)
class Moving:
    """A cylinder that turns with one throw, or the unbalances that ride on it.

    Attributes
    ----------
    pin
        Its throw.
    cylinder
        Its number from 0; None of unbalances.
    found
        Its loads alone; where the bank angle is open, of a cylinder upright, a quarter turn further and upside down.
    ahead
        Angle that makes them those at theta = 0, no whole turns and open angles at zero [rad].
    riding
        Unbalances by the names of their rotors.
    """

    pin: int
    cylinder: int | None
    found: tuple[Evaluation, ...]
    ahead: float
    riding: dict[str, complex]


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
    """Return True if the rows are averages about angles: of means (P7), or of peaks that gas bends (no less)."""
    bends = problem.has_gas and measure.depends_on_gas and measure.norm.refinement > 1
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
    is_geometry_open
        Whether the bank angle and split pins are open.
    turns
        What an open angle adds to every throw: side of cylinder 1 where throws are counted from its dead centre.
    """

    share_left_out: tuple[float, float] = 1e-4, 1e-3
    """Of the moving parts' root mean square, that orders left out may hold, of the first few next to nothing; bounds
    are lowered by it. Of many orders more: inside the crankcase a pressure that jumps has no end of them."""
    _followed: tuple[float, float] = 1e-4, 3e-5

    def __init__(
        self, problem: Problem, layout: Layout, rides: dict[str, int],
        is_geometry_open: tuple[bool, bool] = (False, False), turns: float = 0.0,
    ) -> None:  # fmt: skip
        self.problem, self.layout, self._is_geometry_open, self._turns = problem, layout, is_geometry_open, turns
        self.throws = len(layout.throw_positions)
        if any(is_geometry_open) and self.throws == 1:
            # one throw is cheap to follow
            self.share_left_out, self._followed = (1e-6, 1e-6), (1e-9, 1e-9)
        engine = problem.engine
        still = tuple(replace(rotor, unbalance=0.0j) if rotor.name in rides else rotor for rotor in engine.rotors)
        inside = any(measure.is_inside for measure in problem.measures)
        self.parts = [*self._cylinders(inside), *self._riding(rides, inside)]
        self.rest = AffineModel(replace(motored(problem), engine=only_rotors(engine, still, inside)), keep_all=True)
        self.times = self._kept()
        every = sorted({wave for part in self.parts for wave, *_ in self._waves_of(part)})
        self.orders = np.array([[float(order) for order in wave] for wave in every])
        self._place_of = {wave: place for place, wave in enumerate(every)}
        self._turning = [as_order(abs(rotor.shaft.ratio)) for rotor in still]
        self.base = common_base([order for order in (*self.times, *self._turning, Fraction(1)) if order])
        self.rest.base = self.base

    def _cylinders(self, inside: bool) -> Iterator[Moving]:
        # alpha = 0 when phi = 0; for loads inside the crankcase each cylinder stands beside idle ones
        engine, layout = self.problem.engine, self.layout
        for k, (part, pin) in enumerate(zip(engine.slider_cranks, layout.pins, strict=True)):
            acting, late = working(self.problem, part.name), layout.late[k] if layout.late else 0.0
            banks = QUARTERS if self._is_geometry_open[0] else (layout.banks[k],)
            turned = (replace(part, bank=bank, throw=bank, firing_angle=late) for bank in banks)
            found = tuple(evaluate(acting, isolate(engine, k, inside, each)) for each in turned)
            # what is not open makes the cylinder later, or sooner
            ahead = 0.0 if self._is_geometry_open[0] else -layout.banks[k]
            yield Moving(pin, k, found, ahead + (0.0 if self._is_geometry_open[1] else layout.pin_offsets[k]), {})

    def _riding(self, rides: dict[str, int], inside: bool) -> Iterator[Moving]:
        # unbalances that ride on every throw
        engine, layout = self.problem.engine, self.layout
        for pin in sorted(set(rides.values())):
            own = [rotor for rotor in engine.rotors if rides.get(rotor.name) == pin and rotor.unbalance]
            k = layout.pins.index(pin)
            angle = engine.slider_cranks[k].throw - layout.pin_offsets[k]
            if own:
                found = evaluate(motored(self.problem), only_rotors(engine, own, inside))
                yield Moving(pin, None, (found,), -angle, {rotor.name: rotor.unbalance for rotor in own})

    def _waves_of(self, part: Moving) -> Iterator[tuple[Wave, int, int]]:
        side = Fraction(0 if part.cylinder is None else self.layout.side(part.cylinder))
        for j, step in enumerate((-1, 0, 1) if len(part.found) > 1 else (0,)):
            for h, order in enumerate(self.times):
                turned = order * Fraction(self._turns)
                each = (turned - (order + step) * side, turned - order * side)
                yield (order, *(m for m, is_open in zip(each, self._is_geometry_open, strict=True) if is_open)), h, j

    @property
    def followed(self) -> float:
        """Share of the heaviest order above which an order is followed along an arc; others count as their size."""
        return self._followed[any(map(self._is_bent_peak, self.problem.measures))]

    def _is_bent_peak(self, measure: Measure) -> bool:
        return averages(self.problem, measure) and not measure.norm.averages

    @property
    def _loads(self) -> list[Measure]:
        return [measure for measure in self.problem.measures if measure.is_load]

    def counted(self, measure: Measure, found: Evaluation) -> list[Spectrum]:
        """Return the counted spectra of a load, one per operating point with a weight."""
        engine = self.problem.engine
        shares = measure.shares(self.problem.points)
        return [
            narrow_signal(measure, signal, engine)
            for signal, share in zip(found.signals(measure.load), shares, strict=True)
            if share > 0.0
        ]

    def _kept(self) -> tuple[Fraction, ...]:
        """The lowest orders, up to where what follows is next to nothing for every measure."""
        # what rides on a throw turns once a turn
        kept = {Fraction(1)}
        for measure in self._loads:
            squares: dict[Fraction, float] = {}
            every = (found for part in self.parts for found in part.found)
            for signal in (one for found in every for one in self.counted(measure, found)):
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
        """Return the most that the omitted orders amount to, wherever the throws stand [SI]."""
        return sum(self._left_out(measure, part, samples) for part in self.parts) if measure.is_load else 0.0

    def _left_out(self, measure: Measure, part: Moving, samples: int) -> float:
        # |A cos b + B sin b + C| is no more than all three
        every = [self.counted(measure, found) for found in part.found]
        if len(every) == 1:
            return self.tail(measure, every[0], samples)
        total = 0.0
        for u, a, d in zip(*every, strict=True):
            still = (u + d).mapped(lambda values: 0.5 * values)
            leaning = (u + d.mapped(np.negative)).mapped(lambda values: 0.5 * values), a + still.mapped(np.negative)
            total = max(total, sum(self.tail(measure, [one], samples) for one in (still, *leaning)))
        return total

    def tail(self, measure: Measure, signals: Sequence[Spectrum], samples: int) -> float:
        """Return the most that omitted orders of signals amount to, including those beyond the last [SI]."""
        total, kept = 0.0, np.array([float(order) for order in self.times])
        for one in signals:
            # of what bends at an angle so many orders are listed that those beyond are next to nothing
            signal = one if one.kinks is None else one.padded(_LISTED)
            out = ~orders_equal(signal.orders, kept)
            rest = signal.with_coefficients(np.where(out[:, None, None], signal.coefficients, 0.0))
            if measure.norm.is_euclidean or measure.norm.averages:
                # neither is more than the root mean square, nor rows of averages more than their lengths
                maximum = np.sqrt(mean_square(rest))
                if measure.norm.averages:
                    maximum = np.minimum(maximum, _averaged(signal, out, samples * float(self.base)))
                total = max(total, float(maximum.max(initial=0.0)))
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
        for own, part in zip(waves, self.parts, strict=True):
            if measure.is_load or (measure.is_mass and part.cylinder is None):
                rows = self._own_rows(measure, part, samples)
                for wave, h, j in self._waves_of(part):
                    own[self._place_of[wave]] += rows[j][h]
        return WaveNorm(fixed, waves, self.left_out(measure, samples))

    def _own_rows(self, measure: Measure, part: Moving, samples: int) -> list[ComplexArray]:
        times = np.array([float(order) for order in self.times])
        turned = np.exp(1j * times * part.ahead)[:, None, None]
        if measure.is_load:
            every = [found.signals(measure.load) for found in part.found]
            by_point = [self._components([self._coefficients(one) for one in own]) for own in zip(*every, strict=True)]
            return [self._rows_of(measure, own, samples) * turned for own in zip(*by_point, strict=True)]
        return [np.asarray((times == 1.0)[:, None, None] * turned * self._weights(measure, part))]

    @staticmethod
    def _components(found: list[ComplexArray]) -> list[ComplexArray]:
        if len(found) == 1:
            return found
        a, b, still = leaning(*found)
        return [0.5 * (a - 1j * b), still, 0.5 * (a + 1j * b)]

    def _weights(self, measure: Measure, part: Moving) -> ComplexArray:
        engine = self.problem.engine
        rows = [
            mass_rows(
                measure, [replace(r, unbalance=turn * part.riding.get(r.name, 0.0)) for r in engine.rotors]
            ).vectors
            for turn in (1.0, 1.0j)
        ]
        return np.asarray(rows[0] - 1j * rows[1])

    def _coefficients(self, signal: Spectrum) -> ComplexArray:
        return np.array([signal.at(float(order)) for order in self.times])

    def _rows_of(self, measure: Measure, own: Sequence[ComplexArray], samples: int) -> ComplexArray:
        """Rows of every order of coefficients at the operating points, shape (orders, k, d)."""
        steps, times = [round(order / self.base) for order in self.times], np.array([float(t) for t in self.times])
        angles = math.tau / float(self.base) * np.arange(samples) / samples
        waves, blocks = np.exp(1j * np.outer(times, angles)), []
        for values, share in zip(own, measure.shares(self.problem.points), strict=True):
            series = np.zeros((max(steps) + 1, *values.shape[1:]), complex)
            series[steps] = values
            one = averaged(self.problem, measure, Spectrum(self.base, series), samples)
            # as load_rows has them: what counts of every place, at one angle after the other
            counted = narrow_signal(measure, one, self.problem.engine).coefficients[steps]
            if share > 0.0 and counted.shape[1]:
                rows = np.einsum("hpd,hs->hpsd", counted, waves)
                blocks.append(rows.reshape(len(steps), -1, counted.shape[-1]))
        return np.concatenate(blocks, axis=1) if blocks else np.zeros((len(steps), 1, 1), complex)

    def arcs(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Bounds of the throws in a box of all angles, which open ones turn, as what rides on them knows them [rad]."""
        ends = self._turns * lower[self.throws :].sum(), self._turns * upper[self.throws :].sum()
        return lower[: self.throws] + min(ends), upper[: self.throws] + max(ends)

    def samples(self, measure: Measure, wanted: int) -> int:
        """Steps at which squares are exact, or as many as wanted."""
        turning = (*self.times, *self._turning)
        highest = max((order for order in turning if measure.counted([float(order)])[0]), default=Fraction(1))
        return 2 * int(highest / self.base) + 2 if measure.norm.is_euclidean else wanted


def _averaged(signal: Spectrum, out: Mask, steps: float) -> Array:
    # bound of averaged orders, including those beyond the listed ones
    sizes = np.linalg.norm(signal.coefficients[out], axis=-1)
    whole = np.sinc(signal.orders[out] / steps) ** 2 @ sizes
    if signal.kinks is None:
        return np.asarray(whole)
    count, base = len(signal.coefficients), float(signal.base)
    further = signal.kinks.beyond_averaged(count, base, steps / base)
    return np.asarray(whole + np.linalg.norm(further, axis=-1))
