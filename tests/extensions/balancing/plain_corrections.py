"""Corrections by brute force: every choice of holes of a file, in mm, g and degrees, without code of the package.

`python tests/extensions/balancing/plain_corrections.py 200 3` compares the command's answer on 200 random files with at
most 3 holes in a plane.
"""

from __future__ import annotations

import cmath
import itertools
import math
import random
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

Tables = dict[str, Any]


@dataclass(frozen=True)
class PlainHole:
    """Hole at a place: its angle on the crank [deg], diameter, depth and radius of its end [mm], change [g mm]."""

    angle: float
    diameter: float
    depth: float
    end: float
    filled: bool
    change: complex


def number(text: str | float) -> float:
    return float(str(text).split()[0])


def integral(low: float, high: float, f: Callable[[float], float]) -> float:
    """Return the integral by Simpson's rule, exact for cubics."""
    return (high - low) / 6.0 * (f(low) + 4.0 * f(0.5 * (low + high)) + f(high))


def change(job: Tables, radius: float, diameter: float, depth: float, fill: float) -> float:
    """Change of the unbalance [g mm], summed over slices across the hole; densities in kg/m^3 are 1e-6 g/mm^3 each."""
    steel, area = 1e-6 * number(job["density"]), math.pi * diameter**2 / 4.0
    lever = (lambda z: radius - z) if job["direction"] == "radial" else (lambda _: radius)
    total = (1e-6 * fill - steel) * integral(0.0, depth, lambda z: area * lever(z))
    if "point_angle" in job:
        height = diameter / 2.0 / math.tan(math.radians(job["point_angle"] / 2.0))
        total -= steel * integral(depth, depth + height, lambda z: area * (1.0 - (z - depth) / height) ** 2 * lever(z))
    return total


def edge_distance(angle: float, radius: float, edge: float) -> float:
    """Return the distance of a place from the ray of an edge."""
    place, far = cmath.rect(radius, math.radians(angle)), cmath.rect(1e6, math.radians(edge))
    return point_distance(place, 0.0, far)


def point_distance(point: complex, start: complex, end: complex) -> float:
    """Return the distance of a point from the line between two points."""
    way = end - start
    share = 0.0 if way == 0.0 else ((point - start) * way.conjugate()).real / abs(way) ** 2
    return abs(point - start - min(max(share, 0.0), 1.0) * way)


def axis_distance(one: PlainHole, other: PlainHole, radius: float) -> float:
    """Return the distance of the axes of two holes in the plane, which do not cross, from an end of one of them."""
    axes = [[cmath.rect(r, math.radians(hole.angle)) for r in (radius, hole.end)] for hole in (one, other)]
    return min(point_distance(end, *axis) for axis, points in (axes, axes[::-1]) for end in points)


def is_inside(angle: float, sector: list[float]) -> bool:
    return (angle - sector[0]) % 360.0 <= (sector[1] - sector[0]) % 360.0


def end_depth(job: Tables, diameter: float, depth: float) -> float:
    """Return the depth of the centre of a ball of the hole's diameter that covers its end, with the drill's point."""
    slender = diameter / 2.0 / math.tan(math.radians(job.get("point_angle", 180) / 2.0)) - diameter / 2.0
    return depth + max(slender, 0.0)


def holes_of(job: Tables, plane: Tables) -> Iterator[list[PlainHole]]:
    """Yield all holes of each place."""
    radius, wall = number(plane["radius"]), number(job.get("wall", 0.0))
    depth_limit = number(plane.get("max_depth", job["max_depth"]))
    step = number(job["depth_step"])
    depths = [k * step for k in range(1, 200) if number(job["min_depth"]) <= k * step <= depth_limit]
    kinds = [(number(d), 0.0) for d in job["drills"]]
    if "slugs" in job:
        kinds += [(number(d), number(job["slugs"]["density"])) for d in job["slugs"]["diameters"]]
    angles = plane.get("angles") or [plane["first_place"] + 360.0 * k / plane["places"] for k in range(plane["places"])]
    for angle in angles:
        there = []
        for (diameter, fill), depth in itertools.product(kinds, depths):
            end = radius - end_depth(job, diameter, depth) if job["direction"] == "radial" else radius
            room = diameter / 2.0 + wall - 1e-9

            def clear(sector: list[float], angle: float = angle, end: float = end, room: float = room) -> bool:
                return all(edge_distance(angle, end, edge) >= room for edge in sector)

            fits = all(not is_inside(angle, sector) and clear(sector) for sector in plane.get("solid", []))
            allowed = plane.get("allowed", [])
            if fits and (not allowed or any(is_inside(angle, s) and clear(s) for s in allowed)):
                size = cmath.rect(change(job, radius, diameter, depth, fill), math.radians(angle))
                there.append(PlainHole(angle, diameter, depth, end, fill > 0.0, size))
        if there:
            yield there


def residuals(job: Tables, plane: Tables, max_holes: int) -> tuple[complex, list[float]]:
    """Return the initial unbalance [g mm] and the least residual with 0, 1, 2 ... holes, infinite without a design."""
    measured = plane["measured"]
    size = (
        number(measured["unbalance"]) if "unbalance" in measured
        else number(measured["mass"]) * number(measured["radius"])
    )  # fmt: skip
    sense = 1.0 if job["machine_counts"] == "with rotation" else -1.0
    initial = cmath.rect(size, math.radians(job["zero_mark"] + sense * measured["angle"]))
    radius, wall = number(plane["radius"]), number(job.get("wall", 0.0))
    places = list(holes_of(job, plane))
    least = []
    for count in range(min(max_holes, len(places)) + 1):
        best = math.inf
        for chosen in itertools.combinations(places, count):
            pairs = list(itertools.combinations(range(count), 2))
            for holes in itertools.product(*chosen):
                size = abs(initial + sum(hole.change for hole in holes))
                if size < best and all(
                    (holes[i].diameter + holes[j].diameter) / 2.0 + wall
                    <= axis_distance(holes[i], holes[j], radius) + 1e-9
                    for i, j in pairs
                ):
                    best = size
        least.append(best)
    return initial, least


def random_file(seed: int, max_holes: int = 3) -> Tables:
    """Return the tables of a random correction that brute force can solve."""
    draw = random.Random(seed)
    radial = draw.random() < 0.5
    job: Tables = {
        "goal": draw.choice(["fewest holes", "least residual"]),
        "density": f"{draw.uniform(7000, 8000):.1f} kg/m^3",
        "direction": "radial" if radial else "axial",
        "drills": [f"{d} mm" for d in sorted(draw.sample([6, 8, 10, 13, 16, 20], draw.randint(1, 3)))],
        "depth_step": f"{draw.choice([1.5, 2, 3])} mm",
        "min_depth": f"{draw.choice([0, 4, 5])} mm",
        "max_depth": f"{draw.randint(9, 14)} mm",
        "wall": f"{draw.choice([0.0, 1.5, 3.0])} mm",
        "max_holes": max_holes,
        "zero_mark": round(draw.uniform(-360, 360), 2),
        "machine_counts": draw.choice(["with rotation", "against rotation"]),
        "planes": [],
    }
    if draw.random() < 0.5:
        job["point_angle"] = draw.choice([90, 118, 140])
    if draw.random() < 0.4:
        job["slugs"] = {"density": "17000 kg/m^3", "diameters": [f"{draw.choice([9, 12])} mm"]}
    for name in ("front", "rear"):
        radius = draw.randint(32, 60)
        plane: Tables = {"name": name, "radius": f"{radius} mm"}
        if draw.random() < 0.5:
            plane |= {"places": draw.randint(4, 8), "first_place": round(draw.uniform(0, 90), 2)}
        else:
            plane["angles"] = [
                round(a * 12 + draw.uniform(0, 8), 2) for a in draw.sample(range(30), draw.randint(4, 7))
            ]
        if draw.random() < 0.4:
            start = draw.uniform(0, 360)
            plane["allowed"] = [[round(start, 2), round(start + draw.uniform(200, 330), 2)]]
        if draw.random() < 0.4:
            start = draw.uniform(0, 360)
            plane["solid"] = [[round(start, 2), round(start + draw.uniform(5, 60), 2)]]
        size, angle = draw.uniform(50, 1500), round(draw.uniform(0, 360), 2)
        plane["measured"] = (
            {"unbalance": f"{size:.2f} g mm", "angle": angle} if draw.random() < 0.5
            else {"mass": f"{size / radius:.4f} g", "radius": f"{radius} mm", "angle": angle}
        )  # fmt: skip
        plane["permitted_unbalance"] = f"{draw.choice([5, 20, 60, 150])} g mm"
        job["planes"].append(plane)
    for plane in job["planes"] if radial and draw.random() < 0.6 else []:
        # narrow places, where the depth of each hole decides how near the next one may be
        for key in ("places", "allowed"):
            plane.pop(key, None)
        first, step = plane.pop("first_place", 0.0), draw.uniform(14, 28)
        plane |= {"angles": [round(first + k * step, 2) for k in range(5)], "max_depth": f"{draw.randint(10, 22)} mm"}
        if "solid" in plane:
            plane["solid"] = [[round(first + k * step, 2) for k in (2.2, 2.6)]]
    return {"title": f"random correction {seed}", "correction": job}


def holes_clash(plane: Any, design: Any) -> bool:
    """Return True if two holes of a design are at one place or too near."""
    pairs = itertools.combinations(design, 2)
    return any(p == q or bool(plane.clashes(p, q)[hole, other]) for (p, hole), (q, other) in pairs)


def mismatches(seed: int, max_holes: int = 3) -> list[str]:
    """Compare the package's optimum of a random file with that of brute force; empty if both agree."""
    from laufruhe.errors import InputError
    from laufruhe.extensions.balancing.file import CorrectionFile, correction_of
    from laufruhe.extensions.balancing.report import decide
    from laufruhe.files.complaints import Refused

    tables = random_file(seed, max_holes)
    job = tables["correction"]
    plain = [residuals(job, plane, max_holes) for plane in job["planes"]]
    try:
        correction = correction_of(CorrectionFile.model_validate(tables).correction, 1e-4)
    except (Refused, InputError) as error:
        # one place at least must take a hole
        return [] if any(len(least) == 1 for _, least in plain) else [f"{seed}: refused: {error}"]
    faults = []
    for result, (initial, least), gap in zip(decide(correction).planes, plain, correction.gaps, strict=True):
        permitted, gap = number(f"{1e6 * (result.plane.permitted or 0.0)}"), 1e6 * gap + 1e-9
        where = f"{seed} {result.plane.name}"
        if abs(1e6 * result.plane.initial - initial) > 1e-6:
            faults.append(f"{where}: initial {result.plane.initial}, {initial}")
        for holes, count in enumerate(result.counts):
            value, bound = 1e6 * count.value, 1e6 * count.bound
            if not (count.proven and value - gap <= least[holes] + 1e-7 and (value >= least[holes] - 1e-7)):
                faults.append(f"{where}: {holes} holes leave {value}, but brute force {least[holes]}")
            if bound > least[holes] + 1e-7:
                faults.append(f"{where}: bound {bound} of {holes} holes is above {least[holes]}")
        if holes_clash(result.plane, result.design):
            faults.append(f"{where}: holes clash")
        enough = [holes for holes, size in enumerate(least) if size <= permitted]
        if job["goal"] == "fewest holes":
            if result.is_met != bool(enough) or (enough and len(result.design) != enough[0]) or not result.is_fewest:
                faults.append(f"{where}: {len(result.design)} holes, but brute force {enough[:1]}")
        elif abs(1e6 * abs(result.residual)) > min(least) + gap + 1e-7 or not result.is_least:
            faults.append(f"{where}: residual {1e6 * abs(result.residual)}, but brute force {min(least)}")
    return faults


if __name__ == "__main__":
    COUNT, HOLES = (int(word) for word in (*sys.argv[1:], *("200", "3")[len(sys.argv) - 1 :]))
    FAULTS = [fault for seed in range(COUNT) for fault in mismatches(seed, HOLES)]
    print("\n".join([*FAULTS, f"{COUNT} random files, {len(FAULTS)} mismatches"]))
    sys.exit(bool(FAULTS))
