"""Damping that follows stiffness, and joined springs: plain sums, time integration, bounds, refused input."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from laufruhe.errors import InputError
from laufruhe.load_models.mount_symbols import mount_matrices
from laufruhe.machine import Mount
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.rigid_body import turned_axes
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.prove.certificate import Proof
from laufruhe.prove.mounts.subdivision import StiffnessBoxes
from laufruhe.solvers import solve
from mounts.bounds_seen import bounds_over_designs, designs
from mounts.files import BLOCK, ENGINE, MOUNTS, OPEN, changed, problem_of
from mounts.powertrain import BLOCK as POWERTRAIN
from mounts.powertrain import random_mounting, wrench
from prove.test_subdivision import boxes

FOLLOWING = changed(MOUNTS, ("loss_factor = 0.1", 'loss_factor = 0.05\ndamping_per_stiffness = "0.8 ms"'))
RMS = '[objective]\nminimise = "rms mount force"\norders = [2, 4]\n'
TURNED = tuple(map(tuple, turned_axes(NUMBERS, (0.4, -0.3, 0.9)).tolist()))


def test_damping_that_follows_stiffness_is_that_of_dampers_beside_the_springs() -> None:
    plain = random_mounting(3, damping=0.0)
    lagging = [replace(mount, lag=2e-3 * (k + 1)) for k, mount in enumerate(plain.mounts)]
    damped = [
        replace(mount, damping=tuple(2e-3 * (k + 1) * c for c in mount.stiffness))
        for k, mount in enumerate(plain.mounts)
    ]
    ours, theirs = (elastic_mounting(plain.block, mounts).forces(wrench(), 40.0) for mounts in (lagging, damped))
    assert np.allclose(ours.coefficients, theirs.coefficients, rtol=1e-13)
    free = plain.forces(wrench(), 40.0).coefficients
    assert np.abs(ours.coefficients - free).max() > 0.05 * np.abs(free).max()


def test_one_mass_on_a_lagging_spring_moves_as_it_does_in_time() -> None:
    # Kelvin and Voigt: m x'' + k (x + lag x') = F cos W t
    stiffness, lag, force, omega = 4e5, 1.5e-3, 100.0, 30.0
    arms = [(x, y, 0.0) for x in (-0.3, 0.3) for y in (-0.2, 0.2)]
    block = replace(POWERTRAIN, inertia=((4.0, 0.0, 0.0), (0.0, 8.0, 0.0), (0.0, 0.0, 7.0)))
    mounts = [Mount(str(k), arm, (stiffness,) * 3, lag=lag) for k, arm in enumerate(arms)]
    load = wrench(orders=1)
    load = replace(load, coefficients=np.array([np.zeros(6), [0.0, 0.0, force, 0.0, 0.0, 0.0]], dtype=complex))
    travel = elastic_mounting(block, mounts).travel(load, omega).coefficients[1, 0, 2]
    k, c = 4 * stiffness / block.mass, 4 * stiffness * lag / block.mass

    def rates(t, state):
        return [state[1], force / block.mass * np.cos(omega * t) - k * state[0] - c * state[1]]

    times = np.linspace(3.0, 3.0 + 2.0 * np.pi / omega, 50)
    found = solve_ivp(rates, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-14).y[0]
    assert (travel * np.exp(1j * omega * times)).real == pytest.approx(found, abs=1e-6 * np.abs(found).max())


OBJECTIVES = {
    "rms": RMS,
    "mean": '[objective]\nminimise = "mean mount force"\n',
    "travel": '[objective]\nminimise = "maximum mount travel"\n',
}


@pytest.mark.parametrize("name", OBJECTIVES)
def test_bounds_know_damping_that_follows(name: str, tmp_path: Path) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, FOLLOWING, OBJECTIVES[name])
    ratios = bounds_over_designs(problem)
    assert max(ratios) <= 1.0 + 1e-9
    assert max(ratios) > 0.99


def test_the_best_stiffness_with_its_damping_is_that_of_a_grid(tmp_path: Path) -> None:
    rear = f'position  = ["-300 mm", "200 mm", "0 mm"]\nstiffness = ["120 N/mm", "120 N/mm", {OPEN}]'
    tied = changed(FOLLOWING, (rear, 'like = "front left"\nposition  = ["-300 mm", "200 mm", "0 mm"]'))
    problem = problem_of(tmp_path, ENGINE, BLOCK, tied, RMS + "[search]\nstarts = 4\n")
    result = solve(problem)
    grid = np.geomspace(2e4, 4e6, 400)
    initial = evaluate(problem)
    values = [objective_value(problem, with_mounts(initial, problem.design([float(k)]))) for k in grid]
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value <= min(values) * (1.0 + 1e-6)
    assert result.objective.value == pytest.approx(min(values), rel=1e-2)


# springs joined in one place


RUN = """
[[constraints]]
limit = "transmissibility"
max = "9"
[[constraints]]
limit = "run-up travel"
max = "1 m"
[[constraints]]
limit = "run-up force"
max = "1 MN"
[run_up]
up_to = "900 rpm"
time = "1 s"
"""
FIXED = MOUNTS.replace('{ between = ["20 N/mm", "4000 N/mm"], start = "400 N/mm" }', '"400 N/mm"')


@pytest.mark.parametrize("gap", [np.inf, 1e-4])
def test_springs_in_parts_are_the_spring_that_they_make(gap: float, tmp_path: Path) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, FIXED, RMS, RUN)
    first, *rest = problem.engine.mounts
    whole = replace(first, lag=1e-3, stop_gap=gap, stop_stiffness=6e5)
    half = replace(whole, stiffness=tuple(0.5 * k for k in whole.stiffness), stop_stiffness=3e5)
    found = []
    for mount in (whole, replace(half, joined=(replace(half, name="pad"),))):
        engine = replace(problem.engine, mounts=(mount, *rest))
        evaluation = evaluate(problem, engine)
        found.append([objective_value(problem, evaluation), *(evaluation.value(m.measure) for m in problem.limits)])
        assert evaluation.mount_names == ["front left", "front right", "rear left", "rear right"]
    assert found[0] == pytest.approx(found[1], rel=1e-9 if gap == np.inf else 1e-5)
    assert min(found[0]) > 0.0


def test_joined_springs_turned_any_way_add_up(tmp_path: Path) -> None:
    plain = random_mounting(1)
    first, *rest = plain.mounts
    pad = Mount("pad", first.position, (2e5, 1e5, 4e5), TURNED, 0.2, (100.0, 50.0, 20.0), lag=1e-3)
    together = elastic_mounting(plain.block, [replace(first, joined=(pad,)), *rest])
    apart = elastic_mounting(plain.block, [first, *rest, pad])
    for ours, theirs in ((together.stiffness, apart.stiffness), (together.modes.squares, apart.modes.squares)):
        assert np.allclose(ours, theirs, rtol=1e-12)
    forces, separate = (m.forces(wrench(), 60.0).coefficients for m in (together, apart))
    assert forces.shape[1] == 4
    assert np.allclose(forces[:, 0], separate[:, 0] + separate[:, 4], rtol=1e-10, atol=1e-9)
    assert np.allclose(forces[:, 1:], separate[:, 1:4], rtol=1e-10, atol=1e-9)
    assert np.allclose(together.travel(wrench(), 60.0).coefficients, apart.travel(wrench(), 60.0).coefficients[:, :4])


PAD = """[[mounts.places]]
name = "pad"
joined_to = "front left"
turned = [20, 0, 40]
damping_per_stiffness = "1 ms"
stiffness = [{ between = ["20 N/mm", "300 N/mm"] }, "0 N/mm", "80 N/mm"]
"""
REAR = '[[mounts.places]]\nname = "rear left"'
OPEN_PAD = changed(MOUNTS, (REAR, PAD + REAR))


def test_symbols_and_numbers_agree_on_joined_springs(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, OPEN_PAD, RMS)
    assert [decision.name for decision in problem.decisions] == [
        "front left.stiffness.z", "pad.stiffness.x", "rear left.stiffness.z",
    ]  # fmt: skip
    x = [3e5, 9e4, 7e5]
    mounting = mounting_in(problem.design(x))
    root = np.linalg.inv(np.linalg.cholesky(mounting.block.mass_matrix))
    found = [np.array(each) for each in mount_matrices(problem, mounting.block)(x)]
    for ours, theirs in zip(found[:3], (mounting.springs, mounting.losses, mounting.dampers), strict=True):
        assert np.allclose(ours, root @ mounting.total(theirs) @ root.T, rtol=1e-12)
    seen = mounting.motions @ root.T
    for ours, theirs in zip(found[4:7], (mounting.springs, mounting.losses, mounting.dampers), strict=True):
        assert np.allclose(ours, (theirs @ seen).reshape(-1, 6), rtol=1e-12)


def test_bounds_know_joined_springs(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, OPEN_PAD, RMS)
    value = objective_value(problem, evaluate(problem))
    plain = StiffnessBoxes(problem, 1e-4 * value)
    low, high = boxes(problem, 8, 2)
    ratios = []
    for ends in zip(low, high, strict=True):
        minimum = min(designs(problem, *ends, 3))
        ratios.append(float(plain.bounds(ends[0][None], ends[1][None])[0][0]) / minimum)
    assert max(ratios) <= 1.0 + 1e-9
    assert max(ratios) > 0.99


JOINED = '[[mounts.places]]\nname = "pad"\njoined_to = "front left"\nstiffness = ["1 N/mm", "1 N/mm", "1 N/mm"]\n'


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (JOINED.replace('"front left"', '"pad"'), 'joined_to = "pad": is not the name of a mount'),
        (JOINED + 'position = ["0 mm", "0 mm", "0 mm"]', "already follows from mount 'front left'"),
        (
            JOINED + JOINED.replace('"pad"', '"shim"').replace('"front left"', '"pad"'),
            "is itself joined to another mount",
        ),
        (JOINED + 'damping_per_stiffness = "-1 ms"', "damping_per_stiffness"),
        (JOINED + "damping_per_stiffness = 0.001", "has no unit"),
    ],
)
def test_meaningless_input_is_refused_in_a_line(more: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, more, RMS)
    assert message in str(refused.value)
