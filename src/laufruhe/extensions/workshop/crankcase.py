"""Space of a crankcase: pistons, rods, walls and round parts, and their clearances to bodies (H6, H7)."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from laufruhe.extensions.workshop.bodies import Body
from laufruhe.extensions.workshop.distances import Minimum, distance_to_polygon, minimum_of, minimum_over_cycle
from laufruhe.extensions.workshop.outlines import corners_of
from laufruhe.extensions.workshop.shapes import Shape
from laufruhe.machine import Shaft, SliderCrank
from laufruhe.machine.slider_crank import OffsetCrank
from laufruhe.numerics.arrays import Array, ComplexArray

FINE = 0.02
"""Angle between points of the outline of another body [rad]."""


@dataclass(frozen=True)
class RodSize:
    """Rod as an obstacle: widths across and along the shaft, and diameters of its ends [m]."""

    width: float
    thickness: float
    big_end: float
    small_end: float = 0.0
    powers: ClassVar = dict.fromkeys(("width", "thickness", "big_end", "small_end"), (0, 1))


@dataclass(frozen=True)
class Wall:
    """Flat wall along the shafts: direction of its outward normal (C4) and distance from the crank axis [m]."""

    name: str
    direction: complex
    distance: float
    powers: ClassVar = {"distance": (0, 1)}


@dataclass(frozen=True)
class RoundPart:
    """Round part along the shafts, such as a camshaft: place of its axis (C4), radius and ends along x [m]."""

    name: str
    place: complex
    radius: float
    ends: tuple[float, float] = (-math.inf, math.inf)
    powers: ClassVar = dict.fromkeys(("place", "radius", "ends"), (0, 1))


@dataclass(frozen=True)
class Crankcase:
    """Everything that a weight may hit.

    Attributes
    ----------
    clearance
        Smallest distance that a weight keeps from every part [m].
    skirt
        Distance from the piston pin to the lower edge of the piston [m]; None if pistons are not checked.
    rod
        Sizes of all rods; None if rods are not checked.
    """

    clearance: float = 0.0
    skirt: float | None = None
    rod: RodSize | None = None
    walls: tuple[Wall, ...] = ()
    round_parts: tuple[RoundPart, ...] = ()
    powers: ClassVar = {"clearance": (0, 1), "skirt": (0, 1)}


@dataclass(frozen=True)
class Seat:
    """Place of a body on its shaft: x [m], and angle at phi = 0, None if it is open [rad]."""

    x: float
    shaft: Shaft
    angle: float | None

    @property
    def axis(self) -> complex:
        """Point of the shaft across the crank axis [m] (C4)."""
        return complex(self.shaft.z, self.shaft.y)


@dataclass(frozen=True)
class Obstacle:
    """Moving polygon with a rounding.

    Attributes
    ----------
    corners
        Function of crank angles, shape (n,), that returns its corners, shape (k, n) [m].
    radius
        Rounding around the polygon [m].
    rate
        Largest speed of a point of it over the speed of the crank [m].
    """

    name: str
    corners: Callable[[Array], ComplexArray]
    radius: float
    rate: float


@dataclass(frozen=True)
class Clearance:
    """Least distance of a body from one part over a cycle [m], and the crank angle; NaN if it is the same always."""

    part: str
    minimum: Minimum


def is_checked(part: SliderCrank) -> bool:
    """Return True for a plain slider-crank, whose piston and rod are obstacles."""
    return type(part) in (SliderCrank, OffsetCrank) and math.isfinite(part.rod_length)


def obstacles(crankcase: Crankcase, parts: Sequence[SliderCrank], ends: tuple[float, float]) -> Iterator[Obstacle]:
    """Yield pistons and rods that reach between two planes across the shafts [m]."""
    for part in filter(is_checked, parts):
        gap = max(ends[0] - part.x, part.x - ends[1], 0.0)
        lean = part.rod_ratio + abs(part.offset_ratio)
        rate = abs(part.shaft.ratio) * part.crank_radius / math.sqrt(1.0 - lean**2)
        half = 0.5 * (part.bore or 0.0)
        if crankcase.skirt is not None and gap < half:
            chord = math.sqrt(half**2 - gap**2)
            sides = cmath.exp(1j * part.bank) * np.array(
                [complex(up, side) for up, side in ((-crankcase.skirt, -chord), (-crankcase.skirt, chord),
                                                    (half, chord), (half, -chord))]
            )  # fmt: skip
            yield Obstacle(f"piston of {part.name}", partial(_piston_corners, part, sides), 0.0, rate)
        if crankcase.rod is not None and gap < 0.5 * crankcase.rod.thickness:
            rod, name = crankcase.rod, f"rod of {part.name}"
            yield Obstacle(name, partial(_rod_corners, part, (0, 1)), 0.5 * rod.width, rate)
            yield Obstacle(name, partial(_rod_corners, part, (0,)), 0.5 * rod.big_end, rate)
            yield Obstacle(name, partial(_rod_corners, part, (1,)), 0.5 * rod.small_end, rate)


def joints(part: SliderCrank, phi: Array) -> ComplexArray:
    """Return crank pin and piston pin of a plain slider-crank at crank angles [m], shape (2, n) (C4, C5)."""
    turn = part.throw + part.shaft.ratio * phi
    travel = part.motion(np, turn - part.bank).points[0][1][0]
    centre = complex(part.shaft.z, part.shaft.y)
    # travel counts from alpha = 0, where an offset leans the rod
    height = part.crank_radius + math.sqrt(part.rod_length**2 - part.offset**2)
    piston = (height + travel) * cmath.exp(1j * part.bank)
    return np.array([centre + part.crank_radius * np.exp(1j * turn), centre + piston])


def _piston_corners(part: SliderCrank, sides: ComplexArray, phi: Array) -> ComplexArray:
    corners: ComplexArray = joints(part, phi)[1] + sides[:, None]
    return corners


def _rod_corners(part: SliderCrank, ends: tuple[int, ...], phi: Array) -> ComplexArray:
    return joints(part, phi)[list(ends)]


def _other_corners(shape: Shape, seat: Seat, phi: Array) -> ComplexArray:
    turned = np.exp(1j * ((seat.angle or 0.0) + seat.shaft.ratio * phi))
    return np.asarray(seat.axis + corners_of(shape.outline, FINE)[:, None] * turned)


def _to_obstacle(shape: Shape, seat: Seat, obstacle: Obstacle, cycle: float, wanted: float) -> Minimum:
    """Return the least distance of a turning shape from an obstacle; an open angle takes the disc that it sweeps."""

    def distance(phi: Array) -> Array:
        corners = obstacle.corners(phi) - seat.axis
        if seat.angle is None:
            starts, ends = corners, np.roll(corners, -1, axis=0)
            along = ends - starts
            share = np.clip(-(starts * along.conj()).real / np.maximum(np.abs(along) ** 2, 1e-300), 0.0, 1.0)
            return np.asarray(np.abs(starts + share * along).min(axis=0) - shape.outer_radius - obstacle.radius)
        turned = corners * np.exp(-1j * (seat.angle + seat.shaft.ratio * phi))
        return distance_to_polygon(shape.outline, turned) - obstacle.radius

    rate = obstacle.rate + (0.0 if seat.angle is None else abs(seat.shaft.ratio) * shape.outer_radius)
    return minimum_over_cycle(distance, rate, cycle, wanted)


def clearances(
    crankcase: Crankcase, parts: Sequence[SliderCrank], cycle: float, body: Body, seat: Seat,
    others: Sequence[tuple[str, Body, Seat]] = (), wanted: float = -math.inf,
) -> Iterator[Clearance]:  # fmt: skip
    """Yield the clearance of a body from every part that it may hit.

    Parameters
    ----------
    cycle
        Crank angle of a working cycle, after which all shafts return [rad].
    others
        Names, bodies and seats of bodies on other shafts.
    wanted
        Distance above which a clearance need not be exact [m].
    """
    radius = body.shape.outer_radius
    for wall in crankcase.walls:
        distance = wall.distance - (wall.direction.conjugate() * seat.axis).real - radius
        yield Clearance(wall.name, Minimum(distance, distance, math.nan))
    for round_part in crankcase.round_parts:
        if any(low < round_part.ends[1] and high > round_part.ends[0] for low, high in body.extents(seat.x)):
            distance = abs(round_part.place - seat.axis) - round_part.radius - radius
            yield Clearance(round_part.name, Minimum(distance, distance, math.nan))
    by_part: dict[str, list[Minimum]] = {}
    for ends in body.extents(seat.x):
        for obstacle in obstacles(crankcase, parts, ends):
            minimum = _to_obstacle(body.shape, seat, obstacle, cycle, wanted)
            by_part.setdefault(obstacle.name, []).append(minimum)
    for name, other, place in others:
        if any(a < d and c < b for a, b in body.extents(seat.x) for c, d in other.extents(place.x)):
            rate = abs(place.shaft.ratio) * other.shape.outer_radius
            obstacle = Obstacle(name, partial(_other_corners, other.shape, place), 0.0, rate)
            by_part[name] = [_to_obstacle(body.shape, seat, obstacle, cycle, wanted)]
    yield from (Clearance(name, minimum_of(results)) for name, results in by_part.items())


def is_clear(
    crankcase: Crankcase, parts: Sequence[SliderCrank], cycle: float, body: Body, seat: Seat, shape: Shape
) -> bool:
    """Return True if a shape in place of the body's keeps the clearance, which a bound over the cycle proves (H7)."""
    all_clearances = clearances(crankcase, parts, cycle, replace(body, shape=shape), seat, wanted=crankcase.clearance)
    return all(clearance.minimum.bound >= crankcase.clearance for clearance in all_clearances)
