"""Moments of bodies against sums over points, sizes of least mass, and clearances against shapely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from shapely import affinity
from shapely.geometry import LineString, Point, Polygon

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.workshop.bodies import Body, BodyFit, BodyRange
from laufruhe.extensions.workshop.crankcase import Crankcase, RodSize, Seat, clearances, is_clear
from laufruhe.extensions.workshop.outlines import corners_of
from laufruhe.extensions.workshop.part import weights_of
from laufruhe.extensions.workshop.shapes import Cheek, Sector, Shape, Slab
from laufruhe.machine import CRANKSHAFT, Shaft, SliderCrank
from laufruhe.numerics.arrays import Array
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
SIDE = 1000
SAGGING = 1e-5
"""Largest error of distances from polygons in place of arcs [m]."""


def polygon(shape: Shape) -> Polygon:
    corners = corners_of(shape.outline, 1e-3)
    return Polygon(np.column_stack([corners.real, corners.imag]))


def within(shape: Shape, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return which points belong to a sharp shape, by its definition and not by its outline."""
    r, turn = np.hypot(u, v), np.abs(np.arctan2(v, u))
    inside = r <= shape.outer_radius
    if isinstance(shape, Sector):
        return inside & (r >= shape.inner_radius) & (turn <= 0.5 * shape.angle)
    if isinstance(shape, Slab):
        return inside & (u >= shape.inner_radius) & (np.abs(v) <= 0.5 * (shape.width or math.inf))
    assert isinstance(shape, Cheek)
    half = 0.5 * shape.width
    plate = (np.abs(v) <= half) & (u >= half - shape.tail) & ((u < 0.0) | inside)
    end = np.hypot(u - half + shape.tail, v) <= half
    return plate | end | (inside & (turn <= 0.5 * (shape.angle or 0.0)))


@pytest.mark.parametrize("shape", SHARP, ids=lambda shape: f"{shape.name}-{len(shape.outline)}")
def test_moments_are_those_of_a_million_points(shape: Shape) -> None:
    reach = 0.1
    places = reach * ((np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0)
    u, v = np.meshgrid(places, places)
    cell, inside = (2.0 * reach / SIDE) ** 2, within(shape, u, v)
    ours = shape.moments
    assert ours.area == pytest.approx(cell * inside.sum(), rel=2e-3)
    assert ours.first.real == pytest.approx(cell * u[inside].sum(), rel=2e-3)
    assert ours.first.imag == pytest.approx(0.0, abs=1e-12)
    assert ours.polar == pytest.approx(cell * (u**2 + v**2)[inside].sum(), rel=2e-3)


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


def part_of(rng: np.random.Generator) -> SliderCrank:
    r = rng.uniform(0.03, 0.07)
    length, bore = r / rng.uniform(0.22, 0.34), r * rng.uniform(1.4, 2.2)
    return SliderCrank(
        "cylinder 1", 0.0, r, length, 1.0, throw=rng.uniform(0.0, 6.0), bank=rng.uniform(-1.0, 1.0),
        offset=rng.uniform(-0.1, 0.1) * r, bore=bore,
    )  # fmt: skip


def by_shapely(part: SliderCrank, case: Crankcase, body: Body, seat: Seat, angles: Array) -> dict[str, float]:
    """Return the least distances at some crank angles, with the slider-crank written out anew."""
    least = {"piston of cylinder 1": math.inf, "rod of cylinder 1": math.inf}
    shape, rod = polygon(body.shape), case.rod
    assert rod is not None
    assert case.skirt is not None
    for phi in angles:
        turn = part.throw + phi - part.bank
        pin = (part.crank_radius * math.cos(turn), part.crank_radius * math.sin(turn))
        up = pin[0] + math.sqrt(part.rod_length**2 - (pin[1] - part.offset) ** 2)
        half, lower = 0.5 * (part.bore or 0.0), up - case.skirt
        piston = Polygon([(lower, part.offset - half), (lower, part.offset + half), (up + half, part.offset + half),
                          (up + half, part.offset - half)])  # fmt: skip
        line = LineString([pin, (up, part.offset)]).buffer(0.5 * rod.width, quad_segs=64)
        ends = (
            Point(pin).buffer(0.5 * rod.big_end, quad_segs=64),
            Point(up, part.offset).buffer(0.5 * rod.small_end, quad_segs=64),
        )
        assert seat.angle is not None
        turned = affinity.rotate(shape, seat.angle + seat.shaft.ratio * phi - part.bank, (0, 0), use_radians=True)
        axis = complex(seat.shaft.z, seat.shaft.y) * np.exp(-1j * part.bank)
        turned = affinity.translate(turned, axis.real, axis.imag)
        least["piston of cylinder 1"] = min(least["piston of cylinder 1"], turned.distance(piston))
        least["rod of cylinder 1"] = min(least["rod of cylinder 1"], *(turned.distance(one) for one in (line, *ends)))
    return least


def compare_with_shapely(seed: int, steps: int = 720) -> tuple[float, float]:
    """Check one random engine; return the least distance of both parts [m]."""
    rng = np.random.default_rng(seed)
    part = part_of(rng)
    rod = RodSize(0.3 * part.crank_radius, 0.03, 1.1 * part.crank_radius, 0.6 * part.crank_radius)
    room = part.rod_length - part.crank_radius
    case = Crankcase(0.0, 0.35 * room, rod)
    outer = rng.uniform(0.4, 0.75) * room
    shape = [
        Sector(outer, 0.002, 0.3 * outer, rng.uniform(0.5, 3.0)),
        Slab(outer, 0.002, 0.4 * outer, rng.uniform(0.5, 1.2) * outer),
        Cheek(outer, 0.0, 0.8 * outer, 0.6 * outer, rng.uniform(1.0, 3.0)),
    ][seed % 3]
    is_crank = bool(rng.integers(2))
    far = part.crank_radius + rng.uniform(0.8, 1.8) * room
    aside = far * np.exp(1j * rng.uniform(0.0, math.tau))
    shaft = CRANKSHAFT if is_crank else Shaft("s", float(rng.choice([-1.0, 2.0, -2.0])), aside.imag, aside.real)
    seat = Seat(0.0, shaft, rng.uniform(0.0, 6.0))
    body = Body(shape, 0.02, 7850.0)
    theirs = by_shapely(part, case, body, seat, np.linspace(0.0, 4.0 * math.pi, steps, endpoint=False))
    worst = math.inf
    for clearance in clearances(case, [part], 4.0 * math.pi, body, seat):
        least, sampled = clearance.minimum, theirs[clearance.part]
        # no sampled angle is below the bound, and the angle of the least distance has this distance
        assert least.bound <= max(sampled, 0.0) + SAGGING, (seed, clearance, sampled)
        there = by_shapely(part, case, body, seat, np.array([least.angle]))[clearance.part]
        assert there == pytest.approx(max(least.distance, 0.0), abs=SAGGING), (seed, clearance, there)
        worst = min(worst, least.distance)
    return worst, min(theirs.values())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_clearances_are_those_of_shapely(seed: int) -> None:
    compare_with_shapely(seed, 360)


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
    for _ in range(4000):
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
    assert found > 1000


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
