"""Tolerances: errors of the numbers of a built engine, and the parts of an engine that they change.

A tolerance is a list of independent errors in units of their largest size: a real error lies between -1 and 1, an
unbalance of any angle in the unit disc. A problem with fixed errors is an ordinary problem again, so that all methods
for drawings also apply to built engines (R2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import pairwise
from typing import ClassVar, TypeAlias

import numpy as np

from laufruhe.machine import CRANKSHAFT, Role, Rotor, Shaft
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import RotorDrive
from laufruhe.problem.problem import Drawing, Extra, Path, Problem, Rebuild, no_file

SIGMAS = 3.0
"""Tolerance over standard deviation of the normal law; errors beyond the tolerance are rejected."""


class Law(StrEnum):
    """Distribution of errors within their tolerance."""

    UNIFORM = "uniform"
    NORMAL = "normal"


class Scope(StrEnum):
    """Extent of an error: one for each part that has the tolerance, or one for all parts of the batch."""

    PIECE = "piece"
    BATCH = "batch"


@dataclass(frozen=True)
class PistonDrive:
    """Effect of an error on the reciprocating mass of one slider-crank: mass += gain x error (L2, L3)."""

    cylinder: int
    gain: float
    is_affine: ClassVar[bool] = True

    def with_error(self, drawing: Drawing, error: complex) -> Drawing:
        """Return the drawing of the engine with the error in the reciprocating mass of one cylinder."""
        parts = list(drawing.engine.slider_cranks)
        part = parts[self.cylinder]
        mass = part.reciprocating_mass + self.gain * error.real
        parts[self.cylinder] = replace(part, reciprocating_mass=mass)
        return replace(drawing, engine=replace(drawing.engine, slider_cranks=tuple(parts)))


@dataclass(frozen=True)
class AddedDrive:
    """Effect of an error as a further unbalance gain x error, at the position `x` along the shaft [m] (L1)."""

    name: str
    x: float
    gain: complex
    shaft: Shaft = CRANKSHAFT
    is_affine: ClassVar[bool] = True

    def with_error(self, drawing: Drawing, error: complex) -> Drawing:
        """Return the drawing of the engine with a further rotor that has the error."""
        return replace(drawing, engine=replace(drawing.engine, rotors=(*drawing.engine.rotors, self.rotor(error))))

    def rotor(self, error: complex) -> Rotor:
        """Return the added rotor."""
        return Rotor(self.name, self.x, self.gain * error, self.shaft, Role.THROW)


@dataclass(frozen=True)
class ShareDrive:
    """Effect of an error on an unbalance, and on the drives of its decisions: factor 1 + share x error (R3)."""

    rotor: str
    share: float
    is_affine: ClassVar[bool] = True

    def with_error(self, drawing: Drawing, error: complex) -> Drawing:
        """Return the drawing of the engine with a relative error in the unbalance of a rotor, and in its decisions."""
        factor = 1.0 + self.share * error.real
        rotors = tuple(
            replace(rotor, unbalance=factor * rotor.unbalance) if rotor.name == self.rotor else rotor
            for rotor in drawing.engine.rotors
        )
        decisions = tuple(
            replace(decision, drives=tuple(
                replace(drive, gain=factor * drive.gain)
                if isinstance(drive, RotorDrive) and drive.rotor == self.rotor
                else drive
                for drive in decision.drives
            ))
            for decision in drawing.decisions
        )  # fmt: skip
        return replace(drawing, engine=replace(drawing.engine, rotors=rotors), decisions=decisions)


@dataclass(frozen=True)
class FileDrive:
    """Effect of an error on a number of the problem file: number += gain x error; the file builds the problem again.

    Attributes
    ----------
    path
        Keys of the number.
    number, gain
        Number of the drawing and largest error, in the unit of the file.
    unit
        Unit in the file; "" for a plain number.
    """

    path: Path
    number: float
    gain: float
    unit: str
    is_affine: ClassVar[bool] = False

    def with_error(self, drawing: Drawing, _: complex) -> Drawing:
        """Return the drawing unchanged, because the file builds it."""
        return drawing

    def written(self, error: complex) -> str | float:
        """Return the number as written in a file."""
        value = self.number + self.gain * error.real
        return f"{value!r} {self.unit}" if self.unit else value


ErrorDrive: TypeAlias = PistonDrive | AddedDrive | ShareDrive | FileDrive
"""Effect of an error on an engine; `is_affine` if all loads are affine in it and all other affine errors."""


@dataclass(frozen=True)
class Error:
    """Independent error of a built engine, in units of its largest size.

    Attributes
    ----------
    name
        Name of the part that has the error.
    drives
        Effects of the error on the engine.
    width
        1 for a real number, 2 for an unbalance of any angle.
    """

    name: str
    drives: tuple[ErrorDrive, ...]
    width: int = 1

    @property
    def is_affine(self) -> bool:
        """True if all loads are affine in this error."""
        return all(drive.is_affine for drive in self.drives)


@dataclass(frozen=True)
class Tolerance:
    """Tolerance of a number of the engine drawing: the errors that it allows in a built engine.

    Attributes
    ----------
    name
        Key of the file.
    unit
        SI unit; "" for a share.
    size
        Largest error [SI].
    errors
        One error for each part, or one for the batch.
    law, scope
        Distribution and extent of the errors.
    scale
        Factor of the size, which is varied for shadow prices.
    """

    name: str
    unit: str
    size: float
    errors: tuple[Error, ...]
    law: Law = Law.UNIFORM
    scope: Scope = Scope.PIECE
    scale: float = 1.0

    def draw(self, random: np.random.Generator, count: int) -> Array:
        """Return random errors, shape (count, columns): uniform in interval or disc, or normal and truncated."""
        parts = []
        for width in (error.width for error in self.errors):
            if self.law is Law.NORMAL:
                part = random.normal(0.0, 1.0 / SIGMAS, (count, width))
                while (is_outside := np.hypot.reduce(part, axis=1) > 1.0).any():
                    part[is_outside] = random.normal(0.0, 1.0 / SIGMAS, (int(is_outside.sum()), width))
            elif width == 1:
                part = random.uniform(-1.0, 1.0, (count, 1))
            else:
                size, angle = np.sqrt(random.uniform(0.0, 1.0, count)), random.uniform(0.0, 2.0 * np.pi, count)
                part = np.stack([size * np.cos(angle), size * np.sin(angle)], axis=1)
            parts.append(part)
        return np.concatenate(parts, axis=1)


@dataclass(frozen=True)
class Population:
    """Engines over which objective and limits are taken.

    Attributes
    ----------
    share
        Share of engines that must not exceed the objective; None for the worst case.
    engines
        Count of random engines, if the objective needs them.
    seed
        Seed of these engines; the engines of the comparison have another seed.
    """

    share: float | None = None
    engines: int = 1000
    seed: int = 0


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of a problem in the order of its file; all their errors form one vector."""

    tolerances: tuple[Tolerance, ...]

    @property
    def nonzero(self) -> Tolerances:
        """Tolerances with a size above zero."""
        return Tolerances(tuple(t for t in self.tolerances if t.size * t.scale > 0.0))

    @cached_property
    def errors(self) -> tuple[Error, ...]:
        """Errors of all tolerances."""
        return tuple(error for tolerance in self.tolerances for error in tolerance.errors)

    @cached_property
    def columns(self) -> tuple[slice, ...]:
        """Slice of each error in the vector of all errors."""
        ends = np.cumsum([0, *(error.width for error in self.errors)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @property
    def count(self) -> int:
        """Length of the vector of all errors."""
        return sum(error.width for error in self.errors)

    @property
    def is_affine(self) -> bool:
        """True if all loads are affine in all errors jointly."""
        return all(error.is_affine for error in self.errors)

    def scaled(self, name: str, factor: float) -> Tolerances:
        """Return the tolerances with the tolerance `name` times a factor."""
        return Tolerances(tuple(replace(t, scale=factor * t.scale) if t.name == name else t for t in self.tolerances))

    def draw(self, random: np.random.Generator, count: int) -> Array:
        """Return random errors of many engines, shape (count, columns)."""
        return np.concatenate([np.zeros((count, 0)), *(t.draw(random, count) for t in self.tolerances)], axis=1)

    def draw_mirrored(self, random: np.random.Generator, count: int) -> Array:
        """Return random errors, shape (count, columns); the second half is the negative of the first (R9)."""
        half = self.draw(random, -(-count // 2))
        return np.concatenate([half, -half])

    def with_errors(self, drawing: Drawing, errors: Array, rebuild: Rebuild = no_file) -> Drawing:
        """Return the drawing of the engine with errors, shape (columns,).

        `rebuild` makes the drawing of a problem file with changed numbers.
        """
        moves: list[tuple[ErrorDrive, complex]] = []
        columns = iter(self.columns)
        for tolerance in self.tolerances:
            for error in tolerance.errors:
                components = errors[next(columns)] * tolerance.scale
                value = complex(components[0], components[1] if error.width > 1 else 0.0)
                moves += [(drive, value) for drive in error.drives if value != 0.0]
        written = {v.path: v.written(e) for v, e in moves if isinstance(v, FileDrive)}
        drawing = rebuild(written) if written else drawing
        for drive, value in moves:
            drawing = drive.with_error(drawing, value)
        return drawing


@dataclass(frozen=True)
class Robust(Extra):
    """Objective and limits over the built engines of a population within tolerances."""

    tolerances: Tolerances
    population: Population
    words: ClassVar[str] = "tolerances"

    def objective_name(self, name: str) -> str:
        """Return the name of the objective for reports, with the engines that it counts: `NAME, worst case`."""
        share, engines = self.population.share, self.population.engines
        if share is not None:
            return f"{name}, {100.0 * share:g} % of engines below"
        return f"{name}, worst case" if self.tolerances.is_affine else f"{name}, worst of {engines} drawn engines"


def robust_of(problem: Problem) -> Robust:
    """Return the tolerances of a problem, and which engines its objective counts."""
    robust = problem.extra(Robust)
    assert robust is not None
    return robust


def tolerances_of(problem: Problem) -> Tolerances:
    """Return the tolerances of a problem."""
    return robust_of(problem).tolerances


def with_tolerances(problem: Problem, tolerances: Tolerances) -> Problem:
    """Return the problem with other tolerances."""
    return replace(problem, extras=(replace(robust_of(problem), tolerances=tolerances),))


def with_errors(problem: Problem, errors: Array, tolerances: Tolerances | None = None) -> Problem:
    """Return the problem of the engine with errors, shape (columns,), and without tolerances (R2)."""
    applied = tolerances_of(problem) if tolerances is None else tolerances
    drawing = Drawing(problem.engine, problem.points, problem.decisions, problem.mount_numbers)
    built_drawing = applied.with_errors(drawing, errors, problem.rebuild)
    return replace(
        problem, engine=built_drawing.engine, points=built_drawing.points, decisions=built_drawing.decisions,
        mount_numbers=built_drawing.mount_numbers, extras=(),
    )  # fmt: skip
