"""Norms of loads over throws at any angles as smooth expressions, with coefficients from the exact model (S19).

What a cylinder loads by turns with its throw and leans with its bank, its gas with its firing dead centre
phi_k = 2 pi l_k - (theta_k + o_k - beta_k); a rotor that rides on a throw turns with it. The number of turns l_k is the
firing order's, and stays while the throws move (S23).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.lines import Lines
from laufruhe.load_models.mount_rows import SAMPLES_PER_ORDER
from laufruhe.load_models.turned_loads import OrderSelection, TurnedLoads
from laufruhe.machine import OperatingPoint, Rotor, SliderCrank
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

LEAST_SAMPLES = 72
NEGLIGIBLE, LEFT_OUT = 1e-9, 1e-2
"""Shares of the root mean square, of forces and of the torque of gas, that orders left out may hold together."""
INSIDE_LEFT_OUT, HIGHEST = 1e-2, 24.0
"""The same of a load inside the crankcase, and the last order that is known of it: a pressure that jumps has no end of
them."""
ROLL = 3
"""Of the components of a wrench."""


@dataclass(frozen=True, eq=False)
class UnevenSymbols:
    """Variables of the program.

    Attributes
    ----------
    throws
        Angle of every throw [rad], the first given by cylinder 1's dead centre.
    bank, split
        Bank angle and split pin [rad], symbols or numbers.
    unbalances
        Columns of the unbalance decisions.
    """

    throws: Sequence[Any]
    bank: Any
    split: Any
    unbalances: Any


class UnevenModel:
    """Smooth norms of a problem over throws, bank, split pin and unbalances.

    Parameters
    ----------
    problem
        Of the star that the program starts from, with its firing order.
    layout
        Of that star.
    rides
        Throw that every rotor turns with; rotors left out stand still beside the throws.
    left_out
        Share of the root mean square of the roll moment that orders left out may hold together, where gas acts.
    """

    def __init__(self, problem: Problem, layout: Layout, rides: dict[str, int], left_out: float = LEFT_OUT) -> None:
        self.problem, self.layout, self.rides = problem, layout, rides
        self.domains: tuple[Domain, ...] = domains_of(problem.unbalances)
        self._mounting = mounting_of(problem.engine, problem.fidelity)
        self._start = [_throw_of(problem.engine.slider_cranks, layout, k) for k in range(len(layout.throw_positions))]
        self._left_out = left_out
        self._wrenches: dict[tuple[OperatingPoint, UnevenSymbols], Lines] = {}

    def _points(self, quantity: Measure) -> list[OperatingPoint]:
        return [p for p in self.problem.points if quantity.points is None or p.name in quantity.points]

    def rows(self, measure: Measure, at: UnevenSymbols) -> tuple[Any, Grid]:
        """Vectors whose norm a measure is, and where they stand (P1).

        Of a norm that knows nothing but squares these are the orders' own (Parseval); of
        others the values at angles over a period.
        """
        if measure.is_mass:
            counted = counted_rotors(measure, self.problem.engine.rotors)
            rows = [(self._unbalance(r, at) / radius_of(r)).T for r in counted]
            return ca.vertcat(*rows), Grid(np.ones(len(rows)), 1)
        chosen = self._points(measure)
        whole = sum(point.weight for point in chosen)
        blocks: list[Any] = []
        weights: list[Array] = []
        if measure.norm.is_euclidean:
            for point in chosen:
                found = self._signal(measure, point, at)
                half = np.where(found[0].orders == 0.0, 1.0, 0.5) * point.weight / whole / len(found)
                blocks += [part.T for place in found for part in (place.real, place.imaginary)]
                weights += [half] * (2 * len(found))
            return ca.vertcat(*blocks), Grid(np.concatenate(weights), blocks[0].shape[0])
        # one map for all orders: the wrench alone is sampled
        mapped = measure.channel is channels.MOUNT_FORCE and isinstance(self._mounting, RigidMounting)
        signals = [[self._counted(measure, p, at)] if mapped else self._signal(measure, p, at) for p in chosen]
        # points keep orders of their own: every signal has as many steps as the finest needs
        steps = max(_steps(place) for places in signals for place in places)
        for point, places in zip(chosen, signals, strict=True):
            values = [place.sampled(steps) for place in places]
            if mapped:
                values = [values[0] @ ca.DM(m.real).T for m in self._maps(measure, 0.0, point)]
            blocks += values
            weights.append(np.full(len(values) * steps, point.weight / whole / len(values) / steps))
        return ca.vertcat(*blocks), Grid(np.concatenate(weights), steps, points=len(chosen))

    def _signal(self, quantity: Measure, point: OperatingPoint, at: UnevenSymbols) -> list[Lines]:
        # per mount, for the block, or per place inside the crankcase
        if quantity.is_inside:
            return self._inside(quantity, point, at)
        counted = self._counted(quantity, point, at)
        if isinstance(quantity.channel, LoadChannel) and quantity.channel.part is not None:
            return [counted.mapped(np.eye(6)[quantity.channel.part])]
        by_order = [self._maps(quantity, float(h), point) for h in counted.orders]
        return [counted.map_orders([maps[m] for maps in by_order]) for m in range(len(by_order[0]))]

    def _inside(self, quantity: Measure, point: OperatingPoint, at: UnevenSymbols) -> list[Lines]:
        # S37
        engine = self.problem.engine

        def signal(loads: PointLoads) -> Spectrum:
            return narrow_signal(quantity, quantity.load.signal(loads).series, engine).truncated(HIGHEST)

        return self._turned(point, at, signal, [OrderSelection(slice(None), INSIDE_LEFT_OUT)], True)

    def _turned(
        self, point: OperatingPoint, at: UnevenSymbols, signal: Callable[[PointLoads], Spectrum],
        felt: Sequence[OrderSelection], beside: bool,
    ) -> list[Lines]:  # fmt: skip
        k, parts = self.problem.points.index(point), self.problem.engine.slider_cranks
        turned = TurnedLoads(self.problem, k, signal, at.bank is not None, felt, beside)
        placed = [self._place(k, part, at) for k, part in enumerate(parts)]
        stars = [a - b - math.tau * _turns_of(part) for (a, b), part in zip(placed, parts, strict=True)]
        return turned.lines(stars, [bank for _, bank in placed], lambda rotor: self._unbalance(rotor, at))

    def _counted(self, quantity: Measure, point: OperatingPoint, at: UnevenSymbols) -> Lines:
        # a block on soft mounts feels the first orders of its gas alone
        gain = self._gain(quantity, point) if quantity.on_mounts else None
        found = self.wrench(point, at, gain)
        counted = np.flatnonzero(quantity.counted(found.orders))
        return found.select(counted) if len(counted) else Lines(np.ones(1), ca.DM.zeros(6, 1), ca.DM.zeros(6, 1))

    def _maps(self, quantity: Measure, order: float, point: OperatingPoint) -> list[NDArray[np.complex128]]:
        weights = np.diag(quantity.direction_weights or (1.0, 1.0, 1.0))
        every = self._map(quantity, order, point.speed)
        return [weights @ every[k] for k in quantity.places([mount.name for mount in self.problem.engine.mounts])]

    def _map(self, quantity: Measure, order: float, speed: float) -> NDArray[np.complex128]:
        if self._mounting is None:
            raise ValueError("an engine without mounts has no mount forces")
        if quantity.channel is channels.MOUNT_FORCE:
            return mount_maps(self._mounting, order, speed)
        base = as_order(order)
        units = np.stack([np.zeros((6, 6)), np.eye(6)]).astype(complex)
        spectra = [Spectrum(base or Fraction(1), units[:, k] if base else units[1:, k]) for k in range(6)]
        travels = [travel_of(self.problem.engine, self._mounting, unit, speed) for unit in spectra]
        return np.stack([t.coefficients[-1] for t in travels if t is not None], axis=-1)

    def _gain(self, quantity: Measure, point: OperatingPoint) -> Callable[[float], float] | None:
        if isinstance(self._mounting, RigidMounting):
            return None
        return lambda h: float(np.abs(self._map(quantity, h, point.speed)[:, :, 3]).max())

    def wrench(self, point: OperatingPoint, at: UnevenSymbols, gain: Callable[[float], float] | None = None) -> Lines:
        """Wrench by order; the roll moment of gas of the orders that a gain leaves to matter."""
        if gain is not None:
            return self._wrench(point, at, gain)
        if (point, at) not in self._wrenches:
            self._wrenches[point, at] = self._wrench(point, at, lambda _: 1.0)
        return self._wrenches[point, at]

    def _wrench(self, point: OperatingPoint, at: UnevenSymbols, gain: Callable[[float], float]) -> Lines:
        share = NEGLIGIBLE if self.problem.fidelity.gas_of(point) is None else self._left_out
        others = [OrderSelection(slice(k, k + 1), NEGLIGIBLE) for k in range(6) if k != ROLL]
        roll = OrderSelection(slice(ROLL, ROLL + 1), share, gain)
        (found,) = self._turned(point, at, _wrench_of, [*others, roll], False)
        return found

    def _place(self, k: int, part: SliderCrank, at: UnevenSymbols) -> tuple[Any, Any]:
        side = self.layout.side(k)
        bank = side * at.bank if at.bank is not None else part.bank
        offset = -side * at.split if at.split is not None else self.layout.pin_offsets[k]
        return at.throws[self.layout.pins[k]] + offset, bank

    def _unbalance(self, rotor: Rotor, at: UnevenSymbols) -> Any:
        """U of a rotor as (re, im), turned with the throw that it rides on."""
        real: Any = rotor.unbalance.real
        imaginary: Any = rotor.unbalance.imag
        for domain in self.domains:
            for drive in domain.decision.rotor_drives:
                if drive.rotor != rotor.name:
                    continue
                columns = at.unbalances[domain.columns]
                for j, direction in enumerate(domain.set.directions):
                    d = drive.of(direction)
                    real = real + d.real * columns[j]
                    imaginary = imaginary + d.imag * columns[j]
                # the rotor stands at the decision's start in the design as given
                given = drive.of(domain.decision.start)
                real, imaginary = real - given.real, imaginary - given.imag
        if rotor.name not in self.rides:
            return ca.vertcat(real, imaginary)
        pin = self.rides[rotor.name]
        turn = at.throws[pin] - self._start[pin]
        cosine, sine = ca.cos(turn), ca.sin(turn)
        return ca.vertcat(cosine * real - sine * imaginary, sine * real + cosine * imaginary)


def _throw_of(parts: Sequence[SliderCrank], layout: Layout, pin: int) -> float:
    k = layout.pins.index(pin)
    return parts[k].throw - layout.pin_offsets[k]


def _turns_of(part: SliderCrank) -> int:
    return round((part.firing_angle + part.throw - part.bank) / math.tau)


def _wrench_of(loads: PointLoads) -> Spectrum:
    return loads.wrench.mapped(lambda wrench: wrench[:, None, :])


def _steps(lines: Lines) -> int:
    return max(LEAST_SAMPLES, int(SAMPLES_PER_ORDER * float(lines.orders.max()) / lines.base))


def rides_of(phasing: Phasing, candidate: Candidate) -> dict[str, int]:
    """The throw that each rotor turns with: found by moving one throw at a time."""
    count = len(candidate.throws)
    throws = tuple(math.tau * k / count for k in range(count))
    return dict(_rides_of(phasing, replace(candidate, throws=throws, firing_order=None, without_gas=True)))


@lru_cache(maxsize=16)
def _rides_of(phasing: Phasing, candidate: Candidate) -> dict[str, int]:
    out = {}
    before = rotor_states(phasing.realise(candidate))
    for k in range(len(candidate.throws)):
        throws = tuple(angle + (0.1 if j == k else 0.0) for j, angle in enumerate(candidate.throws))
        after = rotor_states(phasing.realise(replace(candidate, throws=throws)))
        out.update({name: k for name, state in after.items() if state != before[name]})
    return out


def rotor_states(problem: Problem) -> dict[str, tuple[complex, ...]]:
    """Unbalance of every rotor, and what open ones drive it with."""
    gains: dict[str, list[complex]] = {rotor.name: [] for rotor in problem.engine.rotors}
    for decision in problem.decisions:
        for drive in decision.rotor_drives:
            gains[drive.rotor].append(drive.gain)
    return {rotor.name: (rotor.unbalance, *gains[rotor.name]) for rotor in problem.engine.rotors}
