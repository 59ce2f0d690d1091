"""Receivers of an engine's vibration, and the frame that its mounts stand on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal, Self, TypeAlias

import numpy as np

from laufruhe.extensions.receivers.weightings import Weighting
from laufruhe.machine import Block, Engine, Mount
from laufruhe.machine.extra import Extra
from laufruhe.machine.mount import Vector3
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.processes import call_by_name

Quantity = Literal["acceleration", "velocity", "pressure"]


@dataclass(frozen=True)
class FrequencyFunction:
    """Complex function of frequency, linear between measured frequencies (Q2).

    Attributes
    ----------
    name
        Name of its file.
    frequencies
        Measured frequencies in ascending order [Hz].
    values
        Values at each frequency.
    """

    name: str
    frequencies: tuple[float, ...]
    values: tuple[tuple[complex, ...], ...]

    def at(self, frequencies: Array) -> ComplexArray:
        """Return the values at frequencies [Hz] within the measured range, shape (*frequencies.shape, components)."""
        columns = np.array(self.values).T
        return np.stack([np.interp(frequencies, self.frequencies, column) for column in columns], axis=-1)

    @property
    def peaks(self) -> list[float]:
        """Measured frequencies at which the amount of a value is larger than at both neighbours [Hz]."""
        size = np.abs(np.array(self.values))
        is_peak = ((size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:])).any(axis=1)
        return [f for f, peak in zip(self.frequencies[1:-1], is_peak, strict=True) if peak]


_EDGE = 1e-9
"""Distance from the edge of a band, relative to its frequency."""
Curve: TypeAlias = Weighting | FrequencyFunction | None
"""Weighting of one direction: of a standard, from a file, or none."""


@dataclass(frozen=True)
class Receiver:
    """A point at which vibration or sound is felt.

    Attributes
    ----------
    point
        Position (x, y, z) [m] (C2) on the engine or on the frame; None for a receiver with transfer functions.
    on_frame
        True if the point moves with the frame.
    functions
        Transfer function from the mount forces to each component of the response, its values mount by mount along x, y
        and z (Q2); None for a component without response. Empty for a point.
    takes_frame_force
        True if these functions apply to the forces on the moving frame, not to those on rigid ground.
    band
        Lowest and highest frequency that counts [Hz].
    weightings
        Weighting of each component.
    """

    name: str
    quantity: Quantity
    point: Vector3 | None = None
    on_frame: bool = False
    functions: tuple[FrequencyFunction | None, ...] = ()
    takes_frame_force: bool = False
    band: tuple[float, float] = (0.0, math.inf)
    weightings: tuple[Curve, ...] = (None, None, None)
    powers: ClassVar = {"point": (0, 1)}

    def weights(self, frequencies: Array) -> ComplexArray:
        """Return the factor of each component at frequencies [Hz], shape (n, components): zero outside the band."""
        low, high = self.band
        counts = (frequencies >= low) & (frequencies <= high)
        factors = np.zeros((len(frequencies), len(self.weightings)), dtype=complex)
        for k, curve in enumerate(self.weightings):
            within = frequencies[counts]
            factors[counts, k] = 1.0 if curve is None else curve.at(within).reshape(len(within))
        return factors


@dataclass(frozen=True)
class Frame:
    """Rigid frame on springs, on which the engine mounts stand: the second stage of an isolation.

    Attributes
    ----------
    body
        Mass, inertia and centre of gravity.
    springs
        Springs between frame and ground; none for a free frame.
    """

    body: Block
    springs: tuple[Mount, ...] = ()


@dataclass(frozen=True)
class Receivers(Extra):
    """Receivers of an engine, and the frame under its mounts; None for rigid ground."""

    name: ClassVar[str] = "receivers"
    receivers: tuple[Receiver, ...] = ()
    frame: Frame | None = None

    def scaled(self, length: float, mass: float) -> Self:
        """Return the receivers with points at scaled positions; measured functions and the frame stay."""
        return replace(super().scaled(length, mass), frame=self.frame)

    def critical_frequencies(self, engine: Engine, /) -> Mapping[str, Sequence[float]]:
        """Return natural frequencies of engine and frame, and edges and peaks of measured functions [Hz]."""
        physics = "laufruhe.extensions.receivers.physics:frame_frequencies"
        edges = [edge for receiver in self.receivers for edge in receiver.band if 0.0 < edge < math.inf]
        functions = [f for receiver in self.receivers for f in receiver.functions if f is not None]
        return {
            "natural frequency on the frame": () if self.frame is None else call_by_name(physics, self.frame, engine),
            # the response jumps beside an edge
            "edge of a band": [side * edge for edge in edges for side in (1.0 - _EDGE, 1.0 + _EDGE)],
            "peak of a transfer function": [peak for function in functions for peak in function.peaks],
        }

    @property
    def labels(self) -> Sequence[str]:
        """Return the names of the receivers."""
        return [receiver.name for receiver in self.receivers]


def receivers_of(engine: Engine, quantity: Quantity | None = None) -> tuple[Receiver, ...]:
    """Return the receivers of an engine, all of them or those of one quantity."""
    extra = engine.extra(Receivers)
    return tuple(one for one in (extra.receivers if extra else ()) if quantity in (None, one.quantity))
