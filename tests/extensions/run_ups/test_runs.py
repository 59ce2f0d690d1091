"""Run-ups of small blocks, compared with steps by hand, closed forms, and integration by SciPy."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from laufruhe.errors import ModelError
from laufruhe.extensions.run_ups.linear_run import NODES, Sweep
from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.runs import (
    HIGHEST,
    MAX_STEPS,
    STEPS_PER_PERIOD,
    STRETCHES,
    missed_share,
    run_through,
    sweep_of,
)
from laufruhe.extensions.run_ups.stopped_run import responses_to
from laufruhe.machine import Block, Mount
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.static_cases import Stops
from laufruhe.physics.time_model import TimeModel
from mounts.powertrain import powertrain, wrench
from physics.test_static_motion import HEAVE, four_mounts


def test_loads_of_a_run_are_taken_at_the_gauss_points() -> None:
    """Check Re c e^{i h angle} of every order, the first load times the square of the speed (E28)."""
    rng = np.random.default_rng(6)
    sweep = Sweep(20.0, 15.0, 0.003, 7)
    loads = [(np.array(orders), rng.normal(size=(2, 6)) + 1j * rng.normal(size=(2, 6))) for orders in ([1, 2], [0, 3])]
    nodes = 0.5 * (np.polynomial.legendre.leggauss(NODES)[0] + 1.0)
    result = sweep.wrenches(loads).reshape(NODES, 6, sweep.count)
    for n, node in enumerate(nodes):
        for k in range(sweep.count):
            t = (k + node) * sweep.step
            speed, angle = 20.0 + 15.0 * t, 20.0 * t + 7.5 * t**2
            first, second = (
                sum((own * np.exp(1j * h * angle)).real for h, own in zip(*load, strict=True)) for load in loads
            )
            assert result[n, :, k] == pytest.approx(speed**2 * first + second, rel=1e-12)


@pytest.mark.parametrize("seconds", [4.0, 90.0])
def test_steps_follow_the_highest_order_and_miss_what_a_wave_leaves(seconds: float) -> None:
    """Check the steps per period, fewer in long runs, and the peak of a cosine between two samples."""
    run = Run(speed=150.0, up=0.5 * seconds, down=seconds)
    sweep = sweep_of(run.speed, 0.0, run.down)
    assert sweep is not None
    assert sweep.step * sweep.count == pytest.approx(seconds)
    turned = HIGHEST * run.speed * sweep.step
    allowed = STRETCHES * MAX_STEPS
    assert turned <= math.tau / STEPS_PER_PERIOD or sweep.count == allowed
    # no more than one step a stretch is spare
    assert sweep.count <= min(allowed, HIGHEST * run.speed * seconds * STEPS_PER_PERIOD / math.tau + STRETCHES)
    assert missed_share(run) == pytest.approx(1.0 / math.cos(0.5 * turned) - 1.0, rel=0.02)


def test_a_constant_load_swings_to_twice_its_rest() -> None:
    """Compare the force from rest without damping with F (1 - cos w t); check that negative speeds are refused."""
    mounting = four_mounts(2e4)
    speed, force = 90.0, 400.0
    load = Spectrum(Fraction(1), np.array([force * HEAVE / speed**2, 0.0 * HEAVE], dtype=complex))
    half = math.pi / math.sqrt(4.0 * 2e4 / 50.0)
    run = run_through(mounting, load, None, speed, speed, 1.5 * half, stretches=3)
    # four mounts carry it, and the swing ends its first stretch half way to rest
    assert run.force == pytest.approx(2.0 * force / 4.0 * np.array([0.5, 1.0, 1.0]), rel=1e-4)
    assert run.travel == pytest.approx(run.force / 2e4, rel=1e-6)
    assert run.speeds == pytest.approx([speed] * 3)
    for first, last, seconds in ((-1.0, 50.0, 1.0), (50.0, -1.0, 1.0), (50.0, 0.0, 0.0)):
        with pytest.raises(ModelError, match="speeds that are not negative"):
            run_through(mounting, load, None, first, last, seconds)


def stopped(travels: Array, gaps: Array, stops: Array, stiffness: Array) -> TimeModel:
    """Return a model of two coordinates with stops and no block."""
    none = np.zeros((3, 2))
    return TimeModel(
        stiffness, np.diag([4.0, 6.0]), np.eye(2, 6), none, none, Stops(travels, gaps, stops, np.eye(3)[None]),
        np.zeros(1, dtype=np.intp), np.zeros(2),
    )  # fmt: skip


def test_stops_push_back_as_scipy_says() -> None:
    """Compare two coordinates with a shared stop with SciPy; stiff stops and a missing design give none."""
    travels = np.array([[1.0, 0.5], [0.0, 1.0], [1.0, 0.0]])
    gaps, stops = np.array([0.01, np.inf, 0.004]), np.array([3000.0, 0.0, 0.0])
    model = stopped(travels, gaps, stops, np.array([[900.0, 100.0], [100.0, 1600.0]]))
    sweep = Sweep(25.0, 10.0, 5e-4, 1000)
    wrench = np.array([0.02, 0.01, 0.0, 0.0, 0.0, 0.0])
    (found,) = responses_to([model], sweep, [sweep.wrenches([(np.array([1.0]), wrench[None] + 0j)])])
    assert found is not None

    def rates(t: float, z: Array) -> Array:
        push = (25.0 + 10.0 * t) ** 2 * wrench[:2] * math.cos(25.0 * t + 5.0 * t**2)
        travel = travels @ z[:2]
        back = travels.T @ (stops * np.sign(travel) * np.maximum(np.abs(travel) - gaps, 0.0))
        return np.concatenate([z[2:], push - model.stiffness @ z[:2] - model.damping @ z[2:] - back])

    times = sweep.step * np.arange(0, sweep.count + 1, 20)
    exact = solve_ivp(rates, (0.0, times[-1]), np.zeros(4), "DOP853", times, rtol=1e-7, atol=1e-10, max_step=0.01).y
    # the stop is met on both sides, by far
    reach = (travels @ found.y)[0]
    assert reach.max() > 1.5 * gaps[0]
    assert reach.min() < -1.5 * gaps[0]
    assert np.abs(found.y[:, ::20] - exact[:2]).max() < 2e-4 * np.abs(exact[:2]).max()
    wrenches = sweep.wrenches([(np.array([1.0]), wrench[None] + 0j)])
    stiff = replace(model, stops=replace(model.stops, stiffness=np.array([3e6, 0.0, 0.0])))
    assert responses_to([stiff], sweep, [wrenches]) == [None]
    assert responses_to([model, stiff], sweep, [wrenches] * 2) == [None, None]
    assert responses_to([model, None], sweep, [wrenches] * 2) == [None, None]


def test_a_mode_next_to_rest_is_pushed_by_stops_as_by_integration() -> None:
    """Compare the motion of a nearly free mode with a stop with that of SciPy."""
    travels = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    gaps, stops = np.array([0.002, np.inf, np.inf]), np.array([2000.0, 0.0, 0.0])
    model = stopped(travels, gaps, stops, np.diag([1e-4, 900.0]))
    sweep = Sweep(10.0, 0.0, 1e-3, 300)
    wrench = np.array([1e-3, 0.0, 0.0, 0.0, 0.0, 0.0])
    (found,) = responses_to([model], sweep, [sweep.wrenches([(np.array([0.0]), wrench[None] + 0j)])])
    assert found is not None

    def rates(_: float, z: Array) -> list[float]:
        return [z[1], 0.1 - 1e-4 * z[0] - 4.0 * z[1] - 2000.0 * max(z[0] - 0.002, 0.0)]

    times = sweep.step * np.arange(sweep.count + 1)
    exact = solve_ivp(rates, (0.0, 0.3), [0.0, 0.0], "DOP853", times, rtol=1e-8, atol=1e-12, max_step=5e-3).y[0]
    assert exact.max() > 0.002
    assert np.abs(found.y[0] - exact).max() < 1e-4 * exact.max()


def test_run_up_passes_resonance_with_less_than_the_steady_peak_and_slow_ones_reach_it():
    mounting = powertrain(loss=0.15)
    unit = Spectrum(wrench().base, np.array([np.zeros(6), [0, 0, 0.02, 0, 0, 0]], dtype=complex))
    top = 2 * np.pi * 20.0
    speeds = np.linspace(1.0, top, 600)
    peaks = []
    for speed in speeds:
        load = Spectrum(unit.base, unit.coefficients * speed**2)
        peaks.append(np.linalg.norm(mounting.forces(load, speed).sample(64), axis=-1).max())
    quick = run_through(mounting, unit, None, 0.0, top, 0.6, stretches=60)
    slow = run_through(mounting, unit, None, 0.0, top, 12.0, stretches=120)
    below = speeds < 2 * np.pi * 14.0
    steady = np.max(np.array(peaks)[below])

    def resonance(run):
        return run.force[run.speeds < 2 * np.pi * 14.0].max()

    assert resonance(quick) < 0.97 * steady
    assert resonance(slow) == pytest.approx(steady, rel=0.05)


def test_shut_down_meets_the_same_resonance():
    mounting = powertrain(loss=0.15)
    unit = Spectrum(wrench().base, np.array([np.zeros(6), [0, 0, 0.02, 0, 0, 0]], dtype=complex))
    up = run_through(mounting, unit, None, 0.0, 2 * np.pi * 15.0, 6.0, stretches=60)
    down = run_through(mounting, unit, None, 2 * np.pi * 15.0, 0.0, 6.0, stretches=60)
    assert down.speeds[-1] == pytest.approx(0.0, abs=1e-9)
    assert down.travel.max() == pytest.approx(up.travel.max(), rel=0.15)


def test_a_mode_far_too_fast_to_resolve_is_followed_in_a_run_up():
    """Check that a block with little inertia in roll runs up like any other if no load rolls it."""
    corners = [(x, y, 0.0) for x in (0.3, -0.3) for y in (0.2, -0.2)]
    mounts = [Mount(f"m{k}", place, (1.2e5, 1.2e5, 4e5), loss_factor=0.1) for k, place in enumerate(corners)]
    lift = np.zeros((3, 6), dtype=complex)
    lift[2, 2] = 0.05
    runs = []
    for roll, method in ((20.0, "RK45"), (1e-9, "Radau")):
        block = Block(420.0, ((roll, 0.0, 0.0), (0.0, 50.0, 0.0), (0.0, 0.0, 50.0)))
        mounting = elastic_mounting(block, mounts)
        assert (mounting.modes.frequencies[-1] > 1e5) == (method == "Radau")
        runs.append(run_through(mounting, Spectrum(Fraction(1), lift), None, 0.0, 60.0, 0.6, 12, method, 1e-5))
    assert runs[1].force == pytest.approx(runs[0].force, rel=1e-2, abs=1e-2 * runs[0].force.max())
