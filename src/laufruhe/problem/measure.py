"""Measures: norms of channels that a problem minimises and limits (P1).

A measure of loads or masses is a norm of rows, vectors that are affine in the unbalances. Evaluation, optimisation and
proofs all use these rows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint, Role, Rotor, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN, NORMS, Grid, Norm
from laufruhe.numerics.spectrum import JUMP_OFFSET, Spectrum, orders_equal
from laufruhe.problem.channels import CHANNELS, MOUNT_FORCE, Channel, LoadChannel, MassChannel, is_at_mounts
from laufruhe.problem.loads import MeasureQuery, PointLoads


@dataclass(frozen=True)
class Measure(MeasureQuery):
    """A number of a design: a channel narrowed by keys, or the norm of a load over angles, places and points."""

    channel: Channel
    norm: Norm = MEAN

    @property
    def name(self) -> str:
        """Name in reports."""
        part = "alternating " if self.alternating else ""
        text = f"{self.norm.name} {part}{self.channel}" if self.is_load else str(self.channel)
        if self.direction_weights is not None:
            text += " with direction weights " + ", ".join(f"{weight:g}" for weight in self.direction_weights)
        if self.orders is not None:
            text += " of order " + ", ".join(f"{order:g}" for order in self.orders)
        narrowed = {" of ": self.motions, " on ": self.at, " at ": self.points, " under ": self.cases}
        return text + "".join(word + ", ".join(names) for word, names in narrowed.items() if names is not None)

    @property
    def unit(self) -> str:
        """SI unit."""
        return self.channel.unit

    @property
    def is_load(self) -> bool:
        """True for a norm of a signal over the cycle."""
        return self.channel.is_load

    @property
    def is_mass(self) -> bool:
        """True for a sum of masses."""
        return self.channel.is_mass

    @property
    def is_mounting(self) -> bool:
        """True for a number of a block on its mounts."""
        return self.channel.is_mounting

    @property
    def load(self) -> LoadChannel:
        """Channel of a load."""
        if not isinstance(self.channel, LoadChannel):
            raise TypeError(f"{self.name} is no load")
        return self.channel

    @property
    def roles(self) -> tuple[Role, ...]:
        """Roles of the rotors in a sum of masses."""
        if not isinstance(self.channel, MassChannel):
            raise TypeError(f"{self.name} is no mass")
        return self.channel.roles

    @property
    def on_mounts(self) -> bool:
        """True for the force or the travel of each mount."""
        return is_at_mounts(self.channel)

    @property
    def is_inside(self) -> bool:
        """True for a load inside the crankcase."""
        return self.is_load and not self.load.is_block_load

    @property
    def depends_on_gas(self) -> bool:
        """True if the gas may change the measure.

        These are norms of loads with gas, run-ups, and numbers computed from loads or the torque.
        """
        channel = self.channel
        depends_on_loads = channel.depends_on_torque or (channel.is_number and channel.depends_on_loads)
        return channel.depends_on_gas or bool(channel.simulation) or depends_on_loads

    @property
    def depends_on_loads(self) -> bool:
        """True if the measure may depend on loads of pistons, rods and gas."""
        return not self.is_mass and (self.channel.depends_on_loads or self.channel.depends_on_torque)

    @property
    def is_cylinder_resolved(self) -> bool:
        """True for a number of the crankshaft's torsion, which is no sum over the cylinders."""
        return self.channel.depends_on_loads and self.channel.is_number and not self.is_mounting

    def shares(self, points: Sequence[OperatingPoint]) -> Array:
        """Return the weight of each operating point, shape (points,): sum one, zero for points that do not count."""
        weights = [p.weight if self.includes_point(p) else 0.0 for p in points]
        return np.array(weights) / (sum(weights) or math.nan)

    def counted(self, orders: Sequence[float] | Array) -> NDArray[np.bool_]:
        """Return the mask of the orders that count, shape of `orders`."""
        counts = np.ones(np.shape(orders), dtype=bool) if self.orders is None else orders_equal(orders, self.orders)
        return counts & ~orders_equal(orders, 0.0) if self.alternating else counts

    @property
    def includes_mean(self) -> bool:
        """True if the measure contains the mean of the load over the cycle."""
        return self.is_load and bool(self.counted([0.0])[0])

    @property
    def with_all_orders(self) -> Measure:
        """The same measure with all orders, including the mean."""
        return replace(self, orders=None, alternating=False)

    def signal(self, loads: PointLoads, engine: Engine) -> Spectrum:
        """Return the spectrum of the places and orders that count at an operating point, shape (n, places, d)."""
        return narrow_signal(self, self.load.signal(loads), engine)


@dataclass(frozen=True)
class Term:
    """A weighted term of the objective."""

    measure: Measure
    weight: float = 1.0


@dataclass(frozen=True)
class PriorityLevel:
    """Objective of one priority, minimised over the optima of all objectives of higher priority.

    Objectives of lower priority may increase this one by the fraction `within` of its minimum.
    """

    terms: tuple[Term, ...]
    within: float = 0.0


@dataclass(frozen=True)
class Limit:
    """Limits of a measure.

    Attributes
    ----------
    maximum, minimum
        Largest and smallest allowed value [SI].
    outside
        Lower and upper edge of a band that no value may lie in [SI].
    """

    name: str
    measure: Measure
    maximum: float = math.inf
    minimum: float = -math.inf
    outside: tuple[float, float] | None = None

    def slack(self, value: float) -> tuple[float, float, str]:
        """Return the distance of a value from the nearer side of a limit: slack, bound, "at most" or "at least" (E15).

        The slack is relative to the bound, and negative if the value violates the limit. The bound is in SI units.
        """
        sides = self._sides(value)
        if self.outside is not None:
            low, high = self.outside
            nearest = max((low - value, low, "at most"), (value - high, high, "at least"))
            sides.append((nearest[0] / (abs(nearest[1]) or 1.0), *nearest[1:]))
        return min(sides, default=(math.inf, 0.0, ""))

    def slacks(self, values: Array) -> Array:
        """Return the slack of each value relative to its bound, shape of `values`."""
        if self.outside is not None:
            return np.array([self.slack(value)[0] for value in values.tolist()])
        slacks = [np.full(len(values), math.inf), *(slack for slack, *_ in self._sides(values))]
        return np.asarray(np.min(slacks, axis=0))

    def _sides(self, value: Any) -> list[tuple[Any, float, str]]:
        # relative slack, bound and sense of the smallest and the largest allowed value
        bounds = ((self.minimum, "at least", 1.0), (self.maximum, "at most", -1.0))
        return [
            (sign * (value - bound) / (abs(bound) or 1.0), bound, side)
            for bound, side, sign in bounds
            if math.isfinite(bound)
        ]


Side: TypeAlias = tuple[Limit, str]
"""A limit and one of its sides: "at most" or "at least"."""

MEAN_MOUNT_FORCE = Measure(MOUNT_FORCE)

MEASURES: Mapping[str, tuple[Channel, Norm]] = {
    **{f"{norm} {c}": (c, NORMS[norm]) for c in CHANNELS.values() for norm in c.norms},
    **{name: (channel, MEAN) for name, channel in CHANNELS.items() if not channel.is_load},
}
"""Measures by their names in files and reports."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Vectors whose norm is a measure, shape (k, d) [SI] (P1)."""

    norm: Norm
    vectors: Array
    grid: Grid

    @property
    def value(self) -> float:
        """Value of the measure [SI]."""
        return self.norm.value(self.grid, self.vectors)


def load_rows(
    measure: Measure, points: Sequence[OperatingPoint], signals: Sequence[Spectrum], engine: Engine, samples: int,
    kink_angles: Sequence[Array] | None = None,
) -> Rows:  # fmt: skip
    """Return the vectors (rows) of a load: samples at equal steps of its period, and for peaks also values at kinks.

    Parameters
    ----------
    signals
        Signal of the channel at each operating point, shape (n, places, d), all with one base order.
    engine
        Engine whose mounts, bearings or cylinders are the places.
    samples
        Number of samples over the period of the signals.
    kink_angles
        Angles of kinks at each operating point, the same number for each [rad]; by default those of `kinks_of`.

    Returns
    -------
    Rows, ordered by operating point, place, and angle (samples, then kinks). Their weights sum to one.
    """
    blocks, weights = [], []
    kink_angles = kinks_of(measure, signals, engine) if kink_angles is None else kink_angles
    for signal, share, angles in zip(signals, measure.shares(points), kink_angles, strict=True):
        if share == 0.0:
            continue
        counted = narrow_signal(measure, signal, engine)
        if measure.norm.refinement == 1:
            values = counted.series.sample(samples)
        else:
            values = np.concatenate([counted.sample(samples, JUMP_OFFSET), counted.values(angles)])
        # the engine may lack the selected places
        if not values.shape[1]:
            continue
        rows = values.swapaxes(0, 1).reshape(-1, values.shape[-1])
        blocks.append(rows)
        weights.append(np.full(len(rows), share / len(rows)))
    if not blocks:
        return Rows(measure.norm, np.zeros((1, 1)), Grid(np.ones(1), 1))
    count = len(kink_angles[0])
    # one block needs no copy
    rows, shares = (blocks[0], weights[0]) if len(blocks) == 1 else (np.concatenate(blocks), np.concatenate(weights))
    return Rows(measure.norm, rows, Grid(shares, samples + count, count, len(blocks)))


def kinks_of(measure: Measure, signals: Sequence[Spectrum], engine: Engine) -> list[Array]:
    """Return the crank angles [rad] at which the slope of a signal jumps, so that a peak may lie there (L5a).

    The list has one array for each operating point, all of the same length.
    """
    if measure.norm.refinement == 1:
        return [np.zeros(0)] * len(signals)
    kinks = [narrow_signal(measure, signal, engine).kink_angles for signal in signals]
    count = max(map(len, kinks))
    return [np.resize(angles, count) if len(angles) else np.zeros(count) for angles in kinks]


def narrow_signal(measure: Measure, signal: Spectrum, engine: Engine) -> Spectrum:
    """Return the part of a signal that a measure counts: its places, orders and weighted directions, (n, places, d).

    A channel that sums its places is multiplied by their number, so that the mean over places is the sum.
    """
    if measure.at is not None:
        signal = signal.mapped(lambda values: values[:, measure.places(measure.load.places(engine)), :])
    if measure.direction_weights is not None:
        signal = signal.mapped(lambda values: values * np.array(measure.direction_weights))
    if measure.load.sums_places:
        signal = signal.mapped(lambda values: values * values.shape[1])
    if measure.orders is not None:
        signal = signal.with_orders(measure.orders)
    return signal.without_mean if measure.alternating else signal


def counted_rotors(measure: Measure, rotors: Sequence[Rotor]) -> tuple[Rotor, ...]:
    """Return the rotors whose masses a measure sums."""
    roles = measure.roles
    return tuple(r for r in rotors if (r.role in roles if measure.rotors is None else r.name in measure.rotors))


def counterweight_masses(measure: Measure, parts: Sequence[SliderCrank]) -> list[float]:
    """Return the masses of the counterweights of mechanisms that a measure sums [kg]; none if it names rotors."""
    counts = Role.COUNTERWEIGHT in measure.roles and measure.rotors is None
    return [mass for part in parts if counts and (mass := part.counterweight_mass) is not None]


def mass_rows(measure: Measure, rotors: Sequence[Rotor], parts: Sequence[SliderCrank] = ()) -> Rows:
    """Return the vectors (rows) of a sum of masses, shape (k, 2) [kg]: unbalance / radius of rotors, and masses.

    Without any counted part there is one zero row.
    """
    counted = counted_rotors(measure, rotors)
    vectors = [[r.unbalance.real / radius_of(r), r.unbalance.imag / radius_of(r)] for r in counted]
    vectors += [[mass, 0.0] for mass in counterweight_masses(measure, parts)]
    return Rows(MEAN, np.array(vectors or [[0.0, 0.0]]), Grid(np.ones(max(len(vectors), 1)), 1))


def radius_of(rotor: Rotor) -> float:
    """Return the radius of a rotor [m]; `ModelError` if it is missing."""
    if rotor.radius is None:
        raise ModelError(f"'{rotor.name}' needs a radius, because a measure counts its mass; add the key radius")
    return rotor.radius
