"""Problem with objective and limits as norms of load rows that are affine in the decisions (P1).

A row is the vector of a load at one sampled angle and place. The coefficients are loads that the exact model computes
once for each column, an entry of the decision vector.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint, Rotor
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN, NORMS, Grid, Norm
from laufruhe.numerics.spectrum import Spectrum, as_order, common_base
from laufruhe.physics.mounting import NO_MAP, Mounting, mounting_of, travel_of
from laufruhe.physics.shaking_loads import added_geared_loads, added_rotor_loads, shaking_loads
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.decision import Decision, Domain, Kind, NumberDrive, column_scales, decision_vector, domains_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Limit, Measure, Rows, kinks_of, load_rows, mass_rows
from laufruhe.problem.problem import Problem

MAXIMUM = NORMS["maximum"]
# largest unit of a column over the value that balances the loads, and smallest unit over the bound of the column
UNIT_MARGIN, MIN_UNIT = 1e3, 1e-9
FEASIBLE = 1e-6
"""Relative violation of a limit that counts as none."""
MANY_COLUMNS, FREE = 16, 1e-12
"""Number of columns from which fewer free columns are looked for, and relative size of a load that counts as none."""
MAX_NUMBERS = 60_000_000
"""Largest number of coefficients of one measure; a solver needs about ten times that memory."""


@dataclass(frozen=True, eq=False)
class AffineNorm:
    """Norm of load rows that are affine in the decision vector x: N(V0 + B x).

    Attributes
    ----------
    constant
        Rows V0 of the load of the design with every decision at zero, shape (k, d).
    slope
        Derivative B of the rows by x, shape (k, d, n).
    """

    norm: Norm
    constant: Array
    slope: Array
    grid: Grid

    @cached_property
    def free_slope(self) -> tuple[Array, Array]:
        """Slope B' in few free columns basis x, with B = B' basis; shapes (k, d, r) and (r, n) (P21).

        Many columns often change the rows in few directions only. Otherwise r = n, and the basis is the identity.
        """
        n, rows = self.slope.shape[-1], self.slope.reshape(self.constant.size, -1)
        if n >= MANY_COLUMNS:
            sizes = np.maximum(rows.max(axis=0), -rows.min(axis=0))
            sizes = np.where(sizes > 0.0, sizes, 1.0)
            # few rows suggest the directions, and all rows confirm them
            sample = rows[np.random.default_rng(n).integers(len(rows), size=8 * n)] / sizes
            _, values, directions = np.linalg.svd(sample, full_matrices=False)
            directions = directions[values > FREE * values[0]]
            if 0 < 2 * len(directions) <= n:
                slope, basis = rows @ (directions / sizes).T, directions * sizes
                errors = (np.abs(slope @ basis[:, k] - rows[:, k]).max() for k in range(n))
                if all(error <= FREE * size for error, size in zip(errors, sizes, strict=True)):
                    return slope.reshape(*self.constant.shape, len(basis)), basis
        return self.slope, np.eye(n)

    def coarser(self, factor: int) -> AffineNorm:
        """Return the norm with every `factor`-th sample only; `factor` divides the samples of a signal."""
        grid = replace(self.grid, weights=factor * self.grid.weights[::factor], steps=self.grid.steps // factor)
        return replace(self, constant=self.constant[::factor], slope=self.slope[::factor], grid=grid)

    def rows(self, x: Array) -> Array:
        """Return the load rows V0 + B x, shape (k, d)."""
        moved = self.slope.reshape(self.constant.size, len(x)) @ x
        return self.constant + moved.reshape(self.constant.shape)

    def value(self, x: Array) -> float:
        """Return the norm at a decision vector of shape (n,)."""
        return self.norm.value(self.grid, self.rows(x))

    def subgradient(self, x: Array) -> Array:
        """Return dual rows Z, shape (k, d), with <Z, V> = N(V) at the rows V of a decision vector (P2)."""
        return self.norm.subgradient(self.grid, self.rows(x))

    def pullback(self, z: Array) -> Array:
        """Return the gradient of <Z, V> in the decision vector, shape (n,), for dual rows of shape (k, d)."""
        return np.asarray(z.ravel() @ self.slope.reshape(z.size, -1))

    def dual_norm(self, z: Array) -> float:
        """Return the dual norm of dual rows z, shape (k, d) (P3)."""
        return self.norm.dual_norm(self.grid, z)

    def dual_feasible(self, z: Array) -> Array:
        """Return dual rows, shape (k, d), scaled into the unit ball of the dual norm (P3)."""
        return self.norm.dual_feasible(self.grid, z)


@dataclass(frozen=True, eq=False)
class AffineProblem:
    """Convex problem: minimise a weighted sum of norms under limits on norms, with every decision in its set.

    Attributes
    ----------
    terms, limits
        Pairs (weight, norm) of the objective, and pairs (maximum, norm) of the limits.
    samples
        Number of samples over the common period of the loads.
    groups
        Index of the sum that each term belongs to; the objective is the largest sum. Empty for one sum of all terms.
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
        """Decision vector of the initial design, shape (n,)."""
        return decision_vector(self.domains)

    @property
    def scales(self) -> Array:
        """Largest absolute value of every column, shape (n,)."""
        return column_scales(self.domains)

    @cached_property
    def units(self) -> Array:
        """Unit of every decision in a solver, shape (n,): its bound, or less if a small value balances the loads.

        The unit is at most `UNIT_MARGIN` times the value that balances the constant rows. Otherwise a huge bound of one
        column would leave no significant digits for the others.
        """
        norms = [norm for _, norm in (*self.terms, *self.limits)]
        constants = [float(np.linalg.norm(norm.constant)) for norm in norms]
        squares = [np.einsum("kdn,kdn->n", norm.slope, norm.slope) for norm in norms]
        units = []
        for domain in self.domains:
            slopes = [math.sqrt(float(square[domain.columns].sum())) for square in squares]
            sizes = [constant / slope for constant, slope in zip(constants, slopes, strict=True) if slope > 0.0]
            balancing = max(sizes, default=0.0)
            # a size that is a rounding error of the bound counts as none
            unit = max(UNIT_MARGIN * balancing, MIN_UNIT * domain.scale) if balancing else domain.scale
            units += [min(domain.scale, unit)] * domain.width
        return np.array(units)

    def objective(self, x: Array) -> float:
        """Return the weighted sum of the terms at x, or the largest sum of several groups of terms."""
        values = np.array([weight * norm.value(x) for weight, norm in self.terms])
        return float(np.bincount(self.groups or [0] * len(values), values).max(initial=0.0))

    def with_weighted_groups(self, shares: Array) -> AffineProblem:
        """Return the problem whose objective is the mixture of the group sums with weights `shares`, shape (groups,).

        Shares that are not negative and add up to one give a lower bound of the largest sum.
        """
        used = [k for k, group in enumerate(self.groups) if shares[group] > 0.0]
        terms = tuple((self.terms[k][0] * float(shares[self.groups[k]]), self.terms[k][1]) for k in used)
        return replace(self, terms=terms, groups=())

    def violation(self, x: Array) -> float:
        """Return the largest relative violation of a limit at x, negative if all are kept; zero without limits."""
        return max(((norm.value(x) - maximum) / (maximum or 1.0) for maximum, norm in self.limits), default=0.0)


def typical_size(problem: AffineProblem, norms: Sequence[AffineNorm]) -> float:
    """Return a typical positive value of norms [SI]: the largest norm at x = 0, or slope times unit of its column."""
    sizes = [norm.value(np.zeros(problem.size)) for norm in norms]
    sizes += [float(np.abs(norm.slope * problem.units).max(initial=0.0)) for norm in norms]
    return max(sizes, default=0.0) or 1.0


class AffineModel:
    """Load spectra of the design with every decision at zero, and of each column of the decision vector.

    Norms at any number of samples follow from these spectra without another evaluation of the engine.

    Parameters
    ----------
    keep_all
        Whether load rows keep components that are zero, so that several models can be added up.
    whole_cycle
        Whether load rows cover the whole working cycle, even if the loads repeat within it.

    Attributes
    ----------
    bare
        Evaluation of the design with every decision at zero.
    base
        Lowest order of the common period of the loads.
    kink_model
        Model whose kinks are used in place of its own, so that several models share sample angles; None for its own.
    """

    kink_model: AffineModel | None = None

    def __init__(self, problem: Problem, keep_all: bool = False, whole_cycle: bool = False) -> None:
        self.problem = problem
        self._keep_all = keep_all
        # rows that repeat within the common period are needed once, unless models are to be added up
        self._once = not keep_all and not whole_cycle
        self.domains = domains_of(problem.unbalances)
        self.bare = evaluate(problem, problem.design([0.0] * len(problem.unbalances), problem.unbalances))
        if problem.fidelity.mounts == "time" and problem.engine.block is not None:
            raise ModelError(NO_MAP)
        mounting = mounting_of(problem.engine, problem.fidelity)
        self._changes = [
            _change(problem, domain.decision, direction)
            for domain in self.domains
            for direction in domain.set.directions
        ]
        # loads of one unit of every column, at every operating point
        columns = [(_only_changed(problem.engine, change), change.shares) for change in self._changes]
        self._slopes = [[_loads(*column, point, problem, mounting) for column in columns] for point in problem.points]
        self.base = problem.engine.cycle.base_order
        if not whole_cycle:
            orders = tuple(as_order(abs(rotor.shaft.ratio)) for change in self._changes for rotor in change.rotors)
            # loads inside the crankcase may repeat less often than the wrench on the block, and machines may be still
            inside = {measure.load for measure in problem.measures if measure.is_inside}
            machines = [
                loads for columns in self._slopes for loads, change in zip(columns, self._changes, strict=True)
                if change.extras
            ]  # fmt: skip
            counted = [*self.bare.loads, *machines]
            signals = [loads.wrench for loads in counted]
            signals += [channel.signal(loads) for channel in inside for loads in counted]
            self.base = common_base([signal.repeat_order(orders) for signal in signals] or [Fraction(1)])

    @property
    def full_samples(self) -> int:
        """Number of samples over one period of the loads that the fidelity of the problem asks for."""
        cycle = self.problem.engine.cycle
        return max(int(self.problem.fidelity.samples * float(cycle.base_order / self.base)), 24)

    def at(self, samples: int, averaged: bool = False, finer: bool = False) -> AffineProblem:
        """Return every measure as a norm of rows V0 + B x in the decisions x, sampled over the period of the loads.

        Parameters
        ----------
        averaged
            Whether rows of means are averages over the step about each sample. A lower bound of their mean is a lower
            bound of the mean over the whole cycle (P7).
        finer
            Whether the rows of peaks have the finer samples of the final evaluation (M6).
        """

        def norm(measure: Measure) -> AffineNorm:
            times = measure.norm.refinement if finer and measure.is_load else 1
            return self.norm(measure, times * samples, averaged)

        problem = self.problem
        terms = tuple((term.weight, norm(term.measure)) for term in problem.objective)
        limits = tuple((limit.maximum, norm(limit.measure)) for limit in problem.load_limits)
        return AffineProblem(terms, limits, self.domains, samples)

    def with_limits(self, limits: Sequence[Limit]) -> AffineModel:
        """Return a copy of the model with these limits of the problem."""
        other = copy(self)
        other.problem = replace(self.problem, limits=tuple(limits))
        return other

    def wrenches(self) -> list[tuple[Spectrum, tuple[Spectrum, ...]]]:
        """Return, for each operating point, the wrench without the open unbalances, and that of one unit of each."""
        return [
            (loads.wrench, tuple(column.wrench for column in columns))
            for loads, columns in zip(self.bare.loads, self._slopes, strict=True)
        ]

    def spectra(self, channel: LoadChannel) -> list[tuple[Spectrum, tuple[Spectrum, ...]]]:
        """Return, for each operating point, a load without the open unbalances, and that of one unit of each."""
        signals = self.bare.signals(channel)
        columns = [tuple(map(channel.signal, slopes)) for slopes in self._slopes]
        return [(_listed(bare, units), units) for bare, units in zip(signals, columns, strict=True)]

    def norm(self, measure: Measure, samples: int, averaged: bool = False, peaks: int = 0) -> AffineNorm:
        """Return a measure as the norm of load rows that are affine in the decision vector.

        Parameters
        ----------
        averaged
            Whether the rows of a mean are averages over the step about each sample.
        peaks
            Rows of norms other than means are averaged over 1/`peaks` of a step, if `averaged`; 0 for no average.
        """
        channel, linearised = measure.channel, self.problem.known_rows.get(measure)
        if linearised is not None:
            grid = Grid(np.ones(len(linearised.constant)), len(linearised.constant))
            return AffineNorm(MAXIMUM, linearised.constant, linearised.slope, grid)
        if channel.is_number:
            # numbers of fixed mounts or of a fixed flywheel are the same for every design
            rows = Rows(MEAN, np.array([[self.bare.value(measure)]]), Grid(np.ones(1), 1))
            return _stacked(rows, [np.zeros((1, 1))] * len(self._changes), len(self._changes), self._keep_all)
        if not isinstance(channel, LoadChannel):
            engine = self.bare.engine
            bare, slopes = mass_rows(measure, engine.rotors, engine.slider_cranks), []
            for change in self._changes:
                changed = {rotor.name: rotor.unbalance for rotor in change.rotors}
                rotors = [replace(rotor, unbalance=changed.get(rotor.name, 0.0)) for rotor in engine.rotors]
                slopes.append(mass_rows(measure, rotors, _only_changed(engine, change).slider_cranks).vectors)
            return _stacked(bare, slopes, len(slopes), self._keep_all)
        parts = peaks if averaged and not measure.norm.averages else int(averaged)
        pairs = self.spectra(channel)
        bare_signals = [bare for bare, _ in pairs]
        column_signals = [[columns[k] for _, columns in pairs] for k in range(len(self._changes))]
        base = self.base
        if self._once:
            signals = [*bare_signals, *(signal for column in column_signals for signal in column)]
            base = common_base([signal.repeat_order() for signal in signals])
            # shortest period that whole numbers of samples divide
            if any((steps * self.base / base).denominator > 1 for steps in (samples, self.full_samples)):
                base = self.base
        samples = int(samples * self.base / base)
        # decisions add no kinks, but their rows stand at the same angles
        kinked = bare_signals if self.kink_model is None else self.kink_model.bare.signals(channel)
        kinks = kinks_of(measure, [signal.with_base(base) for signal in kinked], self.problem.engine)

        def sampled(signals: Sequence[Spectrum]) -> Rows:
            period = [signal.with_base(base) for signal in signals]
            if parts:
                period = [signal.averaged(signal.period / (parts * samples)) for signal in period]
            return load_rows(measure, self.problem.points, period, self.problem.engine, samples, kinks)

        bare = sampled(bare_signals)
        if bare.vectors.size * len(self._changes) > MAX_NUMBERS:
            size = f"{bare.vectors.size * len(self._changes) / 1e6:.0f} million numbers at once"
            raise ModelError(f"{size} are needed; give fewer operating points, open numbers or samples", "problem")
        columns = (sampled(column).vectors for column in column_signals)
        return _stacked(bare, columns, len(column_signals), self._keep_all)


class _Change(NamedTuple):
    # one unit of a column: rotors by their unbalance, pistons by one kilogram, geared shafts by all their inertia,
    # numbers of extensions by one
    rotors: tuple[Rotor, ...]
    pistons: tuple[tuple[str, str], ...]
    shares: tuple[str, ...]
    extras: Mapping[str, Mapping[Any, complex]]


def _change(problem: Problem, decision: Decision, direction: complex) -> _Change:
    by_name = {rotor.name: rotor for rotor in problem.engine.rotors}
    rotors = tuple(replace(by_name[d.rotor], unbalance=d.of(direction)) for d in decision.rotor_drives)
    extras: dict[str, dict[Any, complex]] = {}
    for drive in decision.drives:
        if isinstance(drive, NumberDrive) and drive.kind not in (Kind.PISTON, Kind.SHARE):
            extras.setdefault(drive.kind.name, {})[drive.key] = direction
    return _Change(rotors, decision.keys(Kind.PISTON), decision.keys(Kind.SHARE), extras)


def _only_changed(engine: Engine, change: _Change) -> Engine:
    # the engine with the changed rotors and pistons as its only masses, and the changed machines as its only load
    parts = (part.only({mass: 1.0 for name, mass in change.pistons if name == part.name})
             for part in engine.slider_cranks)  # fmt: skip
    extras = tuple(extra.only(change.extras.get(extra.name, {})) for extra in engine.extras)
    return replace(engine, slider_cranks=tuple(parts), rotors=change.rotors, load_torque=None, extras=extras)


def _loads(
    parts: Engine, shares: tuple[str, ...], point: OperatingPoint, problem: Problem, mounting: Mounting | None
) -> PointLoads:
    """Return the loads that some parts of the engine cause at an operating point, at the speed of the whole engine.

    `parts` is the engine with these parts as its only masses. `shares` are names of geared shafts whose whole inertia
    is added.
    """
    without_gas = replace(problem.fidelity, gas=False, gas_orders=None)
    wrench = added_rotor_loads(parts.rotors, problem.engine, point, problem.fidelity)
    if parts.is_loaded or any(part != part.only({}) for part in parts.slider_cranks):
        wrench = shaking_loads(parts, point, without_gas)
    if shares:
        geared = tuple(replace(shaft, share=1.0) for shaft in problem.engine.geared if shaft.name in shares)
        wrench = wrench + added_geared_loads(replace(problem.engine, geared=geared), point, problem.fidelity)
    forces = mounting.forces(wrench, point.speed) if mounting else None
    travel = travel_of(problem.engine, mounting, wrench, point.speed)
    return PointLoads(point, wrench, forces, travel, parts, without_gas)


def _listed(bare: Spectrum, columns: Sequence[Spectrum]) -> Spectrum:
    # the orders of its kinks that a sum with the columns lists, because means count listed orders alone (L5a)
    for column in columns:
        if bare.kinks is not None and column.orders[-1] > bare.orders[-1]:
            bare = bare + column.mapped(np.zeros_like)
    return bare


def _stacked(bare: Rows, slopes: Iterable[Array], count: int, keep_all: bool) -> AffineNorm:
    """Return the norm of rows and their slopes, shape (k, d) for each of `count` columns, without unused components."""
    slope = np.empty((*bare.vectors.shape, count))
    used = np.array([keep_all or component.any() for component in bare.vectors.T])
    # one column after another, because each is as large as the rows
    for column, rows in enumerate(slopes):
        slope[..., column] = rows
        used |= [is_used or component.any() for is_used, component in zip(used, rows.T, strict=True)]
    used[:1] |= not used.any()
    if used.all():
        return AffineNorm(bare.norm, bare.vectors, slope, bare.grid)
    # rows contiguous in memory, which products with them need
    return AffineNorm(bare.norm, np.compress(used, bare.vectors, axis=1), np.compress(used, slope, axis=1), bare.grid)
