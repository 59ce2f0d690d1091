"""Forces of steam, pumps and traces on both sides of pistons, all on one rod (G14-G17).

A diagram is over the piston's travel x from the dead centre at which its chamber is smallest, once on
the way out and once on the way back; what its pressure is over that of the air around drives the rod.
"""

from __future__ import annotations

import math

import numpy as np

from laufruhe.machine import Chamber, Chambers, Cycle, PressureTrace, SliderCrank, Steam
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.physics.cylinder_volume import JUMP_WIDTH, dead_centres, swept_volume
from laufruhe.physics.pressure_trace import trace_pressure

_HALVINGS = 53


def chambers_thrust(gas: Chambers, part: SliderCrank, angles: Array) -> Array:
    """Return P = -sum of +-F (p - p_0) along the axis of a cylinder, away from the crank [N] (G14; eq. 296).

    Angles count from the dead centre of the cylinder [rad].
    """
    total = np.zeros(np.shape(angles))
    for chamber in gas.of(part):
        total -= chamber.side * chamber.area * (chamber_pressure(chamber, part, angles) - gas.crankcase_pressure)
    return total


def chambers_breaks(gas: Chambers, part: SliderCrank) -> Array:
    """Return the angles after the dead centre at which a derivative of a pressure jumps [rad]."""
    breaks = set[float]()
    for chamber in gas.of(part):
        smallest, largest = _ends(chamber, part)
        diagram = chamber.diagram
        if isinstance(diagram, PressureTrace):
            breaks.update(smallest + angle for angle in diagram.angles)
            continue
        kinks = [(place, True) for place in (diagram.cut_off, diagram.release)]
        kinks += [(place, False) for place in (diagram.compression, diagram.lead)]
        inner = [(place, is_out) for place, is_out in kinks if 0.0 < place < 1.0]
        places, way = np.array([place for place, _ in inner]), np.array([is_out for _, is_out in inner], dtype=bool)
        # on either way from where the chamber is smallest, forwards or backwards, so that travel rises
        begin = np.where(way, smallest, smallest + math.tau)
        low, high = np.zeros(len(inner)), np.ones(len(inner))
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            beyond = chamber_travel(chamber, part, begin + middle * (largest - begin)) > places
            low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
        breaks.update([smallest, largest, *(begin + low * (largest - begin)).tolist()])
    return np.array(sorted(breaks))


def chamber_pressure(chamber: Chamber, part: SliderCrank, angles: Array) -> Array:
    """Return the absolute pressure [Pa], at a jump the mean of both sides, shape of `angles`."""

    def at(angles: Array) -> Array:
        smallest, largest = _ends(chamber, part)
        local = np.mod(angles - smallest, math.tau)
        if isinstance(chamber.diagram, PressureTrace):
            return trace_pressure(chamber.diagram, Cycle.TWO_STROKE, local)
        return _steam(chamber.diagram, chamber_travel(chamber, part, angles), local < largest - smallest)

    return 0.5 * (at(angles - JUMP_WIDTH) + at(angles + JUMP_WIDTH))


def chamber_travel(chamber: Chamber, part: SliderCrank, angles: Array) -> Array:
    """Return the travel from where a chamber is smallest, as part of the stroke."""
    swept = np.clip(swept_volume(part, angles), 0.0, 1.0)
    return swept if chamber.side > 0 else 1.0 - swept


def _ends(chamber: Chamber, part: SliderCrank) -> tuple[float, float]:
    top, bottom = dead_centres(part)
    return (top, bottom) if chamber.side > 0 else (bottom, top + math.tau)


def _steam(diagram: Steam, travel: Array, out: Mask) -> Array:
    """Return the pressure of admission, expansion and release, then of exhaust, compression and lead (G15)."""
    released = _expanded(diagram, diagram.admission, diagram.cut_off, np.asarray(diagram.release))
    squeezed = _expanded(diagram, diagram.back_pressure, diagram.compression, np.asarray(diagram.lead))
    way = (travel - diagram.release) / (1.0 - diagram.release if diagram.release < 1.0 else 1.0)
    falling = released + np.maximum(way, 0.0) * (diagram.back_pressure - released)
    opening = np.maximum(diagram.lead - travel, 0.0) / (diagram.lead if diagram.lead > 0.0 else 1.0)
    rising = squeezed + opening * (diagram.admission - squeezed)
    behind_cut_off = np.clip(travel, diagram.cut_off, diagram.release)
    expanding = _expanded(diagram, diagram.admission, diagram.cut_off, behind_cut_off)
    closed = np.clip(travel, diagram.lead, diagram.compression)
    squeezing = _expanded(diagram, diagram.back_pressure, diagram.compression, closed)
    on_way_out = np.where(travel <= diagram.release, expanding, falling)
    return np.where(out, on_way_out, np.where(travel >= diagram.lead, squeezing, rising))


def _expanded(diagram: Steam, pressure: float, begin: float, end: Array) -> Array:
    volume = end + diagram.clearance
    shrinking = np.where(volume > 0.0, (begin + diagram.clearance) / np.where(volume > 0.0, volume, 1.0), 1.0)
    return np.asarray(pressure * shrinking**diagram.exponent)
