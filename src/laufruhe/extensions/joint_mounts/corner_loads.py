"""Norms of what unbalances load on given mounts, and what multipliers of them say of all mounts, order by order (E69).

Rows of forces and travel at the samples of the exact model, of one set of mounts after the other; what dual rows at
these samples say of the rows on any other mounts is told by their sums over the cycle, one for every order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from laufruhe.extensions.joint_mounts.mount_loops import mount_loop
from laufruhe.extensions.joint_mounts.mounted_loads import MountedLoads
from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.measure import Measure, load_rows
from laufruhe.prove.certificate import Multipliers, minorant
from laufruhe.prove.mounts.box_response import is_travel
from laufruhe.prove.mounts.ranges import SLACK


@dataclass(frozen=True, eq=False)
class Pairing:
    """What multipliers make of loads on any mounts: constant + slopes . u + Re sum of conj(Z) f over orders.

    Attributes
    ----------
    forces, travels
        Z of the forces and of the travel of all mounts, shape (w, 3 mounts).
    constant, slopes
        Of what mounts do not change, prices of limits included; slopes of shape (columns,).
    """

    forces: ComplexArray
    travels: ComplexArray
    constant: float
    slopes: Array


class CornerLoads(MountedLoads):
    """Loads of a problem that is open in unbalances and numbers of mounts, as norms on given mounts."""

    @property
    def columns(self) -> int:
        """Of the unbalances, and one for what is given, in three directions."""
        return 3 * (1 + sum(domain.width for domain in self.domains))

    @property
    def rows(self) -> int:
        """Of all that is asked on mounts."""
        asked = self.problem
        measures = [*(t.measure for t in asked.load_terms), *(limit.measure for limit in asked.load_limits)]
        places = [mount.name for mount in self.problem.engine.mounts]
        return sum(
            self.samples * len(measure.places(places)) * int(np.count_nonzero(measure.shares(self.problem.points)))
            for measure in measures
            if measure.on_mounts
        )

    def at(self, mounts: Array) -> AffineProblem:
        """Norms of the unbalances on these mounts; infinite rows on a resonance that nothing damps."""
        loop, orders = mount_loop(self.problem, self.orders.omegas, mounts, mounts), self.orders
        felt = [np.einsum("wri,wci->cwr", maps[0], orders.loads, optimize=True) for maps in (loop.forces, loop.travels)]

        def norm(measure: Measure, averaged: bool) -> AffineNorm:
            return self._norm(measure, averaged, felt[is_travel(measure.channel)] if measure.on_mounts else None)

        terms = tuple((term.weight, norm(term.measure, False)) for term in self.problem.load_terms)
        # a mean that is kept by many samples may be over its limit at few (P7)
        limits = tuple(
            (limit.maximum * (1.0 + SLACK), norm(limit.measure, limit.measure.norm.averages))
            for limit in self.problem.load_limits
        )
        return AffineProblem(terms, limits, self.domains, self.samples)

    def _norm(self, measure: Measure, averaged: bool, felt: ComplexArray | None) -> AffineNorm:
        if felt is None:
            return self.still(measure, averaged)
        none = [np.zeros(0)] * len(self.problem.points)
        rows = [
            load_rows(measure, self.problem.points, signals, self.problem.engine, self.samples, none)
            for signals in (self._signals(each, averaged) for each in felt)
        ]
        slopes = [each.vectors for each in rows[1:]]
        slope = np.stack(slopes, axis=-1) if slopes else np.zeros((*rows[0].vectors.shape, 0))
        return AffineNorm(measure.norm, rows[0].vectors, slope, rows[0].grid)

    def _signals(self, felt: ComplexArray, averaged: bool) -> list[Spectrum]:
        """Per operating point, of orders (w, 3 mounts)."""
        found = []
        for p in range(len(self.problem.points)):
            own = self.orders.points == p
            coefficients = np.zeros((1 + int(self.orders.places.max(initial=0)), felt.shape[1] // 3, 3), dtype=complex)
            coefficients[self.orders.places[own]] = felt[own].reshape(-1, felt.shape[1] // 3, 3)
            signal = Spectrum(self._model.base, coefficients)
            found.append(signal.averaged(signal.period / self.samples) if averaged else signal)
        return found

    def pairing(self, problem: AffineProblem, multipliers: Multipliers) -> Pairing:
        """What multipliers found on some mounts say of all: terms in the dual unit ball, limits with their prices."""
        used = minorant(problem, multipliers).multipliers
        asked = self.problem
        told = [(t.weight, t.measure, norm, z) for t, (_, norm), z in zip(
            asked.load_terms, problem.terms, used.terms, strict=True)]  # fmt: skip
        told += [(1.0, limit.measure, norm, z) for limit, (_, norm), z in zip(
            asked.load_limits, problem.limits, used.limits, strict=True)]  # fmt: skip
        prices = [norm.dual_norm(z) * most for (most, norm), z in zip(problem.limits, used.limits, strict=True)]
        constant, slopes = -sum(prices), np.zeros(problem.size)
        width = 3 * len(asked.engine.mounts)
        sums = [np.zeros((len(self.orders.omegas), width), dtype=complex) for _ in range(2)]
        for k, (weight, measure, norm, z) in enumerate(told):
            if measure.on_mounts:
                averaged = k >= len(asked.load_terms) and measure.norm.averages
                sums[is_travel(measure.channel)] += weight * self._sums(measure, z, averaged)
            else:
                constant += weight * float(np.vdot(z, norm.constant))
                slopes = slopes + weight * norm.pulled(z)
        return Pairing(sums[0], sums[1], constant, slopes)

    def _sums(self, measure: Measure, z: Array, averaged: bool) -> ComplexArray:
        """Z of all orders, of dual rows of points, mounts and samples: <z, rows> = Re sum of conj(Z) f."""
        asked, orders = self.problem, self.orders
        chosen, shares = measure.places([mount.name for mount in asked.engine.mounts]), measure.shares(asked.points)
        points = [p for p in range(len(asked.points)) if shares[p] > 0.0]
        rows = z.reshape(len(points), len(chosen), self.samples, 3) * np.array(measure.direction_weights or (1.0,) * 3)
        # sum of z exp(-i k t) over samples
        waves = np.fft.fft(rows, axis=2)
        out = np.zeros((len(orders.omegas), len(asked.engine.mounts), 3), dtype=complex)
        counted = measure.counted(orders.numbers)
        for k, p in enumerate(points):
            own = np.flatnonzero((orders.points == p) & counted)
            out[np.ix_(own, np.array(chosen))] = waves[k][:, orders.places[own] % self.samples].transpose(1, 0, 2)
        if averaged:
            step = 1.0 / self.samples
            out *= (np.sinc(orders.places * step) ** 2)[:, None, None]
        return out.reshape(len(out), -1)


def coarser(problem: AffineProblem, times: int) -> AffineProblem:
    """The same at every so many of its samples."""

    def fewer(norm: AffineNorm) -> AffineNorm:
        # masses have no samples, and few have none to spare
        if norm.grid.steps != problem.samples or problem.samples % times:
            return norm
        kept = np.arange(0, len(norm.grid.weights), times)
        grid = replace(norm.grid, weights=norm.grid.weights[kept] * times, steps=norm.grid.steps // times)
        return replace(norm, constant=norm.constant[kept], slope=norm.slope[kept], grid=grid)

    terms, limits = (tuple((number, fewer(norm)) for number, norm in each) for each in (problem.terms, problem.limits))
    return replace(problem, terms=terms, limits=limits, samples=problem.samples // times)
