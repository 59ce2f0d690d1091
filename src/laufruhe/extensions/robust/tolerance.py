"""Tolerances: how far the numbers of a built engine stand from those of its drawing, and what of it moves with them.

Every tolerance is a list of independent errors, counted in their largest size: a real error lies between -1 and 1,
an unbalance of any angle in the unit disc. A problem with given errors is a problem again, so that all that
evaluates, bounds or decides a drawing does the same for a built engine (R2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from itertools import pairwise
from typing import ClassVar, Protocol

import numpy as np

from laufruhe.machine import CRANKSHAFT, Role, Rotor, Shaft
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import RotorDrive
from laufruhe.problem.problem import Drawing, Extra, Path, Problem, Rebuild, no_file

SIGMAS = 3.0
"""Standard deviations of a normal law that the tolerance is; what lies beyond is not built in."""


class Law(StrEnum):
    """Distribution of errors within their tolerance."""

    UNIFORM = "uniform"
    NORMAL = "normal"


class Scope(StrEnum):
    """Extent of an error: each piece has one of its own, or all have the same."""

    PIECE = "piece"
    BATCH = "batch"


class ErrorDrive(Protocol):
    """Part of an engine that an error moves."""

    @property
    def is_affine(self) -> bool:
        """Return whether every load is affine in it together with all others of which the same is true."""

    def moved(self, drawing: Drawing, error: complex, /) -> Drawing:
        """Return the drawing with this error, in units of its largest size."""


@dataclass(frozen=True)
class PistonDrive:
    """Reciprocating mass of one slider-crank += gain x error (L2, L3)."""

    cylinder: int
    gain: float
    is_affine: ClassVar[bool] = True

    def moved(self, drawing: Drawing, error: complex) -> Drawing:
        """Return the drawing with the mass of one cylinder moved."""
        parts = list(drawing.engine.slider_cranks)
        part = parts[self.cylinder]
        mass = part.reciprocating_mass + self.gain * error.real
        parts[self.cylinder] = replace(part, reciprocating_mass=mass)
        return replace(drawing, engine=replace(drawing.engine, slider_cranks=tuple(parts)))


@dataclass(frozen=True)
class AddedDrive:
    """An unbalance gain x error beside those of the drawing (L1)."""

    name: str
    x: float
    gain: complex
    shaft: Shaft = CRANKSHAFT
    is_affine: ClassVar[bool] = True

    def moved(self, drawing: Drawing, error: complex) -> Drawing:
        """Return the drawing with one rotor more."""
        return replace(drawing, engine=replace(drawing.engine, rotors=(*drawing.engine.rotors, self.rotor(error))))

    def rotor(self, error: complex) -> Rotor:
        """Return the rotor that is added."""
        return Rotor(self.name, self.x, self.gain * error, self.shaft, Role.THROW)


@dataclass(frozen=True)
class ShareDrive:
    """An unbalance U and all that decides it, times 1 + share x error (R3)."""

    rotor: str
    share: float
    is_affine: ClassVar[bool] = True

    def moved(self, drawing: Drawing, error: complex) -> Drawing:
        """Return the drawing with the rotor, and what drives it, moved."""
        factor = 1.0 + self.share * error.real
        rotors = tuple(
            replace(r, unbalance=factor * r.unbalance) if r.name == self.rotor else r for r in drawing.engine.rotors
        )
        decisions = tuple(
            replace(d, drives=tuple(
                replace(v, gain=factor * v.gain) if isinstance(v, RotorDrive) and v.rotor == self.rotor else v
                for v in d.drives
            ))
            for d in drawing.decisions
        )  # fmt: skip
        return replace(drawing, engine=replace(drawing.engine, rotors=rotors), decisions=decisions)


@dataclass(frozen=True)
class FileDrive:
    """A number of the problem file += gain x error; the problem is put together anew.

    Attributes
    ----------
    path
        Where the number stands.
    number, gain
        The drawing's and the largest error, in the unit of the file.
    unit
        Of the file; empty for a plain number.
    """

    path: Path
    number: float
    gain: float
    unit: str
    is_affine: ClassVar[bool] = False

    def moved(self, drawing: Drawing, _: complex) -> Drawing:
        """Return the drawing as it is: files put the problem together."""
        return drawing

    def written(self, error: complex) -> str | float:
        """Return the number as a file has it."""
        value = self.number + self.gain * error.real
        return f"{value!r} {self.unit}" if self.unit else value


@dataclass(frozen=True)
class Error:
    """Independent error.

    Attributes
    ----------
    name
        Of what has it.
    drives
        All that moves with it.
    width
        One real number, or two for an unbalance of any angle.
    """

    name: str
    drives: tuple[ErrorDrive, ...]
    width: int = 1

    @property
    def is_affine(self) -> bool:
        """Return whether every load is affine in it."""
        return all(drive.is_affine for drive in self.drives)


@dataclass(frozen=True)
class Tolerance:
    """A number of the drawing and how far it may be off.

    Attributes
    ----------
    name
        The key of the file.
    unit
        SI; "" where it is a share.
    size
        Largest error [SI].
    errors
        One for each piece, or one for the batch.
    scale
        Times its own size that it is taken at.
    """

    name: str
    unit: str
    size: float
    errors: tuple[Error, ...]
    law: Law = Law.UNIFORM
    scope: Scope = Scope.PIECE
    scale: float = 1.0

    def draw(self, random: np.random.Generator, count: int) -> Array:
        """Draw errors of many engines, shape (count, columns), even over interval or disc, or normal within it."""
        parts = [self._one(random, count, error.width) for error in self.errors]
        return np.concatenate(parts, axis=1)

    def _one(self, random: np.random.Generator, count: int, width: int) -> Array:
        if self.law is Law.NORMAL:
            return _normal(random, count, width)
        if width == 1:
            return random.uniform(-1.0, 1.0, (count, 1))
        size, angle = np.sqrt(random.uniform(0.0, 1.0, count)), random.uniform(0.0, 2.0 * np.pi, count)
        return np.stack([size * np.cos(angle), size * np.sin(angle)], axis=1)


def _normal(random: np.random.Generator, count: int, width: int) -> Array:
    found = random.normal(0.0, 1.0 / SIGMAS, (count, width))
    while (out := np.hypot.reduce(found, axis=1) > 1.0).any():
        found[out] = random.normal(0.0, 1.0 / SIGMAS, (int(out.sum()), width))
    return found


@dataclass(frozen=True)
class Population:
    """Choice of the built engines that what is minimised and limited is taken of.

    Attributes
    ----------
    share
        Of built engines that are to stay below; None for the worst that tolerances allow.
    engines
        Drawn where a share is minimised, or where the worst case is sought among drawn ones.
    seed
        Of these; those that certify have another.
    """

    share: float | None = None
    engines: int = 1000
    seed: int = 0

    def named(self, measure: str, is_affine: bool) -> str:
        """Return the name of the objective with the engines that count."""
        if self.share is not None:
            return f"{measure}, {100.0 * self.share:g} % of engines below"
        return f"{measure}, worst case" if is_affine else f"{measure}, worst of {self.engines} drawn engines"


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of a problem, their errors side by side in one vector.

    Attributes
    ----------
    tolerances
        In the order of the file.
    """

    tolerances: tuple[Tolerance, ...]

    @property
    def nonzero(self) -> Tolerances:
        """Tolerances but those of no size."""
        return replace(self, tolerances=tuple(t for t in self.tolerances if t.size * t.scale > 0.0))

    @cached_property
    def errors(self) -> tuple[Error, ...]:
        """Errors of all tolerances."""
        return tuple(error for tolerance in self.tolerances for error in tolerance.errors)

    @cached_property
    def columns(self) -> tuple[slice, ...]:
        """Columns of every error in the vector of all."""
        ends = np.cumsum([0, *(error.width for error in self.errors)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @property
    def count(self) -> int:
        """Length of the vector of all errors."""
        return sum(error.width for error in self.errors)

    @property
    def is_affine(self) -> bool:
        """Return whether every load is affine in all errors together."""
        return all(error.is_affine for error in self.errors)

    def columns_of(self, name: str) -> slice:
        """Return the columns of one tolerance in the vector of all errors."""
        start = 0
        for tolerance in self.tolerances:
            width = sum(error.width for error in tolerance.errors)
            if tolerance.name == name:
                return slice(start, start + width)
            start += width
        raise KeyError(name)

    def scaled(self, name: str, factor: float) -> Tolerances:
        """Return all with one of them so many times as wide."""
        tolerances = tuple(replace(t, scale=factor * t.scale) if t.name == name else t for t in self.tolerances)
        return replace(self, tolerances=tolerances)

    def draw(self, random: np.random.Generator, count: int) -> Array:
        """Return errors of many engines, shape (count, columns)."""
        return np.concatenate([np.zeros((count, 0)), *(t.draw(random, count) for t in self.tolerances)], axis=1)

    def draw_mirrored(self, random: np.random.Generator, count: int) -> Array:
        """Return errors of as many engines, half of them the others with every error turned round (R9)."""
        half = self.draw(random, -(-count // 2))
        return np.concatenate([half, -half])

    def with_errors(self, drawing: Drawing, errors: Array, rebuild: Rebuild = no_file) -> Drawing:
        """Return the drawing of engines with these errors, shape (columns,); numbers of a file draw it anew."""
        moves: list[tuple[ErrorDrive, complex]] = []
        at = iter(self.columns)
        for tolerance in self.tolerances:
            for error in tolerance.errors:
                own = errors[next(at)] * tolerance.scale
                value = complex(own[0], own[1] if error.width > 1 else 0.0)
                moves += [(drive, value) for drive in error.drives if value != 0.0]
        written = {v.path: v.written(e) for v, e in moves if isinstance(v, FileDrive)}
        drawing = rebuild(written) if written else drawing
        for drive, value in moves:
            drawing = drive.moved(drawing, value)
        return drawing


@dataclass(frozen=True)
class Robust(Extra):
    """Take what is minimised and limited of built engines.

    Attributes
    ----------
    tolerances
        How far they stand from the drawing.
    over
        Which of them count.
    """

    tolerances: Tolerances
    over: Population
    words: ClassVar[str] = "tolerances"

    def objective_name(self, name: str) -> str:
        """Return the name of what is minimised, with the engines that it is of."""
        return self.over.named(name, self.tolerances.is_affine)


def robust_of(problem: Problem) -> Robust:
    """Return the tolerances of a problem, and the engines that count."""
    found = problem.extra(Robust)
    assert found is not None
    return found


def tolerances_of(problem: Problem) -> Tolerances:
    """Return the tolerances of a problem."""
    return robust_of(problem).tolerances


def with_tolerances(problem: Problem, tolerances: Tolerances) -> Problem:
    """Return a problem of built engines with other tolerances."""
    return replace(problem, extras=(replace(robust_of(problem), tolerances=tolerances),))


def with_errors(problem: Problem, errors: Array, tolerances: Tolerances | None = None) -> Problem:
    """Return the problem of the engine with these errors, shape (columns,), and no tolerances (R2)."""
    own = tolerances_of(problem) if tolerances is None else tolerances
    given = Drawing(problem.engine, problem.points, problem.decisions, problem.mount_numbers)
    found = own.with_errors(given, errors, problem.rebuild)
    return replace(
        problem, engine=found.engine, points=found.points, decisions=found.decisions,
        mount_numbers=found.mount_numbers, extras=(),
    )  # fmt: skip
