"""Fidelities of elastic mounts: estimates are bounds, omitted parts are small, choices agree in their limits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cli import scenes
from laufruhe.errors import InputError, ModelError
from laufruhe.files.reader import load
from laufruhe.machine import Engine
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.mounting import mounting_of
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.physics.steady_state import TimeMounting
from laufruhe.physics.time_model import time_model
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from problem_files import ELASTIC, PROBLEMS, written


def on_given_mounts(path: Path) -> Problem:
    """Return a ready problem on its given mounts, with a load to judge."""
    problem = load(path).balance
    objective = problem.objective or load(PROBLEMS / "tractor-four-elastic.toml").balance.objective
    return replace(problem, limits=(), objective=objective)


@pytest.mark.parametrize("path", ELASTIC, ids=lambda path: path.stem)
def test_modes_without_excitation_have_no_response(path: Path) -> None:
    """Compare motion with the whole matrices in the coordinates of the block."""
    problem = on_given_mounts(path)
    engine, point = problem.engine, problem.points[0]
    assert engine.block is not None
    mounting, wrench = mounting_in(engine), evaluate(problem).loads[0].wrench
    still = [k for k in range(6) if k not in mounting.excited(wrench)]
    moved = wrench.coefficients @ moved_wrench(NUMBERS, engine.block.centre_of_gravity).T
    shapes, mass = mounting.modes.shapes, engine.block.mass_matrix
    damping, loss = mounting.total(mounting.dampers), mounting.total(mounting.losses)
    for order, load_ in zip(wrench.orders[1:60], moved[1:60], strict=False):
        omega = order * point.speed
        motion = np.linalg.solve(mounting.stiffness + 1j * loss + 1j * omega * damping - omega**2 * mass, load_)
        amplitudes = shapes.T @ mass @ motion
        assert np.abs(amplitudes[still]).max(initial=0.0) <= 1e-9 * max(np.abs(amplitudes).max(), 1e-300)


def viscous_forces(mounting: ElasticMounting, wrench: Spectrum, speed: float) -> Spectrum:
    """Return the mount forces of the equations that time integrates, without bump stops (E25, E26)."""
    model = time_model(mounting)
    omega = wrench.orders[:, None, None] * speed
    impedance = model.stiffness + 1j * omega * model.damping - omega**2 * np.eye(model.size)
    y = np.linalg.solve(impedance, (wrench.coefficients @ model.load.T)[..., None])
    forces = (model.forces + 1j * omega * model.damping_forces) @ y
    return Spectrum(wrench.base, forces.reshape(len(omega), -1, 3))


def stiffer(engine: Engine, factor: float) -> Engine:
    stiff = [tuple(factor * k for k in mount.stiffness) for mount in engine.mounts]
    mounts = tuple(replace(m, stiffness=k, loss_factor=0.0) for m, k in zip(engine.mounts, stiff, strict=True))
    return replace(engine, mounts=mounts)


def test_stiff_mounts_are_rigid_ones() -> None:
    problem = replace(on_given_mounts(PROBLEMS / "tractor-four-elastic.toml"), decisions=())
    errors = []
    for factor in (1e5, 1e6):
        stiff = replace(problem, engine=stiffer(problem.engine, factor))
        rigid = replace(stiff, fidelity=Fidelity(samples=360, mounts="rigid", orders=12))
        own = replace(rigid, fidelity=Fidelity(samples=360, orders=12))
        values = [objective_value(p, evaluate(p)) for p in (own, rigid)]
        errors.append(abs(values[0] / values[1] - 1.0))
    # the error is omega squared over that of the modes
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.1)


def test_every_mode_is_all_modes() -> None:
    problem = on_given_mounts(PROBLEMS / "powertrain-least-force.toml")
    values = [
        objective_value(own, evaluate(own))
        for modes in (None, (1, 2, 3, 4, 5, 6))
        for own in [replace(problem, fidelity=Fidelity(samples=96, orders=8, modes=modes))]
    ]
    assert values[0] == values[1]


def test_time_agrees_with_the_frequency_domain_of_the_same_law() -> None:
    problem = on_given_mounts(PROBLEMS / "powertrain-least-force.toml")
    fidelity = Fidelity(samples=180, orders=6)
    point = problem.points[0]
    wrench = evaluate(replace(problem, fidelity=fidelity)).loads[0].wrench
    mounting = mounting_in(problem.engine)
    result = TimeMounting(mounting, 180).forces(wrench, point.speed).sample(180)
    same = viscous_forces(mounting, wrench, point.speed).sample(180)
    assert np.abs(result - same).max() <= 1e-6 * np.abs(same).max()
    # and the law itself matters here, so the test above can tell
    other = mounting.forces(wrench, point.speed).sample(180)
    assert np.abs(result - other).max() > 1e-3 * np.abs(same).max()


def test_without_hysteresis_the_two_laws_are_one() -> None:
    problem = on_given_mounts(PROBLEMS / "powertrain-least-force.toml")
    mounts = tuple(replace(m, loss_factor=0.0, damping=(300.0, 300.0, 300.0)) for m in problem.engine.mounts)
    engine = replace(problem.engine, mounts=mounts)
    wrench = evaluate(replace(problem, engine=engine)).loads[0].wrench
    ours = viscous_forces(mounting_in(engine), wrench, problem.points[0].speed).coefficients
    theirs = mounting_in(engine).forces(wrench, problem.points[0].speed).coefficients
    assert np.abs(ours - theirs).max() <= 1e-10 * np.abs(theirs).max()


def test_travel_by_every_choice() -> None:
    problem = on_given_mounts(PROBLEMS / "powertrain-least-force.toml")
    one = replace(problem, points=problem.points[:1])
    sizes = {}
    for mounts in ("frequency", "rigid", "time"):
        evaluation = (
            evaluate(replace(one, fidelity=Fidelity(samples=96, orders=4, mounts=mounts))).loads[0].mount_travel
        )
        assert evaluation is not None
        sizes[mounts] = np.abs(evaluation.sample(96)).max()
    assert sizes["rigid"] == 0.0
    assert sizes["time"] == pytest.approx(sizes["frequency"], rel=0.1)


def test_time_is_not_solved_for() -> None:
    problem = on_given_mounts(PROBLEMS / "tractor-four-elastic.toml")
    with pytest.raises(ModelError, match=r"leave fidelity\.mounts out"):
        solve(replace(problem, fidelity=Fidelity(samples=48, mounts="time")))


def test_open_mounts_are_no_rigid_ones() -> None:
    problem = load(PROBLEMS / "powertrain-least-force.toml")
    with pytest.raises(ModelError, match="mounts, which are open"):
        solve(replace(problem, fidelity=Fidelity(mounts="rigid")))


def test_rigid_mounts_have_no_choice() -> None:
    engine = load(PROBLEMS / "tractor-three.toml").engine
    for mounts in ("rigid", "time", "frequency"):
        assert type(mounting_of(engine, Fidelity(mounts=mounts))) is type(mounting_of(engine))


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ('mounts = "rigid"', "fidelity.mounts"),
        ("modes = [1, 2]", "fidelity.modes"),
        ('mounts = "time"', "fidelity.mounts"),
    ],
)
def test_choices_of_elastic_mounts_need_them(table: str, key: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=key):
        load(written(tmp_path, scenes.GIVEN + "\n[fidelity]\n" + table))


@pytest.mark.parametrize("modes", ["[0]", "[7]", "[1, 1]"])
def test_modes_are_numbers_of_the_table(modes: str, tmp_path: Path) -> None:
    text = _elastic_text() + f"\n[fidelity]\nmodes = {modes}\n"
    with pytest.raises(InputError, match=r"fidelity\.modes"):
        load(written(tmp_path, text))
    with pytest.raises(ModelError, match="modes"):
        Fidelity(modes=tuple(int(k) for k in modes.strip("[]").split(",")))


def _elastic_text() -> str:
    """Return the text of a ready problem whose mounts are given numbers."""
    import re

    text = (PROBLEMS / "study-soft-mounts.toml").read_text(encoding="utf-8")
    text = re.sub(r"\{ between = [^}]*start = (\"[^\"]*\") \}", r"\1", text)
    return text[: text.index("[objective]")] + '[objective]\nminimise = "mean mount force"\n'


def test_modes_from_a_file(tmp_path: Path) -> None:
    problem = load(written(tmp_path, _elastic_text() + "\n[fidelity]\nmodes = [3, 6]\n"))
    assert problem.fidelity.modes == (3, 6)
    with pytest.raises(InputError, match="leave one of the two out"):
        load(written(tmp_path, _elastic_text() + '\n[fidelity]\nmodes = [3]\nmounts = "rigid"\n'))
