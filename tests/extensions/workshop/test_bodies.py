"""Moments of bodies against sums over points, sizes of least mass, and clearances against shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest

import laufruhe
from attack.bodies import compare_with_shapely, polygon, worst_of_points
from laufruhe.errors import InputError
from laufruhe.extensions.workshop.bodies import Body, BodyFit, BodyRange
from laufruhe.extensions.workshop.crankcase import Crankcase, is_clear
from laufruhe.extensions.workshop.part import weights_of
from laufruhe.extensions.workshop.shapes import Cheek, Sector, Shape, Slab
from problem_files import PROBLEMS

READY = PROBLEMS / "single-crank-weight.toml"
SHARP = [
    Sector(0.08, 0.0, 0.02, 2.0),
    Sector(0.08, 0.0, 0.0, 4.0),
    Slab(0.08, 0.0, 0.03, 0.06),
    Slab(0.08, 0.0, 0.03),
    Cheek(0.09, 0.0, 0.06, 0.07),
    Cheek(0.09, 0.0, 0.06, 0.07, 2.0),
]


@pytest.mark.parametrize("shape", SHARP, ids=lambda shape: f"{shape.name}-{len(shape.outline)}")
def test_moments_are_those_of_a_million_points(shape: Shape) -> None:
    assert worst_of_points(shape) < 1e-3


def test_a_sector_has_the_closed_forms_of_the_tables() -> None:
    shape = Sector(0.08, 0.0, 0.02, 2.0)
    assert shape.moments.area == pytest.approx(0.5 * 2.0 * (0.08**2 - 0.02**2), rel=1e-13)
    assert shape.moments.first.real == pytest.approx(2.0 / 3.0 * math.sin(1.0) * (0.08**3 - 0.02**3), rel=1e-13)
    assert shape.moments.polar == pytest.approx(0.25 * 2.0 * (0.08**4 - 0.02**4), rel=1e-13)


@pytest.mark.parametrize("shape", [*SHARP[:1], *SHARP[2:]], ids=lambda shape: f"{shape.name}-{len(shape.outline)}")
def test_fillets_are_what_an_opening_by_a_disc_leaves(shape: Shape) -> None:
    # erosion and dilation by the same disc round the corners that point outwards
    radius = 0.003
    opened = polygon(shape).buffer(-radius, quad_segs=400).buffer(radius, quad_segs=400)
    ours = shape.sized(fillet=radius)
    assert ours.moments.area == pytest.approx(opened.area, rel=2e-6)
    assert ours.moments.area < shape.moments.area
    assert ours.moments.first.real == pytest.approx(opened.area * opened.centroid.x, rel=5e-6)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_clearances_are_those_of_shapely(seed: int) -> None:
    assert compare_with_shapely(seed, 360)[1] == []


@pytest.mark.slow
def test_open_sizes_have_the_least_mass_of_random_ones() -> None:
    least = Body(Sector(0.05, 0.003, 0.03, 0.6), 0.008, 7850.0)
    most = Body(Sector(0.1, 0.003, 0.03, 3.0), 0.02, 7850.0)

    def clear(shape: Shape) -> bool:
        # a made-up limit that couples radius and angle
        assert isinstance(shape, Sector)
        return shape.outer_radius <= 0.095 - 0.01 * max(shape.angle - 1.0, 0.0)

    fit = BodyFit(BodyRange(least, most), clear)
    rng = np.random.default_rng(1)
    found = 0
    for _ in range(700):
        shape = Sector(rng.uniform(0.05, 0.1), 0.003, 0.03, rng.uniform(0.6, 3.0))
        body = Body(shape, rng.uniform(0.008, 0.02), 7850.0)
        if not clear(shape):
            continue
        found += 1
        assert body.unbalance <= fit.bounds[1] * (1.0 + 1e-4)
        best = fit.body_of(body.unbalance)
        assert best.unbalance == pytest.approx(body.unbalance, rel=1e-5)
        assert best.mass <= body.mass * (1.0 + 1e-6)
        assert clear(best.shape)
    assert found > 200


@pytest.mark.slow
def test_the_ready_problem_is_proven_and_its_body_has_the_unbalance() -> None:
    result = laufruhe.solve(READY)
    assert result.certificate.kind == "global"
    (weight,) = weights_of(result.final.engine)
    assert weight.fault == ""
    assert weight.body.unbalance == pytest.approx(abs(weight.rotor.unbalance), rel=1e-6)
    engine = result.final.engine
    case = Crankcase(0.002, 0.048)
    assert is_clear(case, engine.slider_cranks, engine.cycle.angle, weight.body, weight.seat, weight.body.shape)


def test_an_open_thickness_is_the_mass_at_the_lever_of_the_shape() -> None:
    text = READY.read_text(encoding="utf-8")
    fixed = text.replace('{ between = ["50 mm", "110 mm"] }', '"88 mm"').replace("{ between = [60, 180] }", "150")
    problem = laufruhe.load(fixed.replace('"8 mm", "22 mm"', '"0 mm", "22 mm"'))
    (decision,) = problem.decisions
    (rotor,) = (one for one in problem.engine.rotors if one.name == "webs")
    shape = Sector(0.088, 0.003, 0.032, math.radians(150.0))
    assert decision.name == "webs.mass"
    assert rotor.radius == pytest.approx(shape.lever)
    assert decision.upper == pytest.approx(Body(shape, 0.022, 7850.0, 0.06).mass)


def test_every_part_that_the_smallest_body_overlaps_is_named() -> None:
    """Check that all overlapping parts are named, because none of them has a distance."""
    text = READY.read_text(encoding="utf-8").replace(', spacing = "60 mm"', "")
    with pytest.raises(InputError, match=r"its clearance from (?=.*rod of cylinder 1).*piston of cylinder 1"):
        laufruhe.load(text.replace('"50 mm", "110 mm"', '"95 mm", "110 mm"'))


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('spacing = "60 mm" }', 'spacing = "60 mm", tail = "50 mm" }', "body.tail"),
        ("angle = { between = [60, 180] }, ", "", "body.angle"),
        ("[60, 180]", "[60, 250]", "body.angle"),
        ('fillet = "3 mm"', 'fillet = "30 mm"', "body"),
        ('opposite_throw = 1\n', 'opposite_throw = 1\nradius = "50 mm"\n', ".radius"),
        ('opposite_throw = 1\n', 'opposite_throw = 1\nunbalance = "900 kg mm"\n', "body"),
        ('"50 mm", "110 mm"', '"95 mm", "110 mm"', "body"),
        ('distance = "118 mm"', 'distance = "30 mm"', "body"),
    ],
)  # fmt: skip
def test_bad_bodies_are_refused_in_one_line(old: str, new: str, key: str) -> None:
    text = READY.read_text(encoding="utf-8")
    assert old in text
    with pytest.raises(InputError) as error:
        laufruhe.load(text.replace(old, new))
    (complaint,) = error.value.complaints
    assert complaint.where.endswith(key)
