"""Measured parts of which each cylinder takes one (R12)."""

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
"""For each lot, the index of the part in each cylinder."""


@dataclass(frozen=True)
class Lot:
    """Lot: a batch of measured pistons or rods; the engine as drawn has their mean mass.

    Attributes
    ----------
    kind
        "piston" or "rod".
    masses
        Reciprocating and rotating mass of each part [kg].
    """

    kind: str
    masses: tuple[tuple[float, float], ...]

    @property
    def differences(self) -> Array:
        """Reciprocating and rotating mass less the mean of the lot, shape (parts, 2) [kg]."""
        masses = np.array(self.masses)
        return np.asarray(masses - masses.mean(axis=0))


@dataclass(frozen=True)
class Assembly(Extra):
    """Lots (batches of measured pistons and rods) to assemble; each cylinder takes one part of each lot."""

    lots: tuple[Lot, ...]
    words: ClassVar[str] = "the choice of parts"

    @property
    def open_names(self) -> tuple[str, ...]:
        """Names of the open choices."""
        return tuple(f"the {lot.kind} of every cylinder" for lot in self.lots)


def assemble(engine: Engine, lots: Sequence[Lot], chosen: Chosen) -> Engine:
    """Return the engine assembled from chosen pistons and rods.

    A lot is a batch of measured parts; a part counts by its difference from the mean mass of its lot.
    """
    differences = np.sum([lot.differences[list(parts)] for lot, parts in zip(lots, chosen, strict=True)], axis=0)
    drawing = [
        AddedDrive(
            f"difference of the rod of {part.name}", part.x, cmath.rect(part.crank_radius, part.throw), part.shaft
        )
        for part in engine.slider_cranks
    ]
    pistons = tuple(
        replace(part, reciprocating_mass=part.reciprocating_mass + float(difference))
        for part, difference in zip(engine.slider_cranks, differences[:, 0], strict=True)
    )
    rotors = tuple(
        drive.rotor(float(difference))
        for drive, difference in zip(drawing, differences[:, 1], strict=True)
        if difference
    )
    return replace(engine, slider_cranks=pistons, rotors=(*engine.rotors, *rotors))
