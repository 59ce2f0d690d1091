"""Noise of a measured cycle: detection, removal, and cycles that stay as they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import lagrange
from scipy.optimize import minimize_scalar

from lanes import first_fast
from laufruhe.extensions.flywheel.torque import torque_parts
from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.machine import Cycle, Engine, OperatingPoint, SliderCrank
from laufruhe.numerics.spectrum import spectrum_with_kinks
from laufruhe.physics.gas_facts import gas_facts
from laufruhe.physics.gas_loads import gas_coefficients
from laufruhe.physics.measured_cycle import _low_pass, _noise, smooth_cycle
from recorded_cycle import AREA, BORE, CRANK, ROD, cycle_pressure, lever, mean_torque

Array = NDArray[np.float64]
BAR = 1e5
PART = SliderCrank("cylinder 1", 0.0, CRANK, ROD, 0.45, bore=BORE)
FOUR = Cycle.FOUR_STROKE
FINE = np.arange(0.0, 720.0, 0.05)
TORQUE = (cycle_pressure(FINE) - 1.0) * BAR * AREA * lever(FINE)


def noisy(step: float, noise: float, seed: int) -> tuple[Array, Array]:
    """Return the angles and pressures of a cycle with normal noise [bar]."""
    degrees = -360.0 + step * np.arange(round(720.0 / step))
    dice = np.random.default_rng(seed)
    return np.radians(degrees), BAR * (cycle_pressure(degrees) + noise * dice.standard_normal(len(degrees)))


COMBINATIONS = [(20 * k + j, 0.5 * k / 9, 0.1 + 0.9 * j / 19) for k in range(10) for j in range(20)]
"""Seeds, noises from none to 0.5 bar, and steps from a tenth of a degree to one degree."""
FIXED = [one for k, one in enumerate(COMBINATIONS) if k % 3 == 0] + [one for k, one in enumerate(COMBINATIONS) if k % 3]


@pytest.mark.parametrize(("seed", "noise", "step"), first_fast(FIXED, 67))
def test_the_torque_behind_the_noise_is_found(seed: int, noise: float, step: float) -> None:
    """Against an integration of the closed form without noise; the raw torque is up to 5 % too high."""
    step = 720.0 / round(720.0 / step)
    angles, pressures = noisy(step, noise, seed)
    smooth = smooth_cycle(angles, pressures, FOUR)
    trace = PressureTrace(tuple(smooth.angles.tolist()), tuple(smooth.pressures.tolist()), BAR)
    torque = gas_coefficients(trace, PART, FOUR).coefficients
    values = np.fft.irfft(
        np.concatenate([torque[:1], 0.5 * torque[1:-1], torque[-1:]]), 2 * (len(torque) - 1), norm="forward"
    )
    assert values.max() == pytest.approx(TORQUE.max(), rel=0.02)
    assert values.min() == pytest.approx(TORQUE.min(), abs=0.02 * TORQUE.max())
    assert torque[0].real == pytest.approx(mean_torque(), abs=0.004 * TORQUE.max())
    assert smooth.noise == pytest.approx(BAR * noise, rel=0.15, abs=1e-3 * BAR)
    assert (smooth.cut_off is None) == (noise == 0.0)


@pytest.mark.parametrize("step", [0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0])
def test_a_smooth_cycle_is_kept_to_the_last_bit(step: float) -> None:
    angles, pressures = noisy(step, 0.0, 0)
    smooth = smooth_cycle(angles, pressures, FOUR)
    assert smooth.cut_off is None
    assert smooth.pressures is pressures
    rounded = np.round(pressures, -3)
    assert smooth_cycle(angles, rounded, FOUR).pressures is rounded


def test_a_jump_is_kept() -> None:
    """A low-pass would round its corners by more than the noise."""
    degrees = np.arange(0.0, 360.0)
    pressures = BAR * (np.where(degrees < 90.0, 60.0, 1.0) + 0.02 * np.random.default_rng(3).standard_normal(360))
    smooth = smooth_cycle(np.radians(degrees), pressures, Cycle.TWO_STROKE)
    assert smooth.noise == pytest.approx(0.02 * BAR, rel=0.2)
    assert smooth.pressures is pressures


@given(
    seed=st.integers(0, 10_000), noise=st.floats(0.01, 1.0), scale=st.floats(0.1, 10.0), shift=st.floats(-3.0, 3.0),
    turned=st.integers(0, 719),
)  # fmt: skip
def test_smoothing_follows_scale_zero_and_beginning(
    seed: int, noise: float, scale: float, shift: float, turned: int
) -> None:
    angles, pressures = noisy(1.0, noise, seed)
    plain = smooth_cycle(angles, pressures, FOUR)
    other = smooth_cycle(angles, np.roll(scale * pressures, turned) + shift * BAR, FOUR)
    assert other.noise == pytest.approx(scale * plain.noise, rel=1e-9)
    np.testing.assert_allclose(
        other.pressures, np.roll(scale * plain.pressures, turned) + shift * BAR, rtol=0, atol=1e-3
    )
    assert np.mean(plain.pressures) == pytest.approx(np.mean(pressures), rel=1e-12)


def test_the_low_pass_is_the_smoothing_spline_of_least_cross_validation() -> None:
    """Against the definition (Craven and Wahba 1979): dense matrices, the penalty from third derivatives of sines."""
    count = 60
    places = math.tau * np.arange(count) / count
    data = np.sin(places) + 0.5 * np.cos(3 * places) + 0.1 * np.random.default_rng(5).standard_normal(count)
    orders = np.fft.rfftfreq(count, 1 / count)
    third = np.fft.irfft((1j * orders[:, None]) ** 3 * np.fft.rfft(np.eye(count), axis=0), count, axis=0)
    # the sine of the highest order has no derivative on the grid: its penalty is that of its cosine
    penalty = (
        third.T @ third + np.outer(np.cos(count // 2 * places), np.cos(count // 2 * places)) * orders[-1] ** 6 / count
    )
    scores = []
    for cut_off in np.geomspace(2.0, 2.0 * count, 400):
        influence = np.linalg.inv(np.eye(count) + penalty / cut_off**6)
        residual = data - influence @ data
        scores.append((residual @ residual / (1.0 - np.trace(influence) / count) ** 2, cut_off, influence @ data))
    _, cut_off, smooth = min(scores, key=lambda score: score[0])
    found, harmonic = _low_pass(data)
    assert harmonic == pytest.approx(cut_off)
    np.testing.assert_allclose(found, smooth, atol=1e-9)


@pytest.mark.parametrize("noise", [1e-3, 0.1, 10.0])
def test_noise_is_measured(noise: float) -> None:
    data = 5.0 * np.sin(np.linspace(0.0, math.tau, 7200, endpoint=False))
    data[100] += 50.0
    result = _noise(data + noise * np.random.default_rng(7).standard_normal(7200))
    assert result == pytest.approx(noise, rel=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_points_closer_than_samples_keep_mean_and_orders(noise: float) -> None:
    """Kinks from differences of noise over a tenth of a degree made torques of 1e8 N m between the samples."""
    angles, pressures = noisy(0.1, noise, 1)
    trace = PressureTrace(tuple(angles.tolist()), tuple(np.maximum(pressures, 1e3).tolist()), BAR)
    torque = gas_coefficients(trace, PART, FOUR)
    raw = (np.maximum(pressures, 1e3) - BAR) * AREA * lever(np.degrees(angles))
    assert torque.coefficients[0].real == pytest.approx(raw.mean(), rel=1e-9)
    exact = np.fft.rfft(np.roll(raw, -3600)) * 2.0 / len(raw)
    np.testing.assert_allclose(torque.coefficients[1:700], exact[1:700], rtol=0, atol=1e-6 * abs(exact).max())
    assert torque.sample(11520).max() <= raw.max() * 1.001


def test_a_signal_of_many_breaks_has_the_orders_of_finer_samples() -> None:
    steps = np.arange(400)
    breaks, heights = math.tau * steps / 400, np.random.default_rng(2).standard_normal(400)

    def signal(angles: Array) -> Array:
        return np.interp(np.mod(angles, math.tau), np.append(breaks, math.tau), np.append(heights, heights[0]))

    spectrum = spectrum_with_kinks(signal, 100, FOUR.base_order * 2, breaks)
    exact = np.fft.rfft(heights) / 200
    assert spectrum.kinks is None
    assert len(spectrum.coefficients) == 51
    np.testing.assert_allclose(spectrum.coefficients[1:], exact[1:51], atol=1e-12)


def test_key_figures_are_those_of_an_integration() -> None:
    angles, pressures = noisy(0.5, 0.0, 0)
    trace = PressureTrace(tuple(angles.tolist()), tuple(pressures.tolist()), BAR)
    engine = Engine("one", FOUR, (PART,))
    facts = gas_facts(engine, OperatingPoint("1000 rpm", 100.0, trace))
    assert facts is not None
    assert facts.torque == pytest.approx(mean_torque(), rel=1e-5)
    assert facts.power == pytest.approx(100.0 * mean_torque(), rel=1e-5)
    assert facts.displacement == pytest.approx(AREA * 2.0 * CRANK)
    assert facts.imep == pytest.approx(4.0 * math.pi * mean_torque() / (AREA * 2.0 * CRANK), rel=1e-5)
    assert facts.peak_pressure == pressures.max()
    top = int(pressures.argmax())
    near = slice(top - 1, top + 2)
    parabola = lagrange(angles[near], pressures[near])
    least = minimize_scalar(lambda angle: -parabola(angle), bounds=angles[[top - 1, top + 1]], options={"xatol": 1e-12})
    assert facts.peak_angle == pytest.approx(least.x, abs=1e-6)
    assert torque_parts(engine, OperatingPoint("1000 rpm", 100.0, trace))["gas"].coefficients[0].real == pytest.approx(
        facts.torque
    )
    assert gas_facts(engine, OperatingPoint("idle", 100.0)) is None
