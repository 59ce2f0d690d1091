"""Cylinder pressure over the working cycle (G1-G12).

Volumes are in displacements, v = V / V_h, so that no bore enters. Angles gamma count
from the firing dead centre of the cylinder, alpha = 0 (C5), in the direction in which
the crank turns. Every model meets the indicated mean pressure wanted of the whole
cycle: that of a four-stroke cycle includes its gas exchange.

Pressure jumps where a valve opens or heat comes at once. All jumps are at dead centres,
where the piston stands, so that torque does not jump; a sample on one takes the mean of
both sides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Cycle, GasModel, PressureTrace, Seiliger, SliderCrank, Wiebe
from laufruhe.physics import slider_crank

FloatArray: TypeAlias = NDArray[np.float64]

MAX_CHARGE_HEAT = 50.0
"""Most heat taken for possible, over p V of the charge. Fuel and air without excess hold
some 3.4 MJ/m3 at 1 bar and 300 K, which is 34; 50 leaves room for cold charges."""

MAX_TRACE_GAP = math.radians(30.0)
"""Largest gap between points of a measured trace."""

_JUMP_WIDTH = 1e-11
_ROUNDING = 1e-12


def cylinder_pressure(gas: GasModel, part: SliderCrank, cycle: Cycle, samples: int) -> FloatArray:
    """Absolute cylinder pressure over one cycle.

    Parameters
    ----------
    gas
        Mixed cycle, finite heat release, or a measured trace.
    part
        The slider-crank whose piston the gas works on.
    cycle
        Two- or four-stroke.
    samples
        Number of equal steps.

    Returns
    -------
    Shape (samples,) [Pa], at crank angles gamma = k cycle.angle / samples from the firing
    dead centre.

    Raises
    ------
    ModelError
        If the model cannot meet its indicated mean pressure, or a trace does not cover
        the cycle.
    """
    angles = cycle.angle * np.arange(samples) / samples
    if isinstance(gas, PressureTrace):
        return trace_pressure(gas, cycle, angles)
    if isinstance(gas, Seiliger):
        return seiliger_pressure(gas, part, cycle, angles)
    return wiebe_pressure(gas, part, cycle, angles)


def indicated_mean_pressure(pressures: FloatArray, part: SliderCrank, cycle: Cycle) -> float:
    """Cyclic integral of p dV over the displacement (G3).

    Parameters
    ----------
    pressures
        Shape (n,) [Pa], at equal steps over one cycle from the firing dead centre.
    part
        The slider-crank whose piston the gas works on.
    cycle
        Two- or four-stroke.

    Returns
    -------
    Mean pressure [Pa] by the trapezoidal rule with the exact dV/d gamma. It converges
    faster than any power of 1/n for a smooth trace, and with 1/n^2 where the pressure
    has jumps at dead centres or bends.
    """
    angles = cycle.angle * np.arange(len(pressures)) / len(pressures)
    return float(np.mean(pressures * swept_rate(part, angles)) * cycle.angle)


def swept_volume(part: SliderCrank, angles: FloatArray) -> FloatArray:
    """Volume swept from the highest piston position, over the displacement (G1); 0 to 1, shape of `angles`."""
    rod_ratio, offset_ratio = part.rod_ratio, _turned_offset(part)
    top, _ = dead_centres(part)
    path = slider_crank.travel(np, angles, rod_ratio, offset_ratio)
    highest = slider_crank.travel(np, top, rod_ratio, offset_ratio)
    return np.asarray((path - highest) * (part.crank_radius / part.stroke))


def swept_rate(part: SliderCrank, angles: FloatArray) -> FloatArray:
    """Derivative of `swept_volume` by the crank angle, exact, shape of `angles`."""
    velocity = slider_crank.piston_velocity(np, angles, part.rod_ratio, _turned_offset(part))
    return np.asarray(-velocity * (part.crank_radius / part.stroke))


def dead_centres(part: SliderCrank) -> tuple[float, float]:
    """Crank angles of the highest and the lowest piston position [rad] (G2).

    Crank and rod are in one line there. With an offset both lie off gamma = 0 and pi.
    """
    rod_ratio, offset_ratio = part.rod_ratio, _turned_offset(part)
    return math.asin(offset_ratio / (1.0 + rod_ratio)), math.pi + math.asin(offset_ratio / (1.0 - rod_ratio))


def _turned_offset(part: SliderCrank) -> float:
    """Offset ratio as it is met in the direction in which the crank turns.

    alpha = n gamma (C5), and a mechanism seen in a mirror turns the other way.
    """
    ratio = part.shaft.ratio
    if abs(ratio) != 1.0:
        raise ModelError(
            f"{part.name}: a working cycle on shaft '{part.shaft.name}' with ratio {ratio:g} is not modelled, "
            "the ratio must be 1 or -1; give a pressure trace"
        )
    return ratio * part.offset_ratio


@dataclass(frozen=True)
class _Cylinder:
    """Volumes of a cylinder over its cycle, and when its valves open.

    The closed period runs from the lowest piston position before firing to that after
    it, lowest - 2 pi to lowest; exhaust and intake strokes follow in a four-stroke cycle.
    """

    part: SliderCrank
    cycle: Cycle
    compression_ratio: float

    @property
    def smallest(self) -> float:
        """V_c / V_h."""
        return 1.0 / (self.compression_ratio - 1.0)

    @property
    def largest(self) -> float:
        """(V_c + V_h) / V_h."""
        return self.compression_ratio / (self.compression_ratio - 1.0)

    def volume(self, angles: FloatArray) -> FloatArray:
        """V / V_h (G1)."""
        return self.smallest + swept_volume(self.part, angles)

    def pressure(
        self, gas: Seiliger | Wiebe, closed: Callable[[FloatArray], FloatArray], angles: FloatArray
    ) -> FloatArray:
        """Pressure over the cycle from that of the closed period, the mean of both sides at a jump [Pa]."""
        before = self._one_sided(gas, closed, angles - _JUMP_WIDTH)
        after = self._one_sided(gas, closed, angles + _JUMP_WIDTH)
        return 0.5 * (before + after)

    def _one_sided(
        self, gas: Seiliger | Wiebe, closed: Callable[[FloatArray], FloatArray], angles: FloatArray
    ) -> FloatArray:
        top, bottom = dead_centres(self.part)
        first = bottom - math.tau
        local = first + np.mod(angles - first, self.cycle.angle)
        pressures = np.where(local < top + math.tau, gas.exhaust_pressure, gas.intake_pressure)
        is_closed = local < bottom
        pressures[is_closed] = closed(local[is_closed])
        return pressures


def gas_exchange_pressure(gas: Seiliger | Wiebe, cycle: Cycle) -> float:
    """Mean pressure of the exhaust and intake strokes [Pa]; none in a two-stroke cycle (G6, G11)."""
    return gas.intake_pressure - gas.exhaust_pressure if cycle is Cycle.FOUR_STROKE else 0.0


# mixed cycle


def seiliger_pressure(gas: Seiliger, part: SliderCrank, cycle: Cycle, angles: FloatArray) -> FloatArray:
    """Pressure of the mixed cycle (G4, G5).

    Parameters
    ----------
    gas
        Model with the indicated mean pressure wanted.
    part
        The slider-crank whose piston the gas works on.
    cycle
        Two- or four-stroke.
    angles
        Shape (n,), crank angles gamma [rad].

    Returns
    -------
    Shape (n,) [Pa].

    Raises
    ------
    ModelError
        If the peak pressure is below the end of compression, or no cut-off gives the
        indicated mean pressure.
    """
    cylinder = _Cylinder(part, cycle, gas.compression_ratio)
    top, _ = dead_centres(part)
    cut_off = cylinder.smallest * seiliger_cut_off(gas, cycle)

    def closed(local: FloatArray) -> FloatArray:
        volume = cylinder.volume(local)
        compression = gas.intake_pressure * (cylinder.largest / volume) ** gas.compression_exponent
        expansion = gas.peak_pressure * np.minimum(1.0, cut_off / volume) ** gas.expansion_exponent
        return np.where(local < top, compression, expansion)

    return cylinder.pressure(gas, closed, angles)


def seiliger_cut_off(gas: Seiliger, cycle: Cycle) -> float:
    """Volume at the cut-off over the smallest volume, solved for the indicated mean pressure (G6).

    The mean pressure rises with the cut-off all the way, from heat at constant volume
    alone (1) to constant pressure down the whole stroke (the compression ratio).

    Raises
    ------
    ModelError
        With the range that can be reached.
    """
    # late, for it takes longer than all the rest of a small problem
    from scipy.optimize import brentq

    end = compression_end_pressure(gas)
    if gas.peak_pressure < end * (1.0 - _ROUNDING):
        raise ModelError(
            f"peak_pressure {_bar(gas.peak_pressure)} is below the {_bar(end)} at the end of compression "
            f"(ratio {gas.compression_ratio:g}, exponent {gas.compression_exponent:g}, "
            f"from {_bar(gas.intake_pressure)}); raise peak_pressure or lower compression_ratio"
        )
    least, most = seiliger_imep(gas, cycle, 1.0), seiliger_imep(gas, cycle, gas.compression_ratio)
    slack = _ROUNDING * gas.peak_pressure
    if not least - slack <= gas.imep <= most + slack:
        remedy = "raise peak_pressure" if gas.imep > most else "lower peak_pressure"
        raise ModelError(
            f"imep {_bar(gas.imep)} cannot be reached with a peak pressure of {_bar(gas.peak_pressure)}: from none to "
            f"full cut-off it is between {_bar(least)} and {_bar(most)}; {remedy} or change imep"
        )
    if gas.imep <= least:
        return 1.0
    if gas.imep >= most:
        return gas.compression_ratio
    return float(
        brentq(
            lambda ratio: seiliger_imep(gas, cycle, ratio) - gas.imep,
            1.0,
            gas.compression_ratio,
            xtol=1e-15,
            rtol=1e-15,
        )
    )


def compression_end_pressure(gas: Seiliger) -> float:
    """Pressure at the smallest volume before heat comes [Pa] (G4)."""
    return float(gas.intake_pressure * gas.compression_ratio**gas.compression_exponent)


def seiliger_imep(gas: Seiliger, cycle: Cycle, cut_off_ratio: float) -> float:
    """Indicated mean pressure of the mixed cycle for a cut-off, in closed form [Pa] (G6).

    Parameters
    ----------
    gas
        Model; its own imep is not used.
    cycle
        Two- or four-stroke.
    cut_off_ratio
        Volume at the cut-off over the smallest volume, 1 to the compression ratio.
    """
    whole = gas.compression_ratio
    compression = compression_end_pressure(gas) * _polytropic_work(whole, gas.compression_exponent)
    expansion = cut_off_ratio * _polytropic_work(whole / cut_off_ratio, gas.expansion_exponent)
    burning = gas.peak_pressure * (cut_off_ratio - 1.0 + expansion)
    return (burning - compression) / (whole - 1.0) + gas_exchange_pressure(gas, cycle)


def _polytropic_work(ratio: float, exponent: float) -> float:
    """Work of an expansion by a volume ratio, over p V at its small end; any exponent, 1 included."""
    power, log = exponent - 1.0, math.log(ratio)
    return -math.expm1(-power * log) / power if power != 0.0 else log


# finite heat release


def wiebe_pressure(gas: Wiebe, part: SliderCrank, cycle: Cycle, angles: FloatArray) -> FloatArray:
    """Pressure with finite heat release (G7-G9).

    Parameters
    ----------
    gas
        Model with the indicated mean pressure wanted.
    part
        The slider-crank whose piston the gas works on.
    cycle
        Two- or four-stroke.
    angles
        Shape (n,), crank angles gamma [rad].

    Returns
    -------
    Shape (n,) [Pa].

    Raises
    ------
    ModelError
        If the burn leaves the closed period, or no heat that a charge can hold gives the
        indicated mean pressure.
    """
    cylinder = _Cylinder(part, cycle, gas.compression_ratio)
    heat = wiebe_heat(gas, part, cycle)

    def closed(local: FloatArray) -> FloatArray:
        volume = cylinder.volume(local)
        motored = gas.intake_pressure * (cylinder.largest / volume) ** gas.heat_ratio
        burnt = np.clip((local - gas.start) / gas.duration, 0.0, 1.0)
        added = heat * (gas.heat_ratio - 1.0) * _stored_heat(gas, cylinder, burnt)
        return np.asarray(motored + added / volume**gas.heat_ratio)

    return cylinder.pressure(gas, closed, angles)


def wiebe_heat(gas: Wiebe, part: SliderCrank, cycle: Cycle) -> float:
    """Heat that gives the indicated mean pressure, burnt or not, over the displacement [Pa] (G10, G11).

    Heat released at a volume V works with the efficiency 1 - (V / V_largest)^(kappa-1)
    whatever the rest does, so the mean pressure is linear in the heat.

    Raises
    ------
    ModelError
        With the range that can be reached.
    """
    cylinder = _Cylinder(part, cycle, gas.compression_ratio)
    _check_burn(gas, part)
    places, weights = _unit_quadrature()

    def worked(x: FloatArray) -> FloatArray:
        volume = cylinder.volume(gas.start + gas.duration * x)
        return np.asarray(-np.expm1((gas.heat_ratio - 1.0) * np.log(volume / cylinder.largest)))

    efficiency = float(np.sum(weights * _burn_rate(gas, places) * worked(places)))
    least = gas_exchange_pressure(gas, cycle)
    charge = gas.intake_pressure * cylinder.largest
    most = least + MAX_CHARGE_HEAT * charge * efficiency / gas.completeness
    slack = _ROUNDING * max(gas.intake_pressure, gas.exhaust_pressure)
    if not least - slack <= gas.imep <= most:
        remedy = "raise intake_pressure" if gas.imep > most else "raise imep or lower exhaust_pressure"
        raise ModelError(
            f"imep {_bar(gas.imep)} cannot be reached with an intake pressure of {_bar(gas.intake_pressure)}: from no "
            f"heat to the most that fuel and air can hold it is between {_bar(least)} and {_bar(most)}; {remedy}"
        )
    return max(gas.imep - least, 0.0) / efficiency


def _check_burn(gas: Wiebe, part: SliderCrank) -> None:
    _, bottom = dead_centres(part)
    first, last = gas.start, gas.start + gas.duration
    if first < bottom - math.tau - _ROUNDING or last > bottom + _ROUNDING:
        raise ModelError(
            f"{part.name}: the burn from {math.degrees(first):.6g} to {math.degrees(last):.6g} deg must lie between "
            f"the dead centres at {math.degrees(bottom) - 360.0:.6g} and {math.degrees(bottom):.6g} deg; move start or "
            "shorten duration"
        )


def _burn_rate(gas: Wiebe, x: FloatArray) -> FloatArray:
    """Derivative of the burnt fraction 1 - exp(-a x^(m+1)) by x, the elapsed part of the burn (G7)."""
    order = gas.shape + 1.0
    efficiency = -math.log1p(-gas.completeness)
    return np.asarray(efficiency * order * x**gas.shape * np.exp(-efficiency * x**order))


def _stored_heat(gas: Wiebe, cylinder: _Cylinder, elapsed: FloatArray) -> FloatArray:
    """Integral of v^(kappa-1) over the burnt fraction up to each elapsed part of the burn (G9)."""
    places, weights = _unit_quadrature()
    # every sample after the burn has the same integral
    ends, inverse = np.unique(elapsed, return_inverse=True)
    x = np.outer(ends, places)
    volume = cylinder.volume(gas.start + gas.duration * x)
    integrals = ends * ((_burn_rate(gas, x) * volume ** (gas.heat_ratio - 1.0)) @ weights)
    return np.asarray(integrals[inverse])


@lru_cache(maxsize=1)
def _unit_quadrature() -> tuple[FloatArray, FloatArray]:
    """Places and weights of the double-exponential rule on (0, 1) (Takahasi and Mori 1974).

    The burn rate behaves as x^m at its start: this rule takes any such end in its stride.
    """
    step = 1.0 / 24.0
    t = step * np.arange(-84, 85)
    lean = 0.5 * math.pi * np.sinh(t)
    places = 1.0 / (1.0 + np.exp(-2.0 * lean))
    weights = step * math.pi * np.cosh(t) * places / (1.0 + np.exp(2.0 * lean))
    for table in (places, weights):
        table.setflags(write=False)
    return places, weights


# measured trace


def trace_pressure(gas: PressureTrace, cycle: Cycle, angles: FloatArray) -> FloatArray:
    """Measured pressure, interpolated with the period of the cycle (G12).

    Monotone cubics between the points (Fritsch and Carlson 1980) stay within their
    neighbours: a jump does not ring.

    Parameters
    ----------
    gas
        The trace.
    cycle
        Two- or four-stroke.
    angles
        Shape (n,), crank angles gamma [rad].

    Returns
    -------
    Shape (n,) [Pa].

    Raises
    ------
    ModelError
        If the trace covers less or more than the cycle, or has a gap of over 30 degrees.
    """
    # late, for it takes longer than all the rest of a small problem
    from scipy.interpolate import PchipInterpolator

    points, pressures = _one_period(gas, cycle)
    _check_gaps(points, cycle)
    # a slope looks at two neighbours on either side
    around = np.concatenate([points[-3:] - cycle.angle, points, points[:3] + cycle.angle])
    values = np.concatenate([pressures[-3:], pressures, pressures[:3]])
    local = points[0] + np.mod(angles - points[0], cycle.angle)
    return np.asarray(PchipInterpolator(around, values)(local))


def _one_period(gas: PressureTrace, cycle: Cycle) -> tuple[FloatArray, FloatArray]:
    """Points of a trace, an end that repeats the beginning merged into it."""
    points, pressures = np.array(gas.angles), np.array(gas.pressures)
    missing = cycle.angle - (points[-1] - points[0])
    step = float(np.min(np.diff(points)))
    if missing < -1e-3 * step:
        raise ModelError(
            f"the trace runs from {_degrees(points[0])} to {_degrees(points[-1])} deg, more than the "
            f"{_degrees(cycle.angle)} deg of a {cycle.name.lower().replace('_', '-')} cycle; cut it to one cycle"
        )
    if missing > 1e-3 * step:
        return points, pressures
    merged = pressures[:-1].copy()
    merged[0] = 0.5 * (pressures[0] + pressures[-1])
    return points[:-1], merged


def _check_gaps(points: FloatArray, cycle: Cycle) -> None:
    inner = np.diff(points)
    outer = float(points[0] + cycle.angle - points[-1])
    if outer > min(2.0 * float(inner.max()), MAX_TRACE_GAP):
        raise ModelError(
            f"the trace runs from {_degrees(points[0])} to {_degrees(points[-1])} deg, so {_degrees(outer)} of the "
            f"{_degrees(cycle.angle)} deg of a {cycle.name.lower().replace('_', '-')} cycle are missing; "
            "give the whole cycle"
        )
    k = int(np.argmax(inner))
    if inner[k] > MAX_TRACE_GAP:
        raise ModelError(
            f"the trace has no point between {_degrees(points[k])} and {_degrees(points[k + 1])} deg, gaps must not "
            f"exceed {_degrees(MAX_TRACE_GAP)} deg; add points"
        )


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.6g}"


def _bar(pressure: float) -> str:
    return f"{pressure * 1e-5:.6g} bar"
