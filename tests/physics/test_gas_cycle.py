"""Cylinder pressure against closed forms, quadrature and integration written anew here."""

from __future__ import annotations

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from laufruhe.errors import ModelError
from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.machine import Cycle, Seiliger, Shaft, SliderCrank, Wiebe
from laufruhe.machine.gas.charge import dead_centres, swept_volume
from laufruhe.machine.gas.seiliger import (
    compression_end_pressure,
    seiliger_cut_off,
    seiliger_imep,
)
from laufruhe.machine.gas.wiebe import wiebe_heat
from laufruhe.physics.gas_loads import _one_cylinder, gas_coefficients
from one_cylinder import cylinder_pressure, indicated_mean_pressure, swept_rate

BAR, AT = 1e5, 98_066.5
RADIUS = 0.06


def _part(rod_ratio: float = 0.26, offset: float = 0.0, ratio: float = 1.0) -> SliderCrank:
    length = RADIUS / rod_ratio if rod_ratio else math.inf
    return SliderCrank("cylinder 1", 0.0, RADIUS, length, 1.25, offset=offset, bore=0.1, shaft=Shaft("crank", ratio))


PARTS = {
    "plain": _part(),
    "offset": _part(offset=0.012),
    "far offset": _part(offset=-0.05),
    "yoke": _part(0.0),
    "backwards": _part(offset=0.012, ratio=-1.0),
}
DIESEL = Seiliger(80 * AT, 9 * AT)
BURN = Wiebe(9 * BAR, math.radians(-10), math.radians(55))

every_part = pytest.mark.parametrize("part", PARTS.values(), ids=PARTS.keys())
every_cycle = pytest.mark.parametrize("cycle", list(Cycle), ids=lambda cycle: cycle.name.lower())


def _volume(part: SliderCrank, angle: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return the piston travel below its highest position over the stroke, from the triangle itself."""
    alpha = part.shaft.ratio * np.asarray(angle)
    r, e = part.crank_radius, part.offset
    if math.isinf(part.rod_length):
        return np.asarray(0.5 * (1.0 - np.cos(alpha)))
    l = part.rod_length
    height = r * np.cos(alpha) + np.sqrt(l**2 - (r * np.sin(alpha) - e) ** 2)
    highest, lowest = math.sqrt((l + r) ** 2 - e**2), math.sqrt((l - r) ** 2 - e**2)
    return np.asarray((highest - height) / (highest - lowest))


class TestVolume:
    @every_part
    def test_against_the_triangle(self, part: SliderCrank) -> None:
        angles = np.linspace(-4.0, 14.0, 301)
        np.testing.assert_allclose(swept_volume(part, angles), _volume(part, angles), atol=5e-15)

    @every_part
    def test_dead_centres(self, part: SliderCrank) -> None:
        ends = np.array(dead_centres(part))
        np.testing.assert_allclose(swept_volume(part, ends), [0.0, 1.0], atol=2e-15)
        np.testing.assert_allclose(swept_rate(part, ends), 0.0, atol=1e-15)
        assert abs(ends[0]) < 1.0
        assert abs(ends[1] - math.pi) < 1.0

    @every_part
    def test_rate_is_the_derivative(self, part: SliderCrank) -> None:
        angles, step = np.linspace(0.0, 12.0, 97), 1e-5
        slope = (_volume(part, angles + step) - _volume(part, angles - step)) / (2 * step)
        np.testing.assert_allclose(swept_rate(part, angles), slope, atol=1e-9)

    def test_offset_moves_the_dead_centres(self) -> None:
        top, bottom = dead_centres(PARTS["offset"])
        assert top > 0.01
        assert bottom - math.pi > top
        assert dead_centres(PARTS["plain"]) == (0.0, math.pi)
        assert dead_centres(PARTS["yoke"]) == (0.0, math.pi)

    def test_backwards_is_the_mirror_image(self) -> None:
        ahead = cylinder_pressure(DIESEL, _part(offset=-0.012), Cycle.FOUR_STROKE, 360)
        np.testing.assert_array_equal(cylinder_pressure(DIESEL, PARTS["backwards"], Cycle.FOUR_STROKE, 360), ahead)
        other = cylinder_pressure(DIESEL, _part(offset=0.012), Cycle.FOUR_STROKE, 360)
        assert np.abs(other - ahead).max() > BAR


class TestMeanPressure:
    @every_part
    @every_cycle
    def test_smooth_pressure_is_integrated_to_rounding(self, part: SliderCrank, cycle: Cycle) -> None:
        """Check p = p0 + p1 dv/dgamma: p1 times the integral of the squared rate."""
        angles = cycle.angle * np.arange(256) / 256
        mean = indicated_mean_pressure(3 * BAR + BAR * swept_rate(part, angles), part, cycle)
        exact = cycle.turns * mpmath.quad(
            lambda g: swept_rate(part, np.array(float(g))) ** 2, np.linspace(0, math.tau, 9).tolist()
        )
        assert mean == pytest.approx(BAR * float(exact), rel=1e-12)

    @every_cycle
    def test_constant_pressure_does_no_work(self, cycle: Cycle) -> None:
        assert abs(indicated_mean_pressure(np.full(720, 80 * BAR), PARTS["offset"], cycle)) < 1e-12 * 80 * BAR


def _seiliger_loop(gas: Seiliger, cycle: Cycle, cut_off: float) -> float:
    """Return the work of the mixed cycle over the displacement, by quadrature in mpmath."""
    with mpmath.workdps(30):
        clearance = 1 / (mpmath.mpf(gas.compression_ratio) - 1)
        largest, knee = clearance + 1, clearance * cut_off
        panels = [clearance * (largest / clearance) ** (mpmath.mpf(k) / 4) for k in range(5)]
        after = [knee * (largest / knee) ** (mpmath.mpf(k) / 4) for k in range(5)]
        compression = mpmath.quad(lambda v: gas.intake_pressure * (largest / v) ** gas.compression_exponent, panels)
        expansion = mpmath.quad(lambda v: gas.peak_pressure * (knee / v) ** gas.expansion_exponent, after)
        work = gas.peak_pressure * (knee - clearance) + expansion - compression
        if cycle is Cycle.FOUR_STROKE:
            work += gas.intake_pressure - gas.exhaust_pressure
        return float(work)


class TestSeiliger:
    @every_cycle
    @pytest.mark.parametrize("exponents", [(1.35, 1.30), (1.0, 1.25), (1.4, 1.0), (0.8, 1.6), (1 + 1e-9, 1 - 1e-9)])
    @pytest.mark.parametrize("cut_off", [1.0, 1.4, 8.0])
    def test_closed_form(self, cycle: Cycle, exponents: tuple[float, float], cut_off: float) -> None:
        gas = Seiliger(
            90 * BAR, 0.0, *exponents, compression_ratio=14.0, intake_pressure=1.4 * BAR, exhaust_pressure=1.1 * BAR
        )
        expected = _seiliger_loop(gas, cycle, cut_off)
        assert seiliger_imep(gas, cycle, cut_off) == pytest.approx(expected, rel=1e-13, abs=1e-13 * gas.peak_pressure)

    @given(
        share=st.floats(0.0, 1.0),
        ratio=st.floats(1.05, 60.0),
        exponents=st.tuples(st.floats(0.9, 1.67), st.floats(0.9, 1.67)),
        rise=st.floats(1.0, 5.0),
        exhaust=st.floats(0.2, 4.0),
        cycle=st.sampled_from(Cycle),
    )
    def test_cut_off_meets_the_mean_pressure(
        self, share: float, ratio: float, exponents: tuple[float, float], rise: float, exhaust: float, cycle: Cycle
    ) -> None:
        gas = Seiliger(1.0, 0.0, *exponents, compression_ratio=ratio, exhaust_pressure=exhaust * BAR)
        gas = replace(gas, peak_pressure=rise * compression_end_pressure(gas))
        minimum, maximum = seiliger_imep(gas, cycle, 1.0), seiliger_imep(gas, cycle, ratio)
        assert minimum < maximum
        gas = replace(gas, imep=minimum + share * (maximum - minimum))
        result = seiliger_cut_off(gas, cycle)
        assert 1.0 <= result <= ratio
        # volumes are in displacements: at a ratio near 1 the clearance is many of them
        terms = gas.peak_pressure * ratio / (ratio - 1.0)
        assert abs(seiliger_imep(gas, cycle, result) - gas.imep) <= 1e-13 * terms

    @every_part
    @every_cycle
    def test_sampled_mean_pressure_converges_with_the_square_of_the_step(self, part: SliderCrank, cycle: Cycle) -> None:
        """The bend at the cut-off falls anywhere in a step, so the error scatters below its bound."""
        counts = np.array([250, 360, 500, 720, 1000, 1440, 2000, 2880, 5760, 11520]) * cycle.turns
        errors = np.array(
            [indicated_mean_pressure(cylinder_pressure(DIESEL, part, cycle, n), part, cycle) - 9 * AT for n in counts]
        )
        steps = cycle.angle / counts
        assert (np.abs(errors) < 0.5 * steps**2 * DIESEL.imep).all()
        assert np.abs(errors[:3]).max() > 100 * np.abs(errors[-2:]).max()

    @every_part
    @every_cycle
    def test_peak_and_its_place(self, part: SliderCrank, cycle: Cycle) -> None:
        angles = np.linspace(0.0, cycle.angle, 7200, endpoint=False) + 1e-4
        pressures = DIESEL.cycle_pressure(part, cycle, angles, 1.0)
        assert pressures.max() == DIESEL.peak_pressure
        clearance = 1.0 / (DIESEL.compression_ratio - 1.0)
        at_peak = angles[pressures == DIESEL.peak_pressure]
        assert (np.mod(at_peak - dead_centres(part)[0], cycle.angle) < 1.0).all()
        knee = float(_volume(part, at_peak).max()) / clearance + 1.0
        assert knee == pytest.approx(seiliger_cut_off(DIESEL, cycle), rel=3e-3)

    def test_strokes_of_a_four_stroke_cycle(self) -> None:
        gas = replace(DIESEL, intake_pressure=1.5 * BAR, exhaust_pressure=1.2 * BAR)
        part, clearance = PARTS["offset"], 1.0 / 16.0
        angles = np.radians([100.0, 200.0, 350.0, 380.0, 520.0, 600.0])
        result = gas.cycle_pressure(part, Cycle.FOUR_STROKE, angles, 1.0)
        expansion, compression = clearance + _volume(part, angles[[0, 5]])
        knee = clearance * seiliger_cut_off(gas, Cycle.FOUR_STROKE)
        assert result[0] == pytest.approx(gas.peak_pressure * (knee / expansion) ** 1.30, rel=1e-12)
        assert result[1:5].tolist() == [1.2 * BAR, 1.2 * BAR, 1.5 * BAR, 1.5 * BAR]
        assert result[5] == pytest.approx(1.5 * BAR * ((1 + clearance) / compression) ** 1.35, rel=1e-12)

    def test_two_stroke_cycle_has_no_gas_exchange_strokes(self) -> None:
        part = PARTS["plain"]
        result = DIESEL.cycle_pressure(part, Cycle.TWO_STROKE, np.radians([179.0, 181.0, 300.0]), 1.0)
        assert result[0] > 2 * BAR
        assert result[1] == pytest.approx(DIESEL.intake_pressure, rel=1e-3)
        assert result[2] > 1.5 * DIESEL.intake_pressure
        other = replace(DIESEL, exhaust_pressure=3 * BAR)
        np.testing.assert_array_equal(
            cylinder_pressure(other, part, Cycle.TWO_STROKE, 360),
            cylinder_pressure(DIESEL, part, Cycle.TWO_STROKE, 360),
        )

    @every_cycle
    def test_gas_exchange_is_part_of_the_mean_pressure(self, cycle: Cycle) -> None:
        throttled = replace(DIESEL, exhaust_pressure=DIESEL.intake_pressure + 0.5 * BAR)
        change = seiliger_imep(throttled, cycle, 1.4) - seiliger_imep(DIESEL, cycle, 1.4)
        assert change == pytest.approx(-0.5 * BAR if cycle is Cycle.FOUR_STROKE else 0.0, rel=1e-12)

    @every_cycle
    def test_no_heat_and_equal_exponents_do_no_work(self, cycle: Cycle) -> None:
        end = 1.1 * BAR * 15.0**1.35
        gas = Seiliger(
            end, 0.0, 1.35, 1.35, compression_ratio=15.0, intake_pressure=1.1 * BAR, exhaust_pressure=1.1 * BAR
        )
        assert abs(seiliger_imep(gas, cycle, 1.0)) < 1e-14 * end
        # within rounding of the least that can be reached: not refused
        assert seiliger_cut_off(gas, cycle) == pytest.approx(1.0, abs=1e-7)
        pressures = cylinder_pressure(gas, PARTS["plain"], cycle, 720)
        assert abs(indicated_mean_pressure(pressures, PARTS["plain"], cycle)) < 1e-9 * BAR
        angles = np.radians([3.0, 40.0, 120.0])
        left = gas.cycle_pressure(PARTS["plain"], cycle, cycle.angle - angles, 1.0)
        np.testing.assert_allclose(gas.cycle_pressure(PARTS["plain"], cycle, angles, 1.0), left, rtol=1e-7)

    @every_cycle
    def test_full_cut_off_keeps_the_peak_down_the_whole_stroke(self, cycle: Cycle) -> None:
        gas = replace(DIESEL, imep=seiliger_imep(DIESEL, cycle, 17.0))
        assert seiliger_cut_off(gas, cycle) == 17.0
        result = gas.cycle_pressure(PARTS["plain"], cycle, np.linspace(0.01, 3.14, 50), 1.0)
        assert (result == gas.peak_pressure).all()


class TestJumps:
    def test_a_sample_on_a_jump_takes_the_mean_of_both_sides(self) -> None:
        gas = replace(DIESEL, exhaust_pressure=1.4 * BAR)
        result = cylinder_pressure(gas, PARTS["plain"], Cycle.FOUR_STROKE, 720)
        assert result[0] == pytest.approx(0.5 * (compression_end_pressure(gas) + gas.peak_pressure), rel=1e-12)
        assert result[360] == pytest.approx(0.5 * (gas.exhaust_pressure + gas.intake_pressure), rel=1e-12)
        before = gas.cycle_pressure(PARTS["plain"], Cycle.FOUR_STROKE, np.array([math.pi - 1e-6]), 1.0)
        assert result[180] == pytest.approx(0.5 * (before[0] + gas.exhaust_pressure), rel=1e-6)
        assert before[0] > 2 * BAR

    @every_part
    @every_cycle
    @pytest.mark.parametrize("gas", [DIESEL, replace(BURN, imep=12 * BAR)], ids=["seiliger", "wiebe"])
    def test_torque_does_not_jump(self, gas: Seiliger | Wiebe, part: SliderCrank, cycle: Cycle) -> None:
        steps = []
        for samples in (3600, 36000):
            angles = cycle.angle * np.arange(samples) / samples
            torque = cylinder_pressure(gas, part, cycle, samples) * swept_rate(part, angles)
            steps.append(np.abs(np.diff(torque, append=torque[:1])).max())
        assert steps[1] < 0.11 * steps[0]


def _integrated(gas: Wiebe, part: SliderCrank, heat: float, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the pressure from dp/dgamma = -kappa p V'/V + (kappa - 1)/V dQ/dgamma through the closed period."""
    clearance, a = 1.0 / (gas.compression_ratio - 1.0), -math.log(1.0 - gas.completeness)
    _, bottom = dead_centres(part)
    first, begin, end = bottom - math.tau, gas.start, gas.start + gas.duration

    def slope(angle: float, p: NDArray[np.float64], burning: bool) -> NDArray[np.float64]:
        v, dv = clearance + _volume(part, angle), swept_rate(part, np.array(angle))
        x = (angle - gas.start) / gas.duration
        rate = (
            a
            * (gas.shape + 1)
            / gas.duration
            * max(x, 0.0) ** gas.shape
            * math.exp(-a * max(x, 0.0) ** (gas.shape + 1))
        )
        return np.asarray((-gas.heat_ratio * p * dv + (gas.heat_ratio - 1) * heat * rate * burning) / v)

    out = np.zeros_like(angles)
    p = gas.intake_pressure
    for low, high, burning in ((first, begin, False), (begin, end, True), (end, bottom, False)):
        inside = (angles >= low) & (angles < high)
        run = solve_ivp(
            slope,
            (low, high),
            [p],
            method="DOP853",
            t_eval=np.append(angles[inside], high),
            rtol=1e-12,
            atol=1e-6,
            args=(burning,),
        )
        out[inside] = run.y[0, :-1]
        p = run.y[0, -1]
    return out


class TestWiebe:
    @every_part
    @pytest.mark.parametrize(
        "gas",
        [
            BURN,
            replace(BURN, shape=0.0, completeness=0.9, start=0.0),
            replace(BURN, shape=0.6, heat_ratio=1.25, intake_pressure=1.8 * BAR),
            replace(BURN, shape=12.0, start=math.radians(-60), duration=math.radians(200), imep=3 * BAR),
        ],
        ids=["usual", "even", "m = 0.6", "m = 12"],
    )
    def test_against_integration(self, gas: Wiebe, part: SliderCrank) -> None:
        angles = np.linspace(-2.8, 2.8, 117)
        expected = _integrated(gas, part, wiebe_heat(gas, part, Cycle.TWO_STROKE), angles)
        result = gas.cycle_pressure(part, Cycle.TWO_STROKE, angles, 1.0)
        np.testing.assert_allclose(result, expected, rtol=1e-9)

    @every_part
    @every_cycle
    def test_sampled_mean_pressure_converges_with_the_square_of_the_step(self, part: SliderCrank, cycle: Cycle) -> None:
        counts = np.array([360, 720, 1440, 2880, 5760]) * cycle.turns
        errors = np.array(
            [indicated_mean_pressure(cylinder_pressure(BURN, part, cycle, n), part, cycle) - BURN.imep for n in counts]
        )
        assert (np.abs(errors) < 0.1 * (cycle.angle / counts) ** 2 * BURN.imep).all()

    @every_cycle
    def test_bends_alone_make_the_error(self, cycle: Cycle) -> None:
        """Check fourth order after one extrapolation with dead centres and ends of the burn on samples."""
        gas, part = replace(BURN, duration=math.radians(60)), PARTS["plain"]
        coarse, fine = (
            indicated_mean_pressure(cylinder_pressure(gas, part, cycle, n * cycle.turns), part, cycle)
            for n in (720, 1440)
        )
        assert (4 * fine - coarse) / 3 == pytest.approx(gas.imep, rel=1e-8)
        assert abs(fine / gas.imep - 1) > 1e-8

    @given(
        imep=st.floats(1.0, 25.0),
        start=st.floats(-60.0, 40.0),
        duration=st.floats(1.0, 110.0),
        shape=st.floats(0.0, 10.0),
        ratio=st.floats(5.0, 30.0),
    )
    def test_heat_is_linear_in_the_mean_pressure(
        self, imep: float, start: float, duration: float, shape: float, ratio: float
    ) -> None:
        gas = Wiebe(imep * BAR, math.radians(start), math.radians(duration), shape, compression_ratio=ratio)
        try:
            heat = wiebe_heat(gas, PARTS["offset"], Cycle.TWO_STROKE)
        except ModelError:
            assume(False)
        half = wiebe_heat(replace(gas, imep=0.5 * gas.imep), PARTS["offset"], Cycle.TWO_STROKE)
        assert heat == pytest.approx(2 * half, rel=1e-13)
        # no heat works better than all of it at the smallest volume
        otto = 1 - ratio ** (1 - gas.heat_ratio)
        assert heat >= gas.imep / (otto * gas.completeness) * (1 - 1e-12)

    def test_sudden_heat_at_dead_centre_is_the_otto_cycle(self) -> None:
        gas = Wiebe(8 * BAR, 0.0, 1e-4, completeness=1 - 1e-12)
        heat = wiebe_heat(gas, PARTS["plain"], Cycle.TWO_STROKE)
        assert heat == pytest.approx(8 * BAR / (1 - 17.0**-0.35), rel=1e-7)
        end = gas.intake_pressure * 17.0**1.35
        result = gas.cycle_pressure(PARTS["plain"], Cycle.TWO_STROKE, np.array([2e-4]), 1.0)
        assert result[0] == pytest.approx(end + 0.35 * heat * 16.0, rel=1e-5)

    @every_part
    @every_cycle
    def test_no_heat_is_the_motored_engine(self, part: SliderCrank, cycle: Cycle) -> None:
        gas = replace(BURN, exhaust_pressure=1.3 * BAR)
        exchange = gas.intake_pressure - gas.exhaust_pressure if cycle is Cycle.FOUR_STROKE else 0.0
        gas = replace(gas, imep=exchange)
        assert wiebe_heat(gas, part, cycle) == 0.0
        result = indicated_mean_pressure(cylinder_pressure(gas, part, cycle, 1440), part, cycle)
        assert result == pytest.approx(exchange, rel=2e-4, abs=1e-9 * BAR)
        angles = np.linspace(-2.8, 2.8, 41)
        adiabatic = gas.intake_pressure * (17.0 / (1.0 + 16.0 * _volume(part, angles))) ** 1.35
        np.testing.assert_allclose(gas.cycle_pressure(part, cycle, angles, 1.0), adiabatic, rtol=1e-8)
        whole = cycle.angle * np.arange(720) / 720
        cold = BURN.motored(cycle).cycle_pressure(part, cycle, whole, 1.0)
        gas = replace(gas, exhaust_pressure=BURN.exhaust_pressure, imep=0.0)
        np.testing.assert_allclose(cold, gas.cycle_pressure(part, cycle, whole, 1.0), rtol=1e-8)


class TestTrace:
    @every_part
    @every_cycle
    @pytest.mark.parametrize("first", [0.0, -1.3])
    def test_fine_trace_gives_back_what_it_was_taken_from(self, part: SliderCrank, cycle: Cycle, first: float) -> None:
        angles = first + np.linspace(0.0, cycle.angle, 3600 * cycle.turns, endpoint=False)
        trace = PressureTrace(tuple(angles), tuple(DIESEL.cycle_pressure(part, cycle, angles, 1.0)))
        expected, found = (cylinder_pressure(gas, part, cycle, 1440) for gas in (DIESEL, trace))
        away = np.ones(1440, dtype=bool)
        for centre in dead_centres(part):
            gap = np.mod(cycle.angle * np.arange(1440) / 1440 - centre + 0.5, math.pi) - 0.5
            away &= np.abs(gap) > 0.01
        assert away.sum() > 1400
        np.testing.assert_allclose(found[away], expected[away], rtol=1e-3)
        assert indicated_mean_pressure(found, part, cycle) == pytest.approx(9 * AT, rel=2e-4)

    def test_passes_through_its_points_and_closes(self) -> None:
        angles = np.radians(np.arange(0.0, 720.0, 10.0))
        pressures = 2 * BAR + BAR * np.cos(0.5 * angles)
        trace = PressureTrace(tuple(angles), tuple(pressures))
        np.testing.assert_allclose(
            cylinder_pressure(trace, PARTS["plain"], Cycle.FOUR_STROKE, 72), pressures, rtol=1e-14
        )
        seam = trace.cycle_pressure(PARTS["plain"], Cycle.FOUR_STROKE, 4 * math.pi + np.array([-1e-7, 0.0, 1e-7]), 1.0)
        np.testing.assert_allclose(seam, seam[1], rtol=1e-6)
        fine = trace.cycle_pressure(PARTS["plain"], Cycle.FOUR_STROKE, np.radians(np.arange(0.0, 720.0)), 1.0)
        exact = 2 * BAR + BAR * np.cos(0.5 * np.radians(np.arange(0.0, 720.0)))
        assert np.abs(fine - exact).max() < 5e-3 * BAR

    def test_periodic_from_any_beginning(self) -> None:
        angles = np.radians(np.arange(0.0, 720.0, 5.0))
        pressures = 3 * BAR + BAR * np.cos(angles) + BAR * np.sin(0.5 * angles)
        at = np.linspace(0.0, 4 * math.pi, 333)
        whole = PressureTrace(tuple(angles), tuple(pressures)).cycle_pressure(
            PARTS["plain"], Cycle.FOUR_STROKE, at, 1.0
        )
        turned = PressureTrace((*(angles[72:] - 4 * math.pi), *angles[:72]), (*pressures[72:], *pressures[:72]))
        np.testing.assert_allclose(turned.cycle_pressure(PARTS["plain"], Cycle.FOUR_STROKE, at, 1.0), whole, rtol=1e-12)

    def test_repeated_end_is_merged(self) -> None:
        angles = np.radians(np.arange(-360.0, 361.0, 5.0))
        pressures = 3 * BAR + BAR * np.cos(0.5 * angles)
        at = np.linspace(-7.0, 7.0, 99)
        open_end = PressureTrace(tuple(angles[:-1]), tuple(pressures[:-1]))
        closed = PressureTrace(tuple(angles), tuple(pressures))
        np.testing.assert_allclose(
            closed.cycle_pressure(PARTS["plain"], Cycle.FOUR_STROKE, at, 1.0),
            open_end.cycle_pressure(PARTS["plain"], Cycle.FOUR_STROKE, at, 1.0),
            rtol=1e-12,
        )
        apart = PressureTrace(tuple(angles), (*pressures[:-1], pressures[-1] + BAR))
        seam = apart.cycle_pressure(PARTS["plain"], Cycle.FOUR_STROKE, angles[:1], 1.0)
        assert seam[0] == pytest.approx(pressures[0] + 0.5 * BAR)

    def test_a_jump_does_not_ring(self) -> None:
        angles = np.radians(np.arange(0.0, 360.0, 2.0))
        pressures = np.where(angles < 1.0, 60 * BAR, BAR)
        result = cylinder_pressure(
            PressureTrace(tuple(angles), tuple(pressures)), PARTS["plain"], Cycle.TWO_STROKE, 5000
        )
        # rounding of a mixture of two equal numbers
        assert result.min() > BAR * (1 - 1e-12)
        assert result.max() < 60 * BAR * (1 + 1e-12)

    @given(seed=st.integers(0, 10_000), points=st.integers(16, 90))
    def test_stays_within_its_neighbours(self, seed: int, points: int) -> None:
        random = np.random.default_rng(seed)
        gaps = random.uniform(1.0, 1.3, points)
        angles = np.cumsum(gaps) * math.tau / gaps.sum() - 2.0
        pressures = random.uniform(1.0, 100.0, points) * BAR
        at = np.linspace(-3.0, 6.0, 801)
        result = PressureTrace(tuple(angles), tuple(pressures)).cycle_pressure(
            PARTS["plain"], Cycle.TWO_STROKE, at, 1.0
        )
        left = np.searchsorted(angles, angles[0] + np.mod(at - angles[0], math.tau), side="right") - 1
        ends = np.stack([pressures[left], pressures[(left + 1) % points]])
        assert (result >= ends.min(axis=0) * (1 - 1e-9)).all()
        assert (result <= ends.max(axis=0) * (1 + 1e-9)).all()


def _one_line(error: pytest.ExceptionInfo[ModelError], *words: str) -> None:
    text = str(error.value)
    assert "\n" not in text
    assert len(text) < 260
    rule, _, remedy = text.partition("; ")
    assert rule
    assert remedy
    for word in words:
        assert word in text


DEGREES = np.arange(0.0, 720.0, 5.0)


class TestRefusals:
    @pytest.mark.parametrize(
        ("model", "changes", "words"),
        [
            (DIESEL, {"peak_pressure": -1.0}, ["peak_pressure", "-1e-05 bar", "positive"]),
            (DIESEL, {"peak_pressure": math.inf}, ["peak_pressure", "inf"]),
            (DIESEL, {"intake_pressure": 0.0}, ["intake_pressure", "0 bar"]),
            (DIESEL, {"exhaust_pressure": math.nan}, ["exhaust_pressure", "nan"]),
            (DIESEL, {"crankcase_pressure": -1e5}, ["crankcase_pressure", "-1 bar", "absolute"]),
            (DIESEL, {"imep": math.nan}, ["imep nan", "finite"]),
            (DIESEL, {"compression_ratio": 1.0}, ["compression_ratio 1 ", "over 1"]),
            (DIESEL, {"compression_ratio": math.inf}, ["compression_ratio inf", "1000"]),
            (DIESEL, {"compression_exponent": 0.0}, ["compression_exponent 0", "over 0"]),
            (DIESEL, {"expansion_exponent": 13.0}, ["expansion_exponent 13", "at most 5"]),
            (BURN, {"imep": math.inf}, ["imep inf"]),
            (BURN, {"compression_ratio": 0.5}, ["compression_ratio 0.5"]),
            (BURN, {"intake_pressure": -1e5}, ["intake_pressure", "-1 bar"]),
            (BURN, {"start": math.nan}, ["start nan"]),
            (BURN, {"duration": 0.0}, ["duration 0 deg", "positive"]),
            (BURN, {"duration": math.inf}, ["inf deg"]),
            (BURN, {"start": -4.0}, ["-229.183", "-180"]),
            (BURN, {"duration": 4.0}, ["219.183", "shorten"]),
            (BURN, {"shape": -0.1}, ["shape -0.1", "0 and 20"]),
            (BURN, {"completeness": 1.0}, ["completeness 1 ", "between 0 and 1"]),
            (BURN, {"completeness": 0.0}, ["completeness 0 "]),
            (BURN, {"heat_ratio": 1.0}, ["heat_ratio 1 ", "over 1"]),
            (BURN, {"heat_ratio": 2.0}, ["heat_ratio 2 ", "1.7"]),
        ],
    )
    def test_values(self, model: Seiliger | Wiebe, changes: dict[str, float], words: list[str]) -> None:
        with pytest.raises(ModelError) as error:
            replace(model, **changes)
        _one_line(error, *words)

    @pytest.mark.parametrize(
        ("angles", "pressures", "words"),
        [
            ([0.0, 1.0, 2.0], [1e5] * 2, ["3 angles", "2 pressures"]),
            ([0.0, 1.0, 2.0], [1e5] * 3, ["3 angles"]),
            ([0.0, 1.0, 1.0, 2.0], [1e5] * 4, ["rise", "sort"]),
            ([0.0, 2.0, 1.0, 3.0], [1e5] * 4, ["rise"]),
            ([0.0, math.nan, 1.0, 3.0], [1e5] * 4, ["finite"]),
            ([0.0, 1.0, 2.0, 3.0], [1e5, 1e5, -2e5, 1e5], ["positive", "absolute"]),
            ([0.0, 1.0, 2.0, 3.0], [1e5, math.inf, 1e5, 1e5], ["finite"]),
        ],
    )
    def test_points(self, angles: list[float], pressures: list[float], words: list[str]) -> None:
        with pytest.raises(ModelError) as error:
            PressureTrace(tuple(angles), tuple(pressures))
        _one_line(error, *words)

    @pytest.mark.parametrize(
        ("degrees", "cycle", "words"),
        [
            (DEGREES[:72], Cycle.FOUR_STROKE, ["0 to 355 deg", "365 of the 720 deg", "four-stroke", "missing"]),
            (DEGREES, Cycle.TWO_STROKE, ["0 to 715 deg", "more than the 360 deg", "two-stroke"]),
            (DEGREES[:-3], Cycle.FOUR_STROKE, ["20 of the 720 deg", "missing"]),
            (np.delete(DEGREES, np.s_[20:28]), Cycle.FOUR_STROKE, ["between 95 and 140 deg", "30 deg"]),
            (np.arange(0.0, 720.0, 90.0), Cycle.FOUR_STROKE, ["90", "deg"]),
        ],
        ids=["half", "twice", "end missing", "hole", "coarse"],
    )
    def test_cover(self, degrees: NDArray[np.float64], cycle: Cycle, words: list[str]) -> None:
        trace = PressureTrace(tuple(np.radians(degrees)), (BAR,) * len(degrees))
        with pytest.raises(ModelError) as error:
            cylinder_pressure(trace, PARTS["plain"], cycle, 90)
        _one_line(error, *words)

    @pytest.mark.parametrize(
        ("gas", "words"),
        [
            (
                Seiliger(80 * BAR, 90 * BAR),
                ["imep 90 bar", "peak_pressure 80 bar", "between", "raise peak_pressure"],
            ),
            (Seiliger(80 * BAR, 2 * BAR), ["imep 2 bar", "lower intake_pressure", "peak_pressure together"]),
            (Seiliger(40 * BAR, 5 * BAR), ["peak_pressure 40 bar", "46.4326 bar", "raise peak_pressure"]),
            (replace(BURN, imep=-BAR), ["imep -1 bar", "0 bar", "raise imep"]),
            (replace(BURN, imep=40 * BAR), ["imep 40 bar", "intake_pressure 1.01325 bar", "raise intake_pressure"]),
        ],
    )
    def test_out_of_reach(self, gas: Seiliger | Wiebe, words: list[str]) -> None:
        with pytest.raises(ModelError) as error:
            cylinder_pressure(gas, PARTS["plain"], Cycle.FOUR_STROKE, 90)
        _one_line(error, *words)

    def test_the_stated_range_of_imep_can_be_reached(self) -> None:
        """Check that a mean pressure just inside the stated range is accepted, and just outside refused."""
        minimum, maximum = (seiliger_imep(DIESEL, Cycle.FOUR_STROKE, ratio) for ratio in (1.0, 17.0))
        for inside in (minimum + 1.0, maximum - 1.0):
            seiliger_cut_off(replace(DIESEL, imep=inside), Cycle.FOUR_STROKE)
        for outside in (minimum - 1.0, maximum + 1.0):
            with pytest.raises(ModelError, match=f"{minimum * 1e-5:.6g} bar and {maximum * 1e-5:.6g} bar"):
                seiliger_cut_off(replace(DIESEL, imep=outside), Cycle.FOUR_STROKE)

    def test_rounding_of_a_range_is_not_refused(self) -> None:
        minimum, maximum = (seiliger_imep(DIESEL, Cycle.FOUR_STROKE, ratio) for ratio in (1.0, 17.0))
        below, above = minimum * (1 - 1e-14), maximum * (1 + 1e-14)
        assert seiliger_cut_off(replace(DIESEL, imep=below), Cycle.FOUR_STROKE) == 1.0
        assert seiliger_cut_off(replace(DIESEL, imep=above), Cycle.FOUR_STROKE) == 17.0
        end = compression_end_pressure(DIESEL)
        gas = replace(DIESEL, peak_pressure=end * (1 - 1e-15))
        assert seiliger_cut_off(gas, Cycle.FOUR_STROKE) > 1.0
        exchange = replace(BURN, imep=-1e-10)
        assert wiebe_heat(exchange, PARTS["plain"], Cycle.FOUR_STROKE) == 0.0

    @pytest.mark.parametrize("completeness", [0.999, 0.4])
    def test_most_heat_is_what_is_burnt(self, completeness: float) -> None:
        """Check that the largest heat of a charge is the heat released, 50 p V."""
        gas = replace(BURN, completeness=completeness)
        part, cycle = PARTS["plain"], Cycle.TWO_STROKE
        unit = wiebe_heat(gas, part, cycle) / gas.imep
        maximum = 50 * gas.intake_pressure * 17 / 16 / completeness / unit
        wiebe_heat(replace(gas, imep=maximum * (1 - 1e-12)), part, cycle)
        with pytest.raises(ModelError, match="that fuel and air can hold"):
            wiebe_heat(replace(gas, imep=maximum * (1 + 1e-12)), part, cycle)

    def test_burn_past_a_dead_centre_that_the_offset_moved(self) -> None:
        gas = replace(BURN, start=math.radians(-170), duration=math.radians(30), imep=0.0)
        wiebe_heat(gas, _part(offset=0.0), Cycle.TWO_STROKE)
        with pytest.raises(ModelError) as error:
            wiebe_heat(gas, _part(offset=0.05), Cycle.TWO_STROKE)
        _one_line(error, "from -170 to -140 deg", "dead centres")
        late = replace(gas, start=math.radians(140))
        wiebe_heat(late, _part(offset=0.0), Cycle.TWO_STROKE)
        with pytest.raises(ModelError) as error:
            wiebe_heat(late, _part(offset=-0.05), Cycle.TWO_STROKE)
        _one_line(error, "from 140 to 170 deg", "shorten")

    @pytest.mark.parametrize("gas", [DIESEL, BURN])
    def test_shaft_of_another_speed(self, gas: Seiliger | Wiebe) -> None:
        with pytest.raises(ModelError) as error:
            cylinder_pressure(gas, _part(ratio=2.0), Cycle.FOUR_STROKE, 90)
        _one_line(error, "cylinder 1", "ratio 2", "trace")


class TestHasselgruber:
    """Fig. 2: D = 100 mm, s = 120 mm, p_max = 80 kp/cm2, p_i = 9 kp/cm2, b = 504 mm give a mount force of 300 kp."""

    def force(self, gas: Seiliger) -> float:
        """Return the largest A = T / b in kp (eq. 1)."""
        part, samples = PARTS["plain"], 7200
        angles = 4 * math.pi * np.arange(samples) / samples
        load = cylinder_pressure(gas, part, Cycle.FOUR_STROKE, samples) - gas.crankcase_pressure
        torque = part.piston_area * part.stroke * load * swept_rate(part, angles)
        return float(torque.max() / 0.504 / 9.80665)

    def test_largest_mount_force(self) -> None:
        """Compression ratio, exponents and rod ratio are not printed; those of this package give 263 kp."""
        assert self.force(DIESEL) == pytest.approx(263.3, abs=0.5)
        assert self.force(DIESEL) == pytest.approx(300.0, rel=0.15)

    def test_force_depends_on_the_compression_ratio(self) -> None:
        """Check that a gauge pressure of 80 kp/cm2 changes the force little, and the compression ratio much."""
        assert self.force(replace(DIESEL, peak_pressure=81 * AT)) == pytest.approx(263, abs=1.5)
        assert self.force(replace(DIESEL, compression_ratio=20.5)) == pytest.approx(300, abs=3)


class TestCylindersAlike:
    """The gas of a cylinder is computed once for all that it drives alike."""

    @every_part
    def test_gas_is_independent_of_mass_and_place(self, part: SliderCrank) -> None:
        gas, cycle = replace(DIESEL, imep=8.7 * AT), Cycle.FOUR_STROKE
        heavier = replace(part, reciprocating_mass=2.0, rotating_mass=0.3, x=0.4, throw=1.0, bank=0.5, firing_angle=1.0)
        first = gas_coefficients(gas, part, cycle)
        missed = _one_cylinder.cache_info().misses
        assert gas_coefficients(gas, heavier, cycle) is first
        assert _one_cylinder.cache_info().misses == missed
        _one_cylinder.cache_clear()
        anew = gas_coefficients(gas, heavier, cycle)
        np.testing.assert_array_equal(anew.coefficients, first.coefficients)

    @every_part
    def test_another_bore_rod_or_way_to_turn_is(self, part: SliderCrank) -> None:
        turned = replace(part, shaft=replace(part.shaft, ratio=-part.shaft.ratio))
        first = gas_coefficients(DIESEL, part, Cycle.FOUR_STROKE).coefficients
        # without an offset the same holds for a crank that turns backwards
        for other in (replace(part, bore=0.11), replace(part, crank_radius=0.055), *([turned] if part.offset else [])):
            coefficients = gas_coefficients(DIESEL, other, Cycle.FOUR_STROKE).coefficients
            assert not np.array_equal(coefficients, first)
