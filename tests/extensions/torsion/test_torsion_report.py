"""Tables, files and pictures of the crankshaft's twist, compared with the physics."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from laufruhe.extensions.torsion import modes_picture
from laufruhe.extensions.torsion.facts import facts_of, speed_range, torque_over_speed
from laufruhe.extensions.torsion.modes_picture import COLOURS
from laufruhe.extensions.torsion.physics import chain_of, natural_modes, shaft_torque, vector_sums
from laufruhe.plots import names
from laufruhe.problem.evaluation import evaluate
from laufruhe.report.json_result import as_dict
from laufruhe.report.sections import tables_of
from laufruhe.solvers.result import Result
from plots.test_every_picture import SEEN, lab
from ready import initial_tables, solved


@pytest.fixture(scope="module")
def result() -> Result:
    return solved("inline-five-torsion")


@pytest.fixture(scope="module")
def record(result: Result) -> dict:
    return as_dict(result)


def test_modes_and_critical_speeds(result: Result, record: dict) -> None:
    found, engine = record["torsion"], result.final.engine
    modes = natural_modes(chain_of(engine))
    assert found["frequencies"] == pytest.approx(modes.frequencies)
    assert np.array(found["shapes"]) == pytest.approx(modes.shapes.T)
    assert np.array(found["vector_sums"]) == pytest.approx(vector_sums(engine, found["orders"], modes))
    assert found["main_orders"] == [2.5, 5.0, 7.5, 10.0]
    low, high = found["speeds"]
    expected = {
        (order, m + 1): math.tau * f / order for m, f in enumerate(modes.frequencies) for order in found["orders"]
    }
    inside = {key: speed for key, speed in expected.items() if low <= speed <= high}
    assert {(each["order"], each["mode"]): each["speed"] for each in found["critical_speeds"]} == pytest.approx(inside)
    torques = [each["torque"] for each in found["critical_speeds"]]
    assert torques == sorted(torques, reverse=True)
    # the strongest one is what the response has in that order there
    first = found["critical_speeds"][0]
    there = shaft_torque(engine, replace(result.problem.points[1], speed=first["speed"]))
    assert np.abs(there.at(first["order"])).max() == pytest.approx(first["torque"], rel=1e-9)


def test_barred_ranges_end_where_the_limit_is_reached(result: Result, record: dict) -> None:
    limit = next(limit for limit in result.problem.limits if limit.name == "stress")
    barred = record["torsion"]["barred"]
    assert len(barred) > 1

    def stress(speed: float) -> float:
        points = tuple(replace(point, speed=speed) for point in result.problem.points)
        problem = replace(result.problem, points=points, phasing=None, engine=result.final.engine)
        return evaluate(problem).value(limit.measure)

    for each in barred:
        assert stress(0.5 * (each["lowest"] + each["highest"])) > limit.maximum
    inner = barred[0]
    for edge, way in ((inner["lowest"], -1.0), (inner["highest"], 1.0)):
        assert stress(edge + 0.1 * way) < limit.maximum < stress(edge - 0.1 * way)
    # the operating points themselves stand outside
    speeds = [point.speed for point in result.problem.points]
    assert not any(each["lowest"] <= speed <= each["highest"] for each in barred for speed in speeds)


def test_torque_over_speed_is_that_of_the_points(result: Result) -> None:
    point = result.problem.points[0]
    (row,) = torque_over_speed(result.final, np.array([point.speed]))
    values = shaft_torque(result.final.engine, point).sample(result.final.samples)
    assert row == pytest.approx(0.5 * np.ptp(values, axis=0))


def test_places_and_tables(result: Result, record: dict) -> None:
    names = [each["name"] for each in record["shaft_torque"]]
    assert names == [section.name for section in chain_of(result.final.engine).sections]
    assert record["shaft_stress"][1]["max"] == pytest.approx(
        record["shaft_torque"][1]["max"] * 16.0 / (math.pi * 0.048**3), rel=1e-9
    )
    grids = {grid.title: grid for grid in tables_of(result)}
    assert {
        "Natural modes of the crankshaft",
        "Critical speeds of the crankshaft, final design",
        "Barred speed ranges",
    } <= set(grids)
    stress = grids["Shear stress of the crankshaft [N/mm²]"]
    assert float(stress.rows[0][-1]) < 100.0
    assert "2.5, 5, 7.5, 10" in grids["Critical speeds of the crankshaft, final design"].note


def test_pictures(result: Result) -> None:
    assert {"twist_modes", "twist_response"} <= set(names(result))


def test_dots_of_a_picture_are_critical_speeds_on_the_lines_of_their_orders(result: Result) -> None:
    speeds = modes_picture.figure(result).axes[1]
    dots = [line.get_xydata()[0] for line in speeds.lines if line.get_marker() == "o"]
    facts = facts_of(result.final, *speed_range(result))
    expected = [
        (60.0 * frequency / order, frequency)
        for frequency in facts.modes.frequencies[:3] for order in facts.orders
        if math.tau * frequency / order <= speed_range(result)[1]
    ]  # fmt: skip
    assert np.array(sorted(map(tuple, dots))) == pytest.approx(np.array(sorted(expected)))


@pytest.mark.slow
def test_files_of_numbers_hold_what_is_drawn() -> None:
    result, found = initial_tables("inline-five-torsion")
    assert {"crankshaft-modes", "strongest-critical-speeds-initial"} <= set(found)
    # at every speed of the curve the torque is that of the operating point, were it there
    sheet = found["twist-response"]
    chain = chain_of(result.final.engine)
    assert sheet.head[1:] == [f"initial: alternating torque in {section.name} [N m]" for section in chain.sections]
    speeds, torque = np.array(sheet.rows)[:, 0], np.array(sheet.rows)[:, 1:]
    k = len(speeds) // 2
    point = replace(result.problem.points[0], speed=float(speeds[k]) * math.tau / 60.0)
    signal = shaft_torque(result.final.engine, point, result.problem.fidelity).sample(2880)
    assert torque[k] == pytest.approx(0.5 * np.ptp(signal, axis=0), rel=2e-3)
    modes = found["twist-modes"].rows
    assert len(modes) == len(chain.discs) * len({row[1] for row in modes})
    assert max(abs(row[4]) for row in modes) == pytest.approx(1.0)
    assert len(found["critical-speeds"].rows) > len(found["strongest-critical-speeds-initial"].rows)


@pytest.mark.parametrize("eye", SEEN)
def test_colours_of_modes_differ(eye: str) -> None:
    shown = [lab(colour, eye) for colour in COLOURS]
    assert min(float(np.linalg.norm(a - b)) for a, b in combinations(shown, 2)) > 12.0
