"""Holes that correct an unbalance: brute force, properties, physics, and a bound that is broken on purpose."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest

from extensions.balancing.plain_corrections import holes_clash, mismatches, random_file
from laufruhe.errors import BoundError
from laufruhe.extensions.balancing import search
from laufruhe.extensions.balancing.file import Correction, CorrectionFile, correction_of
from laufruhe.extensions.balancing.physics import Dial, Drilling, plane_shares
from laufruhe.extensions.balancing.report import Balanced, decide
from laufruhe.machine.rotor import permitted_unbalance

Tables = dict[str, Any]
STEEL = 7840.0
# some of the 200 random files of `plain_corrections`: all kinds of holes, slugs and sectors, and every number of holes
SEEDS = (0, 4, 5, 13, 22, 37, 42, 55)


def read(tables: Tables) -> Correction:
    return correction_of(CorrectionFile.model_validate(tables).correction, 1e-4)


def answer(tables: Tables) -> Balanced:
    return decide(read(tables))


@pytest.mark.parametrize("seed", SEEDS)
def test_brute_force_finds_the_same_optimum(seed: int) -> None:
    assert mismatches(seed) == []


def test_a_broken_bound_of_sets_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = search.set_bounds
    monkeypatch.setattr(search, "set_bounds", lambda *args: usual(*args) + 1e-3)
    with pytest.raises(BoundError, match="sets of places"):
        answer(random_file(13))
    monkeypatch.delenv("LAUFRUHE_STRICT")
    # without that setting the design stays, and is not called proven
    broken = answer(random_file(13))
    assert not any(plane.is_least for plane in broken.planes)


def test_brute_force_notices_a_search_that_leaves_out_sets(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "propose", lambda *_: None)
    assert mismatches(22) == []
    monkeypatch.setattr(search, "combinations", lambda items, count: [tuple(items)[:count]])
    assert mismatches(22) != []


def turned(tables: Tables, by: float) -> Tables:
    tables = copy.deepcopy(tables)
    sense = 1.0 if tables["correction"]["machine_counts"] == "with rotation" else -1.0
    for plane in tables["correction"]["planes"]:
        plane["measured"]["angle"] += sense * by
        for key in ("allowed", "solid"):
            plane[key] = [[one + by for one in sector] for sector in plane.get(key, [])]
        if "angles" in plane:
            plane["angles"] = [one + by for one in plane["angles"]]
        else:
            plane["first_place"] += by
    return tables


def holes(result: Balanced) -> list[tuple[str, float, float, bool]]:
    return [(plane.name, hole.diameter, hole.depth, hole.filled) for plane, _, hole in result.holes]


@pytest.mark.parametrize("seed", SEEDS[:4])
@pytest.mark.parametrize("by", [37.25, -151.0])
def test_turned_input_gives_turned_holes(seed: int, by: float) -> None:
    tables = random_file(seed)
    first, second = answer(tables), answer(turned(tables, by))
    # the order of the list follows the readings, which are turned
    assert sorted(holes(first)) == sorted(holes(second))
    angles = [sorted((math.degrees(angle) + turn) % 360.0 for _, angle, _ in result.holes)
              for result, turn in ((first, by), (second, 0.0))]  # fmt: skip
    assert angles[0] == pytest.approx(angles[1])
    for plane, other in zip(first.planes, second.planes, strict=True):
        assert abs(plane.residual) == pytest.approx(abs(other.residual), abs=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_more_allowed_places_never_worsen(seed: int) -> None:
    tables = random_file(seed)
    wider = copy.deepcopy(tables)
    for plane in wider["correction"]["planes"]:
        plane.pop("allowed", None)
        plane.pop("solid", None)
        if "places" in plane:
            plane["places"] *= 2
        else:
            plane["angles"].append((min(plane["angles"]) - 5.5) % 360.0)
    for fewer, more, gap in zip(answer(tables).planes, answer(wider).planes, read(tables).gaps, strict=True):
        # the wider search may end earlier, with enough or with nothing left
        for count, other in zip(fewer.counts, more.counts, strict=False):
            assert other.value <= count.value + gap
            assert other.bound <= count.value
        assert more.is_met or not fewer.is_met


RADIAL = [seed for seed in range(40) if any("max_depth" in p for p in random_file(seed)["correction"]["planes"])][:6]


@pytest.mark.parametrize("seed", RADIAL)
def test_a_larger_max_depth_never_leaves_more(seed: int) -> None:
    tables = random_file(seed)
    deeper = copy.deepcopy(tables)
    for plane in deeper["correction"]["planes"]:
        plane["max_depth"] = f"{float(plane['max_depth'].split()[0]) + 5.0} mm"
    for low, high, gap in zip(answer(tables).planes, answer(deeper).planes, read(tables).gaps, strict=True):
        for count, other in zip(low.counts, high.counts, strict=False):
            assert other.value <= count.value + gap
            assert other.bound <= count.value


def cheek(direction: str, unbalance: str) -> Tables:
    """Return a crank cheek of 62 mm, its heavy spot 5 deg beside the solid sector of the pin."""
    return {
        "title": "Cheek",
        "correction": {
            "density": "7850 kg/m^3", "drills": ["8 mm", "10 mm", "12 mm", "14 mm", "16 mm"], "direction": direction,
            "point_angle": 118, "depth_step": "1 mm", "min_depth": "3 mm", "max_depth": "25 mm", "wall": "3 mm",
            "max_holes": 2, "permitted_unbalance": "120.3 g mm",
            "planes": [
                {"name": name, "measured": {"unbalance": unbalance, "angle": 35}, "radius": "62 mm", "places": 36,
                 "solid": [[-30, 30]]}
                for name in ("front", "rear")
            ],
        },
    }  # fmt: skip


def test_each_hole_keeps_its_wall_along_its_own_depth() -> None:
    """Check a hole of 8 mm, 20 mm deep at 40 deg: 3 mm from the pin, 3.70 of 42 g cm left."""
    plane = answer(cheek("radial", "42 g cm")).planes[0]
    assert len(plane.design) == 1
    assert 1e5 * abs(plane.residual) < 3.70


def test_no_hole_stands_opposite_to_another_for_a_residual_far_below_the_permitted_one() -> None:
    plane = answer(cheek("axial", "180 g cm")).planes[0]
    assert plane.is_fewest
    assert len(plane.design) == 2
    assert plane.is_met
    # the least residual, 0.30 g cm, takes 222 g cm away with holes at 40 and 260 deg
    assert 1e5 * sum(abs(plane.plane.holes[place][hole].change) for place, hole in plane.design) < 195.0
    assert plane.counts[2].value < abs(plane.residual)
    assert not plane.is_least


@pytest.mark.parametrize("seed", SEEDS)
def test_fewest_holes_never_waste_more_than_the_least_residual(seed: int) -> None:
    tables = random_file(seed)
    tables["correction"]["goal"] = "fewest holes"
    for plane in answer(tables).planes:
        least = plane.counts[len(plane.design)].design
        assert least is not None
        assert plane.plane.score(plane.design, search.WASTE) <= plane.plane.score(least, search.WASTE)
        assert not holes_clash(plane.plane, plane.design)
        assert len(plane.design) == len(least)
        assert plane.is_met or plane.design == least


def test_zero_mark_and_sense_change_readings_only() -> None:
    tables = random_file(5)
    dials = [Dial(math.radians(zero), sense) for zero, sense in ((0.0, 1.0), (40.0, 1.0), (40.0, -1.0), (-75.0, -1.0))]
    for angle in np.linspace(-7.0, 7.0, 23):
        for dial in dials:
            assert math.remainder(dial.on_crank(dial.reading(angle)) - angle, math.tau) == pytest.approx(0.0, abs=1e-12)
    # a crank angle of 70 deg is 30 deg behind a mark at 40 deg, counted with the rotation
    assert math.degrees(dials[1].reading(math.radians(70.0))) == pytest.approx(30.0)
    assert math.degrees(dials[2].reading(math.radians(70.0))) == pytest.approx(330.0)
    job = tables["correction"]
    before = read(tables)
    sense = 1.0 if job["machine_counts"] == "with rotation" else -1.0
    for plane in job["planes"]:
        on_crank = job["zero_mark"] + sense * plane["measured"]["angle"]
        plane["measured"]["angle"] = -(on_crank - 12.5)
    job |= {"zero_mark": 12.5, "machine_counts": "against rotation"}
    first, second = decide(before), answer(tables)
    assert sorted(holes(first)) == sorted(holes(second))


@pytest.mark.parametrize("goal", ["fewest holes", "least residual"])
def test_without_time_there_is_a_design_but_no_proof(monkeypatch: pytest.MonkeyPatch, goal: str) -> None:
    tables = random_file(13)
    tables["correction"]["goal"] = goal
    proven = answer(tables)
    monkeypatch.setattr("laufruhe.prove.branch_and_bound.is_time_over", lambda: True)
    for hasty, plane in zip(answer(tables).planes, proven.planes, strict=True):
        assert plane.is_least
        assert not hasty.is_fewest
        assert not hasty.is_least
        assert not holes_clash(hasty.plane, hasty.design)
        assert len(hasty.design) > 0
        assert abs(plane.residual) <= abs(hasty.residual) < abs(hasty.plane.initial)


@pytest.mark.parametrize(
    ("inches", "grams", "tip"),
    [(0.5, 9.93, 1.26), (0.625, 15.52, 2.47), (0.75, 22.35, 4.26), (0.875, 30.42, 6.77), (1.0, 39.73, 10.10)],
)
def test_masses_of_holes(inches: float, grams: float, tip: float) -> None:
    """Check 10 mm of a drill and its 118 deg tip in steel of 7.84 g/cm3 (EN24T, vintageajs.uk), by hand."""
    diameter = 25.4e-3 * inches
    flat, pointed = Drilling(STEEL), Drilling(STEEL, point_angle=math.radians(118.0))
    assert -1e3 * flat.mass(diameter, 0.01) == pytest.approx(grams, abs=0.006)
    assert -1e3 * (pointed.mass(diameter, 0.01) - flat.mass(diameter, 0.01)) == pytest.approx(tip, abs=0.006)


def test_a_slug_gains_the_difference_of_densities() -> None:
    """1 in of a 1 in slug of 17 g/cm3 in steel of 7.84 g/cm3 gains 117.9 g, computed by hand."""
    drilling = Drilling(STEEL, slug_density=17000.0)
    assert 1e3 * drilling.mass(0.0254, 0.0254, filled=True) == pytest.approx(117.9, abs=0.05)


def test_a_deep_radial_hole_acts_at_its_centre_of_mass() -> None:
    # the hole as 2000 slices, and its cone as discs
    drilling = Drilling(STEEL, is_radial=True, point_angle=math.radians(118.0))
    diameter, depth, radius = 0.02, 0.03, 0.08
    height = drilling.point_height(diameter)
    slices, cones = ((np.arange(2000) + 0.5) / 2000 * size for size in (depth, height))
    area = 0.25 * math.pi * diameter**2
    cylinder = -STEEL * area * depth * float((radius - slices).mean())
    cone = -STEEL * area * height * float(((1.0 - cones / height) ** 2 * (radius - depth - cones)).mean())
    assert drilling.unbalance(diameter, depth, radius) == pytest.approx(cylinder + cone, rel=1e-6)
    axial = Drilling(STEEL, point_angle=math.radians(118.0))
    assert axial.unbalance(diameter, depth, radius) == pytest.approx(radius * axial.mass(diameter, depth), rel=1e-12)


def test_shares_of_planes_follow_the_lever_rule() -> None:
    """The plane nearer to the centre of mass gets more, at most 70 % (ISO 21940-11, quoted by vibromera.eu)."""
    assert plane_shares((0.0, 0.4), 0.2) == pytest.approx((0.5, 0.5))
    assert plane_shares((0.0, 0.4), 0.15) == pytest.approx((0.625, 0.375))
    assert plane_shares((0.4, 0.0), 0.15) == pytest.approx((0.375, 0.625))
    assert plane_shares((0.0, 0.4), 0.39) == pytest.approx((0.3, 0.7))


@pytest.mark.parametrize(
    ("grade", "mass", "rpm", "permitted"),
    [
        (6.3, 10.0, 3000.0, 200.5),
        (16.0, 25.0, 6000.0, 636.6),
        (40.0, 30.0, 4000.0, 2864.8),
        (2.5, 100.0, 1500.0, 1591.5),
    ],
)
def test_grades_permit_what_the_handy_formula_says(grade: float, mass: float, rpm: float, permitted: float) -> None:
    """The handy form is 9549 G m / n in g mm, with G in mm/s, m in kg and n in rpm."""
    unbalance = 1e6 * permitted_unbalance(1e-3 * grade, mass, rpm * math.pi / 30.0)
    assert unbalance == pytest.approx(9549.3 * grade * mass / rpm, rel=1e-5)
    assert unbalance == pytest.approx(permitted, abs=0.06)
