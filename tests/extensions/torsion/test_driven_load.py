"""Torque of the driven machine as excitation of the crankshaft: closed form, branches, states and firing orders."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from laufruhe.extensions.torsion.physics import chain_of, inertias, shaft_torque, throw_torques, twist
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.load_models.star_model import FiringModel
from laufruhe.machine import LoadTorque
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.solvers.stars.families import families_of
from problem_files import PROBLEMS

LOAD = {"file": str(PROBLEMS / "compressor-torque.csv"), "angle_zero": "70 deg"}


def problem_of(name: str, **changes: Any) -> Problem:
    tables = {**tables_of(PROBLEMS / f"{name}.toml"), "load_torque": LOAD, "constraints": [], **changes}
    return load_tables({key: value for key, value in tables.items() if value is not None}, Path("driven.toml"))


def without_load(problem: Problem) -> Problem:
    return replace(problem, engine=replace(problem.engine, load_torque=None))


def test_two_discs_twist_as_the_closed_form_says() -> None:
    """Compare the twist of two free discs, the rear one loaded, with (T/J)/(w_n^2 - W^2)."""
    single = tables_of(PROBLEMS / "tractor-single.toml")
    torsion = {
        "throw_inertia": "0.05 kg m^2",
        "discs": [{"name": "machine", "end": "rear", "inertia": "0.8 kg m^2", "shaft": {"stiffness": "3e4 N m/rad"}}],
    }
    keys = {key: single[key] for key in ("title", "engine")}
    problem = load_tables(
        {**keys, "torsion": torsion, "load_torque": LOAD, "operating_points": [{"speed": "700 rpm"}]}, Path("two.toml")
    )
    (point,), chain = problem.points, chain_of(problem.engine)
    front, rear = inertias(chain)
    moved = twist(problem.engine, point)
    plain = twist(replace(problem.engine, load_torque=None), point)
    torques = throw_torques(problem.engine, point)
    for order in (2.0, 4.0, 6.0):
        force = torques.at(order)[1]
        response = 3e4 * (1.0 / front + 1.0 / rear) - (order * point.speed) ** 2
        found = (moved.at(order) - plain.at(order))[0]
        assert abs(force) > 1.0
        assert found == pytest.approx(-force / rear / response, rel=1e-9)


@pytest.mark.parametrize("output", [None, "generator"])
@pytest.mark.parametrize("states", [{}, {"misfire": [2]}])
def test_a_load_on_a_branch_meets_the_dense_equations(output: str | None, states: dict[str, Any]) -> None:
    """Compare the twist with (K + i H - W^2 J + i W C) q = T, written out from the file (V5, V16)."""
    torsion = {**tables_of(PROBLEMS / "inline-five-generator.toml")["torsion"]}
    torsion |= {"output": output} if output else {}
    point = {"name": "p", "speed": "1500 rpm", **states}
    problem = problem_of("inline-five-generator", torsion=torsion, operating_points=[point])
    (at,), chain = problem.points, chain_of(problem.engine)
    order = 2.0
    names = [disc.name for disc in chain.discs]
    sizes = [*names, *(absorber.name for absorber in chain.absorbers)]
    ratios = {disc.name: disc.ratio for disc in chain.discs} | {"damper": 1.0}
    matrix = np.zeros((len(sizes), len(sizes)), dtype=complex)
    rate = order * at.speed

    def add(a: str, b: str | None, value: complex) -> None:
        row = np.zeros(len(sizes))
        row[sizes.index(a)] = 1.0
        if b is not None:
            row[sizes.index(b)] = -1.0
        matrix.__iadd__(value * ratios[a] ** 2 * np.outer(row, row))

    for disc in chain.discs:
        add(disc.name, None, 1j * rate * disc.damping - rate**2 * disc.inertia)
    for section, (front, rear, _) in zip(chain.sections, chain.links, strict=False):
        add(names[rear], names[front], section.stiffness * (1 + 1j * section.loss_factor) + 1j * rate * section.damping)
    for absorber in chain.absorbers:
        add(absorber.name, None, -(rate**2) * absorber.inertia)
        add(absorber.on, absorber.name, 1j * rate * absorber.damping + absorber.stiffness)
    drive = np.zeros(len(sizes), dtype=complex)
    plain = without_load(problem).engine
    drive[: len(names)] = throw_torques(plain, at).at(order)
    degrees, torques = np.loadtxt(LOAD["file"], delimiter=",", skiprows=1).T
    wave = np.exp(-1j * order * np.radians(degrees + 70.0))
    load = 2.0 * np.mean(torques * wave)
    drive[sizes.index(output or "flywheel")] -= load
    q = np.linalg.solve(matrix, drive)
    belt = next(k for k, section in enumerate(chain.sections) if section.name == "pulley - generator")
    expected = ratios["generator"] * (q[sizes.index("pulley")] - q[sizes.index("generator")])
    result, before = twist(problem.engine, at).at(order)[belt], twist(plain, at).at(order)[belt]
    assert abs(result - before) > 0.02 * abs(result)
    assert result == pytest.approx(expected, rel=3e-3)
    assert isinstance(shaft_torque(problem.engine, at), Spectrum)


def test_firing_orders_are_ranked_with_the_load() -> None:
    """Compare the rows of every firing order with those of the engine built with it."""
    problem = problem_of("inline-five-torsion", fidelity={"samples": 360})
    phasing = problem.phasing
    family = next(f for f in families_of(phasing)[0])
    model = FiringModel(phasing, family.space, family.geometry)
    for slots in ((0, 1, 3, 4, 2), (0, 4, 2, 1, 3)):
        fired = replace(phasing.problem_of(phasing.fired(slots, family.geometry)), phasing=None)
        exact = evaluate(fired)
        for k, term in enumerate(fired.objective):
            rows = model.at(360).terms[k][1].at(slots)
            assert rows.value(np.zeros(0)) == pytest.approx(exact.value(term.measure), rel=1e-9)
        assert abs(objective_value(fired, exact) / objective_value(fired, evaluate(without_load(fired))) - 1) > 1e-4


def test_a_load_in_torsion_and_flywheel_is_one() -> None:
    problem = problem_of("inline-five-generator")
    assert isinstance(problem.engine.load_torque, LoadTorque)
    swept = [
        throw_torques(e, problem.points[0]).sample(720).sum(axis=1)
        for e in (problem.engine, without_load(problem).engine)
    ]
    assert np.ptp(swept[0] - swept[1]) == pytest.approx(np.ptp(problem.engine.load_torque.torques), rel=1e-3)
