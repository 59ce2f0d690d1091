"""Drawings of bodies: files that other programs read, with the area of the body and its sizes as dimensions."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import ezdxf
import pytest
from ezdxf.math import bulge_to_arc
from typer.testing import CliRunner

import ready
from laufruhe.cli import app
from laufruhe.extensions.workshop.bodies import Body
from laufruhe.extensions.workshop.dimensions import Angle, Distance, Radius
from laufruhe.extensions.workshop.drawings import write_drawings
from laufruhe.extensions.workshop.dxf import write_dxf
from laufruhe.extensions.workshop.outlines import corners_of
from laufruhe.extensions.workshop.part import Weight, weights_of
from laufruhe.extensions.workshop.picture import figure_of
from laufruhe.extensions.workshop.shapes import Cheek, Sector, Shape, Slab
from laufruhe.extensions.workshop.sheet import HEIGHT, WIDTH, Sheet, sheet_of
from picture_faults import faults_of

READY = "single-crank-weight"
SHAPES = [
    Sector(0.09, 0.003, 0.032, math.radians(109.0)),
    Sector(0.11, 0.0, 0.06, math.radians(240.0)),
    Sector(0.04, 0.002, 0.0, math.radians(150.0)),
    Sector(0.08, 0.0, 0.02, math.radians(30.0)),
    Slab(0.08, 0.003, 0.03, 0.06),
    Slab(0.08, 0.0, 0.03),
    Cheek(0.09, 0.004, 0.06, 0.07, 2.0),
    Cheek(0.3, 0.0, 0.2, 0.07),
]


def named(shape: Shape) -> str:
    return f"{shape.name}-{len(shape.outline)}"


def weight_of(shape: Shape, spacing: float = 0.06) -> Weight:
    (weight,) = weights_of(ready.solved(READY).final.engine)
    return replace(weight, body=Body(shape, 0.022, 7850.0, spacing))


def sheet(shape: Shape) -> Sheet:
    return sheet_of(ready.solved(READY).final.engine, weight_of(shape), "an engine")


def area_of(vertices: Sequence[tuple[float, float, float]]) -> float:
    """Return the area of a closed polyline with bulges."""
    area = 0.0
    for (x, y, bulge), (to_x, to_y, _) in zip(vertices, [*vertices[1:], vertices[0]], strict=True):
        area += 0.5 * (x * to_y - to_x * y)
        if bulge:
            _, first, last, radius = bulge_to_arc((x, y), (to_x, to_y), bulge)
            turn = (last - first) % math.tau
            area += math.copysign(0.5 * radius**2 * (turn - math.sin(turn)), bulge)
    return area


@pytest.mark.parametrize("shape", SHAPES, ids=named)
def test_dxf_has_the_area_and_the_sizes_of_the_body(shape: Shape, tmp_path: Path) -> None:
    drawn = sheet(shape)
    write_dxf(drawn, tmp_path / "body.dxf")
    document = ezdxf.readfile(tmp_path / "body.dxf")
    audit = document.audit()
    assert not audit.errors
    assert not audit.fixes
    space = document.modelspace()
    (outline,) = space.query("LWPOLYLINE")
    assert outline.closed
    assert area_of(outline.get_points("xyb")) == pytest.approx(1e6 * shape.moments.area, rel=1e-6)
    measured = sorted(dimension.get_measurement() for dimension in space.query("DIMENSION"))
    sizes = [1e3 * abs(size) for name, size in shape.sizes.items() if name not in shape.angles and size]
    sizes += [math.degrees(size) for name, size in shape.sizes.items() if name in shape.angles]
    assert measured == pytest.approx(sorted([*sizes, 1e3 * shape.lever, 22.0, 60.0]))


@pytest.mark.parametrize("shape", SHAPES, ids=named)
def test_pictures_state_every_size_and_are_not_cut(shape: Shape) -> None:
    drawn = sheet(shape)
    for point in (*corners_of(drawn.outline, 0.1), *(point for one in drawn.dimensions for point in one.reach)):
        from_corner = point - drawn.corner
        assert 0.0 <= from_corner.real <= WIDTH
        assert 0.0 <= from_corner.imag <= HEIGHT
    result = ready.solved(READY)
    assert faults_of(figure_of(result, [weight_of(shape)]), result.problem.title) == []
    texts = {marks.words.text.rpartition(" ")[2] for marks in drawn.marks}
    assert {f"R{1e3 * shape.outer_radius:g}", f"{1e3 * shape.lever:.2f}".rstrip("0").rstrip("."), "22", "60"} <= texts
    kinds = {type(one) for one in drawn.dimensions}
    assert {Distance, Radius} <= kinds
    assert (Angle in kinds) == (shape.sizes.get("angle") is not None)


def test_the_arrow_points_to_the_crank_pin() -> None:
    # the weight of the ready problem stands opposite its crank
    assert sheet(SHAPES[0]).arrow.direction == pytest.approx(1j, abs=1e-6)


@pytest.mark.slow
def test_equal_drawings_are_equal_files(tmp_path: Path) -> None:
    result = ready.solved(READY)
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        assert write_drawings(result, tmp_path / folder) == ["webs"]
    for kind in ("svg", "png", "dxf"):
        one, two = ((tmp_path / folder / f"webs.{kind}").read_bytes() for folder in ("one", "two"))
        assert one == two, kind


def test_a_file_without_bodies_and_a_missing_library_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = CliRunner().invoke(app, ["drawing", "problems/tractor-single.toml"])
    assert answer.exit_code == 2
    assert answer.output.count("\n") == 1
    assert "body: is in no counterweight" in answer.output
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    answer = CliRunner().invoke(app, ["drawing", f"problems/{READY}.toml"])
    assert answer.exit_code == 2
    assert (
        answer.output == "laufruhe: ezdxf: is not installed, and DXF files need it; pip install 'laufruhe[drawings]'\n"
    )
