"""Measures of loads as smooth CasADi expressions of throws, bank angle, split pin and unbalances (S19).

The load of a cylinder turns with its throw and leans with its bank. Its gas follows the firing dead centre
phi_k = 2 pi l_k - (theta_k + o_k - beta_k), with throw theta_k, pin offset o_k and bank angle beta_k. The number of
turns l_k belongs to the firing order, and is fixed (S23). A rotor on a throw turns with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache, partial
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.mount_rows import SAMPLES_PER_ORDER
from laufruhe.load_models.symbolic_spectrum import SymbolicSpectrum
from laufruhe.load_models.turned_loads import OrderSelection, turned_loads
from laufruhe.machine import OperatingPoint, Rotor
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import Spectrum, as_order
from laufruhe.physics.mount_forces import RigidMounting
from laufruhe.physics.mounting import mount_maps, mounting_of, travel_of
from laufruhe.problem import channels
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.decision import Domain, domains_of
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Measure, counted_rotors, narrow_signal, radius_of
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem

MIN_SAMPLES = 72
NEGLIGIBLE, LEFT_OUT = 1e-9, 1e-2
"""Largest share of the root mean square in the omitted orders: of forces, and of the roll moment of gas."""
INSIDE_LEFT_OUT, HIGHEST = 1e-2, 24.0
"""Largest share for loads inside the crankcase, and highest order: a jump of the pressure has orders without end."""
ROLL = 3
"""Index of the roll moment in a wrench."""


@dataclass(frozen=True, eq=False)
class UnevenSymbols:
    """Variables of a smooth program, as CasADi symbols or numbers.

    Attributes
    ----------
    throws
        Angle of every throw [rad], with cylinder 1 at its dead centre at crank angle zero.
    bank, split
        Bank angle and split pin [rad]; None if the layout has none.
    unbalances
        Decision vector of the unbalances.
    """

    throws: Sequence[Any]
    bank: Any
    split: Any
    unbalances: Any


class UnevenModel:
    """Measures of a problem as smooth expressions of throws, bank angle, split pin and unbalances.

    Parameters
    ----------
    problem
        Problem with the crank star and firing order from which a program starts.
    rotor_throws
        Index of the throw that each rotor turns with; rotors that turn with none are left out.
    symbols
        Variables of the expressions.
    """

    def __init__(self, problem: Problem, layout: Layout, rotor_throws: dict[str, int], symbols: UnevenSymbols) -> None:
        self.problem, self._rotor_throws, self._symbols = problem, rotor_throws, symbols
        self.domains: tuple[Domain, ...] = domains_of(problem.unbalances)
        self._mounting = mounting_of(problem.engine, problem.fidelity)
        parts = problem.engine.slider_cranks
        firsts = [layout.pins.index(pin) for pin in range(len(layout.throw_positions))]
        self._start = [parts[k].throw - layout.pin_offsets[k] for k in firsts]
        self._wrenches: dict[OperatingPoint, SymbolicSpectrum] = {}
        # star angle and bank angle of every cylinder
        self._angles = []
        for k, part in enumerate(parts):
            side = layout.side(k)
            bank = side * symbols.bank if symbols.bank is not None else part.bank
            offset = -side * symbols.split if symbols.split is not None else layout.pin_offsets[k]
            # the firing order fixes the number of turns before the firing
            turns = round((part.firing_angle + part.throw - part.bank) / math.tau)
            self._angles.append((symbols.throws[layout.pins[k]] + offset - bank - math.tau * turns, bank))

    def rows(self, measure: Measure) -> tuple[Any, Grid]:
        """Return the vectors (rows) whose norm is a measure, shape (k, d), as CasADi expressions, and their grid (P1).

        Rows are coefficients of orders for a root mean square (Parseval), and values at samples for other norms.
        """
        if measure.is_mass:
            counted = counted_rotors(measure, self.problem.engine.rotors)
            rows = [(self._unbalance(r) / radius_of(r)).T for r in counted]
            return ca.vertcat(*rows), Grid(np.ones(len(rows)), 1)
        chosen = [point for point in self.problem.points if measure.includes_point(point)]
        total_weight = sum(point.weight for point in chosen)
        blocks: list[Any] = []
        weights: list[Array] = []
        if measure.norm.is_euclidean:
            for point in chosen:
                places = self._signal(measure, point)
                half = np.where(places[0].orders == 0.0, 1.0, 0.5) * point.weight / total_weight / len(places)
                blocks += [part.T for place in places for part in (place.real, place.imaginary)]
                weights += [half] * (2 * len(places))
            return ca.vertcat(*blocks), Grid(np.concatenate(weights), blocks[0].shape[0])
        # rigid mounts have one map for all orders, so that the wrench can be sampled first
        is_mapped_later = measure.channel is channels.MOUNT_FORCE and isinstance(self._mounting, RigidMounting)
        signals = [[self._counted(measure, p)] if is_mapped_later else self._signal(measure, p) for p in chosen]
        # orders differ between points: all have the samples that the highest order needs
        highest = max(float(place.orders.max()) / place.base for places in signals for place in places)
        steps = max(MIN_SAMPLES, int(SAMPLES_PER_ORDER * highest))
        for point, places in zip(chosen, signals, strict=True):
            values = [place.sampled(steps) for place in places]
            if is_mapped_later:
                values = [values[0] @ ca.DM(m.real).T for m in self._maps(measure, 0.0, point)]
            blocks += values
            weights.append(np.full(len(values) * steps, point.weight / total_weight / len(values) / steps))
        return ca.vertcat(*blocks), Grid(np.concatenate(weights), steps, points=len(chosen))

    def _signal(self, measure: Measure, point: OperatingPoint) -> list[SymbolicSpectrum]:
        # one spectrum for each mount, one for the block, or one for each place inside the crankcase
        if measure.is_inside:
            # loads inside the crankcase, by every place (S37)
            return self._turned(
                point,
                lambda loads: narrow_signal(
                    measure, measure.load.signal(loads).series, self.problem.engine
                ).truncated(HIGHEST),
                [OrderSelection(slice(None), INSIDE_LEFT_OUT)], True,
            )  # fmt: skip
        counted = self._counted(measure, point)
        if isinstance(measure.channel, LoadChannel) and measure.channel.part is not None:
            return [counted.mapped(np.eye(6)[measure.channel.part])]
        by_order = [self._maps(measure, float(h), point) for h in counted.orders]
        return [counted.map_orders(maps) for maps in zip(*by_order, strict=True)]

    def _turned(
        self, point: OperatingPoint, signal: Callable[[PointLoads], Spectrum], selections: Sequence[OrderSelection],
        keep_places: bool,
    ) -> list[SymbolicSpectrum]:  # fmt: skip
        return turned_loads(
            self.problem, point, signal, selections, keep_places, self._angles,
            self._symbols.bank is not None, self._unbalance,
        )  # fmt: skip

    def _counted(self, measure: Measure, point: OperatingPoint) -> SymbolicSpectrum:
        gain: Callable[[float], float] | None = None
        if measure.on_mounts and not isinstance(self._mounting, RigidMounting):
            # only the lowest orders of gas move a block on soft mounts
            gain = partial(self._roll_gain, measure, point.speed)
        wrench = self.wrench(point, gain)
        counted = np.flatnonzero(measure.counted(wrench.orders))
        if len(counted):
            return wrench.select(counted)
        return SymbolicSpectrum(np.ones(1), ca.DM.zeros(6, 1), ca.DM.zeros(6, 1))

    def _roll_gain(self, measure: Measure, speed: float, order: float) -> float:
        return float(np.abs(self._map(measure, order, speed)[:, :, ROLL]).max())

    def _maps(self, measure: Measure, order: float, point: OperatingPoint) -> list[NDArray[np.complex128]]:
        weights = np.diag(measure.direction_weights or (1.0, 1.0, 1.0))
        maps = self._map(measure, order, point.speed)
        return [weights @ maps[k] for k in measure.places([mount.name for mount in self.problem.engine.mounts])]

    def _map(self, measure: Measure, order: float, speed: float) -> NDArray[np.complex128]:
        if self._mounting is None:
            raise ValueError("an engine without mounts has no mount forces")
        if measure.channel is channels.MOUNT_FORCE:
            return mount_maps(self._mounting, order, speed)
        base = as_order(order)
        units = np.stack([np.zeros((6, 6)), np.eye(6)]).astype(complex)
        spectra = [Spectrum(base or Fraction(1), units[:, k] if base else units[1:, k]) for k in range(6)]
        travels = [travel_of(self.problem.engine, self._mounting, unit, speed) for unit in spectra]
        return np.stack([t.coefficients[-1] for t in travels if t is not None], axis=-1)

    def wrench(self, point: OperatingPoint, gain: Callable[[float], float] | None = None) -> SymbolicSpectrum:
        """Return the symbolic wrench on the block at an operating point.

        `gain` weights each order of the roll moment when negligible orders are dropped.
        """
        if gain is None and point in self._wrenches:
            return self._wrenches[point]
        share = NEGLIGIBLE if self.problem.fidelity.gas_of(point) is None else LEFT_OUT
        unweighted = [OrderSelection(slice(k, k + 1), NEGLIGIBLE) for k in range(6) if k != ROLL]
        roll = OrderSelection(slice(ROLL, ROLL + 1), share, gain or (lambda _: 1.0))
        (wrench,) = self._turned(point, _as_place, [*unweighted, roll], False)
        if gain is None:
            self._wrenches[point] = wrench
        return wrench

    def _unbalance(self, rotor: Rotor) -> Any:
        """Return the unbalance of a rotor as expressions (re, im) [kg m], at the present angle of its throw."""
        real: Any = rotor.unbalance.real
        imaginary: Any = rotor.unbalance.imag
        for domain in self.domains:
            for drive in domain.decision.rotor_drives:
                if drive.rotor != rotor.name:
                    continue
                columns = self._symbols.unbalances[domain.columns]
                for j, direction in enumerate(domain.set.directions):
                    d = drive.of(direction)
                    real = real + d.real * columns[j]
                    imaginary = imaginary + d.imag * columns[j]
                # the unbalance of the rotor has the baseline value of the decision in it
                initial = drive.of(domain.decision.start)
                real, imaginary = real - initial.real, imaginary - initial.imag
        if rotor.name not in self._rotor_throws:
            return ca.vertcat(real, imaginary)
        pin = self._rotor_throws[rotor.name]
        turn = self._symbols.throws[pin] - self._start[pin]
        cosine, sine = ca.cos(turn), ca.sin(turn)
        return ca.vertcat(cosine * real - sine * imaginary, sine * real + cosine * imaginary)


def _as_place(loads: PointLoads) -> Spectrum:
    return loads.wrench.mapped(lambda wrench: wrench[:, None, :])


def rotor_throws_of(phasing: Phasing, candidate: Candidate) -> dict[str, int]:
    """Return the index of the throw that each rotor turns with, by its name, from trial moves of single throws."""
    count = len(candidate.throws)
    throws = tuple(math.tau * k / count for k in range(count))
    return dict(_rotor_throws_of(phasing, replace(candidate, throws=throws, firing_order=None, without_gas=True)))


@lru_cache(maxsize=16)
def _rotor_throws_of(phasing: Phasing, candidate: Candidate) -> dict[str, int]:
    rotor_throws = {}
    before = rotor_states(phasing.problem_of(candidate))
    for k in range(len(candidate.throws)):
        throws = tuple(angle + (0.1 if j == k else 0.0) for j, angle in enumerate(candidate.throws))
        after = rotor_states(phasing.problem_of(replace(candidate, throws=throws)))
        rotor_throws.update({name: k for name, state in after.items() if state != before[name]})
    return rotor_throws


def rotor_states(problem: Problem) -> dict[str, tuple[complex, ...]]:
    """Return by rotor name: the fixed unbalance, then the unbalance per unit of each decision [kg m]."""
    gains: dict[str, list[complex]] = {rotor.name: [] for rotor in problem.engine.rotors}
    for decision in problem.decisions:
        for drive in decision.rotor_drives:
            gains[drive.rotor].append(drive.gain)
    return {rotor.name: (rotor.unbalance, *gains[rotor.name]) for rotor in problem.engine.rotors}
