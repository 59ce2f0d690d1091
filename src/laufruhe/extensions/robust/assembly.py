"""Parts of measured masses, one of which goes into each cylinder (R12)."""

from __future__ import annotations

import cmath
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from laufruhe.extensions.robust.tolerance import AddedDrive
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.problem.problem import Extra

Chosen = tuple[tuple[int, ...], ...]
"""Of every lot the part in each cylinder."""


@dataclass(frozen=True)
class Lot:
    """Parts of one kind; the drawing stands for their mean.

    Attributes
    ----------
    kind
        "piston" or "rod".
    masses
        Of every part what goes to and fro, and what turns with the crank pin [kg].
    """

    kind: str
    masses: tuple[tuple[float, float], ...]

    @property
    def differences(self) -> Array:
        """Differences from the mean of the lot, shape (parts, 2) [kg]."""
        masses = np.array(self.masses)
        return np.asarray(masses - masses.mean(axis=0))


@dataclass(frozen=True)
class Assembly(Extra):
    """Lots of parts, of each of which every cylinder takes one."""

    lots: tuple[Lot, ...]
    words: ClassVar[str] = "the choice of parts"

    @property
    def open_names(self) -> tuple[str, ...]:
        """Names of what is chosen."""
        return tuple(f"the {lot.kind} of every cylinder" for lot in self.lots)


def assemble(engine: Engine, lots: Sequence[Lot], chosen: Chosen) -> Engine:
    """Return the engine with these parts: each weighs more than the drawing by its difference from its lot's mean."""
    more = np.sum([lot.differences[list(parts)] for lot, parts in zip(lots, chosen, strict=True)], axis=0)
    drawing = [
        AddedDrive(
            f"difference of the rod of {part.name}", part.x, cmath.rect(part.crank_radius, part.throw), part.shaft
        )
        for part in engine.slider_cranks
    ]
    pistons = tuple(
        replace(part, reciprocating_mass=part.reciprocating_mass + float(own))
        for part, own in zip(engine.slider_cranks, more[:, 0], strict=True)
    )
    rotors = tuple(drive.rotor(float(own)) for drive, own in zip(drawing, more[:, 1], strict=True) if own)
    return replace(engine, slider_cranks=pistons, rotors=(*engine.rotors, *rotors))
