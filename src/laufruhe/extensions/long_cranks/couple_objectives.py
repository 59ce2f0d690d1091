"""Objectives of even crank stars as convex functions of their rocking couples (S3, S5, S48).

Even crank stars of one pattern have the same forces. So the signals V and V' of two of them differ by what their
couples C_h and C'_h of order h load: V = V' + Re sum_h g_h (C_h - C'_h) e^{i h phi}, with g_h from two stars whose
loads the exact model gives. Averages of V over shifts by s are no more, in a norm that no shift changes. With the
weights 2 cos(h s), of mean size 4 / pi, one order V_h is left.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.extensions.long_cranks.throw_halves import Window
from laufruhe.load_models.amplitudes import AmplitudeObjective
from laufruhe.load_models.star_model import compress_rows
from laufruhe.machine import Role
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.norms import Grid, Norm
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.crank_stars import Stars, StarSpace, star_sums
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.evaluation import Evaluation, evaluate, with_common_base
from laufruhe.problem.measure import Measure, kinks_of, load_rows
from laufruhe.problem.problem import Problem

ONE_ORDER = 4.0 / math.pi
"""Largest ratio of the norm of one order of a signal to that of the signal."""
# number of phases of a couple at which linear bounds touch the objective
PHASES = 8
SMALL, SHORT = 0.01, 0.1
"""Share of the constant part, and lever [m], of the couples at which linear bounds touch the objective."""
# relative differences of loads that count as none: between stars, and of the loads of one order
_SAME, _NEGLIGIBLE = 1e-9, 1e-13
# most numbers of rows that are computed at once
_AT_ONCE = 1 << 22


class StarAmplitudes(AmplitudeObjective):
    """Sum of norms of forces and couples of single orders, with the window of better stars (S3)."""

    def upper_bound(self, space: StarSpace) -> float:
        """Return an upper bound over all crank stars, as if all throws acted on one side [SI]."""
        levers = float(np.abs(space.places).sum())
        return sum(
            term.weight * float(np.hypot(np.multiply(term.force, space.throws), np.multiply(term.couple, levers)).sum())
            for term in self.terms
        )

    def window(self, space: StarSpace, pattern: tuple[int, ...], value: float) -> Window | None:
        """Return the largest couples of crank stars with an objective below `value`; None if there is none (S5)."""
        shares = np.sum([np.multiply(term.weight, term.couple) for term in self.terms], axis=0)
        room = value - self.forces(space, pattern)
        if room < 0.0:
            return None
        return Window.narrowest(space.phases, {
            order: room / share for order, share in zip(self.orders, shares, strict=True) if share > 0.0
        })  # fmt: skip


@dataclass(frozen=True, eq=False)
class CoupleTerm:
    """Weighted norm of a signal that is affine in the couples, w N(V0 + sum_h Re C_h A_h + Im C_h B_h).

    Attributes
    ----------
    constant, couples
        V0 and the rows A and B of every order one after the other, shapes (k, d) and (2 orders, k, d).
    unit_norms
        Norm of one unit of couple in every order, shape (orders,).
    """

    weight: float
    norm: Norm
    grid: Grid
    constant: Array
    couples: Array
    unit_norms: Array

    def values(self, couples: Array) -> Array:
        """Return the objective term of n crank stars [SI], shape (n,), from their couples by order.

        `couples` has real and imaginary parts, shape (n, 2 orders).
        """
        size, values = self.constant.size, np.empty(len(couples))
        flat, step = self.couples.reshape(len(self.couples), -1), max(1, _AT_ONCE // size)
        for start in range(0, len(couples), step):
            part = slice(start, start + step)
            rows = self.constant.reshape(-1) + couples[part] @ flat
            rows = rows.reshape(-1, *self.constant.shape)
            if self.norm.is_monotone_in_lengths:
                row_lengths = np.sqrt(np.einsum("nkd,nkd->nk", rows, rows))
                values[part] = self.norm.norm_from_lengths(row_lengths, self.grid.weights)
            else:
                values[part] = self.norm.values(self.grid, rows)
        return self.weight * values

    def linear_bound(self, couples: Array) -> tuple[float, Array]:
        """Return constant and slope of a linear lower bound that touches the term at `couples`, (2 orders,) (P2)."""
        rows = self.constant + np.tensordot(couples, self.couples, axes=1)
        z = self.norm.dual_feasible(self.grid, self.norm.subgradient(self.grid, rows))
        return self.weight * float(np.vdot(z, self.constant)), self.weight * np.tensordot(self.couples, z, axes=2)

    @property
    def shares(self) -> Array:
        """Smallest value of the term for a unit couple, shape (orders,)."""
        return self.weight * self.unit_norms / (1.0 if self.norm.is_euclidean else ONE_ORDER)


@dataclass(frozen=True, eq=False)
class CoupleNorms:
    """Sum of norms as a function of the couples of even stars; means are averaged to bound the whole cycle (P7)."""

    orders: tuple[int, ...]
    terms: tuple[CoupleTerm, ...]

    def values(self, space: StarSpace, stars: Stars, maximum: float = math.inf) -> Array:
        """Return the objectives of many crank stars [SI], shape (n,); only lower bounds for those above `maximum`."""
        couples = star_sums(stars, space.phases, space.places, self.orders)[:, :, 1]
        parts = np.ascontiguousarray(couples).view(float).reshape(len(stars), 2 * len(self.orders))
        if maximum == math.inf:
            return np.asarray(sum(term.values(parts) for term in self.terms))
        constants, slopes = self._linear_bounds
        values = (constants + parts @ slopes.T).max(axis=1, initial=0.0)
        below_maximum = values <= maximum
        values[below_maximum] = sum(term.values(parts[below_maximum]) for term in self.terms)
        return np.asarray(values)

    @cached_property
    def _linear_bounds(self) -> tuple[Array, Array]:
        """Constants and slopes of lower bounds of the objective, linear in the rocking couples of the orders (P2).

        Each bound touches the objective at small couples of the two strongest orders, with one pair of their phases.
        """
        shares = np.asarray(sum(term.shares for term in self.terms))
        turns = np.exp(1j * np.arange(PHASES) * math.tau / PHASES)
        strongest_orders = np.argsort(-shares, kind="stable")[:2]
        touching_points = np.zeros((len(turns) ** len(strongest_orders), len(self.orders)), dtype=complex)
        for row, chosen in zip(touching_points, itertools.product(turns, repeat=len(strongest_orders)), strict=True):
            # small compared with the part that no couple changes, if there is one
            row[strongest_orders] = np.array(chosen) / np.maximum(shares[strongest_orders], 1e-300)
        constant_part = float(sum(term.values(np.zeros((1, 2 * len(self.orders))))[0] for term in self.terms))
        unit = SMALL * max(constant_part, float(shares.max(initial=0.0)) * SHORT)
        bounds = [[term.linear_bound(unit * row.view(float)) for term in self.terms] for row in touching_points]
        constants = np.array([sum(constant for constant, _ in parts) for parts in bounds])
        return constants, np.array([sum(slope for _, slope in parts) for parts in bounds])

    def upper_bound(self, space: StarSpace) -> float:
        """Return an upper bound over all crank stars [SI]."""
        levers = float(np.abs(space.places).sum())
        return self.lower_bound(space) + levers * sum(term.weight * float(term.unit_norms.sum()) for term in self.terms)

    def lower_bound(self, space: StarSpace) -> float:
        """Return a lower bound over all crank stars: the value without couples (S40) [SI]."""
        del space
        return float(sum(term.values(np.zeros((1, len(term.couples))))[0] for term in self.terms))

    def window(self, space: StarSpace, pattern: tuple[int, ...], value: float) -> Window | None:
        """Return the largest couples of crank stars with an objective below `value`; None if there is none (S48)."""
        del pattern
        minimum = self.lower_bound(space)
        if value < minimum:
            return None
        shares = np.asarray(sum(term.shares for term in self.terms))
        is_euclidean = len(self.terms) == 1 and self.terms[0].norm.is_euclidean
        # squares of orders add up, so that what no couple changes leaves less room
        room = math.sqrt(value - minimum) * math.sqrt(value + minimum) if is_euclidean else value
        places = np.flatnonzero(shares > 0.0)
        return Window.narrowest(space.phases, {self.orders[k]: room / float(shares[k]) for k in places})


def couple_norms(problem: Problem, space: StarSpace, stars: Sequence[Problem]) -> CoupleNorms | None:
    """Return the objective of evenly firing crank stars as a function of their couples; None if it depends on more.

    Nothing but the phasing of the problem may be open. `stars` are the problems of `three_stars`.
    """
    known = all(term.measure.is_load and not term.measure.is_inside for term in problem.objective)
    if not known or problem.fidelity.has_uneven_speed or problem.limits or len(space.patterns) > 1:
        return None
    if any(rotor.role is not Role.THROW for star in stars for rotor in star.engine.rotors):
        return None
    spread = _Spread.from_stars(problem, space, [evaluate(star) for star in stars])
    if spread is None:
        return None
    return CoupleNorms(spread.orders, tuple(spread.term(term.weight, term.measure) for term in problem.objective))


def three_stars(space: StarSpace) -> Stars:
    """Return three crank stars to build and check the model of couples.

    The second has two neighbouring steps of the first exchanged; the third checks the model.
    """
    first = np.array(space.first, dtype=np.uint8)
    second, third = first.copy(), first.copy()
    throw = int(np.flatnonzero(first == 1)[-1])
    second[[throw, throw + 1]] = first[[throw + 1, throw]]
    third[1:] = np.random.default_rng(2).permutation(first[1:])
    return np.array([first, second, third])


@dataclass(frozen=True, eq=False)
class _Spread:
    """Loads of even crank stars: the signal common to all of them, and the signal of a unit couple in every order.

    Attributes
    ----------
    rest, units
        Signal without couples, and g_h, shape (orders, places, d), of every channel and operating point.
    """

    problem: Problem
    design: Evaluation
    orders: tuple[int, ...]
    rest: dict[LoadChannel, list[Spectrum]]
    units: dict[LoadChannel, list[ComplexArray]]

    @classmethod
    def from_stars(cls, problem: Problem, space: StarSpace, designs: Sequence[Evaluation]) -> _Spread | None:
        """Return loads of crank stars as a fixed part and a part by couple.

        The result is None if stars differ in more than couples.
        """
        base = designs[0].engine.cycle.base_order
        channels = {term.measure.load for term in problem.objective}
        signals = {
            channel: [with_common_base(base, design.signals(channel)) for design in designs] for channel in channels
        }
        every = [signal for by_design in signals.values() for star_loads in by_design for signal in star_loads]
        if any(signal.base != base for signal in every):
            return None
        count, per_turn = max(len(signal.coefficients) for signal in every), round(1 / base)
        orders = [order for order in range(1, (count - 1) // per_turn + 1) if order % space.phases]
        sums = star_sums(three_stars(space), space.phases, space.places, orders)[:, :, 1]
        rest: dict[LoadChannel, list[Spectrum]] = {}
        units: dict[LoadChannel, list[ComplexArray]] = {}
        used = np.zeros(len(orders), dtype=bool)
        # orders that shifts by firing intervals change
        fired = np.arange(count) % len(designs[0].engine.cylinders) > 0
        places = np.array(orders, dtype=np.intp) * per_turn
        for channel, by_design in signals.items():
            rest[channel], units[channel] = [], []
            for at in range(len(problem.points)):
                coefficients = (signals_of[at].coefficients for signals_of in by_design)
                star_loads = [np.pad(x, [(0, count - len(x)), *[(0, 0)] * (x.ndim - 1)]) for x in coefficients]
                unit = (star_loads[1] - star_loads[0])[places] / (sums[1] - sums[0])[:, None, None]
                shared = star_loads[0].copy()
                shared[places] -= unit * sums[0][:, None, None]
                third, size = shared.copy(), float(np.abs(star_loads[0]).max(initial=0.0))
                third[places] += unit * sums[2][:, None, None]
                # couples alone have other orders than firing, and give the loads of the third star
                if (
                    np.abs(third - star_loads[2]).max() > _SAME * size
                    or np.abs(shared[fired]).max(initial=0.0) > _SAME * size
                ):
                    return None
                shared[places] = 0.0
                used |= np.abs(unit).max(axis=(1, 2)) * float(np.abs(space.places).sum()) > _NEGLIGIBLE * size
                rest[channel].append(by_design[0][at].with_coefficients(shared))
                units[channel].append(unit)
        selected = tuple(order for order, use in zip(orders, used, strict=True) if use)
        return cls(problem, designs[0], selected, rest, {c: [u[used] for u in values] for c, values in units.items()})

    def term(self, weight: float, measure: Measure) -> CoupleTerm:
        """Return a measure of the objective as a function of couples, with rows sampled as in results.

        Means are averages over each step (P7).
        """
        rest, norm = self.rest[measure.load], measure.norm
        bends = kinks_of(measure, rest, self.design.engine)
        constant, grid = self._rows(measure, rest, bends)
        per_turn = round(1 / self.design.engine.cycle.base_order)
        rows = []
        for place, order in enumerate(self.orders):
            for turn in (1.0, 1j):
                signals_of_order = []
                for signal, units in zip(rest, self.units[measure.load], strict=True):
                    coefficients = np.zeros((order * per_turn + 1, *units.shape[1:]), dtype=complex)
                    coefficients[-1] = turn * units[place]
                    signals_of_order.append(Spectrum(signal.base, coefficients))
                rows.append(self._rows(measure, signals_of_order, bends)[0])
        couples = np.array(rows).reshape(2 * len(self.orders), *constant.shape)
        unit_norms = np.array([norm.value(grid, unit_rows) for unit_rows in couples[::2]])
        if norm.is_euclidean:
            root = np.sqrt(grid.weights)[:, None]
            compressed = compress_rows([constant * root, couples * root])
            if compressed is not None:
                (constant, couples), grid = compressed, Grid(np.ones(compressed[0].shape[0]), compressed[0].shape[0])
        return CoupleTerm(weight, norm, grid, constant, couples, unit_norms)

    def _rows(self, measure: Measure, signals: Sequence[Spectrum], bends: Sequence[Array]) -> tuple[Array, Grid]:
        samples = self.design.samples * (1 if measure.norm.averages else measure.norm.refinement)
        if measure.norm.averages:
            signals = [signal.averaged(signal.period / samples) for signal in signals]
        rows = load_rows(measure, self.problem.points, signals, self.design.engine, samples, bends)
        return rows.vectors, rows.grid
