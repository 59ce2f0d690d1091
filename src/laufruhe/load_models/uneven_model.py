"""Measures of loads as smooth CasADi expressions of throws, bank angle, split pin and unbalances (S19, S23, S37).

A cylinder that fires at crank angle zero has the load A_h in order h with its axis upright, B_h with the axis a quarter
turn further, and D_h upside down. With its axis at bank angle b and its throw at s = theta + o - b - 2 pi l, where o is
the pin offset and l the whole turns before its firing, which the firing order fixes, the load is

    e^{i h s} ((A_h - D_h) / 2 cos b + (B_h - C_h) sin b + C_h),     C_h = (A_h + D_h) / 2,

because the load turns with the axis, except for its components along and about the crankshaft. The load of an unbalance
U is Re U times that of unbalance 1 plus Im U times that of unbalance i, in the order of its shaft. A rotor on a throw
turns with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.load_models.isolated_cylinders import (
    BANK_SAMPLES,
    evaluate_cylinders,
    isolate_rotors,
    motored,
    split_by_bank,
)
from laufruhe.load_models.symbolic_spectrum import SymbolicSpectrum, relevant_orders
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.machine import OperatingPoint, Rotor
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import Spectrum, stacked_coefficients
from laufruhe.problem.decision import Domain, column_scales, domains_of
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Measure, counted_rotors, narrow_signal, radius_of
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem

MIN_SAMPLES, SAMPLES_PER_ORDER = 72, 6
# relative size of an order that counts as zero
_NEGLIGIBLE = 1e-12
# largest share of the root mean square of a component in omitted orders: of the lowest orders, their number, and of
# the others up to the highest; gas and jumps of the pressure have orders without end
LOW_LEFT_OUT, LOWEST, LEFT_OUT, HIGHEST = 1e-9, 24, 1e-3, 24.0
# random designs at which sizes of orders are compared
PROBES = 6


class UnevenModel:
    """Loads of a crank with open angles, smooth in throws, bank angle, split pin and unbalances (S19, S23).

    Parameters
    ----------
    problem
        Problem with the crank star from which the open angles are counted.
    moves
        Open angles and their bounds.
    deviations, unbalances
        CasADi symbols or numbers of the open angles [rad], and of the decision vector of the unbalances.
    """

    def __init__(self, problem: Problem, moves: ThrowMoves, deviations: Any, unbalances: Any) -> None:
        self.problem, self._moves, self._variables = problem, moves, [deviations, unbalances]
        self.domains: tuple[Domain, ...] = domains_of(problem.unbalances)
        self._rotor_throws, layout = rotor_throws_of(moves.phasing, moves.start), moves.layout
        self._throws, open_bank, open_split = moves.angles(deviations)
        parts = problem.engine.slider_cranks
        firsts = [layout.pins.index(pin) for pin in range(len(layout.throw_positions))]
        self._start = [parts[k].throw - layout.pin_offsets[k] for k in firsts]
        engine, inside = problem.engine, any(measure.is_inside for measure in problem.measures)
        # loads that add up: evaluations, the factor of each, and the angle by which their phases are ahead
        self._sources: list[tuple[Sequence[Evaluation], Sequence[Any], Any]] = []
        cylinders = evaluate_cylinders(problem, layout, open_bank is not None, inside)
        for k, (part, cylinder) in enumerate(zip(parts, cylinders, strict=True)):
            side = layout.side(k)
            bank = side * open_bank if open_bank is not None else part.bank
            offset = -side * open_split if open_split is not None else layout.pin_offsets[k]
            # the firing order fixes the number of turns before the firing
            turns = round((part.firing_angle + part.throw - part.bank) / math.tau)
            angle = self._throws[layout.pins[k]] + offset - bank - math.tau * turns
            self._sources.append((cylinder, (ca.cos(bank), ca.sin(bank), 1.0)[-len(cylinder) :], angle))
        if engine.is_loaded:
            fixed = isolate_rotors(engine, (), inside).loaded_as(engine)
            self._sources.append(((evaluate(motored(problem), fixed),), (1.0,), 0.0))
        self._gas_and_inertia = sum(len(evaluations) for evaluations, _, _ in self._sources)
        # unbalance of every rotor as expressions (re, im) [kg m]
        at_zero = problem.design([0.0] * len(problem.unbalances), problem.unbalances)
        self._unbalances = {rotor.name: self._unbalance(rotor, unbalances) for rotor in at_zero.rotors}
        for rotor in engine.rotors:
            units = [isolate_rotors(engine, [replace(rotor, unbalance=u)], inside) for u in (1.0, 1.0j)]
            pair = [evaluate(motored(problem), unit) for unit in units]
            self._sources.append((pair, ca.vertsplit(self._unbalances[rotor.name]), 0.0))

    def rows(self, measure: Measure) -> tuple[Any, Grid]:
        """Return the vectors (rows) whose norm is a measure, shape (k, d), as CasADi expressions, and their grid (P1).

        Rows are coefficients of orders for a root mean square (Parseval), and values at samples for other norms.
        """
        if measure.is_mass:
            counted = counted_rotors(measure, self.problem.engine.rotors)
            rows = [(self._unbalances[r.name] / radius_of(r)).T for r in counted]
            return ca.vertcat(*rows), Grid(np.ones(len(rows)), 1)
        engine, chosen = self.problem.engine, [point for point in self.problem.points if measure.includes_point(point)]
        total_weight = sum(point.weight for point in chosen)
        by_point = [
            self._load(point, lambda loads: narrow_signal(measure, measure.load.signal(loads), engine))
            for point in chosen
        ]
        blocks: list[Any] = []
        weights: list[Array] = []
        if measure.norm.is_euclidean:
            for point, (load, basis, places) in zip(chosen, by_point, strict=True):
                half = np.where(load.orders == 0.0, 1.0, 0.5) * point.weight / total_weight / places
                for part in (load.real, load.imaginary):
                    blocks += ca.horzsplit(part.T @ basis, basis.shape[1] // places)
                weights += [half] * (2 * places)
            return ca.vertcat(*blocks), Grid(np.concatenate(weights), blocks[0].shape[0])
        # orders differ between points: all have the samples that the highest order needs
        highest = max(float(load.orders.max()) / load.base for load, _, _ in by_point)
        steps = max(MIN_SAMPLES, int(SAMPLES_PER_ORDER * highest))
        for point, (load, basis, places) in zip(chosen, by_point, strict=True):
            blocks += ca.horzsplit(load.sampled(steps) @ basis, basis.shape[1] // places)
            weights.append(np.full(places * steps, point.weight / total_weight / places / steps))
        return ca.vertcat(*blocks), Grid(np.concatenate(weights), steps, points=len(chosen))

    def wrench(self, point: OperatingPoint) -> SymbolicSpectrum:
        """Return the symbolic wrench on the block at an operating point."""
        load, basis, _ = self._load(point, lambda loads: loads.wrench.mapped(lambda wrench: wrench[:, None, :]))
        return load.mapped(basis.full().T)

    def wrenches(self, transform: Array) -> list[SymbolicSpectrum]:
        """Return the symbolic wrench on the block at every operating point, multiplied by a 6 x 6 `transform`.

        Orders that are small at all of `PROBES` random designs are left out.
        """
        relevant, bounds = [], column_scales(self.domains)
        for point in self.problem.points:
            wrench = self.wrench(point).mapped(transform)
            function = ca.Function("sizes", self._variables, [wrench.real, wrench.imaginary])
            generator = np.random.default_rng(0)
            designs = [
                (
                    generator.uniform(self._moves.lower, self._moves.upper),
                    bounds * generator.uniform(-1.0, 1.0, len(bounds)),
                )
                for _ in range(PROBES)
            ]
            values = [np.abs(np.array(part, dtype=float)) for design in designs for part in function(*design)]
            relevant.append(wrench.select(relevant_orders(np.max(values, axis=(0, 1)), wrench.orders)))
        return relevant

    def _load(
        self, point: OperatingPoint, signal: Callable[[PointLoads], Spectrum]
    ) -> tuple[SymbolicSpectrum, Any, int]:
        """Return a load at one operating point as an expression of throw and bank angles, its basis and its places.

        `signal` is a function from the loads of an engine to the load, shape (n, places, d). The r components of the
        spectrum times the basis, shape (r, places d), are those of all places, which are mounts, parts of the
        crankcase, or the block.
        """
        p = self.problem.points.index(point)
        signals = [signal(part.loads[p]).series.truncated(HIGHEST) for parts, _, _ in self._sources for part in parts]
        base, stacked = stacked_coefficients(signals, self.problem.engine.cycle.base_order)
        places, d = stacked.shape[2:]
        stacked = stacked.reshape(*stacked.shape[:2], places * d)
        count = self._gas_and_inertia
        is_needed = _needed_orders(np.square(np.abs(stacked[:count])).sum(axis=0)) | stacked[count:].any(axis=(0, 2))
        # forces on rigid mounts have no more independent components than the wrench
        flat = np.concatenate([stacked.real, stacked.imag]).reshape(-1, places * d)
        _, sizes, vectors = np.linalg.svd(
            flat / (np.abs(flat).max(axis=1, keepdims=True) + 1e-300), full_matrices=False
        )
        basis = vectors[: max(int((sizes > _NEGLIGIBLE * sizes[0]).sum()), 1)]
        stacked = stacked @ basis.T
        orders, rows = np.asarray(np.flatnonzero(is_needed) * float(base)), iter(stacked[:, is_needed])
        size = basis.shape[0]
        real, imaginary = ca.DM(size, len(orders)), ca.DM(size, len(orders))
        for parts, factors, angle in self._sources:
            values = tuple(next(rows) for _ in parts)
            terms = split_by_bank(*values) if len(values) == len(BANK_SAMPLES) else values
            a = sum(_dm(coefficients.real.T) * factor for coefficients, factor in zip(terms, factors, strict=True))
            b = sum(_dm(coefficients.imag.T) * factor for coefficients, factor in zip(terms, factors, strict=True))
            phases = ca.DM(orders).T * angle
            cosine, sine = (ca.repmat(wave(phases), size, 1) for wave in (ca.cos, ca.sin))
            real, imaginary = real + a * cosine - b * sine, imaginary + a * sine + b * cosine
        return SymbolicSpectrum(orders, real, imaginary), ca.DM(basis), places

    def _unbalance(self, rotor: Rotor, columns: Any) -> Any:
        # from the rotor with all open unbalances at zero; a rotor on a throw turns with it
        real: Any = rotor.unbalance.real
        imaginary: Any = rotor.unbalance.imag
        for domain in self.domains:
            for drive in domain.decision.rotor_drives:
                for j, direction in enumerate(domain.set.directions if drive.rotor == rotor.name else ()):
                    gain = drive.of(direction)
                    real = real + gain.real * columns[domain.start + j]
                    imaginary = imaginary + gain.imag * columns[domain.start + j]
        if rotor.name not in self._rotor_throws:
            return ca.vertcat(real, imaginary)
        pin = self._rotor_throws[rotor.name]
        turn = self._throws[pin] - self._start[pin]
        cosine, sine = ca.cos(turn), ca.sin(turn)
        return ca.vertcat(cosine * real - sine * imaginary, sine * real + cosine * imaginary)


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


def _needed_orders(squares: Array) -> Mask:
    # orders that any component needs, from the squares of the coefficients, shape (orders, components)
    tail = np.cumsum(squares[::-1], axis=0)[::-1]
    left_out = np.where(np.arange(len(squares)) < LOWEST, LOW_LEFT_OUT, LEFT_OUT)[:, None]
    mask = ((tail > left_out**2 * tail[0]) & (squares > _NEGLIGIBLE**2 * tail[0])).any(axis=1)
    return np.asarray(mask if mask.any() else np.arange(len(squares)) == 0)


def _dm(values: Array) -> Any:
    # sparse, because gas has many orders but few components
    return ca.sparsify(ca.DM(np.ascontiguousarray(values)))
