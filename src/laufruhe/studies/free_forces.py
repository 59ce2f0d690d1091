"""Free forces and couples of the first two orders by layout, in units of one cylinder.

Handbooks tabulate them for the choice of a crankshaft: forces over F_h of one cylinder, couples
about the middle over F_h a. An order that turns with the crank is taken by crank weights; what
turns against it needs a shaft (Hasselgruber 1964, eq. 33, Fig. 29).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Engine
from laufruhe.machine.firing import intervals_of
from laufruhe.physics.order_coefficients import piston_acceleration_orders
from laufruhe.physics.shaking_loads import reciprocating_loads

ORDERS = (1, 2)
SPEED = 100.0
"""Crank speed [rad/s] at which loads are taken; it drops out of the ratios."""


@dataclass(frozen=True)
class FreeLoad:
    """What the pistons of an engine leave of one order, over one cylinder's.

    Attributes
    ----------
    force, couple
        Largest over a turn [1]; couples over force times the spacing.
    force_against, couple_against
        The part that turns against the crank, which no crank weight takes [1].
    """

    force: float
    couple: float
    force_against: float
    couple_against: float


def free_load(engine: Engine, order: int, spacing: float) -> FreeLoad:
    """Free force and couple of the reciprocating masses in an order, about the middle of the engine.

    Parameters
    ----------
    order
        Of crank speed.
    spacing
        Unit of length of the couples [m].

    Raises
    ------
    ModelError
        If cylinders differ in mechanism: there is no one cylinder to compare with.
    """
    shapes = {(p.crank_radius, p.rod_length, p.offset, p.reciprocating_mass) for p in engine.slider_cranks}
    if len(shapes) > 1:
        raise ModelError(f"the cylinders of '{engine.name}' differ, so free forces have no unit; make them equal")
    part = engine.slider_cranks[0]
    amplitude = abs(piston_acceleration_orders(part.rod_ratio, part.offset_ratio, order)[order])
    unit = part.reciprocating_mass * part.crank_radius * SPEED**2 * float(amplitude)
    load = reciprocating_loads(engine, SPEED).at(order)
    force, couple = load[1:3] / unit, load[4:6] / (unit * spacing)
    return FreeLoad(_largest(force), _largest(couple), _against(force), _against(couple))


def _largest(vector: NDArray[np.complex128]) -> float:
    """Largest length of Re c e^{ix} over a turn: the long half axis of its ellipse."""
    return float(np.linalg.norm(np.array([vector.real, vector.imag]), ord=2))


def _against(vector: NDArray[np.complex128]) -> float:
    """Amplitude of the part of z + i y that turns as e^{-ix} (C4, C8)."""
    y, z = vector
    return 0.5 * float(abs(z - 1j * y))


def firing_intervals(engine: Engine) -> tuple[float, float]:
    """Least and largest crank angle from one firing to the next [rad]."""
    turns = sorted(float(part.firing_angle) / math.tau for part in engine.slider_cranks)
    intervals = intervals_of(engine.cycle, turns)
    return min(intervals), max(intervals)


def free_forces(
    engines: Mapping[str, tuple[Engine, float]],
    literature: Mapping[str, Mapping[str, float]],
    say: Callable[[int, int], None] = lambda _done, _all: None,
) -> xr.Dataset:
    """Free forces and couples of several layouts beside printed ones.

    Parameters
    ----------
    engines
        Engine and spacing [m] by name.
    literature
        Printed values by the name of the engine and "force 1", "couple 2", ...; NaN in the
        dataset where a table has none.
    """
    rows, printed, fires = [], [], []
    for k, (name, (engine, spacing)) in enumerate(engines.items()):
        say(k, len(engines))
        loads = [free_load(engine, order, spacing) for order in ORDERS]
        rows.append([[own.force, own.couple, own.force_against, own.couple_against] for own in loads])
        known = literature.get(name, {})
        printed.append([[known.get(f"{what} {order}", math.nan) for what in ("force", "couple")] for order in ORDERS])
        fires.append([math.degrees(angle) for angle in firing_intervals(engine)])
    say(len(engines), len(engines))
    table, known_table, interval = np.array(rows), np.array(printed), np.array(fires)

    def each(values: NDArray[np.float64], words: str) -> tuple[tuple[str, str], NDArray[np.float64], dict[str, str]]:
        return ("case", "order"), values, {"units": "1", "long_name": words}

    return xr.Dataset(
        {
            "force": each(table[..., 0], "free force over one cylinder's"),
            "couple": each(table[..., 1], "free couple over one cylinder's force times the spacing"),
            "force_against": each(table[..., 2], "free force that turns against the crank"),
            "couple_against": each(table[..., 3], "free couple that turns against the crank"),
            "force_printed": each(known_table[..., 0], "free force in the literature"),
            "couple_printed": each(known_table[..., 1], "free couple in the literature"),
            "least_interval": ("case", interval[:, 0], {"units": "deg", "long_name": "shortest firing interval"}),
            "largest_interval": ("case", interval[:, 1], {"units": "deg", "long_name": "longest firing interval"}),
        },
        coords={
            "case": list(engines),
            "order": list(ORDERS),
            "cylinders": ("case", [len(engine.slider_cranks) for engine, _ in engines.values()], {"units": "1"}),
        },
        attrs={"title": "Free forces and couples by layout", "kind": "free forces"},
    )
