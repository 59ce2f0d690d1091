"""Steps of a run-up, compared with integrals, steady states and the periods that they resolve."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from laufruhe.errors import ModelError
from laufruhe.extensions.run_ups.linear_run import NODES, LinearRun, Sweep
from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.runs import missed_share, run_through, sweep_of
from laufruhe.extensions.run_ups.stopped_run import _batch_of
from laufruhe.machine import Mount
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.time_model import time_model
from mounts.powertrain import random_mounting, wrench
from mounts.test_hydraulic_mounts import hydraulic


def test_wrenches_of_steps_have_the_integral_of_the_load() -> None:
    """Compare each step with the integral of an inertia order that grows with the square of speed."""
    sweep = Sweep(20.0, 15.0, 0.01, 12)
    load = np.array([[1.0 + 2.0j, 0.0, -0.5j, 0.0, 0.0, 0.3]])
    result = sweep.wrenches([(np.array([2.0]), load)]).reshape(NODES, 6, -1)
    _, weights = np.polynomial.legendre.leggauss(NODES)
    by_steps = 0.5 * sweep.step * np.einsum("a,ait->it", weights, result)

    def exact(t: float, component: int) -> float:
        angle = 20.0 * t + 7.5 * t * t
        return float((20.0 + 15.0 * t) ** 2 * (load[0, component] * np.exp(2j * angle)).real)

    for component in (0, 2, 5):
        for step in (0, 5, 11):
            whole = quad(exact, step * sweep.step, (step + 1) * sweep.step, args=(component,))[0]
            assert by_steps[component, step] == pytest.approx(whole, rel=1e-9)


def test_steps_are_a_24th_of_the_shortest_period() -> None:
    """Check 24 steps per period of order 12 at the highest speed, and fewer above 4000 steps per stretch."""
    for first, last in ((0.0, 100.0), (100.0, 0.0), (30.0, 60.0)):
        sweep = sweep_of(first, last, 6.0)
        assert sweep is not None
        period = math.tau / (12.0 * max(first, last))
        assert 24.0 <= period / sweep.step <= 24.3
        assert sweep.count * sweep.step == pytest.approx(6.0)
        assert sweep.first + sweep.gain * 6.0 == pytest.approx(last)
    assert sweep_of(0.0, 100.0, 3000.0) is None
    few = 1.0 / math.cos(math.pi / 24.0) - 1.0
    assert missed_share(Run(100.0, 6.0, 6.0)) == pytest.approx(few)
    # 4000 steps in a sixtieth of 100 s: as many to a period of order 12
    longer = Run(100.0, 6.0, 100.0)
    steps = 4000.0 * math.tau / (12.0 * 100.0) / (100.0 / 60.0)
    assert missed_share(longer) == pytest.approx(1.0 / math.cos(math.pi / steps) - 1.0)


@pytest.mark.slow
def test_a_run_at_one_speed_ends_in_its_steady_state() -> None:
    mounting, load, speed = random_mounting(2, loss=0.0, damping=4000.0), wrench(2, orders=2), 60.0
    run = run_through(mounting, load, None, speed, speed * (1.0 + 1e-9), 3.0, stretches=6)
    steady = mounting.forces(load, speed).coefficients * speed**2
    turns = np.exp(1j * np.outer(np.linspace(0.0, math.tau, 721), load.orders))
    forces = np.einsum("th,hmi->tmi", turns, steady).real
    assert run.force[-1] == pytest.approx(np.linalg.norm(forces, axis=2).max(), rel=1e-3)
    travels = np.einsum("th,hmi->tmi", turns, mounting.travel(load, speed).coefficients * speed**2).real
    assert run.travel[-1] == pytest.approx(np.linalg.norm(travels, axis=2).max(), rel=1e-3)
    with pytest.raises(ModelError, match="not negative"):
        run_through(mounting, load, None, -1.0, 10.0, 3.0)


def test_forces_of_stops_that_grow_within_a_step_are_integrated_exactly() -> None:
    """Check z' = rate z + f0 + (f1 - f0) t / h over a step for any rates."""
    mounting = random_mounting(7, loss=0.0, damping=500.0)
    first, *rest = mounting.mounts
    stopped = Mount("stopped", first.position, first.stiffness, first.orientation, damping=first.damping,
                    stop_gap=1e-3, stop_stiffness=2e6)  # fmt: skip
    model, step = time_model(elastic_mounting(mounting.block, [stopped, *rest])), 0.004
    run = LinearRun(model, Sweep(0.0, 1.0, step, 4))
    side = _batch_of([run], step)
    rates, _, inverse = run.modes
    met = np.flatnonzero(model.stops.stiffness)
    into = inverse @ model.stops.rows[met].T
    for k, rate in enumerate(rates):
        integrals = [side.first[0][2 * k : 2 * k + 2], side.second[0][2 * k : 2 * k + 2]]
        for found, weight in zip(integrals, (lambda _: 1.0, lambda t: t / step), strict=True):
            real, imaginary = (
                quad(
                    lambda t, part=part, rate=rate, weight=weight: part(np.exp(rate * (step - t))) * weight(t), 0, step
                )[0]
                for part in (np.real, np.imag)
            )
            own = into[k] * complex(real, imaginary)
            assert found[0] + 1j * found[1] == pytest.approx(own, rel=1e-9)


def test_a_run_up_in_equal_steps_is_that_of_scipy() -> None:
    mounting, load = hydraulic(0, damping=200.0), wrench(0, orders=2)
    sized = load.mapped(lambda values: values / 60.0**2)
    steps = LinearRun(time_model(mounting), sweep_of(0.0, 60.0, 1.0))
    assert steps.is_known
    own = steps.response(steps.sweep.wrenches([(sized.orders, sized.coefficients)]))
    theirs = run_through(mounting, sized, None, 0.0, 60.0, 1.0, tolerance=1e-8)
    assert np.linalg.norm(own.force, axis=-1).max() == pytest.approx(theirs.force.max(), rel=5e-3)
