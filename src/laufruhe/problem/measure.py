"""Quantities that a problem minimises or limits: a measure of a load, or a mass.

Every one is a norm of rows that are affine in the unbalances (P1), so the same few
lines evaluate it, optimise it and prove it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import OperatingPoint, Role, Rotor
from laufruhe.numerics import mixed_norms
from laufruhe.numerics.mixed_norms import Norm
from laufruhe.numerics.spectrum import Spectrum

Array = NDArray[np.float64]


class Subject(StrEnum):
    """What is measured."""

    MOUNT_FORCE = "mount force"
    MOUNT_TRAVEL = "mount travel"
    SHAKING_FORCE = "shaking force"
    ROCKING_COUPLE = "rocking couple"
    ROLL_MOMENT = "roll moment"
    COUNTERWEIGHT_MASS = "counterweight mass"
    BALANCER_MASS = "balancer mass"
    ADDED_MASS = "added mass"

    @property
    def unit(self) -> str:
        """SI unit."""
        if self in MASSES:
            return "kg"
        if self is Subject.MOUNT_TRAVEL:
            return "m"
        return "N" if self in (Subject.MOUNT_FORCE, Subject.SHAKING_FORCE) else "N m"


MASSES: Mapping[Subject, tuple[Role, ...]] = {
    Subject.COUNTERWEIGHT_MASS: (Role.COUNTERWEIGHT,),
    Subject.BALANCER_MASS: (Role.BALANCER,),
    Subject.ADDED_MASS: (Role.COUNTERWEIGHT, Role.BALANCER),
}
ON_MOUNTS = (Subject.MOUNT_FORCE, Subject.MOUNT_TRAVEL)
COMPONENTS: Mapping[Subject, slice] = {
    Subject.SHAKING_FORCE: slice(0, 3),
    Subject.ROLL_MOMENT: slice(3, 4),
    Subject.ROCKING_COUPLE: slice(4, 6),
}
# orders are told apart to a thousandth
_PER_ORDER = 1000
MEASURES: Mapping[str, Norm] = {"mean": Norm.SUM, "maximum": Norm.MAXIMUM, "rms": Norm.RMS}


@dataclass(frozen=True)
class Quantity:
    """One number of a design.

    Attributes
    ----------
    subject
        What is measured.
    norm
        How it is put together over angle, mounts and operating points: the mean over
        all, the largest, or the root mean square over all.
    mounts, points, rotors
        Names of those that count; all when None.
    orders
        Orders of crank speed that count; all when None.
    direction_weights
        Factors on the components of a force before its length is taken.
    """

    subject: Subject
    norm: Norm
    mounts: tuple[str, ...] | None = None
    points: tuple[str, ...] | None = None
    rotors: tuple[str, ...] | None = None
    orders: tuple[float, ...] | None = None
    direction_weights: tuple[float, float, float] | None = None

    @property
    def name(self) -> str:
        """As a report prints it."""
        if self.subject in MASSES:
            return str(self.subject)
        measure = next(text for text, norm in MEASURES.items() if norm is self.norm)
        text = f"{measure} {self.subject}"
        if self.orders is not None:
            text += " of order " + ", ".join(f"{order:g}" for order in self.orders)
        if self.mounts is not None:
            text += " on " + ", ".join(self.mounts)
        if self.points is not None:
            text += " at " + ", ".join(self.points)
        return text

    @property
    def unit(self) -> str:
        """SI unit."""
        return self.subject.unit

    def shares(self, points: Sequence[OperatingPoint]) -> Array:
        """Weight of every operating point, shape (points,); zero where it does not count, one in all."""
        weights = np.array([p.weight if self.points is None or p.name in self.points else 0.0 for p in points])
        return np.asarray(weights / weights.sum())

    def counted(self, orders: Array) -> NDArray[np.bool_]:
        """Which orders of crank speed count, shape of `orders`."""
        if self.orders is None:
            return np.ones(np.shape(orders), dtype=bool)
        return np.isin(np.round(orders * _PER_ORDER), np.round(np.array(self.orders) * _PER_ORDER))


MEAN_MOUNT_FORCE = Quantity(Subject.MOUNT_FORCE, Norm.SUM)


@dataclass(frozen=True, eq=False)
class Rows:
    """The vectors whose norm a quantity is (P1).

    Attributes
    ----------
    vectors
        Shape (k, d).
    weights
        Shape (k,).
    """

    norm: Norm
    vectors: Array
    weights: Array

    @property
    def value(self) -> float:
        """The quantity [SI]."""
        return mixed_norms.value(self.norm, self.weights, self.vectors)


def load_rows(
    quantity: Quantity,
    points: Sequence[OperatingPoint],
    signals: Sequence[Spectrum],
    mount_names: Sequence[str],
    samples: int,
) -> Rows:
    """Rows of a load at equal steps of its period.

    Parameters
    ----------
    quantity
        Of a load.
    points
        Operating points, in the order of `signals`.
    signals
        Per point, mount forces or travels (n, mounts, 3) or the wrench (n, 6), all of one base.
    mount_names
        In the order of the second axis.
    samples
        Steps over the period of the signals.

    Returns
    -------
    Rows of (points, mounts, samples) in that order; weights add up to one.
    """
    blocks, weights = [], []
    for signal, share in zip(signals, quantity.shares(points), strict=True):
        if share == 0.0:
            continue
        values = selected(quantity, signal, mount_names).sample(samples)
        rows = values.swapaxes(0, 1).reshape(-1, values.shape[-1])
        blocks.append(rows)
        weights.append(np.full(len(rows), share / len(rows)))
    return Rows(quantity.norm, np.concatenate(blocks), np.concatenate(weights))


def selected(quantity: Quantity, signal: Spectrum, mount_names: Sequence[str]) -> Spectrum:
    """The components, mounts and orders that count, shape (n, mounts or 1, d)."""
    c = signal.coefficients
    if quantity.subject in ON_MOUNTS:
        if quantity.mounts is not None:
            c = c[:, [mount_names.index(name) for name in quantity.mounts], :]
        if quantity.direction_weights is not None:
            c = c * np.array(quantity.direction_weights)
    else:
        c = c[:, None, COMPONENTS[quantity.subject]]
    if quantity.orders is not None:
        c = np.where(quantity.counted(signal.orders)[:, None, None], c, 0.0)
    return Spectrum(signal.base, c)


def counted_rotors(quantity: Quantity, rotors: Sequence[Rotor]) -> tuple[Rotor, ...]:
    """The rotors whose masses a mass quantity adds up."""
    roles = MASSES[quantity.subject]
    return tuple(r for r in rotors if (r.role in roles if quantity.rotors is None else r.name in quantity.rotors))


def mass_rows(quantity: Quantity, rotors: Sequence[Rotor]) -> Rows:
    """Rows U / radius of the counted rotors, shape (rotors, 2) [kg]."""
    counted = counted_rotors(quantity, rotors)
    vectors = np.array([[r.unbalance.real, r.unbalance.imag] for r in counted]).reshape(-1, 2)
    radii = np.array([radius_of(r) for r in counted]).reshape(-1, 1)
    return Rows(Norm.SUM, vectors / radii, np.ones(len(counted)))


def radius_of(rotor: Rotor) -> float:
    """Radius of a rotor whose mass is limited."""
    if rotor.radius is None:
        raise ModelError(f"the mass of '{rotor.name}' counts, so it needs a radius")
    return rotor.radius
