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
from attack.own_problem import Own
from attack.plain_scene import Table, terms_of
from attack.run_attack import attacked, drawn
from lanes import first_fast
from laufruhe.solvers.result import Result, Status

QUICK = [("joint", 3), ("any mounts", 2), ("any mounts", 5), ("any mounts", 6), ("any mounts", 17)]
NAMED = [*QUICK, ("run-ups", 0), ("elastic-balance", 5)]
DRAWN = NAMED + [("any mounts", seed) for seed in range(24) if ("any mounts", seed) not in QUICK]


def given(table: Table, x: np.ndarray, own: Own) -> Table:
    """The file with its open numbers as they are in a design, which `evaluate` takes as given."""
    out = own.closed(x[None])
    for number, value in zip(own.open, x, strict=True):
        holder = out
        for key in number.path[:-1]:
            holder = holder[key]
        told = own.table
        for key in number.path:
            told = told[key]
        unit = told["between"][0].split(" ", 1)[1] if isinstance(told["between"][0], str) else ""
        start = f"{float(value) / si('1 ' + unit)!r} {unit}" if unit else float(value)
        holder[number.path[-1]] = {**told, "start": start}
    return out


@pytest.mark.parametrize(("family", "seed"), first_fast(DRAWN, len(QUICK), len(NAMED) + 6))
def test_a_random_design_is_worth_the_same(family: str, seed: int, tmp_path: Path) -> None:
    table, _ = drawn(family, seed)
    own, rng = Own(table, 8192), np.random.default_rng(seed)
    x = own.box[:, 0] + (own.box[:, 1] - own.box[:, 0]) * rng.random(len(own.open))
    path = tmp_path / "design.toml"
    path.write_text(toml(given(table, x, own)), encoding="utf-8")
    result, design = laufruhe.evaluate(laufruhe.load(path)), own.designs(x)
    asked = own_judge.reading([term["quantity"] for term in terms_of(table)], table)
    maximum = max(asked, 1.5 * result.error_estimate)
    assert result.objective.value == pytest.approx(float(design.objective[0]), rel=maximum)
    limits = {limit.name: limit for limit in result.limits}
    for told in table.get("constraints", []):
        if told["limit"] != "natural frequencies":
            limit, value = limits[told["name"]], float(design.measure({**told, "quantity": told["limit"]})[0])
            maximum = max(own_judge.reading([told["limit"]], table), 1.5 * limit.error_estimate)
            assert limit.value == pytest.approx(value, rel=maximum), told


@pytest.mark.slow
def test_forces_are_those_of_a_motion_in_time() -> None:
    """From rest until nothing of the start is left; viscous damping alone has a law in time."""
    table, _ = drawn("any mounts", 3)
    table["mounts"] = {"kind": "elastic", "damping_per_stiffness": "4.0 ms", "places": table["mounts"]["places"]}
    for place in table["mounts"]["places"]:
        place.pop("loss_factor", None)
        place.pop("fluid_track", None)
    own = Own(table)
    design = own.designs(own.given)
    b, speed = design.blocks, own.speeds[0]
    stiffness, damping = (b.summed(b.along(part))[0] for part in (b.stiff, b.damping))
    inverse, loads, rates = np.linalg.inv(b.mass), b.about_centre(design.wrench[0, 0]), own.felt / own.turns * speed

    def moving(t: float, y: np.ndarray) -> np.ndarray:
        load = (loads * np.exp(1j * rates * t)[:, None]).real.sum(axis=0)
        return np.concatenate([y[6:], inverse @ (load - damping @ y[6:] - stiffness @ y[:6])])

    free = np.block([[np.zeros((6, 6)), np.eye(6)], [-inverse @ stiffness, -inverse @ damping]])
    cycle = 2.0 * np.pi * own.turns / speed
    began = np.ceil(25.0 / -np.linalg.eigvals(free).real.max() / cycle) * cycle
    times = began + cycle * np.arange(12) / 12
    y = solve_ivp(moving, (0.0, times[-1]), np.zeros(12), t_eval=times, method="DOP853", rtol=1e-10, atol=1e-13).y
    travel, rate = (b.moves[0] @ part[None] for part in (y[:6], y[6:]))
    found = b.along(b.stiff)[0] @ travel + b.along(b.damping)[0] @ rate
    forces = design.coefficients({}, "mount force")[0, 0]
    steady = np.einsum("mni,nt->mit", forces, np.exp(1j * rates[:, None] * times)).real
    assert np.abs(found - steady).max() < 1e-7 * np.abs(steady).max()


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
    ("lie", "heard"),
    [
        (lambda r: r, ""),
        (lambda r: replace(r, objective=replace(r.objective, value=1.00001 * r.objective.value)), "by the own model"),
        (lambda r: replace(r, certificate=replace(r.certificate, lower_bound=1.0001 * r.objective.value)), "bound"),
        (lambda r: replace(r, objective=None, certificate=None, status=Status.INFEASIBLE), "infeasible, but"),
    ],
    ids=["truth", "value", "bound", "infeasible"],
)  # fmt: skip
def test_a_lie_is_found_out(lie: Any, heard: str, example: tuple[Table, Result]) -> None:
    table, result = example
    told = complaints(table, lie(result))
    assert heard in told
    assert bool(heard) == bool(told)
