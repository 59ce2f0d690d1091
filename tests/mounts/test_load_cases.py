"""Loads that are held: closed forms, minimisation of the energy, bounds, and designs that keep a travel."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import differential_evolution, minimize

from laufruhe.errors import InputError
from laufruhe.files.measures import limit_name
from laufruhe.files.reader import load
from laufruhe.load_models.mount_symbols import symbolic_mounts
from laufruhe.machine import Mount
from laufruhe.machine.block import LoadCase
from laufruhe.physics import mount_numbers
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.static_cases import case_wrench, settled, stops_of
from laufruhe.problem.channels import counted_cases, mounting_in
from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.prove.certificate import Proof
from laufruhe.prove.mounts.box_numbers import LINEAR_BOUNDS, static_loads
from laufruhe.prove.mounts.box_response import BoxModel
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status
from laufruhe.solvers.smooth.constraint_collector import ConstraintCollector
from laufruhe.solvers.smooth.variables import StaticCases
from mounts.files import BLOCK, ENGINE, MOUNTS, changed, problem_of
from mounts.powertrain import random_mounting
from problem_files import PROBLEMS
from prove.test_subdivision import boxes
from ready import solved

TORQUE = LoadCase("torque", moment=(180.0, 0.0, 0.0), force=(0.0, 300.0, -50.0), place=(0.3, -0.1, 0.2))
BUMP = LoadCase("bump", times_weight=(0.2, -0.5, -3.0))
CASES = """
[[load_cases]]
name = "bump"
times_weight = [0, 0, -3]
[[load_cases]]
name = "torque"
torque = "400 N m"
"""


def test_weight_alone_is_the_sag() -> None:
    mounting = random_mounting(4)
    result = settled(mounting, LoadCase("weight", times_weight=(0.0, 0.0, -1.0)))
    assert -result.motion[2] == pytest.approx(mount_numbers.sag(mounting), rel=1e-10)


def test_limits_of_load_cases_are_found_by_the_names_of_results() -> None:
    path = PROBLEMS / "powertrain-load-cases.toml"
    limits = tomllib.loads(path.read_text(encoding="utf-8"))["constraints"]
    assert {limit_name(limit) for limit in limits} == {limit.name for limit in load(path).limits}


@pytest.mark.parametrize("case", [TORQUE, BUMP])
def test_mounts_carry_the_load(case: LoadCase) -> None:
    stopped = [replace(m, stop_gap=5e-4, stop_stiffness=2e6) for m in random_mounting(2).mounts]
    mounting = elastic_mounting(random_mounting(2).block, stopped)
    result, centre = settled(mounting, case), np.array(mounting.block.centre_of_gravity)
    arms = np.array([mount.position for mount in mounting.mounts]) - centre
    carried = np.concatenate([result.force.sum(axis=0), np.cross(arms, result.force).sum(axis=0)])
    assert carried == pytest.approx(case_wrench(mounting.block, case), rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("case", [TORQUE, BUMP])
def test_the_block_settles_where_its_energy_is_least(seed: int, case: LoadCase) -> None:
    plain = random_mounting(seed)
    stopped = [replace(m, stop_gap=1e-4 * (k + 1), stop_stiffness=3e6) for k, m in enumerate(plain.mounts)]
    mounting = elastic_mounting(plain.block, stopped)
    result, wrench, size = settled(mounting, case), case_wrench(plain.block, case), 1e-3

    def energy(x):
        q, total = size * x, 0.0
        for mount, motion in zip(mounting.mounts, mounting.motions, strict=True):
            own = np.array(mount.orientation) @ motion @ q
            over = np.maximum(np.abs(own) - mount.stop_gap, 0.0)
            total += 0.5 * np.sum(np.array(mount.stiffness) * own**2 + mount.stop_stiffness * over**2)
        return total - float(wrench @ q)

    other = minimize(energy, np.zeros(6), method="BFGS", options={"gtol": 1e-12, "maxiter": 5000})
    assert energy(result.motion / size) <= other.fun + 1e-9 * abs(other.fun)
    assert result.motion == pytest.approx(size * other.x, abs=2e-4 * np.abs(result.motion).max())
    assert result.on_stops


def test_a_travel_that_just_reaches_its_gap_is_found() -> None:
    """Check the travel at the load that just closes the first gap, to the last digit and around it."""
    plain = random_mounting(4)
    case = LoadCase("push", force=(3000.0, -2000.0, -9000.0))
    rows = stops_of(plain).rows
    reach = np.abs(rows @ settled(plain, case).motion).max()
    for share in np.concatenate([[0.0], np.logspace(-16, -6, 60), -np.logspace(-16, -6, 60)]):
        stopped = [replace(m, stop_gap=reach * (1.0 + share), stop_stiffness=3e7) for m in plain.mounts]
        result = settled(elastic_mounting(plain.block, stopped), case)
        assert np.abs(rows @ result.motion).max() == pytest.approx(reach, rel=2e-6)


def test_one_mount_meets_its_stop_as_two_springs_do() -> None:
    # by hand: k x to the gap, then (k + s) beyond it
    block = random_mounting(0).block
    block = replace(block, mass=100.0, centre_of_gravity=(0.0, 0.0, 0.0))
    places = [(x, y, 0.0) for x in (-0.3, 0.3) for y in (-0.2, 0.2)]
    mounts = [Mount(str(k), p, (1e5,) * 3, stop_gap=2e-3, stop_stiffness=3e5) for k, p in enumerate(places)]
    load = LoadCase("down", force=(0.0, 0.0, -4.0 * 500.0))
    assert settled(elastic_mounting(block, mounts), load).motion[2] == pytest.approx(-(2e-3 + 300.0 / 4e5), rel=1e-12)
    # a second stop farther out, on a spring that is joined: three slopes
    pad = Mount("pad", places[0], (0.0, 0.0, 0.0), stop_gap=2.5e-3, stop_stiffness=6e5)
    joined = elastic_mounting(block, [replace(m, joined=(replace(pad, position=m.position),)) for m in mounts])
    assert settled(joined, load).motion[2] == pytest.approx(-(2.5e-3 + 100.0 / 1e6), rel=1e-12)


OBJECTIVES = {
    "travel": '[objective]\nminimise = "static travel"\n',
    "of one": '[objective]\nminimise = "static travel"\nload_cases = ["torque"]\nmounts = ["front left"]\n',
    "along z": '[objective]\nminimise = "static travel"\ndirection_weights = [0, 0, 1]\n',
    "weighted": '[objective]\nminimise = "static travel"\ndirection_weights = [3, 1, 0.3]\n',
    "force": '[objective]\nminimise = "static mount force"\n',
}
TILTED = BLOCK + 'inertia_products = ["2 kg m^2", "-3 kg m^2", "1 kg m^2"]\n'
AHEAD = TILTED.replace('"0 mm", "0 mm", "120 mm"', '"60 mm", "20 mm", "120 mm"')


def with_stops(gap: str) -> str:
    return changed(
        MOUNTS, ("loss_factor = 0.1", f'loss_factor = 0.1\nstop = {{ gap = "{gap}", stiffness = "1500 N/mm" }}')
    )


GAPS = {"none": MOUNTS, "wide": with_stops("6 mm"), "narrow": with_stops("1.5 mm")}


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("name", OBJECTIVES)
def test_no_design_of_a_box_is_under_its_bound(name: str, gap: str, tmp_path: Path) -> None:
    """Check bump stops met in all of a box, in none of it, and in a part (E60)."""
    problem = problem_of(tmp_path, ENGINE, AHEAD, GAPS[gap], CASES, OBJECTIVES[name])
    measure, evaluation = problem.objective[0].measure, evaluate(problem)
    model, generator, ratios = BoxModel(problem, evaluation), np.random.default_rng(1), []
    # load cases have no operating point
    still = evaluate(replace(problem, points=()))
    for low, high in zip(*boxes(problem, 30, 3), strict=True):
        found = LINEAR_BOUNDS[measure.channel](model, measure, low[None], high[None])
        shares = generator.random((5, 2))
        drawn = [problem.design((low + s * (high - low)).tolist()) for s in shares]
        values = np.array([with_mounts(still, engine).value(measure) for engine in drawn])
        # the linear function itself is under every design, not its least alone
        lines = found.value + (2.0 * shares - 1.0) @ found.slopes[0] - found.remainder
        assert np.all(lines <= values * (1.0 + 1e-9))
        ratios.append(float(found.minimum[0]) / values.min())
    assert max(ratios) <= 1.0 + 1e-9
    assert max(ratios) > 0.99


@pytest.mark.parametrize("name", ["powertrain-joined-springs", "powertrain-hydraulic"])
@pytest.mark.parametrize("quantity", ["static travel", "static mount force"])
def test_joined_and_hydraulic_mounts_with_stops_are_bounded_too(name: str, quantity: str) -> None:
    """Check boxes of every size, random designs and corners."""
    tables = tomllib.loads((PROBLEMS / f"{name}.toml").read_text(encoding="utf-8"))
    tables["mounts"]["stop"] = {"gap": "4 mm", "stiffness": "1200 N/mm"}
    tables["load_cases"] = [{"name": "bump", "times_weight": [0.2, 0, -3]}, {"name": "torque", "torque": "350 N m"}]
    tables["constraints"] = [{"limit": quantity, "max": "1 m" if quantity == "static travel" else "1 MN"}]
    problem, generator, ratios = load(tables), np.random.default_rng(1), []
    evaluation, still = evaluate(problem), evaluate(replace(problem, points=()))
    measure = problem.mount_limits[0].measure
    model = BoxModel(problem, evaluation)
    for width in (0.2, 0.05, 0.01, 0.2, 0.05, 0.01):
        centre = model.lower * (model.upper / model.lower) ** generator.random(len(model.lower))
        low, high = (np.clip(centre * (1.0 + side * width), model.lower, model.upper) for side in (-1.0, 1.0))
        shares = generator.random((4, len(low)))
        drawn = [problem.design((low + s * (high - low)).tolist()) for s in (*shares, *np.round(shares))]
        minimum = min(with_mounts(still, engine).value(measure) for engine in drawn)
        ratios.append(float(static_loads(model, measure, low[None], high[None]).minimum[0]) / minimum)
    assert max(ratios) <= 1.0 + 1e-9
    assert np.median(ratios) > 0.95


@pytest.mark.slow
def test_a_limit_beside_a_stop_is_met_and_proven() -> None:
    """Check that prices of bump and full torque close the boxes of the powertrain."""
    result = solved("powertrain-load-cases")
    assert result.certificate.kind is Proof.GLOBAL
    bump, torque = (next(limit for limit in result.limits if name in limit.name) for name in ("bump", "full torque"))
    for limit in (bump, torque):
        assert limit.value == pytest.approx(limit.limit, rel=1e-5)
        assert limit.shadow_price > 1e3


@pytest.mark.parametrize("gap", ["none", "narrow"])
@pytest.mark.parametrize("name", OBJECTIVES)
def test_the_program_settles_where_the_block_does(name: str, gap: str, tmp_path: Path) -> None:
    """Check that the program's rows give the travel at each mount, at a balance with stops."""
    problem = problem_of(tmp_path, ENGINE, AHEAD, GAPS[gap], CASES, OBJECTIVES[name])
    measure, held, mounting = problem.objective[0].measure, ConstraintCollector(), mounting_in(problem.engine)
    root, numbers = mass_root(mounting.block), ca.MX.sym("d", 2)
    cases = StaticCases(symbolic_mounts(problem, mounting.block, numbers), mounting, root, held)
    top = cases.largest(measure, problem.engine)
    symbols = [symbol for symbol, _ in held.heads]
    rows = ca.Function("rows", [numbers, *symbols], [top, *held.expressions])

    stiffness = [3e5, 9e5]
    engine = problem.design(stiffness)
    load_cases = counted_cases(measure, engine)
    found = [settled(elastic_mounting(engine.block, engine.mounts), case) for case in load_cases]
    given = [settled(mounting, case).motion for case in load_cases]
    motions = [np.linalg.solve(root.T, each.motion) for each in found]
    sizes = [np.linalg.norm(np.linalg.solve(root.T, motion)) for motion in given]
    balances = [motion / size for motion, size in zip(motions, sizes, strict=True)] if gap != "none" else []
    unit, *unmet, squares = (np.asarray(v, dtype=float).ravel() for v in rows(stiffness, *balances, 1.0))

    assert len(unmet) == len(balances)
    for balance in unmet:
        assert balance == pytest.approx(np.zeros(6), abs=1e-4)
    signals = [each.force if name == "force" else each.travel for each in found]
    counted = [signal[:1] if name == "of one" else signal for signal in signals]
    weights = {"along z": [0.0, 0.0, 1.0], "weighted": [3.0, 1.0, 0.3]}.get(name, [1.0, 1.0, 1.0])
    lengths = np.linalg.norm(np.concatenate(counted) * weights, axis=1)
    assert unit * np.sqrt(squares + 1.0) == pytest.approx(lengths, rel=1e-4)


LIMIT = '[[constraints]]\nlimit = "static travel"\nmax = "9 mm"\n[search]\nstarts = 4\n'
SOFT = '[objective]\nminimise = "total stiffness"\n'
STOPPED = GAPS["wide"]


@pytest.fixture(scope="module")
def least_stiff(tmp_path_factory):
    """Return the problem of least stiffness that keeps a travel, with and without bump stops."""
    found = {}
    for name, mounts in (("free", MOUNTS), ("stopped", STOPPED)):
        problem = problem_of(tmp_path_factory.mktemp(name), ENGINE, AHEAD, mounts, CASES, SOFT, LIMIT)
        found[name] = problem, solve(problem)
    return found


def _by_evolution(problem) -> float:
    # load cases have no operating point
    evaluation, (limit,) = evaluate(replace(problem, points=())), problem.limits

    def worth(x):
        design = with_mounts(evaluation, problem.design(np.exp(x).tolist()))
        return objective_value(problem, design) * (1.0 + 100.0 * max(design.check_limit(limit).violation, 0.0))

    bounds = [(np.log(d.lower), np.log(d.upper)) for d in problem.decisions]
    return float(differential_evolution(worth, bounds, seed=1, maxiter=60, popsize=8, tol=1e-9).fun)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["free", "stopped"])
def test_the_least_stiffness_that_keeps_a_travel_is_that_of_a_search(name: str, least_stiff) -> None:
    problem, result = least_stiff[name]
    assert result.status in (Status.OPTIMAL, Status.FEASIBLE)
    assert result.objective.value == pytest.approx(_by_evolution(problem), rel=2e-3)
    assert result.limits[0].value <= 9e-3 * (1.0 + 1e-6)
    assert result.certificate.lower_bound <= result.objective.value * (1.0 + 1e-9)


def test_both_are_proven_and_stops_save_stiffness(least_stiff) -> None:
    free, stopped = (least_stiff[name][1] for name in ("free", "stopped"))
    assert free.certificate.kind is stopped.certificate.kind is Proof.GLOBAL
    assert stopped.objective.value < 0.999 * free.objective.value


@pytest.mark.parametrize(
    ("cases", "more", "message"),
    [
        ("", LIMIT, "needs load cases"),
        ('[[load_cases]]\nname = "nothing"\n', "", "has no load"),
        (CASES + CASES, "", "bump"),
        (CASES, LIMIT.replace("max", 'load_cases = ["pothole"]\nmax'), "is no load case here"),
        (CASES, LIMIT.replace("max", 'mounts = ["rear"]\nmax'), "is no mount here"),
        (CASES.replace('"400 N m"', '"400 N"'), "", "torque"),
    ],
)
def test_meaningless_input_is_refused_in_a_line(cases, more, message, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, cases, SOFT, more)
    assert message in str(refused.value)


def test_load_cases_need_mounts_that_give_way(tmp_path: Path) -> None:
    rigid = '[mounts]\npositions = [["300 mm", "200 mm", "0 mm"], ["-300 mm", "-200 mm", "0 mm"]]\n'
    with pytest.raises(InputError, match="needs elastic mounts"):
        problem_of(tmp_path, ENGINE, rigid, CASES)
