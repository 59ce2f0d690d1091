"""Loads of a design as scalar components, each with a place, a node number and a direction."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from laufruhe.errors import printed, refused
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.present.numbers import RPM
from laufruhe.problem.curves import forces_of, harmonics_of
from laufruhe.problem.measure import MEASURES, Measure, Term
from laufruhe.problem.numerical_zero import OF_ORDERS, ROUNDING, numerical_zero
from laufruhe.solvers.result import FINAL, Result
from laufruhe.version import __version__

BLOCK = "block"
"""Place of the wrench on the block: the origin of C2."""
MADE_BY = f"made by laufruhe {__version__}"
CONVENTION = (
    "axes: x forward, y left, z up; the crank turns clockwise seen from the front",
    "mounts: force of the engine on the mount, displacement of the engine there",
    "block: force and moment of gas and moving masses on the block, at the origin",
    "origin: on the crank axis, midway between first and last cylinder",
    "load at crank angle phi: sum over orders of amplitude cos(order phi + phase)",
    "peak amplitudes; exp(+i w t)",
)
"""Directions, senses and phases in words (C2, C7, C8)."""
_FIELDS: Mapping[str, tuple[str, int, tuple[str, ...]]] = {
    "shaking_force": ("force", 1, ("rms shaking force",)),
    "shaking_moment": ("moment", 4, ("rms roll moment", "rms rocking couple")),
    "mount_force": ("force", 1, ("rms mount force",)),
    "mount_travel": ("displacement", 1, ("rms mount travel",)),
}
"""Quantity and first direction of exported fields, and the measures whose numerical zero is theirs."""


@dataclass(frozen=True, eq=False)
class Component:
    """Load or displacement at a place in one direction.

    Attributes
    ----------
    node
        Number of the place in other programs; zero without one.
    direction
        1 to 3 along x, y, z; 4 to 6 about these axes.
    values
        Values over the cycle, shape (points, steps).
    series
        Complex coefficients by order, shape (points, orders) (C8); numerical zeros are 0.
    """

    place: str
    node: int
    quantity: str
    unit: str
    direction: int
    values: Array
    series: ComplexArray

    @property
    def axis(self) -> str:
        """Name of the direction: x, or about x."""
        return ("x", "y", "z", "about x", "about y", "about z")[self.direction - 1]


@dataclass(frozen=True, eq=False)
class ExportLoads:
    """Components of the loads of one design, and their orders from zero in steps of the base order.

    Attributes
    ----------
    zero
        Crank angle zero in words.
    """

    title: str
    zero: str
    points: tuple[OperatingPoint, ...]
    cycle: float
    orders: Array
    components: tuple[Component, ...]

    def frequencies(self, k: int) -> Array:
        """Return the frequency of every order at operating point k [Hz]."""
        return np.asarray(self.orders * self.points[k].speed / math.tau)

    @property
    def convention(self) -> tuple[str, ...]:
        """Directions, senses and phases in words, with the crank angle from which they count."""
        return (*CONVENTION, self.zero)

    def heading(self) -> list[str]:
        """Return the first lines of a text file: maker, title and convention."""
        return [f"{MADE_BY} from: {printed(self.title)}", *self.convention]


def plain(text: str) -> str:
    """Return a text as one line of ASCII."""
    return printed(text).encode("ascii", "replace").decode()


def speed_text(point: OperatingPoint) -> str:
    """Return name and speed of an operating point as one line of ASCII."""
    return plain(f"operating point {point.name}, speed {point.speed * RPM:.6g} rpm")


def export_loads(result: Result, nodes: Mapping[str, int], highest: float, millimetres: bool) -> ExportLoads:
    """Return the components of the final design up to an order."""
    harmonics = harmonics_of({FINAL: result.final})
    series = {field.name: field.values[0] for field in harmonics.fields}
    orders = np.array(harmonics.rows[1].labels)
    count, components = int(np.sum(orders <= highest)), []
    for field in (field for field in forces_of({FINAL: result.final}).fields if field.name in _FIELDS):
        quantity, first, measures = _FIELDS[field.name]
        terms = tuple(Term(Measure(*MEASURES[name])) for name in measures)
        zero_level = numerical_zero(replace(result.problem, objective=terms), result.final.engine)
        zero_level *= OF_ORDERS / ROUNDING
        is_scaled = millimetres and quantity != "force"
        factor, unit = (1e3, field.unit.replace("m", "mm")) if is_scaled else (1.0, field.unit)
        for index in product(*(range(len(axis.labels)) for axis in field.own_axes)):
            place = str(field.own_axes[0].labels[index[0]]) if len(index) > 1 else BLOCK
            values, coefficients = field.values[0][..., *index].real, series[field.name][:, :count, *index].copy()
            # the mean has no phase
            coefficients[:, 0] = coefficients[:, 0].real
            coefficients[np.abs(coefficients) <= zero_level] = 0.0
            direction = first + index[-1]
            components.append(
                Component(place, nodes.get(place, 0), quantity, unit, direction, factor * values, factor * coefficients)
            )
    problem = result.problem
    return ExportLoads(
        problem.title,
        _zero(result.final.engine),
        problem.points,
        problem.engine.cycle.angle,
        orders[:count],
        tuple(components),
    )


def _zero(engine: Engine) -> str:
    # with throws of the file, cylinder 1 has its dead centre elsewhere (C5)
    cylinders = engine.cylinders or engine.slider_cranks
    if not cylinders:
        return "phi = 0: unbalances at their angles"
    thing = "firing dead centre" if engine.cylinders else "dead centre"
    angle = math.remainder(cylinders[0].firing_angle, engine.cycle.angle)
    return f"phi = {math.degrees(angle) + 0.0:.6g} deg: {thing} of {plain(cylinders[0].name)}"


def node_numbers(engine: Engine, text: str) -> dict[str, int]:
    """Return the node numbers that a text such as "front=101, rear=102" gives all mounts, the block, or both."""
    mounts, nodes = [mount.name for mount in engine.mounts], dict[str, int]()
    for entry in filter(None, map(str.strip, text.split(","))):
        name, _, number = (part.strip() for part in entry.rpartition("="))
        if name not in (*mounts, BLOCK):
            raise refused("--grids", entry, "names no mount", f"use {', '.join((*mounts, BLOCK))}, as in NAME=101")
        if not (number.isascii() and number.isdigit() and 0 < int(number) < 10**8):
            raise refused("--grids", entry, "needs a whole number from 1 to 99999999", f"write {name}=101")
        if name in nodes or int(number) in nodes.values():
            raise refused("--grids", entry, "repeats a place or a number", "give each place its own number")
        nodes[name] = int(number)
    if nodes.keys() - {BLOCK} and (missing := [name for name in mounts if name not in nodes]):
        raise refused("--grids", text, f"leaves out mount '{missing[0]}'", f"add {missing[0]}=N")
    return nodes


def rows(loads: ExportLoads) -> Iterator[tuple[str | float | None, ...]]:
    """Yield point, speed, order, frequency, place, node, quantity, direction, unit, amplitude, phase [deg], Re, Im.

    Orders without an amplitude are left out.
    """
    for k, point in enumerate(loads.points):
        for c in loads.components:
            place = (c.place, c.node or None, c.quantity, c.axis, c.unit)
            for order, hertz, value in zip(loads.orders, loads.frequencies(k), c.series[k], strict=True):
                polar = (abs(value), math.degrees(np.angle(value)), value.real, value.imag)
                if value:
                    yield (point.name, point.speed * RPM, float(order), float(hertz), *place, *map(float, polar))
