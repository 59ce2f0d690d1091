"""A problem as norms of rows that are affine in its decisions, with numbers from the exact model (P1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint, Rotor
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN, NORMS, Grid, Norm
from laufruhe.numerics.spectrum import Spectrum, as_order, common_base
from laufruhe.physics.mounting import NO_MAP, Mounting, mounting_of, travel_of
from laufruhe.physics.shaking_loads import added_geared_loads, added_rotor_loads, shaking_loads
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.decision import Decision, Domain, Kind, column_scales, decision_vector, domains_of
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Limit, Measure, Rows, kinks_of, load_rows, mass_rows
from laufruhe.problem.problem import Problem

MAXIMUM = NORMS["maximum"]
NEEDED, LEAST_UNIT = 1e3, 1e-9
FEASIBLE = 1e-6
"""Relative excess over a limit that counts as none."""
MOST_NUMBERS = 60_000_000
"""Of one measure: rows by open numbers; some ten times as many are held while a program is solved."""


@dataclass(frozen=True, eq=False)
class AffineNorm:
    """N(V0 + B x) on a grid.

    Attributes
    ----------
    constant
        V0, shape (k, d).
    slope
        B, shape (k, d, n).
    grid
        Weights of the rows, and how they follow each other.
    """

    norm: Norm
    constant: Array
    slope: Array
    grid: Grid

    def rows(self, x: Array) -> Array:
        """V0 + B x, shape (k, d)."""
        moved = self.slope.reshape(self.constant.size, len(x)) @ x
        return self.constant + moved.reshape(self.constant.shape)

    def value(self, x: Array) -> float:
        """The norm at x."""
        return self.norm.value(self.grid, self.rows(x))

    def subgradient(self, x: Array) -> Array:
        """Dual rows along the rows at x (P2)."""
        return self.norm.subgradient(self.grid, self.rows(x))

    def pullback(self, z: Array) -> Array:
        """Slope of <Z, V> in the decision vector, shape (n,)."""
        return np.asarray(z.ravel() @ self.slope.reshape(z.size, -1))

    def dual_norm(self, z: Array) -> float:
        """Return the dual norm of rows z, shape (k, d) (P3)."""
        return self.norm.dual_norm(self.grid, z)

    def dual_feasible(self, z: Array) -> Array:
        """Dual rows brought into the unit ball (P3)."""
        return self.norm.dual_feasible(self.grid, z)


@dataclass(frozen=True, eq=False)
class AffineProblem:
    """Least sum of weighted norms, some norms limited, each decision in its own set.

    Attributes
    ----------
    terms
        (weight, norm) pairs.
    limits
        (maximum, norm) pairs.
    domains
        Of the decisions.
    samples
        Steps over the common period of the load rows.
    groups
        Of each term the sum that it belongs to, the largest of which is minimised; one sum of all when empty.
    """

    terms: tuple[tuple[float, AffineNorm], ...]
    limits: tuple[tuple[float, AffineNorm], ...]
    domains: tuple[Domain, ...]
    samples: int
    groups: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        """Length of the decision vector."""
        return sum(domain.width for domain in self.domains)

    @property
    def start(self) -> Array:
        """The decision vector of the design as given."""
        return decision_vector(self.domains)

    @property
    def scales(self) -> Array:
        """Largest size of every column."""
        return column_scales(self.domains)

    @cached_property
    def units(self) -> Array:
        """A size of every column for a solver: its bound, or a thousand times what all loads need if that is less.

        Bounds that are far apart would else leave no digits for the small ones.
        """
        norms = [norm for _, norm in (*self.terms, *self.limits)]
        constants = [float(np.linalg.norm(norm.constant)) for norm in norms]
        squares = [np.einsum("kdn,kdn->n", norm.slope, norm.slope) for norm in norms]
        found = []
        for domain in self.domains:
            own = [math.sqrt(float(square[domain.columns].sum())) for square in squares]
            needs = [constant / size for constant, size in zip(constants, own, strict=True) if size > 0.0]
            # a need that is a rounding of what the bounds could load is none
            needed = max(NEEDED * max(needs, default=0.0), LEAST_UNIT * domain.scale)
            found.append(np.full(domain.width, min(domain.scale, needed) if max(needs, default=0.0) else domain.scale))
        return np.concatenate(found) if found else np.zeros(0)

    def objective(self, x: Array) -> float:
        """Weighted sum of the terms, or the largest of several."""
        values = np.array([weight * norm.value(x) for weight, norm in self.terms])
        return float(np.bincount(self.groups or [0] * len(values), values).max(initial=0.0))

    def shared(self, shares: Array) -> AffineProblem:
        """Return the problem with the sums weighted by shares in place of the largest sum.

        Its value is not larger where the shares add up to one.
        """
        kept = [k for k, group in enumerate(self.groups) if shares[group] > 0.0]
        terms = tuple((self.terms[k][0] * float(shares[self.groups[k]]), self.terms[k][1]) for k in kept)
        return replace(self, terms=terms, groups=())

    def violation(self, x: Array) -> float:
        """Largest relative excess over a limit, negative where all have room; zero without limits."""
        return max(((norm.value(x) - maximum) / (maximum or 1.0) for maximum, norm in self.limits), default=0.0)


def reach(problem: AffineProblem, norms: Sequence[AffineNorm]) -> float:
    """A size of these norms that is not zero: at no decisions, or at large ones."""
    sizes = [norm.value(np.zeros(problem.size)) for norm in norms]
    sizes += [float(np.abs(norm.slope * problem.units).max(initial=0.0)) for norm in norms]
    return max(sizes, default=0.0) or 1.0


class AffineModel:
    """Spectra of the design without its decisions, and of each decision alone.

    Rows at any number of samples follow from them without evaluating the engine again.

    Parameters
    ----------
    whole_cycle
        Rows over the whole working cycle, even where the loads repeat within it.

    Attributes
    ----------
    bare
        The design with every decision at zero.
    lead
        A model whose bends are counted in place of its own.
    """

    lead: AffineModel | None = None

    def __init__(self, problem: Problem, keep_all: bool = False, whole_cycle: bool = False) -> None:
        self.problem = problem
        # components that are zero are dropped, unless models are to be added up
        self._keep_all = keep_all
        # rows that repeat within the common period are needed once, unless they are to be added up
        self._once = not keep_all and not whole_cycle
        self.domains = domains_of(problem.unbalances)
        bare = evaluate(problem, problem.design([0.0] * len(problem.unbalances), problem.unbalances))
        if problem.fidelity.mounts == "time" and problem.engine.block is not None:
            raise ModelError(NO_MAP)
        mounting = mounting_of(problem.engine, problem.fidelity)
        changes = [_change(problem, d.decision, direction) for d in self.domains for direction in d.set.directions]
        self.bare, self._changes = bare, changes
        orders = [as_order(abs(r.shaft.ratio)) for change in changes for r in change.rotors]
        # loads of every column alone, at every operating point
        alone = [(_alone(problem.engine, change), change.shares) for change in changes]
        self._slopes = [[_loads(*each, point, problem, mounting) for each in alone] for point in problem.points]
        self.base = problem.engine.cycle.base_order if whole_cycle else self._shortest_base(bare, orders)

    def _shortest_base(self, bare: Evaluation, orders: Sequence[Fraction]) -> Fraction:
        # a bearing feels each cylinder beside it alone, so loads inside the crankcase count too
        inside = {measure.load for measure in self.problem.measures if measure.is_inside}
        signals = [*(loads.wrench for loads in bare.loads), *(s for channel in inside for s in bare.signals(channel))]
        return common_base([signal.repeat_order(tuple(orders)) for signal in signals] or [Fraction(1)])

    @property
    def full_samples(self) -> int:
        """Steps of the problem's fidelity that fall into one period of the loads."""
        cycle = self.problem.engine.cycle
        return max(int(self.problem.fidelity.samples * float(cycle.base_order / self.base)), 24)

    def at(self, samples: int, averaged: bool = False, finer: bool = False) -> AffineProblem:
        """The problem with its load rows at `samples` steps over their common period.

        Rows of means may be averaged about their angles: what bounds these, bounds the
        whole cycle (P7). Rows of peaks may be as much finer as results are measured (M6).
        """

        def norm(measure: Measure) -> AffineNorm:
            times = measure.norm.refinement if finer and measure.is_load else 1
            return self.norm(measure, times * samples, averaged)

        problem = self.problem
        terms = tuple((term.weight, norm(term.measure)) for term in problem.objective)
        limits = tuple((limit.maximum, norm(limit.measure)) for limit in problem.load_limits)
        return AffineProblem(terms, limits, self.domains, samples)

    def with_limits(self, limits: Sequence[Limit]) -> AffineModel:
        """The same model under some of its limits."""
        other = copy(self)
        other.problem = replace(self.problem, limits=tuple(limits))
        return other

    def wrenches(self) -> list[tuple[Spectrum, tuple[Spectrum, ...]]]:
        """Per operating point the wrench of the bare design, and of one unit of every column."""
        return [
            (loads.wrench, tuple(each.wrench for each in by))
            for loads, by in zip(self.bare.loads, self._slopes, strict=True)
        ]

    def spectra(self, channel: LoadChannel) -> list[tuple[Spectrum, tuple[Spectrum, ...]]]:
        """Per operating point what a channel measures of the bare design, and of one unit of every column."""
        own = self.bare.signals(channel)
        return [(bare, tuple(map(channel.signal, by))) for bare, by in zip(own, self._slopes, strict=True)]

    def norm(self, measure: Measure, samples: int, averaged: bool = False, peaks: int = 0) -> AffineNorm:
        """A measure at `samples` steps over the common period, a mean averaged about them, peaks in parts of these."""
        channel, known = measure.channel, self.problem.known_rows.get(measure)
        if known is not None:
            grid = Grid(np.ones(len(known.constant)), len(known.constant))
            return AffineNorm(MAXIMUM, known.constant, known.slope, grid)
        if channel.is_number:
            # of mounts or of a flywheel that stay: the same for every design
            only = Rows(MEAN, np.array([[self.bare.value(measure)]]), Grid(np.ones(1), 1))
            return _stacked(only, [np.zeros((1, 1))] * len(self._changes), self._keep_all)
        if not isinstance(channel, LoadChannel):
            engine = self.bare.engine
            bare = mass_rows(measure, engine.rotors, engine.slider_cranks)
            slopes = [
                mass_rows(measure, _only(engine, change.rotors), _alone(engine, change).slider_cranks).vectors
                for change in self._changes
            ]
            return _stacked(bare, slopes, self._keep_all)
        parts = peaks if averaged and not measure.norm.averages else int(averaged)
        pairs = self.spectra(channel)
        own = [bare for bare, _ in pairs]
        alone = [[by[k] for _, by in pairs] for k in range(len(self._changes))]
        base = self._own_base([*own, *(signal for by in alone for signal in by)], samples)
        samples = int(samples * self.base / base)
        # what is open does not bend, but has to be known at the same angles
        lead = [signal.with_base(base) for signal in (own if self.lead is None else self.lead.bare.signals(channel))]
        bends = kinks_of(measure, lead, self.problem.engine)
        bare = self._rows(measure, own, base, samples, parts, bends)
        if bare.vectors.size * len(self._changes) > MOST_NUMBERS:
            size = f"{bare.vectors.size * len(self._changes) / 1e6:.0f} million numbers at once"
            raise ModelError(f"{size} are needed; give fewer operating points, open numbers or samples", "problem")
        slopes = [self._rows(measure, by, base, samples, parts, bends).vectors for by in alone]
        return _stacked(bare, slopes, self._keep_all)

    def _own_base(self, signals: Sequence[Spectrum], samples: int) -> Fraction:
        own = common_base([signal.repeat_order() for signal in signals]) if self._once else self.base
        whole = all((steps * self.base / own).denominator == 1 for steps in (samples, self.full_samples))
        return own if whole else self.base

    def _rows(
        self, measure: Measure, signals: Sequence[Spectrum], base: Fraction, samples: int, parts: int,
        bends: Sequence[Array],
    ) -> Rows:  # fmt: skip
        period = [signal.with_base(base) for signal in signals]
        if parts:
            period = [signal.averaged(signal.period / (parts * samples)) for signal in period]
        return load_rows(measure, self.problem.points, period, self.problem.engine, samples, bends)


@dataclass(frozen=True)
class _Change:
    # one unit of a column: rotors, masses with one more kilogram, geared shafts with all inertia
    rotors: tuple[Rotor, ...]
    pistons: tuple[tuple[str, str], ...]
    shares: tuple[str, ...] = ()


def _change(problem: Problem, decision: Decision, direction: complex) -> _Change:
    by_name = {rotor.name: rotor for rotor in problem.engine.rotors}
    rotors = tuple(replace(by_name[d.rotor], unbalance=d.of(direction)) for d in decision.rotor_drives)
    if decision.keys(Kind.PISTON) and problem.fidelity.is_uneven:
        rule = "reciprocating masses are decided for a crank that turns evenly"
        raise ModelError(f"{rule}; leave fidelity.crank_inertia out, or fix the mass")
    return _Change(rotors, decision.keys(Kind.PISTON), decision.keys(Kind.SHARE))


def _only(engine: Engine, rotors: Sequence[Rotor]) -> tuple[Rotor, ...]:
    changed = {rotor.name: rotor.unbalance for rotor in rotors}
    return tuple(replace(rotor, unbalance=changed.get(rotor.name, 0.0)) for rotor in engine.rotors)


def _alone(engine: Engine, change: _Change) -> Engine:
    # the engine with the changed rotors and pistons as its only masses
    parts = (part.only({mass: 1.0 for name, mass in change.pistons if name == part.name})
             for part in engine.slider_cranks)  # fmt: skip
    return replace(engine, slider_cranks=tuple(parts), rotors=change.rotors)


def _loads(
    alone: Engine, shares: tuple[str, ...], point: OperatingPoint, problem: Problem, mounting: Mounting | None
) -> PointLoads:
    """Return the loads of these parts at an operating point; torque and uneven speed are those of the whole engine."""
    without_gas = replace(problem.fidelity, gas=False, gas_orders=None)
    wrench = added_rotor_loads(alone.rotors, problem.engine, point, problem.fidelity)
    if any(part != part.only({}) for part in alone.slider_cranks):
        wrench = shaking_loads(alone, point, without_gas)
    if shares:
        geared = tuple(replace(own, share=1.0) for own in problem.engine.geared if own.name in shares)
        wrench = wrench + added_geared_loads(replace(problem.engine, geared=geared), point, problem.fidelity)
    forces = mounting.forces(wrench, point.speed) if mounting else None
    travel = travel_of(problem.engine, mounting, wrench, point.speed)
    return PointLoads(point, wrench, forces, travel, alone, without_gas)


def _stacked(bare: Rows, slopes: Sequence[Array], keep_all: bool) -> AffineNorm:
    used = np.any([keep_all | np.any(rows != 0.0, axis=0) for rows in (bare.vectors, *slopes)], axis=0)
    used[:1] |= not used.any()
    # in memory row by row, as every product with them takes them
    constant, *moved = (np.compress(used, rows, axis=1) for rows in (bare.vectors, *slopes))
    slope = np.stack(moved, axis=-1) if moved else np.zeros((*constant.shape, 0))
    return AffineNorm(bare.norm, constant, slope, bare.grid)
