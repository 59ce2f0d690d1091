"""Worst errors of a design, compared with all corners and many angles, and their bounds."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from lanes import first_fast
from laufruhe.extensions.robust.worst_case import ErrorBlock, KnownBounds, bound_node, value_at, worst_case
from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.norms import NORMS, Grid

Array = NDArray[np.float64]
COLUMNS = (slice(0, 1), slice(1, 2), slice(2, 3), slice(3, 5))


def random_norm(name: str, seed: int, share: float = 0.3) -> AffineNorm:
    """Return a norm of two signals of twelve rows in a plane that depends on five numbers."""
    random = np.random.default_rng(seed)
    weights = random.uniform(0.5, 1.0, 24)
    slope = share * random.normal(size=(24, 2, 5))
    return AffineNorm(NORMS[name], random.normal(size=(24, 2)), slope, Grid(weights / weights.sum(), 12))


def all_errors(angles: int) -> Array:
    """Return every corner of the three intervals with every angle of the circle, shape (cases, 5)."""
    turns = 2.0 * np.pi * np.arange(angles) / angles
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return np.array([[*ends, *u] for ends in itertools.product((-1.0, 1.0), repeat=3) for u in circle])


@pytest.mark.parametrize("seed", first_fast([1, 2], 1, 1))
@pytest.mark.parametrize("name", NORMS)
def test_worst_of_corners_and_circles(name: str, seed: int) -> None:
    terms = [(1.0, random_norm(name, seed)), (0.5, random_norm("mean", seed + 10))]
    result = worst_case(terms, COLUMNS, 1e-4)
    brute = max(value_at(terms, z) for z in all_errors(180))
    assert result.value == pytest.approx(value_at(terms, result.errors), rel=1e-12)
    assert result.bound >= brute * (1.0 - 1e-12)
    assert result.value >= brute * (1.0 - 2e-4)
    assert result.value <= result.bound <= result.value * (1.0 + 1.01e-4)
    assert np.hypot(*result.errors[3:]) <= 1.0 + 1e-12
    assert np.abs(result.errors[:3]).max() <= 1.0


@pytest.mark.parametrize("name", NORMS)
def test_no_errors_of_a_part_exceed_its_bound(name: str) -> None:
    """Check bounds over whole discs, arcs of them, and with some intervals fixed."""
    random, terms = np.random.default_rng(3), [(1.0, random_norm(name, 4, 1.0))]
    whole = [ErrorBlock(own, np.eye(own.stop - own.start)) for own in COLUMNS]
    for centre, arc in whole[3].parts(np.zeros(5)):
        assert arc is not None
        for middle, narrow in arc.parts(centre):
            assert narrow is not None
            assert narrow.arc is not None
            blocks = [whole[0], whole[2], narrow]
            above = bound_node(terms, middle, blocks, 0.0, KnownBounds(terms)).bound
            for _ in range(40):
                z = np.zeros(5)
                angle = narrow.arc[0] + random.uniform(-1.0, 1.0) * narrow.arc[1]
                z[[0, 2]] = random.choice([-1.0, 1.0], 2)
                z[3:] = np.cos(angle), np.sin(angle)
                assert value_at(terms, z) <= above * (1.0 + 1e-12)


@pytest.mark.parametrize("name", NORMS)
def test_squares_lie_over_their_norm(name: str) -> None:
    random, norm = np.random.default_rng(5), random_norm(name, 6)
    touched = np.linalg.norm(norm.constant, axis=1)
    squares = norm.norm.majorant(norm.grid, touched)
    if squares is None:
        assert name not in ("mean", "rms")
        return
    factors, constant = squares
    for size in (0.0, 0.1, 1.0, 10.0):
        rows = norm.constant + size * random.normal(size=norm.constant.shape)
        above = constant + 0.5 * float(factors @ np.square(rows).sum(axis=1))
        assert norm.norm.value(norm.grid, rows) <= above * (1.0 + 1e-12)
        if size == 0.0:
            assert norm.norm.value(norm.grid, rows) == pytest.approx(above, rel=1e-12)


@pytest.mark.parametrize("name", ["mean", "rms"])
def test_majorants_of_earlier_nodes_hold_at_all_errors(name: str) -> None:
    """Check that each majorant is exact where it touches and not below the norms elsewhere."""
    random, terms = np.random.default_rng(11), [(1.0, random_norm(name, 12, 1.0)), (0.3, random_norm("mean", 13))]
    known, touched = KnownBounds(terms), random.normal(size=(6, 5))
    for z in touched:
        constant, slope, curvature = known.touch([np.linalg.norm(norm.rows(z), axis=1) for _, norm in terms])
        for other in (z, *touched, *random.normal(scale=3.0, size=(40, 5))):
            above = constant + slope @ other + 0.5 * other @ curvature @ other
            assert value_at(terms, other) <= above * (1.0 + 1e-12)
        assert constant + slope @ z + 0.5 * z @ curvature @ z == pytest.approx(value_at(terms, z), rel=1e-11)
    assert len(known.majorants) == 6


def test_an_arc_lies_in_its_trapezoid_and_its_ends_are_vertices() -> None:
    whole, random = ErrorBlock(slice(0, 2), np.eye(2)), np.random.default_rng(14)
    arcs = [(middle, arc) for centre, arc in whole.parts(np.zeros(2)) if arc for middle, arc in arc.parts(centre)]
    for centre, arc in arcs:
        assert arc is not None
        assert arc.arc is not None
        vertices = np.array([centre + arc.spans @ local for local in arc.vertices])
        angles = arc.arc[0] + arc.arc[1] * np.linspace(-1.0, 1.0, 41)
        points = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        for direction in random.normal(size=(200, 2)):
            assert (points @ direction).max() <= (vertices @ direction).max() + 1e-12
        for end in points[[0, -1]]:
            assert np.linalg.norm(vertices - end, axis=1).min() < 1e-12
        # no farther out than the tangents at the middle and at both ends meet
        assert np.linalg.norm(vertices, axis=1).max() == pytest.approx(1.0 / np.cos(0.5 * arc.arc[1]), rel=1e-12)


def test_no_errors_leave_the_drawing() -> None:
    norm = random_norm("mean", 7)
    bare = AffineNorm(norm.norm, norm.constant, norm.slope[..., :0], norm.grid)
    result = worst_case([(2.0, bare)], (), 1e-4)
    assert result.value == result.bound == pytest.approx(2.0 * norm.norm.value(norm.grid, norm.constant))


@pytest.mark.parametrize("name", NORMS)
def test_intervals_alone_end_at_their_worst_corner(name: str) -> None:
    """Check that no part remains to divide, and that two weighted terms add up."""
    random = np.random.default_rng(9)
    constant, slope, grid = random.normal(size=(24, 2)), random.normal(size=(24, 2, 4)), Grid(np.full(24, 1 / 24), 12)
    norms = [AffineNorm(NORMS[own], constant[::step], slope[::step], grid) for own, step in ((name, 1), ("mean", -1))]
    terms = list(zip((3.0, 0.2), norms, strict=True))
    result = worst_case(terms, tuple(slice(k, k + 1) for k in range(4)), 0.0)
    worst = max(value_at(terms, np.array(z)) for z in itertools.product((-1.0, 1.0), repeat=4))
    assert result.value == pytest.approx(worst, rel=1e-9)
    assert worst * (1.0 - 1e-12) <= result.bound <= worst * (1.0 + 1e-9)


def test_wider_errors_are_never_better() -> None:
    norm, last = random_norm("mean", 8), 0.0
    for share in (0.0, 0.5, 1.0, 2.0):
        wider = AffineNorm(norm.norm, norm.constant, share * norm.slope, norm.grid)
        result = worst_case([(1.0, wider)], COLUMNS, 1e-6)
        assert result.value >= last
        last = result.bound


@pytest.mark.parametrize("discs", [1, 2])
@pytest.mark.parametrize("name", ["mean", "maximum", "rms"])
def test_turning_unbalances_add_up(name: str, discs: int) -> None:
    """Check that single unbalances make the same force at every angle, within their discs."""
    phi = 2.0 * np.pi * np.arange(36) / 36
    turned = np.stack([np.stack([np.cos(phi), -np.sin(phi)]), np.stack([np.sin(phi), np.cos(phi)])]).transpose(2, 0, 1)
    slope = np.concatenate([(k + 1.0) * turned for k in range(discs)], axis=2)
    norm = AffineNorm(NORMS[name], np.zeros((36, 2)), slope, Grid(np.full(36, 1.0 / 36.0), 36))
    columns = tuple(slice(2 * k, 2 * k + 2) for k in range(discs))
    result = worst_case([(1.0, norm)], columns, 1e-6)
    assert result.bound == pytest.approx(sum(range(discs + 1)), rel=1e-6)
    for own in columns:
        assert np.hypot(*result.errors[own]) <= 1.0 + 1e-12
