"""Measures: what a problem minimises and limits, a norm of a channel (P1).

Objective and limits are the same thing. A measure of loads or masses is a norm of rows
that are affine in the unbalances, so the same few lines evaluate it, optimise it and
prove it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, OperatingPoint, Role, Rotor, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN, NORMS, Grid, Norm
from laufruhe.numerics.spectrum import BEHIND, Spectrum, orders_equal
from laufruhe.problem.channels import CHANNELS, MOUNT_FORCE, Channel, LoadChannel, MassChannel, is_at_mounts
from laufruhe.problem.loads import PointLoads


@dataclass(frozen=True)
class Measure:
    """One number of a design.

    Attributes
    ----------
    channel
        What is measured.
    norm
        How a load is put together over angle, places and operating points: the mean
        over all, the largest, or the root mean square over all.
    at, points, rotors
        Names of the places, operating points and rotors that count; all when None. Places are
        mounts, bearings, cylinders or sections of the crankshaft, as the channel has them.
    orders
        Orders of crank speed that count; all when None.
    direction_weights
        Factors on the components of a force before its length is taken.
    motions
        That are to have a mode of their own; all when None.
    frequency
        Least and largest natural frequency about the torque-roll axis that is wanted [Hz].
    cases
        Names of the load cases that count; all when None.
    wanted
        Share of a motion in a mode of its own that is enough.
    alternating
        Whether the mean of a load over the cycle is left out (M7).
    """

    channel: Channel
    norm: Norm = MEAN
    at: tuple[str, ...] | None = None
    points: tuple[str, ...] | None = None
    rotors: tuple[str, ...] | None = None
    orders: tuple[float, ...] | None = None
    direction_weights: tuple[float, float, float] | None = None
    motions: tuple[str, ...] | None = None
    frequency: tuple[float, float] = (0.0, math.inf)
    wanted: float = 1.0
    cases: tuple[str, ...] | None = None
    alternating: bool = False

    @property
    def name(self) -> str:
        """As a report prints it."""
        part = "alternating " if self.alternating else ""
        text = f"{self.norm.name} {part}{self.channel}" if self.is_load else str(self.channel)
        if self.orders is not None:
            text += " of order " + ", ".join(f"{order:g}" for order in self.orders)
        if self.motions is not None:
            text += " of " + ", ".join(self.motions)
        if self.at is not None:
            text += " on " + ", ".join(self.at)
        if self.points is not None:
            text += " at " + ", ".join(self.points)
        if self.cases is not None:
            text += " under " + ", ".join(self.cases)
        return text

    @property
    def unit(self) -> str:
        """SI unit."""
        return self.channel.unit

    @property
    def is_load(self) -> bool:
        """Whether it is of a signal over the cycle."""
        return self.channel.is_load

    @property
    def is_mass(self) -> bool:
        """Whether it adds up masses."""
        return self.channel.is_mass

    @property
    def is_mounting(self) -> bool:
        """Whether it is a number of a block on its mounts and no norm."""
        return self.channel.is_mounting

    @property
    def load(self) -> LoadChannel:
        """The channel of a load."""
        if not isinstance(self.channel, LoadChannel):
            raise TypeError(f"{self.name} is no load")
        return self.channel

    @property
    def on_mounts(self) -> bool:
        """Tell if it is of the force or the travel of each mount."""
        return is_at_mounts(self.channel)

    @property
    def is_inside(self) -> bool:
        """Tell if it is of a load inside the crankcase."""
        return self.is_load and not self.load.of_wrench

    @property
    def feels_gas(self) -> bool:
        """Whether gas loads it, or what it is a number of."""
        if self.is_load:
            return self.load.feels_gas
        channel = self.channel
        return channel.is_flywheel or bool(channel.simulation) or (channel.is_number and channel.of_loads)

    @property
    def feels_order(self) -> bool:
        """Whether it changes with the firing order of one star."""
        return self.is_load and self.load.feels_order

    @property
    def is_told_apart(self) -> bool:
        """Whether it is a number of what drives the crankshaft's twist, that no sum over the cylinders gives."""
        return self.channel.of_loads and self.channel.is_number and not self.is_mounting

    @property
    def lever(self) -> int | None:
        """Power of a throw's place that its loads grow with; None where they do not add up by places alone."""
        return self.load.lever if self.is_load else None

    def counts_point(self, point: OperatingPoint) -> bool:
        """Whether an operating point counts."""
        return self.points is None or point.name in self.points

    def shares(self, points: Sequence[OperatingPoint]) -> Array:
        """Weight of every operating point, shape (points,); zero where it does not count, one in all."""
        weights = [p.weight if self.counts_point(p) else 0.0 for p in points]
        return np.array(weights) / (sum(weights) or math.nan)

    def counted(self, orders: Sequence[float] | Array) -> NDArray[np.bool_]:
        """Which orders of crank speed count, shape of `orders`."""
        counts = np.ones(np.shape(orders), dtype=bool) if self.orders is None else orders_equal(orders, self.orders)
        return counts & ~orders_equal(orders, 0.0) if self.alternating else counts

    @property
    def counts_mean(self) -> bool:
        """Tell if the mean of a load over the cycle is a part of it."""
        return self.is_load and bool(self.counted([0.0])[0])

    @property
    def of_all_orders(self) -> Measure:
        """The measure of the whole load, its mean included."""
        return replace(self, orders=None, alternating=False)

    def signal(self, loads: PointLoads, engine: Engine) -> Spectrum:
        """What counts of a load at an operating point, shape (n, places, d)."""
        return selected(self, self.load.signal(loads), engine)

    def places(self, names: Sequence[str]) -> list[int]:
        """Of the places that count among all of these names."""
        return [k for k, name in enumerate(names) if self.at is None or name in self.at]


@dataclass(frozen=True)
class Term:
    """One weighted part of the objective."""

    measure: Measure
    weight: float = 1.0


@dataclass(frozen=True)
class Rank:
    """One of several objectives in order: it is least among the designs that are best by those before it.

    Attributes
    ----------
    within
        Share by which those after it may exceed its least value.
    """

    terms: tuple[Term, ...]
    within: float = 0.0


@dataclass(frozen=True)
class Limit:
    """Bounds of a measure [SI]; `outside` keeps every value out of a band."""

    name: str
    measure: Measure
    maximum: float = math.inf
    minimum: float = -math.inf
    outside: tuple[float, float] | None = None

    def room(self, value: float) -> tuple[float, float, str]:
        """Relative distance inside the nearest side, negative outside; that side, and its sense (E15)."""
        sides = []
        if self.minimum > -math.inf:
            sides.append((value - self.minimum, self.minimum, "at least"))
        if self.maximum < math.inf:
            sides.append((self.maximum - value, self.maximum, "at most"))
        if self.outside is not None:
            low, high = self.outside
            sides.append(max((low - value, low, "at most"), (value - high, high, "at least")))
        return min(((room / (abs(edge) or 1.0), edge, side) for room, edge, side in sides), default=(math.inf, 0.0, ""))


Side: TypeAlias = tuple[Limit, str]
"""A limit, and which of its sides: "at most" or "at least"."""

MEAN_MOUNT_FORCE = Measure(MOUNT_FORCE)

MEASURES: Mapping[str, tuple[Channel, Norm]] = {
    **{f"{norm} {c}": (c, NORMS[norm]) for c in CHANNELS.values() for norm in c.norms},
    **{name: (channel, MEAN) for name, channel in CHANNELS.items() if not channel.is_load},
}
"""Every measure by the name that files and reports call it."""


@dataclass(frozen=True, eq=False)
class Rows:
    """The vectors whose norm a measure is (P1), shape (k, d), and where they stand."""

    norm: Norm
    vectors: Array
    grid: Grid

    @property
    def value(self) -> float:
        """The measure [SI]."""
        return self.norm.value(self.grid, self.vectors)


def load_rows(
    measure: Measure, points: Sequence[OperatingPoint], signals: Sequence[Spectrum], engine: Engine, samples: int,
    bends: Sequence[Array] | None = None,
) -> Rows:  # fmt: skip
    """Rows of a load at equal steps of its period, and of a peak where it bends.

    Parameters
    ----------
    signals
        Per point what the channel measures, shape (n, places, d), all of one base.
    engine
        Whose mounts, bearings or cylinders stand along the second axis.
    samples
        Steps over the period of the signals.
    bends
        Per point as many angles [rad]; those of `bends_of` when left out.

    Returns
    -------
    Rows of (points, places, samples and bends) in that order; weights add up to one.
    """
    blocks, weights = [], []
    bends = bends_of(measure, signals, engine) if bends is None else bends
    for signal, share, own in zip(signals, measure.shares(points), bends, strict=True):
        if share == 0.0:
            continue
        counted = selected(measure, signal, engine)
        if measure.norm.refinement == 1:
            values = counted.series.sample(samples)
        else:
            values = np.concatenate([counted.sample(samples, BEHIND), counted.values(own)])
        # an engine may lack what is named: then it has no load there
        if not values.shape[1]:
            continue
        rows = values.swapaxes(0, 1).reshape(-1, values.shape[-1])
        blocks.append(rows)
        weights.append(np.full(len(rows), share / len(rows)))
    if not blocks:
        return Rows(measure.norm, np.zeros((1, 1)), Grid(np.ones(1), 1))
    count = len(bends[0])
    # of one block no copy is needed
    rows, shares = (blocks[0], weights[0]) if len(blocks) == 1 else (np.concatenate(blocks), np.concatenate(weights))
    return Rows(measure.norm, rows, Grid(shares, samples + count, count, len(blocks)))


def bends_of(measure: Measure, signals: Sequence[Spectrum], engine: Engine) -> list[Array]:
    """Angles at which a peak may stand between any steps, as many for every operating point (L5a)."""
    if measure.norm.refinement == 1:
        return [np.zeros(0)] * len(signals)
    found = [selected(measure, signal, engine).bends for signal in signals]
    most = max(map(len, found))
    return [np.resize(own, most) if len(own) else np.zeros(most) for own in found]


def selected(measure: Measure, signal: Spectrum, engine: Engine) -> Spectrum:
    """The places and orders of a signal (n, places, d) that count, its directions weighted.

    Where places are added up, so many times what each has: a mean over them is then their sum.
    """
    if measure.at is not None:
        signal = signal.each(lambda values: values[:, measure.places(measure.load.places(engine)), :])
    if measure.direction_weights is not None:
        signal = signal.each(lambda values: values * np.array(measure.direction_weights))
    if measure.load.adds_up:
        signal = signal.each(lambda values: values * values.shape[1])
    if measure.orders is not None:
        signal = signal.only(measure.orders)
    return signal.without_mean if measure.alternating else signal


def _roles(measure: Measure) -> tuple[Role, ...]:
    if not isinstance(measure.channel, MassChannel):
        raise TypeError(f"{measure.name} is no mass")
    return measure.channel.roles


def counted_rotors(measure: Measure, rotors: Sequence[Rotor]) -> tuple[Rotor, ...]:
    """The rotors whose masses a measure adds up."""
    roles = _roles(measure)
    return tuple(r for r in rotors if (r.role in roles if measure.rotors is None else r.name in measure.rotors))


def counted_parts(measure: Measure, parts: Sequence[SliderCrank]) -> list[float]:
    """The weights of mechanisms that a measure adds up: of all, or none where rotors are named [kg]."""
    counts = Role.COUNTERWEIGHT in _roles(measure) and measure.rotors is None
    return [mass for part in parts if counts and (mass := part.counterweight_mass) is not None]


def mass_rows(measure: Measure, rotors: Sequence[Rotor], parts: Sequence[SliderCrank] = ()) -> Rows:
    """Rows U / radius of the counted rotors, and those of mechanisms, shape (rows, 2) [kg]; of none one of nothing."""
    counted = counted_rotors(measure, rotors)
    vectors = [[r.unbalance.real / radius_of(r), r.unbalance.imag / radius_of(r)] for r in counted]
    vectors += [[mass, 0.0] for mass in counted_parts(measure, parts)]
    return Rows(MEAN, np.array(vectors or [[0.0, 0.0]]), Grid(np.ones(max(len(vectors), 1)), 1))


def radius_of(rotor: Rotor) -> float:
    """Radius of a rotor whose mass is limited."""
    if rotor.radius is None:
        raise ModelError(f"the mass of '{rotor.name}' counts, so it needs a radius")
    return rotor.radius
