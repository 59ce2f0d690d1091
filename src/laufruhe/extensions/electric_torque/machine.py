"""Electric machines that drive and brake the crank over its angle (T16).

A machine on a shaft of speed ratio n has the torque T = T_0 + sum_h Re(c_h e^{i h phi}), positive if it drives its
shaft. The crank feels |n| T. The roll moment on the block is |n| T if the block carries the stator, (|n| - n/|n|) T if
the ground does.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np

from laufruhe.machine import Engine
from laufruhe.machine.extra import Extra, MachineTorque
from laufruhe.machine.slider_crank import SliderCrank
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.decision import Kind, NumberDrive, Numbers

ELECTRIC_TORQUE = Kind(1.5, "electric_machines", "torques of electric machines", is_affine=True)


@dataclass(frozen=True)
class Harmonic:
    """Torque of one order of the crank, Re(torque e^{i order phi}) [N m], at one operating point or at all (None)."""

    order: Fraction
    torque: complex = 0.0
    point: str | None = None


@dataclass(frozen=True)
class ElectricMachine:
    """Motor or generator whose current follows the crank angle.

    Attributes
    ----------
    ratio
        Speed over crank speed; negative runs against the crank.
    is_on_block
        True if the block carries the stator.
    disc
        Disc of the crankshaft that it drives, if torsion is modelled; empty for the disc of the load.
    mean
        Mean torque [N m]; negative for a generator.
    harmonics
        Torque of each order.
    torque_constant
        Torque over current [N m/A]; None if it is unknown.
    resistance
        Copper loss over the square of the current [ohm]; None if it is unknown.
    """

    name: str
    ratio: float = 1.0
    is_on_block: bool = True
    disc: str = ""
    mean: float = 0.0
    harmonics: tuple[Harmonic, ...] = ()
    torque_constant: float | None = None
    resistance: float | None = None

    def torque(self, point: str, base: Fraction) -> Spectrum:
        """Return its torque at an operating point, shape (n,) [N m]; all orders are multiples of `base`."""
        counted = [one for one in self.harmonics if one.point in (None, point)]
        size = max((int(one.order / base) for one in counted), default=0) + 1
        coefficients = np.zeros(size, dtype=complex)
        coefficients[0] = self.mean
        for one in counted:
            coefficients[int(one.order / base)] += one.torque
        return Spectrum(base, coefficients)


@dataclass(frozen=True)
class ElectricMachines(Extra):
    """Electric machines of an engine; a number is named by (machine, index of the harmonic)."""

    name: ClassVar[str] = ELECTRIC_TORQUE.name
    machines: tuple[ElectricMachine, ...] = ()

    def moved(self, moves: Mapping[Any, complex], __: Sequence[SliderCrank], ___: Sequence[SliderCrank]) -> Self:
        """Return the machines with changes of the torque of single harmonics [N m]."""
        return self._times(1.0, moves) if moves else self

    def only(self, changes: Mapping[Any, complex], /) -> Self:
        """Return the machines with these torques alone."""
        return self._times(0.0, changes)

    def scaled(self, _: float, mass: float) -> Self:
        """Return the machines with torques in proportion to the mass, as those of the gas at one mean piston speed."""
        return self._times(mass, {})

    def _times(self, factor: float, changes: Mapping[Any, complex]) -> Self:
        machines = []
        for machine in self.machines:
            torques = [
                factor * one.torque + changes.get((machine.name, k), 0.0) for k, one in enumerate(machine.harmonics)
            ]
            harmonics = tuple(replace(one, torque=c) for one, c in zip(machine.harmonics, torques, strict=True))
            machines.append(replace(machine, mean=factor * machine.mean, harmonics=harmonics))
        return replace(self, machines=tuple(machines))

    def torques(self, point: str, base: Fraction, /) -> Sequence[MachineTorque]:
        """Return the torques on crank and block at an operating point (T16)."""
        answers = []
        for one in self.machines:
            torque, size = one.torque(point, base), abs(one.ratio)
            lost = 0.0 if one.is_on_block else math.copysign(1.0, one.ratio)
            on_crank, on_block = (torque.mapped(partial(np.multiply, by)) for by in (size, size - lost))
            answers.append(MachineTorque(on_crank, on_block, one.disc))
        return answers


@dataclass(frozen=True)
class TorqueDrive(NumberDrive):
    """Change of the torque of one harmonic by the complex change of the decision."""

    def move(self, numbers: Numbers, change: Any) -> None:
        """Add the change to the changes of the torque."""
        key = self.kind, self.key
        numbers.changes[key] = numbers.changes.get(key, 0.0) + change


def machines_of(engine: Engine) -> tuple[ElectricMachine, ...]:
    """Return the electric machines of an engine."""
    extra = engine.extra(ElectricMachines)
    return extra.machines if extra else ()
