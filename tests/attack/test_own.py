"""The own model of elastic mounts against the package, against time, and that it finds lies out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import laufruhe
from attack import own_judge
from attack.claims import Verdict, solved
from attack.families import problem, toml
from attack.own_loads import si
from attack.own_problem import OwnModel
from attack.plain_scene import Table, terms_of
from attack.run_attack import attacked, drawn
from lanes import first_fast
from laufruhe.solvers.result import Result, Status

QUICK = [("joint", 3), ("any mounts", 2), ("any mounts", 5), ("any mounts", 6), ("any mounts", 17)]
NAMED = [*QUICK, ("run-ups", 0), ("elastic-balance", 5)]
DRAWN = NAMED + [("any mounts", seed) for seed in range(24) if ("any mounts", seed) not in QUICK]


def with_values(table: Table, x: np.ndarray, model: OwnModel) -> Table:
    """Return the file with its open numbers as they are in a design, which `evaluate` takes as given."""
    out = model.closed(x[None])
    for number, value in zip(model.open, x, strict=True):
        holder = out
        for key in number.path[:-1]:
            holder = holder[key]
        node = model.table
        for key in number.path:
            node = node[key]
        unit = node["between"][0].split(" ", 1)[1] if isinstance(node["between"][0], str) else ""
        start = f"{float(value) / si('1 ' + unit)!r} {unit}" if unit else float(value)
        holder[number.path[-1]] = {**node, "start": start}
    return out


@pytest.mark.parametrize(("family", "seed"), first_fast(DRAWN, len(QUICK), len(NAMED) + 6))
def test_a_random_design_is_worth_the_same(family: str, seed: int, tmp_path: Path) -> None:
    table, _ = drawn(family, seed)
    model, rng = OwnModel(table, 8192), np.random.default_rng(seed)
    x = model.box[:, 0] + (model.box[:, 1] - model.box[:, 0]) * rng.random(len(model.open))
    path = tmp_path / "design.toml"
    path.write_text(toml(with_values(table, x, model)), encoding="utf-8")
    result, design = laufruhe.evaluate(laufruhe.load(path)), model.designs(x)
    quantities = own_judge.reading([term["quantity"] for term in terms_of(table)], table)
    maximum = max(quantities, 1.5 * result.error_estimate)
    assert result.objective.value == pytest.approx(float(design.objective[0]), rel=maximum)
    limits = {limit.name: limit for limit in result.limits}
    for entry in table.get("constraints", []):
        if entry["limit"] != "natural frequencies":
            limit, value = limits[entry["name"]], float(design.measure({**entry, "quantity": entry["limit"]})[0])
            maximum = max(own_judge.reading([entry["limit"]], table), 1.5 * limit.error_estimate)
            assert limit.value == pytest.approx(value, rel=maximum), entry


@pytest.mark.slow
def test_forces_are_those_of_a_motion_in_time() -> None:
    """Integrate from rest until the start is forgotten; viscous damping alone has a law in time."""
    table, _ = drawn("any mounts", 3)
    table["mounts"] = {"kind": "elastic", "damping_per_stiffness": "4.0 ms", "places": table["mounts"]["places"]}
    for place in table["mounts"]["places"]:
        place.pop("loss_factor", None)
        place.pop("fluid_track", None)
    model = OwnModel(table)
    design = model.designs(model.start)
    b, speed = design.blocks, model.speeds[0]
    stiffness, damping = (b.summed(b.along(part))[0] for part in (b.stiff, b.damping))
    inverse, loads, rates = (
        np.linalg.inv(b.mass),
        b.about_centre(design.wrench[0, 0]),
        model.harmonics / model.turns * speed,
    )

    def moving(t: float, y: np.ndarray) -> np.ndarray:
        load = (loads * np.exp(1j * rates * t)[:, None]).real.sum(axis=0)
        return np.concatenate([y[6:], inverse @ (load - damping @ y[6:] - stiffness @ y[:6])])

    free = np.block([[np.zeros((6, 6)), np.eye(6)], [-inverse @ stiffness, -inverse @ damping]])
    cycle = 2.0 * np.pi * model.turns / speed
    began = np.ceil(25.0 / -np.linalg.eigvals(free).real.max() / cycle) * cycle
    times = began + cycle * np.arange(12) / 12
    y = solve_ivp(moving, (0.0, times[-1]), np.zeros(12), t_eval=times, method="DOP853", rtol=1e-10, atol=1e-13).y
    travel, rate = (b.moves[0] @ part[None] for part in (y[:6], y[6:]))
    force = b.along(b.stiff)[0] @ travel + b.along(b.damping)[0] @ rate
    forces = design.coefficients({}, "mount force")[0, 0]
    steady = np.einsum("mni,nt->mit", forces, np.exp(1j * rates[:, None] * times)).real
    assert np.abs(force - steady).max() < 1e-7 * np.abs(steady).max()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 8])
def test_no_claim_falls(seed: int) -> None:
    assert attacked("any mounts", seed, 2).wrong == []


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> tuple[Table, Result]:
    table, _ = problem("elastic-few", 2)
    return table, solved(table, tmp_path_factory.mktemp("own"))


def complaints(table: Table, result: Any) -> str:
    verdict = Verdict("elastic-few", 2, result.status.value, "global")
    own_judge.judge(verdict, table, result, np.random.default_rng(0), 300)
    return " ".join(verdict.wrong)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lie", "message"),
    [
        (lambda r: r, ""),
        (lambda r: replace(r, objective=replace(r.objective, value=1.00001 * r.objective.value)), "by the own model"),
        (lambda r: replace(r, certificate=replace(r.certificate, lower_bound=1.0001 * r.objective.value)), "bound"),
        (lambda r: replace(r, objective=None, certificate=None, status=Status.INFEASIBLE), "infeasible, but"),
    ],
    ids=["truth", "value", "bound", "infeasible"],
)  # fmt: skip
def test_a_false_claim_is_detected(lie: Any, message: str, example: tuple[Table, Result]) -> None:
    table, result = example
    lines = complaints(table, lie(result))
    assert message in lines
    assert bool(message) == bool(lines)
