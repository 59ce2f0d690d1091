"""Free forces and couples of the first two orders by layout, in units of one cylinder.

Handbooks tabulate them for the choice of a crankshaft: forces over F_h of one cylinder, couples
about the middle over F_h a. An order that turns with the crank is taken by crank weights; what
turns against it needs a shaft (Hasselgruber 1964, eq. 33, Fig. 29).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.physics.metrics import turning_parts
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
    (_, force_against), (_, couple_against) = turning_parts(*force), turning_parts(*couple)
    return FreeLoad(float(order_amplitude(force)), float(order_amplitude(couple)), force_against, couple_against)


@dataclass(frozen=True)
class Layout:
    """Free loads of one engine by order, and its firing intervals [rad]."""

    loads: tuple[FreeLoad, ...]
    intervals: tuple[float, float]
    cylinders: int


def layout(engine: Engine, spacing: float) -> Layout:
    """Free loads of the orders 1 and 2, couples in units of a spacing [m]."""
    loads = tuple(free_load(engine, order, spacing) for order in ORDERS)
    intervals = engine.firing_intervals
    return Layout(loads, (min(intervals), max(intervals)), len(engine.cylinders))


def compared(layouts: Mapping[str, Layout], literature: Mapping[str, Mapping[str, float]]) -> xr.Dataset:
    """Free forces and couples of several layouts beside printed ones.

    Parameters
    ----------
    literature
        Printed values by the name of the layout and "force 1", "couple 2", ...; NaN in the
        dataset where a table has none.
    """
    table = np.array(
        [[[o.force, o.couple, o.force_against, o.couple_against] for o in own.loads] for own in layouts.values()]
    )
    known = [literature.get(name, {}) for name in layouts]
    kinds = ("force", "couple")
    printed = np.array(
        [[[own.get(f"{what} {order}", math.nan) for what in kinds] for order in ORDERS] for own in known]
    )
    interval = np.degrees([own.intervals for own in layouts.values()])

    def each(values: NDArray[np.float64], words: str) -> tuple[tuple[str, str], NDArray[np.float64], dict[str, str]]:
        return ("case", "order"), values, {"units": "1", "long_name": words}

    return xr.Dataset(
        {
            "force": each(table[..., 0], "free force over one cylinder's"),
            "couple": each(table[..., 1], "free couple over one cylinder's force times the spacing"),
            "force_against": each(table[..., 2], "free force that turns against the crank"),
            "couple_against": each(table[..., 3], "free couple that turns against the crank"),
            "force_printed": each(printed[..., 0], "free force in the literature"),
            "couple_printed": each(printed[..., 1], "free couple in the literature"),
            "least_interval": ("case", interval[:, 0], {"units": "deg", "long_name": "shortest firing interval"}),
            "largest_interval": ("case", interval[:, 1], {"units": "deg", "long_name": "longest firing interval"}),
        },
        coords={
            "case": list(layouts),
            "order": list(ORDERS),
            "cylinders": ("case", [own.cylinders for own in layouts.values()], {"units": "1"}),
        },
        attrs={"title": "Free forces and couples by layout", "kind": "free forces"},
    )


def printed_agree(data: xr.Dataset) -> tuple[int, int]:
    """How many printed values agree to half of their last digit, and of how many."""
    half = 0.5 * 10.0 ** -int(data.attrs["digits"]) * (1.0 + 1e-9)
    apart = np.array([abs(data[what].values - data[f"{what}_printed"].values) for what in ("force", "couple")])
    return int((apart <= half).sum()), int(np.isfinite(apart).sum())
