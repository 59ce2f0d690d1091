"""Degree of irregularity over firing orders and stars, compared with brute force."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import laufruhe
from laufruhe.files.reader import load_tables
from laufruhe.machine.firing import lap_orders
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Result, Status
from one_cylinder import irregularity

THROWS = [0, 50, 130, 180, 265]
WIDE = {"intervals": {"min": "5 deg", "max": "400 deg"}}
LEAST = {"minimise": "degree of irregularity"}


def problem_of(engine: dict[str, Any] | None = None, **more: Any) -> Problem:
    whole = {
        "title": "Five throws",
        "engine": {
            "layout": "inline", "cycle": "four-stroke", "bore": "85 mm", "stroke": "90 mm", "rod_ratio": 0.28,
            "reciprocating_mass": "0.6 kg", "rotating_mass": "0.5 kg", "cylinder_spacing": "100 mm",
            **(engine or {"throws": THROWS, "firing_order": "open"}),
        },
        "operating_points": [{"name": "slow", "speed": "1200 rpm"}, {"name": "fast", "speed": "3500 rpm"}],
        "gas": {"model": "seiliger", "peak_pressure": "60 bar", "imep": "8 bar"},
        "flywheel": {"inertia": "0.3 kg m^2"}, "fidelity": {"samples": 240}, "objective": LEAST,
    }  # fmt: skip
    return load_tables({**whole, **more}, Path("five.toml"))


def by_order(problem: Problem) -> dict[tuple[int, ...], float]:
    """Return the degree of irregularity of every firing order, each engine built anew."""
    phasing = problem.phasing
    layout = phasing.layout(None, None)
    found = {}
    for order in lap_orders(phasing.cycle, layout, phasing.throws):
        engine = problem_of({"throws": THROWS, "firing_order": list(order)}).engine
        found[order] = max(irregularity(engine, point, 0.3, problem.fidelity) for point in problem.points)
    return found


@pytest.fixture(scope="module")
def uneven() -> tuple[Problem, Result, dict[tuple[int, ...], float]]:
    problem = problem_of(phasing=WIDE)
    return problem, laufruhe.solve(problem), by_order(problem)


def test_the_best_firing_order_is_that_of_all_of_them(uneven: Any) -> None:
    _, result, every = uneven
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value == pytest.approx(min(every.values()), rel=1e-9)
    assert result.certificate.lower_bound <= min(every.values()) * (1.0 + 1e-12)
    assert every[result.phasing.ranking[0].firing_orders[0].order] == pytest.approx(min(every.values()), rel=1e-9)
    assert max(every.values()) > 2.0 * min(every.values())


def test_a_limit_takes_orders_away(uneven: Any) -> None:
    """Check that only orders within the limit remain, of which the torque chooses; below the least, none."""
    _, _, every = uneven
    values = sorted(every.values())
    limit = 0.5 * (values[1] + values[2])
    limit_table = {"limit": "degree of irregularity", "max": f"{limit:.6f}"}
    found = laufruhe.solve(
        problem_of(phasing=WIDE, constraints=[limit_table], objective={"minimise": "rms crank torque"})
    )
    assert found.status is Status.OPTIMAL
    feasible = [order for order, value in every.items() if value <= limit]
    assert found.phasing.ranking[0].firing_orders[0].order in feasible
    torques = {
        order: evaluate(one).value(one.objective[0].measure)
        for order in feasible
        for one in [
            problem_of({"throws": THROWS, "firing_order": list(order)}, objective={"minimise": "rms crank torque"})
        ]
    }
    assert found.objective.value == pytest.approx(min(torques.values()), rel=1e-9)
    none = laufruhe.solve(
        problem_of(phasing=WIDE, constraints=[{**limit_table, "max": f"{0.9 * values[0]:.6f}"}],
                   objective={"minimise": "rms crank torque"})
    )  # fmt: skip
    assert none.status is Status.INFEASIBLE


def test_stars_that_fire_evenly_turn_alike() -> None:
    """Check that the couple decides among stars of equal degree, with the degree in the sum or limited."""
    opened = {"throws": "open", "firing_order": "open", "cylinders": 5}
    orders = ([1, 2, 4, 5, 3], [1, 5, 2, 3, 4], [1, 3, 5, 2, 4])
    engines = [problem_of({"firing_order": order, "cylinders": 5}).engine for order in orders]
    point = problem_of().points[0]
    degrees = [irregularity(engine, point, 0.3) for engine in engines]
    assert degrees == pytest.approx([degrees[0]] * 3, rel=1e-11)
    alone = laufruhe.solve(problem_of(opened))
    assert alone.certificate.kind is Proof.GLOBAL
    couple = {"quantity": "rms rocking couple", "weight": 1e-3}
    terms = {"terms": [couple, {"quantity": "degree of irregularity"}]}
    both = laufruhe.solve(problem_of(opened, objective=terms))
    plain = laufruhe.solve(problem_of(opened, objective={"terms": [couple]}))
    assert both.certificate.kind is Proof.GLOBAL
    assert both.objective.value == pytest.approx(plain.objective.value + alone.objective.value, rel=1e-9)
    assert both.certificate.lower_bound >= both.objective.value * (1.0 - 1e-4)
    limit = {"limit": "degree of irregularity", "max": f"{1.01 * alone.objective.value:.6f}"}
    limited = laufruhe.solve(problem_of(opened, objective={"terms": [couple]}, constraints=[limit]))
    assert limited.objective.value == pytest.approx(plain.objective.value)
    assert limited.limits[0].value == pytest.approx(alone.objective.value)
    broken = laufruhe.solve(problem_of(opened, constraints=[{**limit, "max": "0.0001"}]))
    assert broken.status is Status.INFEASIBLE
    assert "the degree of irregularity is equal for all even stars" in broken.message


@pytest.mark.slow
def test_a_number_of_the_wheel_alone_is_the_same_for_uneven_throws() -> None:
    """Check that throws change the torque, not the flywheel, without mounts."""
    rim = {"mean_diameter": "300 mm", "width": "60 mm", "height": "40 mm"}
    problem = problem_of(
        {
            "layout": "vee", "cycle": "two-stroke", "cylinders": 4, "bank_angle": 60, "split_pin_angle": 20,
            "throws": "open",
        },
        phasing={"intervals": {"largest_deviation": "20 deg"}}, flywheel={"rim": rim},
        objective={"minimise": "flywheel mass"}, search={"boxes": 10},
    )  # fmt: skip
    result = laufruhe.solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value == pytest.approx(result.objective.initial, rel=1e-12)
    assert result.certificate.lower_bound == pytest.approx(result.objective.value, rel=1e-3)
