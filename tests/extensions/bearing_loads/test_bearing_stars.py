"""Stars and firing orders under loads inside the crankcase, compared with each one solved by itself."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import laufruhe
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.families import families_of
from problem_files import PROBLEMS

THREE = tables_of(PROBLEMS / "tractor-three-bearings.toml")
LEFT_OUT = ("constraints", "counterweights", "main_bearings", "engine", "objective")
Tables = Mapping[str, Any]
OPEN: Tables = {"mass": {"between": ["0 kg", "3 kg"]}}


def tables(count: int, objective: Tables, web: Tables | None = None, **changes: Any) -> dict[str, Any]:
    """Return an engine in line with bearings beside every throw; a key of `changes` that is None is dropped."""
    half = 62.5 * count
    engine = {key: value for key, value in THREE["engine"].items() if key != "firing_order"}
    whole = {key: value for key, value in THREE.items() if key not in LEFT_OUT}
    whole |= {
        "engine": engine | {"throws": "open", "cylinders": count} | changes.pop("engine", {}),
        "objective": objective,
    }
    whole["fidelity"] = {"samples": 96}
    whole["main_bearings"] = [
        {"x": f"{half - 125 * k} mm", "diameter": "80 mm", "width": "32 mm", "friction": 0.01} for k in range(count + 1)
    ]
    if web is not None:
        whole["counterweights"] = [
            {
                "name": f"web {k + 1}",
                "x": f"{half - 125 * k - 30} mm",
                "opposite_throw": k + 1,
                "radius": "75 mm",
                **web,
            }
            for k in range(count)
        ]
    return {key: value for key, value in (whole | changes).items() if value is not None}


def problem_of(whole: Tables) -> Problem:
    return load_tables(dict(whole), Path("bearings.toml"))


def one_by_one(whole: Tables) -> dict[tuple[int, ...], Result]:
    """Return the result of every firing order with the throws that it makes even."""
    count = whole["engine"]["cylinders"]
    engine = {key: value for key, value in whole["engine"].items() if key not in ("throws", "cylinders")}
    orders = [(1, *rest) for rest in itertools.permutations(range(2, count + 1))]
    return {
        order: laufruhe.solve(problem_of({**whole, "engine": {**engine, "firing_order": list(order)}}))
        for order in orders
    }


def value_of(result: Result) -> float:
    return result.objective.value if result.status in (Status.OPTIMAL, Status.FEASIBLE) else float("inf")


def bearing(norm: str, **keys: Any) -> dict[str, Any]:
    return {"minimise": f"{norm} main-bearing force", **keys}


POINTS = [{"name": "rated", "speed": "2500 rpm"}, {"name": "over", "speed": "3200 rpm", "gas": False, "weight": 0.3}]
CASES = {
    "mean, webs open": tables(4, bearing("mean"), OPEN),
    "webs and angles open, three": tables(3, bearing("mean"), {**OPEN, "angle": {"between": [-90, 90]}}),
    "largest of one bearing": tables(4, bearing("maximum", bearings=["3"]), OPEN),
    "rms, fixed webs": tables(5, bearing("rms"), {"mass": "1.5 kg"}),
    "friction": tables(4, {"minimise": "mean friction power"}),
    "as a beam": tables(4, bearing("mean"), {"mass": "1 kg"}, fidelity={"samples": 96, "crankshaft": "beam"}),
    "two-stroke": tables(4, bearing("mean"), OPEN, engine={"cycle": "two-stroke"}),
    "without gas": tables(4, bearing("mean"), OPEN, gas=None),
    "two points": tables(4, bearing("mean"), OPEN, operating_points=POINTS),
    "mounts under a limit of bearings": tables(
        3, {"minimise": "mean mount force"}, OPEN, constraints=[{"limit": "mean main-bearing force", "max": "6300 N"}]
    ),
    "pressure beside mass": tables(
        3,
        {"minimise": "counterweight mass"},
        OPEN,
        constraints=[{"limit": "mean main-bearing pressure", "max": "24 bar"}],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_best_order_is_that_of_all_solved_one_by_one(name: str) -> None:
    """Compare the best order and the bound with every firing order solved by itself."""
    whole = {**CASES[name], "tolerance": 1e-3}
    result = laufruhe.solve(problem_of(whole))
    # at as many angles as the search found necessary, the gas at those of the file
    found = result.problem.fidelity
    samples = {"samples": found.samples, "gas_samples": found.gas_steps}
    every = one_by_one({**whole, "fidelity": {**whole["fidelity"], **samples}})
    values = {order: value_of(each) for order, each in every.items()}
    minimum = min(values.values())
    assert result.status in (Status.OPTIMAL, Status.FEASIBLE)
    assert result.certificate.kind in (Proof.GLOBAL, Proof.WITHIN_GAP)
    assert result.objective.value == pytest.approx(minimum, rel=3e-4)
    assert result.certificate.lower_bound <= minimum * (1.0 + 1e-6)
    # limits are counted at few angles here
    assert result.certificate.lower_bound >= minimum * (1.0 - (5e-2 if "constraints" in whole else 5e-3))
    best = result.phasing.ranking[0].firing_orders[0].order
    assert values[best] == pytest.approx(result.objective.value, rel=1e-4)
    # orders differ, so that the choice means something
    assert max(values.values()) > 1.004 * minimum


@pytest.mark.slow
def test_a_ranking_lists_orders_by_what_each_is_worth() -> None:
    whole = tables(4, {"minimise": "mean friction power"}, {"mass": "1 kg"}, phasing={"best": 6})
    ranking = laufruhe.solve(problem_of(whole)).phasing.ranking
    values = {order: value_of(each) for order, each in one_by_one(whole).items()}
    assert [star.value for star in ranking] == sorted(star.value for star in ranking)
    for star in ranking:
        assert len(star.firing_orders) == 1
        assert star.value == pytest.approx(values[star.firing_orders[0].order], rel=1e-3)


def test_throws_given_and_their_firing_order_open() -> None:
    """Check that both orders of a flat crank are solved, because their bearing loads differ."""
    crank = {"throws": [0, 180, 0, 180], "firing_order": "open", "cylinders": None}
    whole = tables(4, bearing("mean"), {"mass": "1 kg"})
    whole["engine"] = {key: value for key, value in (whole["engine"] | crank).items() if value is not None}
    result = laufruhe.solve(problem_of(whole))
    given = {order: value_of(each) for order, each in one_by_one(tables(4, bearing("mean"), {"mass": "1 kg"})).items()}
    flat = [value for order, value in given.items() if {order[0], order[2]} == {1, 3}]
    assert result.objective.value == pytest.approx(min(flat), rel=1e-6)


VEE = {"layout": "vee", "bank_angle": 60, "split_pin_angle": 60}
BETWEEN = [{"x": f"{x} mm"} for x in (190, 60, -60, -190)]


@pytest.mark.slow
def test_two_rods_on_a_pin_are_decided_order_by_order() -> None:
    """Compare with all firing orders of all even stars, each solved by itself."""
    one_bearing = bearing("mean", bearings=["2"])
    whole = tables(6, one_bearing, engine=VEE, main_bearings=BETWEEN, phasing={"best": 4})
    result = laufruhe.solve(problem_of(whole))
    assert result.certificate.kind is Proof.GLOBAL
    given = {key: value for key, value in whole["engine"].items() if key != "cylinders"}
    without = {key: value for key, value in whole.items() if key != "phasing"}
    values = {}
    for star in result.phasing.ranking:
        throws = [math.degrees(angle) for angle in star.throws]
        assert star.order_count == 4
        for order in star.firing_orders:
            fired = {**given, "throws": throws, "firing_order": list(order.order)}
            # at as many angles as the whole was told at
            one = laufruhe.solve(problem_of({**without, "engine": fired}).at(result.problem.fidelity))
            values[order.order] = one.final.value(one.problem.objective[0].measure)
    assert len(values) == 8
    assert result.objective.value == pytest.approx(min(values.values()), rel=1e-9)
    assert values[result.phasing.ranking[0].firing_orders[0].order] == pytest.approx(min(values.values()), rel=1e-9)
    assert max(values.values()) > 1.001 * min(values.values())


def test_without_gas_two_rods_on_a_pin_are_decided() -> None:
    """Check that inertia alone makes banks with shared throws stars like any other."""
    whole = tables(6, bearing("mean"), engine=VEE, gas=None, main_bearings=BETWEEN)
    result = laufruhe.solve(problem_of(whole))
    assert result.certificate.kind is Proof.GLOBAL
    for star in result.phasing.ranking:
        given = {key: value for key, value in whole["engine"].items() if key != "cylinders"}
        throws = [math.degrees(angle) for angle in star.throws]
        one = laufruhe.solve(problem_of({**whole, "engine": {**given, "throws": throws}}))
        assert one.final.value(one.problem.objective[0].measure) == pytest.approx(star.value, rel=1e-6)


def test_stress_rows_across_throws_are_those_of_the_exact_model() -> None:
    """Check the torque that a journal takes from the throws before it."""
    gear = {"webs": {"thickness": "25 mm", "width": "110 mm"}}
    whole = tables(4, {"minimise": "rms journal stress"}, running_gear=gear,
                   engine={"big_end": {"diameter": "70 mm", "width": "30 mm"}})  # fmt: skip
    phasing = problem_of(whole).phasing
    family = families_of(phasing, True)[0][0]
    model = family.model(phasing)
    rows = model.at(model.samples)
    for star in family.stars:
        order = tuple(map(int, star))
        star_problem = phasing.problem_of(family.candidate(phasing, order))
        term = rows.at(order).terms[0][1]
        exact = evaluate(star_problem).value(star_problem.objective[0].measure)
        assert term.norm.value(term.grid, term.constant) == pytest.approx(exact, rel=1e-9)
