"""Crankshaft as discs on massless shafts, with absorbers and geared branches."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from laufruhe.errors import ModelError, check_names
from laufruhe.machine import SliderCrank
from laufruhe.machine.extra import Extra
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.numerics.processes import call_by_name
from laufruhe.physics.torque import reduced_inertia
from laufruhe.problem.decision import Kind

TORSION = Kind(8, "torsion", "discs and shafts of the crankshaft", is_alone=True)
"""Decisions that change only the twist of the crankshaft and the rotating inertia."""

STEEL = 80e9
"""Shear modulus of a shaft [Pa] where none is given."""


# of one material, stiffness grows as the cube of length, and damping as the root of inertia times stiffness
_DAMPING = (0.5, 2.5)


@dataclass(frozen=True)
class Disc:
    """Rigid disc of the torsional chain: a throw, flywheel or pulley, or a disc of a geared branch.

    Attributes
    ----------
    inertia
        Inertia of all parts that turn with it, with the mean inertia of its pistons and rods [kg m2] (V1).
    damping
        Viscous damping against the block [N m s/rad].
    cylinders
        Names of the slider-cranks that drive it; empty for a pulley or a flywheel.
    ratio
        Speed over that of the crankshaft; negative against the crank.
    """

    name: str
    inertia: float
    damping: float = 0.0
    cylinders: tuple[str, ...] = ()
    ratio: float = 1.0
    powers: ClassVar = {"inertia": (1, 2), "damping": _DAMPING}

    def __post_init__(self) -> None:
        if not self.inertia > 0.0:
            raise ModelError(f"disc '{self.name}' has an inertia of {self.inertia:g} kg m2; it must be positive")
        if self.damping < 0.0:
            raise ModelError(f"disc '{self.name}' has a negative damping; give zero or more")
        if self.ratio == 0.0:
            raise ModelError(f"disc '{self.name}' has a ratio of zero; give its speed over that of the crankshaft")


@dataclass(frozen=True)
class ShaftSection:
    """Massless shaft between two discs; it turns at the speed of the rear one.

    Attributes
    ----------
    stiffness
        Torsional stiffness [N m/rad].
    damping
        Viscous damping of its twist [N m s/rad].
    loss_factor
        Hysteretic loss factor eta: the stiffness is k (1 + i eta).
    diameter, bore
        Outer and inner diameter of the weakest cross-section [m]; needed for stresses only.
    length
        Length of one round piece, whose stiffness follows from its diameter [m]; else None.
    shear_modulus
        Shear modulus [Pa].
    """

    name: str
    stiffness: float
    damping: float = 0.0
    loss_factor: float = 0.0
    diameter: float | None = None
    bore: float = 0.0
    length: float | None = None
    shear_modulus: float = STEEL
    powers: ClassVar = {
        "stiffness": (0, 3), "damping": _DAMPING, **dict.fromkeys(("bore", "diameter", "length"), (0, 1))
    }  # fmt: skip

    def __post_init__(self) -> None:
        if not self.stiffness > 0.0:
            raise ModelError(f"shaft '{self.name}' has a stiffness of {self.stiffness:g} N m/rad; it must be positive")
        if self.damping < 0.0 or self.loss_factor < 0.0:
            raise ModelError(f"shaft '{self.name}' has a negative damping; give zero or more")
        if self.diameter is not None and not 0.0 <= self.bore < self.diameter:
            raise ModelError(
                f"shaft '{self.name}' has a bore of {self.bore:g} m, but a diameter of {self.diameter:g} m; reduce it"
            )

    def with_numbers(self, stiffness: float, diameter: float | None) -> ShaftSection:
        """Return the shaft section with this stiffness [N m/rad], or that of a new diameter [m] of a round piece."""
        if diameter is None or diameter == self.diameter or self.length is None:
            return replace(self, stiffness=stiffness)
        stiffness = stiffness_of([(self.length, diameter, self.bore)], self.shear_modulus)
        return replace(self, stiffness=stiffness, diameter=diameter)

    @property
    def modulus(self) -> float:
        """Polar section modulus [m3] (V8)."""
        if self.diameter is None:
            raise ModelError(f"shaft '{self.name}' has no diameter, so its stress is not known; give it one")
        return math.pi / 16.0 * (self.diameter**4 - self.bore**4) / self.diameter


@dataclass(frozen=True)
class Absorber:
    """Ring or pendulum on a disc, which absorbs its vibration.

    Attributes
    ----------
    on
        Name of its disc.
    inertia
        Inertia of the ring, or of a pendulum's mass about the crank axis [kg m2].
    stiffness, loss_factor
        Stiffness [N m/rad] and loss of its rubber.
    damping
        Viscous damping between disc and ring [N m s/rad].
    order
        Order of the crankshaft that a pendulum is tuned to: the pull of its rotation is a spring J (n w)^2 (V11).
    damping_ratio
        Share of its critical damping that a pendulum has.
    """

    name: str
    on: str
    inertia: float
    stiffness: float = 0.0
    loss_factor: float = 0.0
    damping: float = 0.0
    order: float = 0.0
    damping_ratio: float = 0.0
    powers: ClassVar = {"inertia": (1, 2), "stiffness": (0, 3), "damping": _DAMPING}

    def __post_init__(self) -> None:
        if not self.inertia > 0.0:
            raise ModelError(f"absorber '{self.name}' has no inertia, so it absorbs nothing; give its ring an inertia")
        if min(self.stiffness, self.loss_factor, self.damping, self.order, self.damping_ratio) < 0.0:
            raise ModelError(f"absorber '{self.name}' has a negative stiffness, damping or order")
        if not (self.stiffness or self.damping or self.order):
            raise ModelError(f"nothing holds the ring of absorber '{self.name}'; give it a stiffness, damping or order")

    def stiffness_at(self, speed: float) -> float:
        """Return the stiffness of rubber and of the pull of rotation [N m/rad]."""
        return self.stiffness + self.inertia * (self.order * speed) ** 2

    def damping_at(self, speed: float) -> float:
        """Return the viscous damping [N m s/rad]."""
        return self.damping + 2.0 * self.damping_ratio * self.order * speed * self.inertia

    def losses(self, rates: Array, speed: float) -> Array:
        """Return twice the power lost for swings of unit amplitude at angular rates, shape (rates,) [W] (V12)."""
        return self.stiffness * self.loss_factor * rates + self.damping_at(speed) * rates**2


@dataclass(frozen=True)
class Torsion(Extra):
    """Discs and shafts from front to rear, with geared branches and absorbers: a tree (V16).

    Attributes
    ----------
    discs
        Discs from the front (C3), then those of the branches.
    sections
        Shafts in front of each disc but the first, one fewer than discs.
    absorbers
        Absorbers on any of the discs.
    output
        Name of the disc where the load takes its torque.
    speeds
        Least and largest crank speed of tables and pictures [rad/s]; None for a range about the operating points.
    parents
        Index of the disc at the front of each section; empty if it is the previous disc, without branches.
    """

    discs: tuple[Disc, ...]
    sections: tuple[ShaftSection, ...]
    absorbers: tuple[Absorber, ...] = ()
    output: str = ""
    speeds: tuple[float, float] | None = None
    parents: tuple[int, ...] = ()
    name: ClassVar[str] = TORSION.name

    def __post_init__(self) -> None:
        check_names("discs", [disc.name for disc in self.discs] + [absorber.name for absorber in self.absorbers])
        if len(self.discs) < 2 or len(self.sections) != len(self.discs) - 1:
            raise ModelError("a shaft that twists needs two discs at least, and a section from each to the next")
        if self.parents and (
            len(self.parents) != len(self.sections) or any(not 0 <= p <= k for k, p in enumerate(self.parents))
        ):
            raise ModelError("every section starts at an earlier disc; correct the parents of the discs")
        for absorber in self.absorbers:
            self.index(absorber.on)

    def index(self, name: str) -> int:
        """Return the index of a disc in the chain."""
        for k, disc in enumerate(self.discs):
            if disc.name == name:
                return k
        raise ModelError(f"there is no disc '{name}' on the crankshaft")

    @cached_property
    def driven(self) -> int:
        """Index of the disc where the load takes its torque: the last where none is named."""
        return self.index(self.output) if self.output else len(self.discs) - 1

    @cached_property
    def links(self) -> tuple[tuple[int, int, float], ...]:
        """Sections, then absorbers: index of the front disc, of the rear disc or ring, and speed ratio."""
        parents, count = self.parents or range(len(self.sections)), len(self.discs)
        sections = [(parent, k, self.discs[k].ratio) for k, parent in enumerate(parents, 1)]
        carriers = [self.index(absorber.on) for absorber in self.absorbers]
        return (*sections, *((disc, k, self.discs[disc].ratio) for k, disc in enumerate(carriers, count)))

    @cached_property
    def ratios(self) -> Array:
        """Speeds of discs and rings over that of the crankshaft, shape (discs and rings,)."""
        return np.array([*(disc.ratio for disc in self.discs), *(r for *_, r in self.links[len(self.sections) :])])

    @cached_property
    def incidence(self) -> Array:
        """Matrix from angles at crank speed to twists of sections and absorbers, (links, discs and rings) (V16)."""
        matrix = np.zeros((len(self.links), len(self.ratios)))
        for row, (front, rear, ratio) in zip(matrix, self.links, strict=True):
            row[front], row[rear] = ratio, -ratio
        return matrix

    @cached_property
    def is_in_front(self) -> Mask:
        """True where a disc is on the front side of a section, shape (sections, discs)."""
        behind = np.eye(len(self.sections), len(self.discs), 1, dtype=bool)
        for k, (front, *_) in reversed([*enumerate(self.links[: len(self.sections)])]):
            if front:
                behind[front - 1] |= behind[k]
        return ~behind

    @property
    def numbers(self) -> dict[tuple[str, str], Any]:
        """Numbers that decisions may change, by the names of a disc, section or absorber and of its attribute."""
        numbers: dict[tuple[str, str], Any] = {(disc.name, "inertia"): disc.inertia for disc in self.discs}
        for part in self.sections:
            numbers |= {(part.name, "stiffness"): part.stiffness, (part.name, "diameter"): part.diameter}
        for absorber in self.absorbers:
            numbers |= {(absorber.name, key): getattr(absorber, key) for key in ("inertia", "stiffness", "damping")}
        return numbers

    def moved(
        self, changes: Mapping[tuple[str, str], float], before: Sequence[SliderCrank], after: Sequence[SliderCrank]
    ) -> Self:
        """Return the chain with changes of its numbers, and with the pistons and rods `after` in place of `before`."""
        chain = self
        if changes:
            numbers = {key: value + changes[key] if key in changes else value for key, value in self.numbers.items()}
            absorbed = ("inertia", "stiffness", "damping")
            chain = replace(
                self,
                discs=tuple(replace(d, inertia=numbers[d.name, "inertia"]) for d in self.discs),
                sections=tuple(
                    s.with_numbers(numbers[s.name, "stiffness"], numbers[s.name, "diameter"]) for s in self.sections
                ),
                absorbers=tuple(replace(a, **{key: numbers[a.name, key] for key in absorbed}) for a in self.absorbers),
            )
        if after != before:
            changes_of_inertia = {
                a.name: reduced_inertia(b) - reduced_inertia(a) for a, b in zip(before, after, strict=True)
            }
            discs = (
                replace(d, inertia=d.inertia + sum(changes_of_inertia[name] for name in d.cylinders))
                for d in chain.discs
            )
            chain = replace(chain, discs=tuple(discs))
        return chain

    def turning_inertia(self, parts: Sequence[SliderCrank], /) -> float:
        """Return the inertia of all discs without pistons and rods [kg m2] (V14); rings of absorbers slip."""
        swinging = sum(reduced_inertia(part) - part.rotating_mass * part.crank_radius**2 for part in parts)
        return sum(disc.inertia * disc.ratio**2 for disc in self.discs) - swinging

    def critical_frequencies(self, _engine: Any, /) -> Mapping[str, Sequence[float]]:
        """Return the natural frequencies of the crankshaft's twist [Hz]."""
        modes = call_by_name("laufruhe.extensions.torsion.physics:natural_modes", self)
        return {"natural frequency of twist": modes.frequencies.tolist()}

    @property
    def labels(self) -> Sequence[str]:
        """Return the names of discs and sections."""
        return [*(disc.name for disc in self.discs), *(section.name for section in self.sections)]


def stiffness_of(pieces: Sequence[tuple[float, float, float]], shear_modulus: float = STEEL) -> float:
    """Return the torsional stiffness of round pieces of shaft in series [N m/rad] (V2).

    Parameters
    ----------
    pieces
        Length, diameter and bore of each piece [m].
    """
    compliance = sum(32.0 * length / (math.pi * (diameter**4 - bore**4)) for length, diameter, bore in pieces)
    return shear_modulus / compliance
