"""Electric machines: closed forms, brute force and a linear program against the proven torque, limits, complaints."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import laufruhe
from lanes import first_fast
from laufruhe.errors import InputError
from laufruhe.extensions.electric_torque.machine import ELECTRIC_TORQUE, ElectricMachines
from laufruhe.extensions.electric_torque.section import SECTION
from laufruhe.extensions.flywheel.torque import torque_facts
from laufruhe.extensions.torsion.physics import chain_of, inertias, twist
from laufruhe.files.reader import load_tables
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.torque import crank_torque, excess_torque
from laufruhe.plots import figure
from laufruhe.problem.channels import CHANNELS, LoadChannel
from laufruhe.problem.dependence import Dependence, dependence, is_affine
from laufruhe.problem.evaluation import evaluate, with_fine_sampling
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result, Status
from picture_faults import faults_of
from problem_files import PROBLEMS

MOUNTS = {"positions": [[f"{x} mm", f"{y} mm", "0 mm"] for x in (200, -200) for y in (250, -250)]}
GAS = {"model": "seiliger", "peak_pressure": "75 bar", "imep": "5 bar"}
SHAFT = {
    "name": "left", "ratio": -2, "position": ["60 mm", "-90 mm"],
    "unbalances": [{"unbalance": {"between": ["0 kg m", "0.02 kg m"]}, "angle": {"between": [0, 360]}}],
}  # fmt: skip


def machine(**keys: Any) -> dict[str, Any]:
    return {"name": "isg", "orders": [2], "max_torque": "60 N m", **keys}


def problem_of(machines: list[dict[str, Any]], minimise: str | None = "rms roll moment", **tables: Any) -> Problem:
    engine = {
        "layout": "inline", "cycle": "four-stroke", "bore": "90 mm", "stroke": "100 mm", "rod_ratio": 0.28,
        "reciprocating_mass": "0.8 kg", "cylinder_spacing": "100 mm", "throws": [0, 180, 180, 0],
        "firing_order": [1, 3, 4, 2], **tables.pop("engine", {}),
    }  # fmt: skip
    whole = {
        "title": "Four with a machine", "engine": engine, "operating_points": [{"speed": "1500 rpm"}], "gas": GAS,
        "mounts": MOUNTS, "electric_machines": machines, **tables,
    }  # fmt: skip
    if minimise:
        whole["objective"] = {"minimise": minimise, "alternating": True}
    return load_tables({key: table for key, table in whole.items() if table is not None}, Path("machine.toml"))


def decided(result: Result) -> tuple[complex, ...]:
    """Return the torque of every harmonic of the first machine of the final design."""
    extra = result.final.engine.extra(ElectricMachines)
    assert extra is not None
    return tuple(complex(one.torque) for one in extra.machines[0].harmonics)


def is_proven(result: Result) -> bool:
    certificate = result.certificate
    return result.status is Status.OPTIMAL and certificate is not None and certificate.kind is Proof.GLOBAL


@pytest.mark.parametrize(("maximum", "reaches"), [(60.0, False), (900.0, True)])
def test_one_order_takes_what_the_engine_makes_as_far_as_it_can(maximum: float, reaches: bool) -> None:
    """Check the least rms of M + c in one order: c = -M, or opposite M at the largest amplitude."""
    result = laufruhe.solve(problem_of([machine(max_torque=f"{maximum} N m")]))
    moment = shaking_loads(result.final.engine.unloaded, result.problem.points[0]).without_mean
    amplitude = complex(moment.at(2.0)[3])
    size = abs(amplitude) if reaches else maximum
    assert (abs(amplitude) < maximum) is reaches
    assert decided(result)[0] == pytest.approx(-amplitude / abs(amplitude) * size, rel=0.02)
    others = 0.5 * float(np.sum(np.abs(moment.coefficients[:, 3]) ** 2)) - 0.5 * abs(amplitude) ** 2
    least = math.sqrt(others + 0.5 * (abs(amplitude) - size) ** 2)
    assert result.objective is not None
    assert is_proven(result)
    assert result.objective.value == pytest.approx(least, rel=1e-4)
    assert result.limits[0].active is not reaches


@pytest.mark.parametrize("seed", first_fast(list(range(50)), 2, 6))
def test_no_torque_on_a_grid_beats_the_proven_one(seed: int) -> None:
    """Compare with a grid of amplitudes and angles of two orders within the largest torque."""
    rng = np.random.default_rng(seed)
    norm, channel = rng.choice(["rms", "maximum", "mean"]), rng.choice(["roll moment", "mount force"])
    throws, order = [([0, 180, 180, 0], [1, 3, 4, 2]), ([0, 240, 120], [1, 2, 3]), ([0, 0], [1, 2])][seed % 3]
    engine = {"throws": throws, "firing_order": order, "reciprocating_mass": f"{rng.uniform(0.4, 1.2)} kg"}
    orders = sorted(rng.choice([0.5, 1.0, 1.5, 2.0, 3.0], 2, replace=False).tolist())
    largest = float(rng.uniform(20.0, 300.0))
    machine_table = machine(orders=orders, max_torque=f"{largest} N m", stator="block")
    problem = problem_of([machine_table], f"{norm} {channel}", engine=engine)
    result = laufruhe.solve(problem)
    assert result.objective is not None
    assert result.certificate is not None
    value, bound = result.objective.value, result.certificate.lower_bound
    assert is_proven(result)
    assert bound <= value * (1.0 + 1e-12)
    angles = np.linspace(0.0, 2.0 * problem.engine.cycle.angle, 4000)
    best = np.array(decided(result))
    for _ in range(12):
        near = rng.random() < 0.5
        torques = best * (1.0 + 0.3 * rng.normal(size=2)) if near else rng.uniform(0, 1.3, 2) * largest
        torques = torques * np.exp(1j * (0.3 if near else 9.0) * rng.normal(size=2))
        values = np.abs(sum(t * np.exp(1j * o * angles) for t, o in zip(torques, orders, strict=True)).real)
        torques = torques * min(1.0, largest / max(float(values.max()), 1e-9))
        other = evaluate(problem, problem.design([complex(torque) for torque in torques]))
        assert with_fine_sampling(other).value(problem.objective[0].measure) >= bound * (1.0 - 1e-9)


def test_a_linear_program_finds_the_same_peak() -> None:
    """Compare the least peak of the roll moment with a linear program of HiGHS at 1440 angles."""
    problem = problem_of([machine(orders=[2, 4, 6], max_torque="90 N m")], "maximum roll moment")
    result = laufruhe.solve(problem)
    angles = problem.engine.cycle.angle * np.arange(1440) / 1440
    moment = shaking_loads(problem.engine, problem.points[0]).without_mean.values(angles)[:, 3]
    waves = np.stack([part(k * angles) for k in (2.0, 4.0, 6.0) for part in (np.cos, np.sin)], axis=1)
    one, none = np.ones((1440, 1)), np.zeros((1440, 1))
    rows = np.block([[waves, -one], [-waves, -one], [waves, none], [-waves, none]])
    bounds = np.concatenate([-moment, moment, np.full(2880, 90.0)])
    answer = linprog([0.0] * 6 + [1.0], A_ub=rows, b_ub=bounds, bounds=[(None, None)] * 7)
    assert is_proven(result)
    assert result.objective is not None
    assert result.objective.value == pytest.approx(answer.fun, rel=3e-4)


def test_torque_of_several_orders_stays_within_the_limit_between_samples() -> None:
    problem = problem_of([machine(orders=[1, 2, 3, 4], max_torque="70 N m")], "maximum mount force")
    result = laufruhe.solve(problem)
    torque = machine_torque(result).sample(200_000)
    assert np.abs(torque).max() <= 70.0 * (1.0 + 1e-4)
    assert result.limits[0].active
    assert result.limits[0].shadow_price > 0.0


def machine_torque(result: Result) -> Any:
    extra = result.final.engine.extra(ElectricMachines)
    assert extra is not None
    return extra.machines[0].torque(result.problem.points[0].name, result.final.engine.cycle.base_order)


def test_copper_loss_and_current_limit_the_torque() -> None:
    """Check R (T_rms / k)^2, k = 0.5 N m/A and 0.05 ohm: 200 W allow 31.6 N m rms, as the section says."""
    keys = {"torque_constant": "0.5 N m/A", "resistance": "0.05 ohm", "max_loss": "200 W", "max_current": "400 A"}
    keys |= {"mean_torque": "-10 N m", "max_torque": "900 N m"}
    result = laufruhe.solve(problem_of([machine(**keys)]))
    assert is_proven(result)
    assert {limit.name: limit.active for limit in result.limits} == {"isg.max_current": False, "isg.max_loss": True}
    rms = math.sqrt(100.0 + 0.5 * abs(decided(result)[0]) ** 2)
    assert 0.05 * (rms / 0.5) ** 2 == pytest.approx(200.0, rel=1e-4)
    (facts,) = SECTION.record(result)["isg"] if SECTION.record else ()
    assert facts["copper_loss"] == pytest.approx(200.0, rel=1e-4)
    assert facts["electric_power"] == pytest.approx(200.0 - 10.0 * result.problem.points[0].speed, rel=1e-4)
    (table,) = SECTION.tables(result)
    assert table.title == "Electric machines"
    assert "isg.max_current of 400 A is 200 N m; isg.max_loss of 200 W is 31.62 N m rms." in table.note


@pytest.mark.parametrize(
    ("keys", "minimise", "is_idle"),
    [
        ({"stator": "ground"}, "rms roll moment", True),
        ({"stator": "ground"}, "peak to peak stored work", False),
        ({}, "rms roll moment", False),
    ],
)
def test_a_machine_without_effect_on_any_measure_is_named(keys: dict[str, Any], minimise: str, is_idle: bool) -> None:
    result = laufruhe.evaluate(problem_of([machine(**keys)], minimise))
    (table,) = SECTION.tables(result)
    assert ("isg acts on nothing that is minimised or limited" in table.note) is is_idle


@pytest.mark.parametrize(
    ("shaft", "stator", "crank", "block"),
    [("crankshaft", "block", 1.0, 1.0), ("crankshaft", "ground", 1.0, 0.0), ("left", "block", 2.0, 2.0),
     ("left", "ground", 2.0, 3.0)],
)  # fmt: skip
def test_reactions_follow_from_work_and_from_the_moments_on_the_whole(
    shaft: str, stator: str, crank: float, block: float
) -> None:
    """Compare crank torque with the work of the machine, and mount loads with the balance of moments.

    A shaft of ratio -2 turns twice as fast and backwards: its machine on the ground pushes the whole engine forwards,
    against the reaction of its mounts, by its torque.
    """
    machine_table = machine(
        orders=[], harmonics=[{"order": 3, "torque": "40 N m", "angle": 30}], shaft=shaft, stator=stator
    )
    problem = problem_of([machine_table], None, balancer_shafts=[{**SHAFT, "unbalances": [{"unbalance": "0 kg m"}]}])
    engine, (point,) = problem.engine, problem.points
    torque = 40.0 * np.exp(1j * math.radians(30.0))
    driven = excess_torque(engine, point).at(3.0) - excess_torque(engine.unloaded, point).at(3.0)
    moved = shaking_loads(engine, point).at(3.0) - shaking_loads(engine.unloaded, point).at(3.0)
    assert driven == pytest.approx(crank * torque, rel=1e-9)
    assert moved == pytest.approx(np.array([0, 0, 0, block * torque, 0, 0]), rel=1e-9, abs=1e-9)
    assert crank_torque(engine, point).at(3.0) == pytest.approx(crank_torque(engine.unloaded, point).at(3.0))


def test_at_an_uneven_speed_the_torque_turns_the_crank() -> None:
    """Check w^2 = w_0^2 + 2 T sin(h phi) / (J h) of a machine on a heavy crank, and T on the block."""
    machine_table = machine(orders=[], harmonics=[{"order": 2, "torque": "50 N m"}])
    engine = {"reciprocating_mass": "1e-9 kg"}
    problem = problem_of([machine_table], None, engine=engine, fidelity={"crank_inertia": "0.8 kg m^2"}, gas=None)
    facts = torque_facts(problem.engine, problem.points[0], problem.fidelity)
    speed = problem.points[0].speed
    ends = [math.sqrt(speed**2 + sign * 2.0 * 50.0 / 0.8 / 2.0) for sign in (1.0, -1.0)]
    assert facts.irregularity == pytest.approx((ends[0] - ends[1]) / speed, rel=1e-5)
    moment = shaking_loads(problem.engine, problem.points[0], problem.fidelity).sample(720)[:, 3]
    assert np.abs(moment).max() == pytest.approx(50.0, rel=1e-4)
    assert dependence(CHANNELS["mount force"], ELECTRIC_TORQUE, problem) is Dependence.SMOOTH


def test_a_machine_twists_the_shaft_from_its_disc() -> None:
    """Check (T/J) / (w_n^2 - W^2) of two free discs, the rear one driven."""
    torsion = {
        "throw_inertia": "0.05 kg m^2",
        "discs": [{"name": "rotor", "end": "rear", "inertia": "0.8 kg m^2", "shaft": {"stiffness": "3e4 N m/rad"}}],
    }
    machine_table = machine(orders=[], harmonics=[{"order": 2, "torque": "50 N m", "angle": 70}], disc="rotor")
    single = {"throws": [0], "firing_order": [1]}
    problem = problem_of([machine_table], None, engine=single, torsion=torsion)
    (point,), (front, rear) = problem.points, inertias(chain_of(problem.engine))
    response = 3e4 * (1.0 / front + 1.0 / rear) - (2.0 * point.speed) ** 2
    moved = twist(problem.engine, point).at(2.0) - twist(problem.engine.unloaded, point).at(2.0)
    assert moved[0] == pytest.approx(-50.0 * np.exp(1j * math.radians(70.0)) / rear / response, rel=1e-9)
    with pytest.raises(InputError, match=r"'fan' is no disc of \[torsion\]|fan.* is no disc"):
        problem_of([{**machine_table, "disc": "fan"}], None, engine=single, torsion=torsion)


def test_loads_depend_on_torques_as_the_table_says() -> None:
    """Check NONE and AFFINE of the table midway between two designs, for every load of the engine."""
    torsion = {"throw_inertia": "0.05 kg m^2", "crank": {"stiffness": "1e6 N m/rad", "diameter": "60 mm"}}
    bearings = [{"x": f"{x} mm"} for x in (-200, 0, 200)]
    problem = problem_of(
        [machine(orders=[0.5, 2], stator="ground", shaft="left"), machine(name="second", orders=[1])],
        torsion=torsion, main_bearings=bearings, balancer_shafts=[SHAFT],
        geared_inertias=[{"name": "geared", "share": 0.2}],
    )  # fmt: skip
    rng, seen = np.random.default_rng(1), set()
    torques = [d for d in problem.decisions if d.kind is ELECTRIC_TORQUE]
    values = rng.normal(size=(2, len(torques))) + 1j * rng.normal(size=(2, len(torques)))
    designs = [
        evaluate(problem, problem.design([complex(x) for x in 9.0 * row], torques))
        for row in (values[0], values[1], values.mean(axis=0))
    ]
    for channel in CHANNELS.values():
        claim = dependence(channel, ELECTRIC_TORQUE, problem)
        if not isinstance(channel, LoadChannel) or not channel.needs.of(problem.engine) or channel.size_factors:
            continue
        try:
            first, second, middle = (design.signals(channel)[0].sample(240) for design in designs)
        except ValueError:
            continue
        size = np.abs(first).max() + 1e-9
        assert claim in (Dependence.NONE, Dependence.AFFINE), channel
        assert np.abs(middle - 0.5 * (first + second)).max() <= 1e-9 * size, channel
        # couples leave no force on all mounts together
        may_stay = claim is Dependence.NONE or channel.name == "resultant mount force"
        assert bool(np.abs(first - second).max() <= 1e-9 * size) is may_stay, channel
        seen.add(channel.name)
    assert {"roll moment", "mount force", "stored work", "shaft torque", "electric torque", "crank torque"} <= seen


def test_torques_and_unbalances_are_proven_together_at_each_operating_point() -> None:
    points = [{"name": "slow", "speed": "800 rpm"}, {"name": "fast", "speed": "1500 rpm"}]
    problem = problem_of([machine(orders=[2, 4])], "rms mount force", operating_points=points, balancer_shafts=[SHAFT])
    assert {decision.name for decision in problem.decisions if decision.kind is ELECTRIC_TORQUE} == {
        f"isg.order {order} at {point}.torque" for order in (2, 4) for point in ("slow", "fast")
    }
    assert is_affine(CHANNELS["mount force"], {decision.kind for decision in problem.decisions}, problem)
    result = laufruhe.solve(problem)
    assert is_proven(result)
    for names in (["left.unbalance"], ["isg.order 2 at slow.torque", "isg.order 4 at fast.torque"]):
        fixed = tuple(d for d in problem.decisions if d.name not in names)
        alone = laufruhe.solve(problem.changed(decisions=fixed))
        assert alone.objective is not None
        assert result.objective is not None
        assert alone.objective.value > result.objective.value
    assert not faults_of(figure(result, "torque"))


@pytest.mark.parametrize("given", [
    {"orders": [1, 1.5]},
    {"orders": [], "harmonics": [{"order": 1.5, "torque": "50 N m", "angle": 95}, {"order": 1, "torque": "3 N m"}]},
])  # fmt: skip
def test_open_stars_beside_a_torque_are_those_of_an_enumeration(given: dict[str, Any]) -> None:
    engine = {"throws": "open", "firing_order": "open", "cylinders": 3}
    whole = laufruhe.solve(problem_of([machine(**given)], "rms mount force", engine=engine))
    values = []
    for throws, order in (([0, 240, 120], [1, 3, 2]), ([0, 120, 240], [1, 2, 3])):
        star = {"throws": throws, "firing_order": order}
        result = laufruhe.solve(problem_of([machine(**given)], "rms mount force", engine=star))
        assert result.objective is not None
        values.append(result.objective.value)
    assert is_proven(whole)
    assert whole.objective is not None
    assert whole.objective.value == pytest.approx(min(values), rel=1e-6)


def test_a_flywheel_is_decided_beside_the_torque() -> None:
    flywheel = {"inertia": {"between": ["0.1 kg m^2", "2 kg m^2"]}}
    terms = [{"quantity": "rms mount force", "weight": 1.0}, {"quantity": "flywheel inertia", "weight": 10.0}]
    problem = problem_of([machine()], None, flywheel=flywheel, objective={"terms": terms})
    assert is_proven(laufruhe.solve(problem))


def test_a_share_of_geared_inertia_is_not_affine_beside_a_torque() -> None:
    """The geared shaft takes a fraction of the torque, and both are open."""
    geared = [{"name": "geared", "share": {"between": [0.0, 0.3]}}]
    problem = problem_of([machine()], geared_inertias=geared)
    kinds = {decision.kind for decision in problem.decisions}
    assert not is_affine(CHANNELS["roll moment"], kinds, problem)
    result = laufruhe.solve(problem.changed(search=replace(problem.search, starts=2)))
    assert result.certificate is None or result.certificate.kind is not Proof.GLOBAL


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"orders": [1.3]}, r"orders = .1\.3.: does not repeat within the four-stroke cycle; give an integer or half"),
        ({"orders": [2], "harmonics": [{"order": 2, "torque": "1 N m"}]}, "order 2 twice"),
        ({"max_torque": None}, "needs a largest torque"),
        ({"shaft": "lef"}, "is no shaft of this engine"),
        ({"max_current": "3 A"}, "add torque_constant"),
        ({"torque_constant": "1 N m/A", "max_loss": "3 W"}, "add resistance"),
        ({"disc": "rotor"}, r"is a disc of \[torsion\], which is missing"),
        ({"harmonics": [{"order": 1, "torque": "1 N m", "operating_point": "x"}]}, "is no operating point"),
        ({"stator": "moon"}, "stator"),
    ],
)
def test_bad_machines_are_refused_with_key_and_remedy(keys: dict[str, Any], words: str) -> None:
    given = {key: value for key, value in machine(**keys).items() if value is not None}
    with pytest.raises(InputError, match=words):
        problem_of([given], balancer_shafts=[SHAFT])


def test_half_orders_belong_to_four_stroke_engines() -> None:
    assert problem_of([machine(orders=[0.5])]).decisions
    two_stroke = {"cycle": "two-stroke", "firing_order": [1, 2, 3], "throws": [0, 240, 120]}
    with pytest.raises(InputError, match="give an integer"):
        problem_of([machine(orders=[0.5])], engine=two_stroke, gas=None)


@pytest.mark.parametrize(
    ("text", "mean", "words"),
    [
        # the compressor takes 34.9 N m, the four-cylinder gives 101 N m
        ("compressor", "80 N m", "drives the crank, and gas and friction take 34.86 N m; the difference of 45.14 N m"),
        ("compressor", "20 N m", "the difference of 14.86 N m would change the speed; give a sum of 34.86 N m"),
        ("compressor", "34.9 N m", ""),
        ("engine", "-300 N m", "brakes the crank, and gas and friction give"),
        ("engine", "-20 N m", ""),
        ("engine", "20 N m", ""),
    ],
)
def test_an_unbalanced_mean_torque_is_reported(text: str, mean: str, words: str) -> None:
    """Check warnings about mean torques of machines on an engine and on a compressor."""
    machines = [{"name": "motor", "mean_torque": mean}]
    if text == "engine":
        problem = problem_of(machines)
    else:
        tables = tomllib.loads((PROBLEMS / "compressor-two-stage.toml").read_text())
        problem = load_tables({**tables, "electric_machines": machines}, Path("compressor.toml"))
    doubts = [str(warning) for warning in problem.plausibility_warnings if "electric machines" in str(warning)]
    assert len(doubts) == bool(words)
    assert all(words in doubt for doubt in doubts)
