"""Loads of a problem with open unbalances and open mounts, order by order (E69)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from laufruhe.extensions.joint_mounts.mount_loops import mount_loop
from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.load_models.throw_waves import MovingPart, ThrowWaves
from laufruhe.load_models.uneven_model import rotor_throws_of
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.spectrum import Spectrum, stacked_coefficients
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.measure import Measure, load_rows
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.prove.certificate import Multipliers, minorant
from laufruhe.prove.mounts.box_response import NEGLIGIBLE, LoadedOrders, is_travel
from laufruhe.prove.mounts.ranges import SLACK

_NONE = Spectrum(Fraction(1), np.zeros((1, 6), dtype=complex))


@dataclass(frozen=True, eq=False)
class OpenThrows:
    """Throws of a crank without gas loads, some with open angles, and without open unbalances on them.

    The initial angles and their bounds [rad] have the shape (throws,).
    """

    waves: ThrowWaves
    angles: Array
    lower: Array
    upper: Array

    @property
    def open(self) -> list[int]:
        """Indices of the open throws."""
        return [int(k) for k in np.flatnonzero(self.lower < self.upper)]

    @property
    def sides(self) -> tuple[Array, Array]:
        """Bounds of the open throws [rad]."""
        return self.lower[self.open], self.upper[self.open]

    def wrenches(self, point: int) -> list[Spectrum]:
        """Return the wrench on the block from each open throw at an angle of zero, at an operating point."""

        def turned(part: MovingPart) -> Spectrum:
            wrench = part.evaluations[0].loads[point].wrench.series
            return wrench.with_coefficients(wrench.coefficients * np.exp(1j * wrench.orders * part.ahead)[:, None])

        parts = self.waves.parts
        return [sum((turned(part) for part in parts if part.pin == pin), start=_NONE) for pin in self.open]


def throws_at(problem: Problem, phasing: Phasing, candidate: Candidate) -> OpenThrows | None:
    """Return the open throws of a crank for bounds over boxes; None if boxes cannot represent them.

    The crank is turned as a whole, so that its throws are closest to their bounds.
    Gas loads are nonlinear in the throws, and open bank angles, pins or shafts are not throws.
    """
    is_unsupported = (
        problem.depends_on_gas
        or problem.fidelity.has_uneven_speed
        or any(phasing.is_geometry_open)
        or phasing.shafts.optional
    )
    if phasing.throw_bounds is None or is_unsupported:
        return None
    star_problem = with_default_sampling(replace(phasing.problem_of(candidate), phasing=None))
    weights_on_throws = rotor_throws_of(phasing, candidate)
    if any(drive.rotor in weights_on_throws for decision in star_problem.decisions for drive in decision.rotor_drives):
        return None
    lower, upper = np.transpose(phasing.throw_bounds)
    angles = np.array(candidate.throws)
    angles = np.clip(angles + math.tau * np.round((0.5 * (lower + upper) - angles) / math.tau), lower, upper)
    return OpenThrows(ThrowWaves(star_problem, phasing.layout_of(candidate), weights_on_throws), angles, lower, upper)


def along_arcs(halves: Array) -> tuple[Array, Array, Array]:
    """Return the linear approximation of e^{i a t} over t from -1 to 1, with its error, for half angles a (E72).

    Order h of a throw at the angle theta has the load c e^{i h theta}. Over theta = m + t d and a = h d at most pi it
    is c e^{i h m} ((1 + cos a) / 2 + i t sin a), up to |c| ((1 - cos a)^2 / 4 + (a^3 / (9 root 3))^2)^(1/2): cos(a t)
    lies between cos a and 1, and sin(a t) differs from its chord by at most a^3 (t - t^3) / 6. A remainder over |c|
    replaces the order. The arrays have the shape of `halves`: the real middle value, the slope along i, and a bound of
    the error.
    """
    remainder = np.hypot(0.5 * (1.0 - np.cos(halves)), halves**3 / (9.0 * math.sqrt(3.0)))
    is_expanded = (halves <= math.pi) & (remainder < 1.0)
    middle, slope = np.where(is_expanded, 0.5 * (1.0 + np.cos(halves)), 0.0), np.where(is_expanded, np.sin(halves), 0.0)
    return middle, slope, np.where(is_expanded, remainder, 1.0)


@dataclass(frozen=True, eq=False)
class Pairing:
    """Lower bound of the objective by multipliers: constant + slopes . u + Re sum of conj(Z) f over orders.

    u are the columns of unbalances, and f the forces and travel of the mounts.

    Attributes
    ----------
    forces, travels
        Multipliers Z of forces and travel of all mounts, shape (w, 3 mounts).
    constant, slopes
        Part without forces and travel, less the prices of limits; slopes of shape (columns,).
    """

    forces: ComplexArray
    travels: ComplexArray
    constant: float
    slopes: Array


class MountedLoads:
    """Loads of a problem with open unbalances and open mounts; loads of open throws are separate from fixed loads.

    Attributes
    ----------
    samples
        Count of samples of each signal over its period.
    domains
        Domains of the open unbalances.
    """

    def __init__(self, problem: Problem, throws: OpenThrows | None = None) -> None:
        self.problem, self._throws = problem, throws
        bounded_problem = off_resonance(problem)
        self._model = AffineModel(bounded_problem, keep_all=True)
        samples = problem.fidelity.samples * bounded_problem.engine.cycle.base_order
        if throws or self._model.full_samples * self._model.base != samples:
            # rows have the samples of the exact model
            self._model = AffineModel(bounded_problem, keep_all=True, whole_cycle=True)
        self.samples, self.domains = self._model.full_samples, self._model.domains
        self._norms: dict[tuple[Measure, bool], AffineNorm] = {}

    @cached_property
    def orders(self) -> LoadedOrders:
        """Orders with loads: wrenches of fixed loads, of each unit column, and of each open throw at angle zero."""
        block = mounting_in(self.problem.engine).block
        # to coordinates with unit mass
        wrench_map = moved_wrench(NUMBERS, block.centre_of_gravity).T @ mass_root(block).T
        rows: list[tuple[int, int, float, float, ComplexArray]] = []
        angles = self._throws.angles[self._throws.open] if self._throws else np.zeros(0)
        for p, (point, (constant, slopes)) in enumerate(zip(self.problem.points, self._model.wrenches(), strict=True)):
            base, series = stacked_coefficients(
                [constant, *slopes, *(self._throws.wrenches(p) if self._throws else ())]
            )
            loads = series @ wrench_map
            waves = np.exp(1j * float(base) * np.outer(angles, np.arange(loads.shape[1])))
            loads[0] -= np.einsum("pk,pki->ki", waves, loads[1 + len(slopes) :])
            size = np.abs(loads).max(axis=(0, 2), initial=0.0)
            for k in np.flatnonzero(size > NEGLIGIBLE * size.max(initial=0.0)):
                number, place = float(k) * float(base), int(k) * base / self._model.base
                rows.append((p, round(place), number, number * point.speed, loads[:, k]))
        points, places, numbers, omegas, wrenches = (np.array(column) for column in zip(*rows, strict=True))
        return LoadedOrders(points, places, numbers, omegas, wrenches, self.samples)

    def norm_without_mounts(self, measure: Measure, averaged: bool) -> AffineNorm:
        """Return the norm of a measure that does not depend on mounts."""
        if (measure, averaged) not in self._norms:
            self._norms[measure, averaged] = self._model.norm(measure, self.samples, averaged)
        return self._norms[measure, averaged]

    @property
    def rows(self) -> int:
        """Number of sampled force or travel vectors (rows) of all measures on mounts."""
        problem = self.problem
        measures = [*(t.measure for t in problem.load_terms), *(limit.measure for limit in problem.load_limits)]
        places = [mount.name for mount in problem.engine.mounts]
        measures = [measure for measure in measures if measure.on_mounts]
        counts = (len(m.places(places)) * int(np.count_nonzero(m.shares(problem.points))) for m in measures)
        return self.samples * sum(counts)

    def at(self, mounts: Array) -> AffineProblem:
        """Return the problem of the unbalances on mounts with these numbers, shape (n,).

        Its numbers are infinite on an undamped resonance.
        """
        loop, orders = mount_loop(self.problem, self.orders.omegas, mounts, mounts), self.orders
        responses = [
            np.einsum("wri,wci->cwr", maps[0], orders.loads, optimize=True) for maps in (loop.forces, loop.travels)
        ]

        def norm(measure: Measure, averaged: bool) -> AffineNorm:
            if not measure.on_mounts:
                return self.norm_without_mounts(measure, averaged)
            return self._norm(measure, averaged, responses[is_travel(measure.channel)])

        terms = tuple((term.weight, norm(term.measure, False)) for term in self.problem.load_terms)
        # averages are lower bounds of means by few samples (P7)
        limits = tuple(
            (limit.maximum * (1.0 + SLACK), norm(limit.measure, limit.measure.norm.averages))
            for limit in self.problem.load_limits
        )
        return AffineProblem(terms, limits, self.domains, self.samples)

    def _norm(self, measure: Measure, averaged: bool, responses: ComplexArray) -> AffineNorm:
        no_kinks = [np.zeros(0)] * len(self.problem.points)
        rows = [
            load_rows(measure, self.problem.points, signals, self.problem.engine, self.samples, no_kinks)
            for signals in (self._signals(response, averaged) for response in responses)
        ]
        slopes = [column_rows.vectors for column_rows in rows[1:]]
        slope = np.stack(slopes, axis=-1) if slopes else np.zeros((*rows[0].vectors.shape, 0))
        return AffineNorm(measure.norm, rows[0].vectors, slope, rows[0].grid)

    def _signals(self, response: ComplexArray, averaged: bool) -> list[Spectrum]:
        # signals of all operating points from responses to orders, shape (w, 3 mounts)
        signals, mounts = [], response.shape[1] // 3
        for p in range(len(self.problem.points)):
            is_at_point = self.orders.points == p
            coefficients = np.zeros((1 + int(self.orders.places.max(initial=0)), mounts, 3), dtype=complex)
            coefficients[self.orders.places[is_at_point]] = response[is_at_point].reshape(-1, mounts, 3)
            signal = Spectrum(self._model.base, coefficients)
            signals.append(signal.averaged(signal.period / self.samples) if averaged else signal)
        return signals

    def pairing(self, problem: AffineProblem, multipliers: Multipliers) -> Pairing:
        """Return a lower bound of the objective that holds for any mounts, by multipliers from one set of mounts.

        It pairs these multipliers with the forces and travel that the mounts of a design have.
        """
        scaled = minorant(problem, multipliers).multipliers
        terms = zip(self.problem.load_terms, problem.terms, scaled.terms, strict=True)
        limits = zip(self.problem.load_limits, problem.limits, scaled.limits, strict=True)
        rows = [(term.weight, term.measure, False, norm, z) for term, (_, norm), z in terms]
        rows += [(1.0, limit.measure, limit.measure.norm.averages, norm, z) for limit, (_, norm), z in limits]
        prices = [norm.dual_norm(z) * maximum for (maximum, norm), z in zip(problem.limits, scaled.limits, strict=True)]
        constant, slopes = -sum(prices), np.zeros(problem.size)
        width = 3 * len(self.problem.engine.mounts)
        sums = [np.zeros((len(self.orders.omegas), width), dtype=complex) for _ in range(2)]
        for weight, measure, averaged, norm, z in rows:
            if measure.on_mounts:
                sums[is_travel(measure.channel)] += weight * self._sums(measure, z, averaged)
            else:
                constant += weight * float(np.vdot(z, norm.constant))
                slopes = slopes + weight * norm.pullback(z)
        return Pairing(sums[0], sums[1], constant, slopes)

    def _sums(self, measure: Measure, z: Array, averaged: bool) -> ComplexArray:
        """Return multipliers Z of mount forces f by order, shape (w, 3 mounts), from multipliers z of samples.

        They give the same sum: <z, rows> = Re sum conj(Z) f.
        """
        problem, orders = self.problem, self.orders
        chosen, shares = measure.places([mount.name for mount in problem.engine.mounts]), measure.shares(problem.points)
        points = [p for p in range(len(problem.points)) if shares[p] > 0.0]
        rows = z.reshape(len(points), len(chosen), self.samples, 3) * np.array(measure.direction_weights or (1.0,) * 3)
        # sum of z exp(-i k t) over samples
        waves = np.fft.fft(rows, axis=2)
        sums = np.zeros((len(orders.omegas), len(problem.engine.mounts), 3), dtype=complex)
        is_counted = measure.counted(orders.orders)
        for k, p in enumerate(points):
            indices = np.flatnonzero((orders.points == p) & is_counted)
            sums[np.ix_(indices, np.array(chosen))] = waves[k][:, orders.places[indices] % self.samples].transpose(
                1, 0, 2
            )
        if averaged:
            step = 1.0 / self.samples
            sums *= (np.sinc(orders.places * step) ** 2)[:, None, None]
        return sums.reshape(len(sums), -1)


def coarser(problem: AffineProblem, factor: int) -> AffineProblem:
    """Return a coarser program, whose norms have every `factor`-th sample only."""
    # masses have no samples
    terms, limits = (
        tuple((number, norm.coarser(factor) if norm.grid.steps == problem.samples else norm) for number, norm in pairs)
        for pairs in (problem.terms, problem.limits)
    )
    return replace(problem, terms=terms, limits=limits, samples=problem.samples // factor)
