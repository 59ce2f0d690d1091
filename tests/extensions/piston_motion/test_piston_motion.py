"""Motion of pistons: closed forms, geometry by intersections with finite differences, reversals, files, results."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import laufruhe
import ready
from laufruhe.errors import InputError
from laufruhe.extensions.bearing_loads.channels import SIDE_FORCE
from laufruhe.extensions.piston_motion.channels import reversals_at
from laufruhe.extensions.piston_motion.motion import piston_motion
from laufruhe.extensions.piston_motion.section import SECTION
from laufruhe.machine import SliderCrank
from laufruhe.prove.certificate import Proof
from laufruhe.report.json_result import as_json
from laufruhe.report.tables import number_tables
from problem_files import PROBLEMS

SPEED = 300.0
SAMPLES = 14400
SINGLE: dict[str, Any] = {
    "title": "Single",
    "engine": {
        "layout": "inline", "cycle": "two-stroke", "stroke": "80 mm", "rod_length": "130 mm",
        "reciprocating_mass": "0.5 kg", "throws": [0],
    },
    "operating_points": [{"speed": "3000 rpm"}],
}  # fmt: skip


def file(**changes: Any) -> dict[str, Any]:
    """Return the tables of the single with changes of [engine] and further tables."""
    engine = {key: changes.pop(key) for key in list(changes) if key in ("offset", "rod_length", "drive", "throws")}
    return {**SINGLE, "engine": {**SINGLE["engine"], **engine}, **changes}


def slider_crank(rod_ratio: float, offset_ratio: float = 0.0) -> SliderCrank:
    rod = math.inf if rod_ratio == 0.0 else 0.04 / rod_ratio
    return SliderCrank("one", 0.0, 0.04, rod, 0.5, offset=0.0 if rod_ratio == 0.0 else offset_ratio * rod)


def test_scotch_yoke_is_a_sine() -> None:
    motion = piston_motion(slider_crank(0.0), SPEED)
    assert motion.stroke == pytest.approx(0.08, rel=1e-14)
    assert motion.mean_speed == pytest.approx(2.0 * 0.08 * SPEED / math.tau, rel=1e-14)
    assert motion.speed.value == pytest.approx(0.04 * SPEED, rel=1e-12)
    assert motion.towards_crank.value == pytest.approx(0.04 * SPEED**2, rel=1e-12)
    assert motion.from_crank.value == pytest.approx(0.04 * SPEED**2, rel=1e-12)
    assert motion.from_crank.angle == pytest.approx(math.pi, abs=1e-9)


@pytest.mark.parametrize("rod_ratio", [0.1, 0.2, 0.24])
def test_dead_centres_of_a_slider_crank(rod_ratio: float) -> None:
    motion = piston_motion(slider_crank(rod_ratio), SPEED)
    assert motion.towards_crank.value == pytest.approx(0.04 * SPEED**2 * (1.0 + rod_ratio), rel=1e-11)
    assert motion.towards_crank.angle == pytest.approx(0.0, abs=1e-7)
    assert motion.from_crank.value == pytest.approx(0.04 * SPEED**2 * (1.0 - rod_ratio), rel=1e-6)


@pytest.mark.parametrize("rod_ratio", [0.02, 0.1, 0.25])
def test_speed_of_the_series_of_two_orders(rod_ratio: float) -> None:
    """The speed sin a + lam/2 sin 2a is largest where cos a + lam cos 2a = 0; terms of lam^3 are left out."""
    cosine = (math.sqrt(1.0 + 8.0 * rod_ratio**2) - 1.0) / (4.0 * rod_ratio)
    sine = math.sqrt(1.0 - cosine**2)
    motion = piston_motion(slider_crank(rod_ratio), 1.0)
    assert motion.speed.value == pytest.approx(0.04 * sine * (1.0 + rod_ratio * cosine), rel=rod_ratio**3 + 1e-11)
    assert motion.speed.angle % math.pi == pytest.approx(math.acos(cosine), abs=rod_ratio**2) or (
        math.tau - motion.speed.angle == pytest.approx(math.acos(cosine), abs=rod_ratio**2)
    )


@pytest.mark.parametrize(("rod_ratio", "offset_ratio"), [(0.25, 0.1), (0.4, -0.3), (0.31, 0.0)])
def test_geometry_and_finite_differences(rod_ratio: float, offset_ratio: float) -> None:
    """The piston pin is where a circle about the crank pin meets its path; derivatives are central differences."""
    part = slider_crank(rod_ratio, offset_ratio)
    step = math.tau / 7200
    pin = part.crank_radius * np.exp(1j * step * np.arange(7200))
    place = pin.real + np.sqrt(part.rod_length**2 - (pin.imag - part.offset) ** 2)
    velocity = (np.roll(place, -1) - np.roll(place, 1)) / (2 * step) * SPEED
    acceleration = (np.roll(place, -1) - 2 * place + np.roll(place, 1)) / step**2 * SPEED**2
    motion = piston_motion(part, SPEED)
    assert motion.stroke == pytest.approx(np.ptp(place), rel=1e-6)
    assert motion.mean_speed == pytest.approx(np.abs(velocity).mean(), rel=1e-5)
    assert motion.speed.value == pytest.approx(np.abs(velocity).max(), rel=1e-5)
    assert motion.towards_crank.value == pytest.approx(-acceleration.min(), rel=1e-5)
    assert motion.from_crank.value == pytest.approx(acceleration.max(), rel=1e-5)
    assert motion.rod_angle is not None
    assert motion.rod_angle.value == pytest.approx(math.asin(rod_ratio + abs(offset_ratio)), rel=1e-10)


@pytest.mark.parametrize("name", ["radial-seven", "shaper", "deltic-nine", "vee-two-90"])
def test_every_mechanism_moves_as_its_travel_does(name: str) -> None:
    engine = laufruhe.load(PROBLEMS / f"{name}.toml").engine
    for part in engine.slider_cranks:
        alpha = math.tau * np.arange(3600) / 3600
        travel = part.travel(np, alpha)
        fast = SPEED * abs(part.shaft.ratio)
        motion = piston_motion(part, SPEED)
        assert motion.stroke == pytest.approx(np.ptp(travel), rel=1e-5)
        assert motion.speed.value == pytest.approx(np.abs(np.gradient(travel, alpha)).max() * fast, rel=1e-4)
        second = (np.roll(travel, -1) - 2 * travel + np.roll(travel, 1)) / alpha[1] ** 2 * fast**2
        assert motion.acceleration == pytest.approx(np.abs(second).max(), rel=1e-4)


def test_reversals_without_gas_are_closed_forms() -> None:
    design = laufruhe.evaluate(file()).designs["initial"]
    (found,) = reversals_at(design.engine, design.loads[0])
    (part,), speed = design.engine.slider_cranks, design.loads[0].point.speed
    # at the dead centres, and where the acceleration changes its sign
    top, out, bottom, back = found
    size = part.reciprocating_mass * part.crank_radius * speed**3 * part.rod_ratio
    assert [top.angle, bottom.angle] == pytest.approx([0.0, math.pi], abs=1e-7)
    assert [top.value, bottom.value] == pytest.approx(
        [size * (1 + part.rod_ratio), size * (1 - part.rod_ratio)], rel=1e-8
    )
    assert out.angle == pytest.approx(math.tau - back.angle, abs=1e-6)
    assert part.motion(np, np.array([out.angle])).points[0][1][2] == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize("name", ["single-piston-slap", "car-four-willans", "radial-seven"])
def test_reversals_are_those_of_fine_samples(name: str) -> None:
    problem = laufruhe.load(PROBLEMS / f"{name}.toml")
    design = laufruhe.evaluate(problem).designs["initial"]
    loads = design.loads[0]
    force = SIDE_FORCE.signal(loads)
    # no reversal is at a step
    angles = force.period * (np.arange(SAMPLES) + 0.3) / SAMPLES
    values = force.values(angles)[..., 0]
    for k, reversals in enumerate(reversals_at(design.engine, loads)):
        one = values[:, k]
        places = np.flatnonzero(one * np.roll(one, -1) < 0.0)
        # on both sides of a reversal, where a jump of pressure may be
        sides = [np.abs(one - np.roll(one, 1))[(places + shift) % SAMPLES] for shift in (0, 2)]
        rates = np.max(sides, axis=0) / (force.period / SAMPLES) * loads.point.speed
        assert len(reversals) == len(places) > 3
        assert sorted(each.value for each in reversals) == pytest.approx(sorted(rates), rel=0.02)


def test_an_offset_is_decided_and_no_scan_is_better() -> None:
    tables = file(
        offset={"between": ["-15 mm", "15 mm"], "start": "2 mm"}, objective={"minimise": "piston acceleration"}
    )
    result = laufruhe.solve(tables)
    assert result.certificate is not None
    assert result.certificate.kind in (Proof.LOCAL, Proof.NONE)
    assert result.objective is not None
    for offset in np.linspace(-0.015, 0.015, 9):
        (part,) = laufruhe.load(file(offset=f"{offset} m")).engine.slider_cranks
        assert piston_motion(part, math.pi * 100.0).acceleration >= result.objective.value * (1 - 1e-9)


def test_a_limit_on_the_rod_angle_has_its_closed_form() -> None:
    result = laufruhe.evaluate(file(rod_length="160 mm", constraints=[{"limit": "rod angle", "max": "15 deg"}]))
    assert result["rod angle"] == pytest.approx(math.asin(0.25), rel=1e-9)
    (limit,) = result.limits
    assert (limit.limit, limit.active) == (pytest.approx(math.radians(15.0)), False)


def test_the_shortest_rod_under_a_limit_has_its_closed_form() -> None:
    tables = file(
        rod_length={"between": ["100 mm", "260 mm"], "start": "220 mm"}, objective={"minimise": "rod length"},
        constraints=[{"limit": "piston acceleration", "max": "5000 m/s^2"}],
    )  # fmt: skip
    result = laufruhe.solve(tables)
    radius, speed = 0.04, 100.0 * math.pi
    # r w^2 (1 + r / l) = 5000 m/s^2
    assert result.objective is not None
    assert result.objective.value == pytest.approx(radius / (5000.0 / (radius * speed**2) - 1.0), rel=1e-5)
    assert result["piston acceleration"] <= 5000.0 * (1 + 1e-9)


def test_a_limit_that_no_throw_moves_keeps_the_proof() -> None:
    text = (PROBLEMS / "inline-five-open.toml").read_text(encoding="utf-8")
    limited = text + '\n[[constraints]]\nlimit = "piston speed"\nmax = "100 m/s"\n'
    before, after = ready.solved("inline-five-open"), laufruhe.solve(limited)
    assert after.certificate is not None
    assert before.certificate is not None
    assert after.certificate.kind is before.certificate.kind is Proof.GLOBAL
    assert after.objective is not None
    assert before.objective is not None
    assert after.objective.value == pytest.approx(before.objective.value, rel=1e-6)


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        (file(objective={"minimise": "piston speeds"}), "is no quantity; did you mean 'piston speed'?"),
        (file(objective={"minimise": "maximum piston speed"}), "is no quantity; did you mean"),
        (file(objective={"minimise": "engine.rod_length"}), "is no quantity; did you mean 'rod length'?"),
        (file(objective={"minimise": "offset"}), "is a number of the file, and no quantity; limit it by its bounds"),
        (file(constraints=[{"limit": "piston speed", "min": "2 m/s"}]), "cannot stand beside piston speed"),
        (file(constraints=[{"limit": "rod angle", "max": "2 m"}]), "is not a unit of an angle"),
        (
            file(constraints=[{"limit": "piston speed", "max": "9 m/s", "cylinders": ["2"]}]),
            "is no cylinder here",
        ),
        (file(constraints=[{"limit": "side-force reversal rate", "max": "1 N"}]), "is not a unit of a rate of force"),
    ],
)  # fmt: skip
def test_complaints(tables: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=".*".join(said.split("'"))):
        laufruhe.load(tables)


@pytest.mark.parametrize(("name", "quantity", "said"), [
    ("rotary-two", "piston speed", "needs pistons"), ("shaper", "rod angle", "needs connecting rods"),
])  # fmt: skip
def test_engines_without_pistons_or_rods(name: str, quantity: str, said: str) -> None:
    text = (PROBLEMS / f"{name}.toml").read_text(encoding="utf-8")
    with pytest.raises(InputError, match=said):
        laufruhe.load(text + f'\n[[constraints]]\nlimit = "{quantity}"\nmax = 1\n')


def test_report_and_record() -> None:
    result = ready.solved("single-piston-slap")
    record = json.loads(as_json(result))["piston_motion"]["cylinder 1"][0]
    assert max(one["rate"] for one in record["side_force_reversals"]) == pytest.approx(
        result.objective.value, rel=1e-12
    )
    rows = number_tables(result)["side-force-reversals"].rows
    assert [(math.radians(angle), rate) for _, _, angle, rate in rows] == [
        pytest.approx((one["angle"], one["rate"])) for one in record["side_force_reversals"]
    ]
    (table,) = SECTION.tables(result)
    assert table.rows[0][:3] == ("3000 rpm", "1", "80.00")
    shown = float(table.rows[0][-1].split(" at ")[0])
    assert shown == pytest.approx(1e-3 * result.objective.value, rel=1e-3)
    assert record["stroke"] == pytest.approx(0.08, rel=1e-12)
    assert record["towards_crank"]["value"] == pytest.approx(result["piston acceleration"], rel=1e-12)


def test_the_table_has_no_column_without_a_value() -> None:
    """The side force of a rhombic drive is not computed."""
    heads = {name: SECTION.tables(laufruhe.evaluate(name))[0] for name in ("rhombic-stirling", "single-piston-slap")}
    slap, rhombic = heads["single-piston-slap"], heads["rhombic-stirling"]
    assert "reversals" in slap.head
    assert "Reversals" in slap.note
    assert rhombic.head == slap.head[: len(rhombic.head)]
    assert "reversals" not in rhombic.head
    assert "Reversals" not in rhombic.note
    assert all(len(row) == len(rhombic.head) for row in rhombic.rows)


def test_speed_scales_the_motion() -> None:
    part = replace(slider_crank(0.3), offset=0.004)
    slow, fast = piston_motion(part, 100.0), piston_motion(part, 300.0)
    assert (fast.speed.value, fast.acceleration) == pytest.approx((3 * slow.speed.value, 9 * slow.acceleration))
    assert fast.rod_angle == slow.rod_angle
