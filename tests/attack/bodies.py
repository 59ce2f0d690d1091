"""Clearances and moments of random bodies against shapely and sums over points.

python tests/attack/bodies.py --from 0 --number 200
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np
import shapely

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from laufruhe.extensions.workshop.bodies import Body
from laufruhe.extensions.workshop.crankcase import Crankcase, RodSize, Seat, clearances
from laufruhe.extensions.workshop.outlines import corners_of
from laufruhe.extensions.workshop.shapes import Cheek, Sector, Shape, Slab
from laufruhe.machine import CRANKSHAFT, Shaft, SliderCrank
from laufruhe.numerics.arrays import Array

SIDE = 1000
SAGGING = 1e-5
"""Largest error of distances from polygons in place of arcs [m]."""
COARSE = 1e-3
"""Largest relative error of sums over points, whose grid is turned against the sides of the shapes."""


def points(z: Array) -> Array:
    return np.stack([z.real, z.imag], axis=-1)


def polygon(shape: Shape) -> shapely.Polygon:
    return shapely.Polygon(points(corners_of(shape.outline, 1e-3)))


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


def worst_of_points(shape: Shape) -> float:
    """Return the largest error of area, first and polar moment against a million points.

    It is relative to the area times a power of the outer radius.
    """
    reach = 1.5 * max(shape.outer_radius, getattr(shape, "tail", 0.0))
    places = reach * ((np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0)
    grid = np.exp(0.4j) * (places + 1j * places[:, None])
    u, v = grid.real, grid.imag
    cell, inside = (2.0 * reach / SIDE) ** 2, within(shape, u, v)
    area, far = cell * inside.sum(), shape.outer_radius
    first, polar = cell * (u + 1j * v)[inside].sum(), cell * (u**2 + v**2)[inside].sum()
    ours = shape.moments
    return float(max(abs(ours.area - area) / area, abs(ours.first - first) / (area * far),
                     abs(ours.polar - polar) / (area * far**2)))  # fmt: skip


def part_of(rng: np.random.Generator) -> SliderCrank:
    r = rng.uniform(0.03, 0.07)
    length, bore = r / rng.uniform(0.22, 0.34), r * rng.uniform(1.4, 2.2)
    return SliderCrank(
        "cylinder 1", 0.0, r, length, 1.0, throw=rng.uniform(0.0, 6.0), bank=rng.uniform(-1.0, 1.0),
        offset=rng.uniform(-0.1, 0.1) * r, bore=bore,
    )  # fmt: skip


def by_shapely(part: SliderCrank, case: Crankcase, body: Body, seat: Seat, angles: Array) -> dict[str, float]:
    """Return the least distances at some crank angles, with the slider-crank written out anew."""
    rod, skirt = case.rod, case.skirt
    assert rod is not None
    assert skirt is not None
    assert seat.angle is not None
    turn = part.throw + angles - part.bank
    pin = part.crank_radius * np.exp(1j * turn)
    up = pin.real + np.sqrt(part.rod_length**2 - (pin.imag - part.offset) ** 2)
    end = up + 1j * part.offset
    half = 0.5 * (part.bore or 0.0)
    pistons = shapely.box(up - skirt, part.offset - half, up + half, part.offset + half)
    lines = shapely.linestrings(points(np.column_stack([pin, end])))
    axis = complex(seat.shaft.z, seat.shaft.y) * np.exp(-1j * part.bank)
    outline = corners_of(body.shape.outline, 1e-3)
    turned = shapely.polygons(points(
        axis + outline * np.exp(1j * (seat.angle + seat.shaft.ratio * angles - part.bank))[:, None]
    ))  # fmt: skip
    # the distance of a disc or a rounded bar is the distance of its centre line, less its radius
    rods = [
        shapely.distance(turned, lines) - 0.5 * rod.width,
        shapely.distance(turned, shapely.points(points(pin))) - 0.5 * rod.big_end,
        shapely.distance(turned, shapely.points(points(end))) - 0.5 * rod.small_end,
    ]
    return {
        "piston of cylinder 1": float(shapely.distance(turned, pistons).min()),
        "rod of cylinder 1": max(float(np.min(rods)), 0.0),
    }


def compare_with_shapely(seed: int, steps: int = 720) -> tuple[Shape, list[str]]:
    """Compare the clearances of one random engine; return its shape, and a line for each difference."""
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
    wrong = []
    for clearance in clearances(case, [part], 4.0 * math.pi, body, seat):
        minimum, sampled = clearance.minimum, theirs[clearance.part]
        # no sampled angle is below the bound, and the angle of the least distance has this distance
        there = by_shapely(part, case, body, seat, np.array([minimum.angle]))[clearance.part]
        if minimum.bound > max(sampled, 0.0) + SAGGING or abs(there - max(minimum.distance, 0.0)) > SAGGING:
            wrong.append(f"{seed} {clearance.part}: {minimum}, sampled {sampled:g} m, there {there:g} m")
    return shape, wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--number", type=int, default=200, help="of engines")
    parser.add_argument("--steps", type=int, default=720, help="crank angles of a cycle that shapely samples")
    arguments = parser.parse_args()
    faults, worst = [], 0.0
    for seed in range(arguments.first, arguments.first + arguments.number):
        shape, wrong = compare_with_shapely(seed, arguments.steps)
        error = worst_of_points(shape.sized(fillet=0.0))
        worst = max(worst, error)
        faults += [*wrong, *([f"{seed} {shape}: moments differ by {error:.2g}"] if error > COARSE else [])]
    print(*faults, sep="\n", end="\n" if faults else "")
    print(
        f"{arguments.number} engines, {len(faults)} differences; "
        f"moments differ from sums over points by {worst:.1e} at most"
    )
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
