"""Loads of throws as sums of waves in the throw angles, with coefficients from the exact model (S26, S30).

A throw at angle theta has the load c_h e^{i h theta} in order h, from its slider-cranks, their gas and the unbalances
on it. A measure of loads is a norm of load rows that are affine in cos(h theta) and sin(h theta) of every throw, and in
the unbalances.

If the bank angle beta is open, a cylinder leans by b = s beta, with s = 1/2 or -1/2. Its load leans by b and comes
later by b. Order h is e^{i h (theta - b)} (A_h cos b + B_h sin b + C_h) with coefficients A_h, B_h and C_h of the
cylinder. These are waves in b of the orders h - 1, h and h + 1. An open split pin only shifts the load in time.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import MAX_NUMBERS, AffineModel, AffineNorm
from laufruhe.load_models.isolated_cylinders import (
    evaluate_cylinders,
    isolate_rotors,
    motored,
    split_by_bank,
)
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.norms.norm import amplitudes, mean_square
from laufruhe.numerics.spectrum import Spectrum, as_order, common_base, orders_equal
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Measure, mass_rows, narrow_signal
from laufruhe.problem.phasing import NO_OPEN_ANGLES, OpenAngles
from laufruhe.problem.problem import Problem

# share of the load above which one of the lowest orders is kept, and number of these orders
_TINY_SHARE, _LOWEST_ORDERS = 1e-10, 24
# number of orders with the stricter share of `share_left_out`
_LOW_ORDERS = 96
# number of orders of a signal with kinks that are summed one by one
_LISTED = 4096
Wave = tuple[Fraction, ...]
"""Multiple of the throw angle, and of every other open angle, in the phase of a wave."""
PEAK_STEPS = 2
"""Number of averages per step in rows of peaks; an average over any interval is at most the peak."""


@dataclass(frozen=True, eq=False)
class MovingPart:
    """Cylinder, or all unbalances, that turn with one throw.

    Attributes
    ----------
    pin
        Index of the throw.
    cylinder
        Index of the cylinder; None for unbalances.
    evaluations
        Loads of this part only: one evaluation, or one for each bank angle of `BANK_SAMPLES` if the bank angle is open.
    ahead
        Angle by which the loads come earlier when the throw and all open angles are at zero [rad].
    unbalances
        Unbalance of every rotor on the throw, by its name [kg m].
    """

    pin: int
    cylinder: int | None
    evaluations: tuple[Evaluation, ...]
    ahead: float
    unbalances: dict[str, complex]


@dataclass(frozen=True, eq=False)
class WaveNorm:
    """Norm N(V0 + B x + sum_p Re sum_h W_ph e^{i h theta_p}) over moving parts p and orders h.

    x is the decision vector of the unbalances, and theta_p the throw angle of part p.

    Attributes
    ----------
    fixed
        Norm of the load rows V0 + B x of all that does not turn with a throw.
    waves
        Coefficients W of every moving part with all open angles at zero, shape (parts, orders, k, d).
    left_out
        Largest change of the norm by the omitted orders [SI].
    """

    fixed: AffineNorm
    waves: ComplexArray
    left_out: float


def uses_averages(problem: Problem, measure: Measure) -> bool:
    """Return True if the load rows of a measure are averages about samples.

    They are for means (P7), and for peaks of loads with kinks by gas.
    """
    has_kinks = problem.has_gas and measure.depends_on_gas and measure.norm.refinement > 1
    return measure.is_load and (measure.norm.averages or has_kinks)


def averaged_signal(problem: Problem, measure: Measure, signal: Spectrum, samples: int) -> Spectrum:
    """Return the signal whose samples are the load rows of a measure: the signal, or its averages over the steps."""
    if not uses_averages(problem, measure):
        return signal
    return signal.averaged(signal.period / (samples if measure.norm.averages else PEAK_STEPS * samples))


class ThrowWaves:
    """Norms of a problem as sums of waves in the angles of its throws.

    Attributes
    ----------
    orders
        Multiples of the throw angle, and of bank angle and split pin if open, in each wave, shape (waves, 1 + open).
    parts
        Cylinders and unbalances that turn with the throws.
    rest
        Loads of the rotors that turn with no throw and of the load torque, affine in the unbalances.
    times
        Orders of crank speed that are kept.
    base
        Order of the common period.

    Parameters
    ----------
    problem
        Problem of a crank with its throws at any angles. No open unbalance turns with a throw.
    rotor_throws
        Index of the throw that each rotor turns with; rotors that turn with none are left out.
    turns
        Change of all throw angles per unit of an open angle: the side (1/2 or -1/2) of cylinder 1 if throws are
        counted from its dead centre, or 0.
    """

    share_left_out: tuple[float, float] = 1e-4, 1e-3
    """Largest share of a moving part's root mean square in omitted orders, by which bounds are lowered.

    The first number is for up to `_LOW_ORDERS` orders. The second is for higher orders of loads inside the crankcase,
    where a jump of the pressure has orders without end."""
    _arc_shares: tuple[float, float] = 1e-4, 3e-5

    def __init__(
        self, problem: Problem, layout: Layout, rotor_throws: dict[str, int],
        is_geometry_open: OpenAngles = NO_OPEN_ANGLES, turns: float = 0.0,
    ) -> None:  # fmt: skip
        self.problem, self.layout, self._is_geometry_open, self._turns = problem, layout, is_geometry_open, turns
        self.throws = len(layout.throw_positions)
        if any(is_geometry_open) and self.throws == 1:
            # with one throw, stricter shares cost little
            self.share_left_out, self._arc_shares = (1e-6, 1e-6), (1e-9, 1e-9)
        engine = problem.engine
        remaining = tuple(
            replace(rotor, unbalance=0.0j) if rotor.name in rotor_throws else rotor for rotor in engine.rotors
        )
        inside = any(measure.is_inside for measure in problem.measures)
        self.parts = [*self._cylinders(inside), *self._unbalances(rotor_throws, inside)]
        rest = isolate_rotors(engine, remaining, inside).loaded_as(engine)
        self.rest = AffineModel(replace(motored(problem), engine=rest), keep_all=True)
        # unbalances on the throws turn in order 1
        loads = [measure for measure in problem.measures if measure.is_load]
        self.times = tuple(sorted({Fraction(1)}.union(*map(self._kept_orders, loads))))
        waves = sorted({wave for part in self.parts for wave, *_ in self._waves_of(part)})
        self.orders = np.array([[float(order) for order in wave] for wave in waves])
        self._place_of = {wave: place for place, wave in enumerate(waves)}
        self._turning = [as_order(abs(rotor.shaft.ratio)) for rotor in remaining]
        loaded = [engine.cycle.base_order] if engine.is_loaded else []
        self.base = common_base([order for order in (*self.times, *self._turning, *loaded, Fraction(1)) if order])
        self.rest.base = self.base

    def _cylinders(self, inside: bool) -> Iterator[MovingPart]:
        layout, (bank_is_open, split_is_open) = self.layout, self._is_geometry_open
        for k, evaluations in enumerate(evaluate_cylinders(self.problem, layout, bank_is_open, inside)):
            # fixed angles shift the cylinder in time
            ahead = (0.0 if bank_is_open else -layout.banks[k]) + (0.0 if split_is_open else layout.pin_offsets[k])
            yield MovingPart(layout.pins[k], k, evaluations, ahead, {})

    def _unbalances(self, rotor_throws: dict[str, int], inside: bool) -> Iterator[MovingPart]:
        # unbalances on every throw
        engine, layout = self.problem.engine, self.layout
        for pin in sorted(set(rotor_throws.values())):
            rotors = [rotor for rotor in engine.rotors if rotor_throws.get(rotor.name) == pin and rotor.unbalance]
            k = layout.pins.index(pin)
            angle = engine.slider_cranks[k].throw - layout.pin_offsets[k]
            if rotors:
                evaluation = evaluate(motored(self.problem), isolate_rotors(engine, rotors, inside))
                yield MovingPart(pin, None, (evaluation,), -angle, {rotor.name: rotor.unbalance for rotor in rotors})

    def _waves_of(self, part: MovingPart) -> Iterator[tuple[Wave, int, int]]:
        side = Fraction(0 if part.cylinder is None else self.layout.side(part.cylinder))
        for j, step in enumerate((-1, 0, 1) if len(part.evaluations) > 1 else (0,)):
            for h, order in enumerate(self.times):
                common_multiple = order * Fraction(self._turns)
                multiples = (common_multiple - (order + step) * side, common_multiple - order * side)
                yield (
                    (order, *(m for m, is_open in zip(multiples, self._is_geometry_open, strict=True) if is_open)),
                    h,
                    j,
                )

    @property
    def min_arc_share(self) -> float:
        """Relative size above which a wave is bounded along its arc of angles; a smaller wave counts by its size."""
        return self._arc_shares[any(map(self._is_averaged_peak, self.problem.measures))]

    def _is_averaged_peak(self, measure: Measure) -> bool:
        return uses_averages(self.problem, measure) and not measure.norm.averages

    def counted(self, measure: Measure, evaluation: Evaluation) -> list[Spectrum]:
        """Return the load of a design in the orders of a measure, for each operating point of the measure."""
        engine = self.problem.engine
        shares = measure.shares(self.problem.points)
        return [
            narrow_signal(measure, signal, engine)
            for signal, share in zip(evaluation.signals(measure.load), shares, strict=True)
            if share > 0.0
        ]

    def _kept_orders(self, measure: Measure) -> set[Fraction]:
        """Return the orders of load to keep for a measure; the others have at most the share `share_left_out` of it."""
        squares: dict[Fraction, float] = defaultdict(float)
        evaluations = (evaluation for part in self.parts for evaluation in part.evaluations)
        for signal in (signal for evaluation in evaluations for signal in self.counted(measure, evaluation)):
            sizes = np.square(np.abs(signal.coefficients)).reshape(len(signal.coefficients), -1).sum(axis=1)
            for j in np.flatnonzero(sizes):
                squares[int(j) * signal.base] += float(sizes[j])
        ordered = sorted(squares)
        tail = np.cumsum([squares[order] for order in ordered[::-1]])[::-1]
        low_share, high_share = self.share_left_out
        high_share = high_share if measure.is_inside and not self._is_averaged_peak(measure) else low_share
        shares = np.full(len(ordered), high_share)
        shares[:_LOW_ORDERS] = low_share
        shares[:_LOWEST_ORDERS] = _TINY_SHARE
        return {ordered[k] for k in np.flatnonzero(tail > shares**2 * tail[:1])}

    def left_out(self, measure: Measure, samples: int) -> float:
        """Return an upper bound of the change of a measure by its omitted orders, for throws at any angles [SI]."""
        total = 0.0
        for part in self.parts if measure.is_load else ():
            signals = [self.counted(measure, evaluation) for evaluation in part.evaluations]
            if len(signals) == 1:
                total += self.tail(measure, signals[0], samples)
                continue
            largest = 0.0
            for u, a, d in zip(*signals, strict=True):
                # |A cos b + B sin b + C| is at most |A| + |B| + |C|
                constant = (u + d).mapped(lambda values: 0.5 * values)
                cosine = (u + d.mapped(np.negative)).mapped(lambda values: 0.5 * values)
                sine = a + constant.mapped(np.negative)
                tails = [self.tail(measure, [signal], samples) for signal in (constant, cosine, sine)]
                largest = max(largest, sum(tails))
            total += largest
        return total

    def tail(self, measure: Measure, signals: Sequence[Spectrum], samples: int) -> float:
        """Return the largest norm of the omitted orders of signals [SI], including those beyond the computed ones."""
        total, kept_orders = 0.0, np.array([float(order) for order in self.times])
        for short in signals:
            # kinks have orders without end; those beyond the listed ones are negligible
            signal = short if short.kinks is None else short.padded(_LISTED)
            is_omitted = ~orders_equal(signal.orders, kept_orders)
            omitted = signal.with_coefficients(np.where(is_omitted[:, None, None], signal.coefficients, 0.0))
            if measure.norm.is_euclidean or measure.norm.averages:
                # neither norm exceeds the root mean square, and averages do not exceed the sum of amplitudes
                maximum = np.sqrt(mean_square(omitted))
                if measure.norm.averages:
                    maximum = np.minimum(maximum, _averaged_amplitudes(signal, is_omitted, samples * float(self.base)))
                total = max(total, float(maximum.max(initial=0.0)))
                continue
            size = amplitudes(omitted)
            if uses_averages(self.problem, measure):
                size = _averaged_amplitudes(signal, is_omitted, PEAK_STEPS * samples * float(self.base))
            # a peak, or a peak to peak, is at most twice the sum of the amplitudes
            total = max(total, 2.0 * float(size.max(initial=0.0)))
        return total

    def norm(self, measure: Measure, samples: int) -> WaveNorm:
        """Return a measure as a function of throw angles and unbalances, at `samples` steps over the period.

        Means are averaged over each step (P7).
        """
        fixed = self.rest.norm(
            measure, samples, averaged=True, peaks=PEAK_STEPS if uses_averages(self.problem, measure) else 0
        )
        count = len(self.parts) * len(self.orders) * fixed.constant.size
        if count > MAX_NUMBERS:
            raise ModelError(
                f"the load waves of all throws take {2e-6 * count:.0f} million numbers, too many for memory"
            )
        waves = np.zeros((len(self.parts), len(self.orders), *fixed.constant.shape), complex)
        for coefficients, part in zip(waves, self.parts, strict=True):
            if measure.is_load or (measure.is_mass and part.cylinder is None):
                # for each wave in the bank angle, the rows of every order
                rows = self._part_rows(measure, part, samples)
                for wave, h, j in self._waves_of(part):
                    coefficients[self._place_of[wave]] += rows[j][h]
        return WaveNorm(fixed, waves, self.left_out(measure, samples))

    def _part_rows(self, measure: Measure, part: MovingPart, samples: int) -> list[ComplexArray]:
        times = np.array([float(order) for order in self.times])
        phases = np.exp(1j * times * part.ahead)[:, None, None]
        if measure.is_load:
            by_point = []
            for signals in zip(*(evaluation.signals(measure.load) for evaluation in part.evaluations), strict=True):
                by_bank = [np.array([signal.at(order) for order in times]) for signal in signals]
                if len(by_bank) > 1:
                    # coefficients of e^{-i b}, 1 and e^{i b} in the bank angle b
                    a, b, constant = split_by_bank(*by_bank)
                    by_bank = [0.5 * (a - 1j * b), constant, 0.5 * (a + 1j * b)]
                by_point.append(by_bank)
            return [self._rows_of(measure, component, samples) * phases for component in zip(*by_point, strict=True)]
        real, imaginary = (
            mass_rows(
                measure,
                [replace(r, unbalance=turn * part.unbalances.get(r.name, 0.0)) for r in self.problem.engine.rotors],
            ).vectors
            for turn in (1.0, 1.0j)
        )
        return [np.asarray((times == 1.0)[:, None, None] * phases * (real - 1j * imaginary))]

    def _rows_of(self, measure: Measure, by_point: Sequence[ComplexArray], samples: int) -> ComplexArray:
        """Return load rows of every order, shape (orders, k, d), from the coefficients at every operating point."""
        steps, times = [round(order / self.base) for order in self.times], np.array([float(t) for t in self.times])
        angles = math.tau / float(self.base) * np.arange(samples) / samples
        waves, blocks = np.exp(1j * np.outer(times, angles)), []
        for values, share in zip(by_point, measure.shares(self.problem.points), strict=True):
            series = np.zeros((max(steps) + 1, *values.shape[1:]), complex)
            series[steps] = values
            signal = averaged_signal(self.problem, measure, Spectrum(self.base, series), samples)
            # the order of rows is that of `load_rows`: all samples of one place, then the next place
            counted = narrow_signal(measure, signal, self.problem.engine).coefficients[steps]
            if share > 0.0 and counted.shape[1]:
                rows = np.einsum("hpd,hs->hpsd", counted, waves)
                blocks.append(rows.reshape(len(steps), -1, counted.shape[-1]))
        return np.concatenate(blocks, axis=1) if blocks else np.zeros((len(steps), 1, 1), complex)

    def throw_bounds(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Return bounds of the throws [rad] in a box of open angles, turned by bank angle and split pin too."""
        ends = self._turns * lower[self.throws :].sum(), self._turns * upper[self.throws :].sum()
        return lower[: self.throws] + min(ends), upper[: self.throws] + max(ends)

    def samples(self, measure: Measure, default: int) -> int:
        """Return the number of samples at which a mean square is exact, or `default` for other norms."""
        turning = (*self.times, *self._turning)
        highest = max((order for order in turning if measure.counted([float(order)])[0]), default=Fraction(1))
        return 2 * int(highest / self.base) + 2 if measure.norm.is_euclidean else default


def _averaged_amplitudes(signal: Spectrum, is_omitted: Mask, steps: float) -> Array:
    # sum of the amplitudes of omitted orders after averaging, orders beyond the listed ones included
    sizes = np.linalg.norm(signal.coefficients[is_omitted], axis=-1)
    total = np.sinc(signal.orders[is_omitted] / steps) ** 2 @ sizes
    if signal.kinks is None:
        return np.asarray(total)
    count, base = len(signal.coefficients), float(signal.base)
    beyond = signal.kinks.beyond_averaged(count, base, steps / base)
    return np.asarray(total + np.linalg.norm(beyond, axis=-1))
