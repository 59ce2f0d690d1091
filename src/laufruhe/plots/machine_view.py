"""The engine to scale, from the front and the left: cranks, pistons, weights, shafts, mounts."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Rectangle, Wedge

from laufruhe.machine import Engine, Rotor
from laufruhe.machine.bodies import Outline
from laufruhe.machine.rotor import Role
from laufruhe.plots.style import AFTER, GREY, ORANGE, PALE, Page, entry_of_dots, page
from laufruhe.plots.words import FAINT, INK, SMALL, round_ticks, width_of
from laufruhe.present.measures import is_changed
from laufruhe.present.poses import THICKNESS, Pose, bore_of, half_disc
from laufruhe.problem.decision import Kind
from laufruhe.solvers.result import Result

METAL, IRON = "#d5dade", "#b4bcc4"
PISTON: Any = {"facecolor": "white", "edgecolor": INK}
MM = 1e3


def slot(axes: Axes, pose: Pose, bore: float, order: float) -> None:
    """Draw the slot of a Scotch yoke, from the front."""
    if math.isfinite(pose.part.rod_length):
        return
    across = 1j * pose.part.crank_radius * cmath.exp(1j * pose.part.bank)
    ends = (pose.foot - across, 0.16 * bore), (pose.foot + across, 0.16 * bore)
    bar(axes, *ends, order, facecolor=METAL, edgecolor=INK)


def at(place: complex) -> tuple[float, float]:
    """Return the coordinates of a point in the view from the front [mm]."""
    return MM * place.imag, MM * place.real


def bar(axes: Axes, start: tuple[complex, float], end: tuple[complex, float], order: float, **look: Any) -> None:
    """Draw a rod or a web: two circles, each a centre [m] and a radius [m], and the area between them."""
    (first, start_radius), (second, end_radius) = start, end
    along = cmath.phase(second - first)
    turns = np.linspace(0.5 * math.pi, 1.5 * math.pi, 13)
    corners = [first + start_radius * cmath.exp(1j * (along + turn)) for turn in turns]
    corners += [second + end_radius * cmath.exp(1j * (along + turn + math.pi)) for turn in turns]
    axes.add_patch(Polygon([at(corner) for corner in corners], closed=True, linewidth=0.8, zorder=order, **look))


def box(axes: Axes, xs: tuple[float, float], levels: tuple[float, float], order: float, **look: Any) -> None:
    """Draw a part from the side: x in metres, levels in millimetres."""
    low, high = min(levels), max(levels)
    style = {"edgecolor": INK, "linewidth": 0.7, **look}
    axes.add_patch(Rectangle((MM * min(xs), low), MM * abs(xs[1] - xs[0]), high - low, zorder=order, **style))


def look_of(body: Outline) -> dict[str, Any]:
    """Return the style of a turning body or of its housing."""
    if body.moves:
        return {**PISTON, "zorder": 2.2}
    return {"fill": False, "edgecolor": GREY, "linewidth": 1.4, "zorder": 1.8}


def cylinder(axes: Axes, pose: Pose, bore: float) -> complex:
    """Draw the walls of a cylinder between its dead centres, and return a point next to them."""
    turn = cmath.exp(1j * pose.part.bank)
    along = complex((pose.piston - pose.crank) / turn)
    ends = [Pose.at_angle(pose.part, phi).piston for phi in np.linspace(0.0, math.tau / abs(pose.part.shaft.ratio), 13)]
    heights = [complex((end - pose.crank) / turn).real for end in ends]
    for side in (-0.5, 0.5):
        walls = [pose.crank + turn * complex(height, along.imag + side * bore) for height in
                 (min(heights) - 0.25 * bore, max(heights) + 0.3 * bore)]  # fmt: skip
        axes.plot(*zip(*map(at, walls), strict=True), color=FAINT, linewidth=0.8, zorder=2.0)
    return pose.crank + turn * complex(max(heights) + 0.1 * bore, along.imag + 0.72 * bore)


def piston_at(axes: Axes, pose: Pose, bore: float, order: float, **look: Any) -> None:
    """Draw a piston and its rings, from the front."""
    turn = cmath.exp(1j * pose.part.bank)

    def corner(up: float, side: float) -> tuple[float, float]:
        return at(pose.piston + turn * bore * complex(up, side))

    corners = [corner(*place) for place in ((-0.25, -0.48), (-0.25, 0.48), (0.25, 0.48), (0.25, -0.48))]
    axes.add_patch(Polygon(corners, closed=True, zorder=order - 0.01, linewidth=0.9, **look))
    for ring in (0.12, 0.19):
        ends = zip(corner(ring, -0.48), corner(ring, 0.48), strict=True)
        axes.plot(*ends, color=FAINT, linewidth=0.6, zorder=order - 0.005)


# width and height of both views, gap between them, least width of a view [inch]
WIDE, HIGH, ACROSS, NARROW = 8.0, 4.4, 0.8, 2.2
_OF_RODS = {"rod", "piston_pin", "bolts"}
WEB, ROD = 0.24, 0.08
"""Distance of a web from the middle of its throw, and half the width of a rod, over the bore."""
ROOM = 1.1
"""Size of each view over the size of the drawn engine."""


@dataclass(frozen=True)
class EngineView:
    """An engine to draw, with the names of its open rotors, mounts, pistons and cranks.

    A crank is open if its throws, its lead angle or sizes of its running gear are open.

    `rods` is true if sizes of the rods were open. The state is "optimised", or "open" in an initial design.
    """

    engine: Engine
    rotors: frozenset[str]
    mounts: frozenset[str]
    pistons: frozenset[str]
    cranks: frozenset[str]
    rods: bool
    state: str

    @classmethod
    def from_result(cls, result: Result) -> EngineView:
        """Return the final design of a result, with the names of the parts that were open, for drawing."""
        engine, problem = result.final.engine, result.problem
        drives = [drive for decision in problem.decisions for drive in decision.drives]

        def driven(what: str, kind: Kind | None = None) -> frozenset[Any]:
            matching = [drive for drive in drives if hasattr(drive, what) and kind in (None, drive.kind)]
            return frozenset(getattr(drive, what) for drive in matching)

        numbers, sizes = driven("mount"), {part for part, _ in driven("key", Kind.SIZE)}
        masses = frozenset(part for part, _ in driven("key", Kind.PISTON))
        mounts = frozenset(mount.name for k, mount in enumerate(engine.mounts) if k in numbers)
        shaft_names = frozenset(part.shaft.name for part in engine.slider_cranks)
        cranks = (
            shaft_names if problem.phasing is not None or sizes - _OF_RODS else driven("key", Kind.LEAD) & shaft_names
        )
        state = "optimised" if is_changed(result) else "open"
        return cls(engine, driven("rotor"), mounts, masses, cranks, bool(sizes & _OF_RODS), state)

    @property
    def weights(self) -> list[Rotor]:
        """Rotors with an unbalance, without the throws."""
        return [rotor for rotor in self.engine.rotors if rotor.role is not Role.THROW and abs(rotor.unbalance) > 0.0]

    @property
    def is_flat(self) -> bool:
        """True if all cylinders lie, so that the second view is from above."""
        leaning = [abs(math.cos(part.bank)) for part in self.engine.slider_cranks]
        return max(leaning) < 0.5

    @property
    def is_star(self) -> bool:
        """True if each of three or more cylinders has its own direction, so that they hide each other from the side."""
        banks = [round(part.bank, 6) for part in self.engine.slider_cranks]
        return len(banks) > 2 and len(set(banks)) == len(banks)

    @property
    def side_view(self) -> str:
        """Viewpoint of the second view."""
        return "from above" if self.is_flat else "from the left"

    @property
    def rod_look(self) -> dict[str, Any]:
        """Style of the rods."""
        return DECIDED if self.rods else {"facecolor": METAL, "edgecolor": INK}

    def piston_look(self, pose: Pose) -> dict[str, Any]:
        """Return the style of a piston."""
        return DECIDED if pose.part.name in self.pistons else PISTON


def views(view: EngineView) -> Page:
    """Return empty panels for both views, to one scale that fills a page."""
    front, side = (np.array(points) for points in reaches(view))
    sizes = np.array([ROOM * np.ptp(points, axis=0) for points in (front, side)])
    scale = min((WIDE - NARROW) / sizes[1, 0], WIDE / sizes[:, 0].sum(), HIGH / sizes[:, 1].max())
    height = float(scale * sizes[:, 1].max())
    drawn = page(1, 2, (0.5 * WIDE, height), across=ACROSS)
    inches, left = drawn.size[0], 0.0
    for axes, points, size, is_side in zip(drawn.panels, (front, side), sizes, (False, True), strict=True):
        width = max(float(scale * size[0]), NARROW)
        axes.set_position((left / inches, 0.0, width / inches, 1.0))
        left += width + ACROSS
        # limits [mm] about the middle of the area over all angles
        (x, y), half = 0.5 * (points.min(axis=0) + points.max(axis=0)), (0.5 * width / scale, 0.5 * height / scale)
        across, up = (x - half[0], x + half[0]), (y - half[1], y + half[1])
        down = is_side and view.is_flat
        axes.set(xlim=across[::-1] if is_side else across, ylim=up[::-1] if down else up, aspect="equal")
        for axis, steps in ((axes.xaxis, width / 0.8), (axes.yaxis, height / 0.5)):
            round_ticks(axis, min(max(int(steps), 2), 7))
    return drawn


def draw_views(drawn: Page, view: EngineView) -> None:
    """Draw both views at a crank angle of zero."""
    front, side = drawn.panels
    _front(front, view)
    _side(side, view)
    front.set_title("from the front, turning clockwise", loc="left", size=SMALL)
    side.set_title(view.side_view, loc="left", size=SMALL)


def _front(axes: Axes, view: EngineView) -> None:
    """Draw the view from the front: y to the right, z up, turning clockwise (C3)."""
    # draw from back to front
    poses = [Pose.at_angle(part, 0.0) for part in sorted(view.engine.slider_cranks, key=lambda part: part.x)]
    bore, places = bore_of(view.engine), dict[str, complex]()
    for k, pose in enumerate(poses):
        behind = 4.0 + k / len(poses)
        for body in pose.bodies:
            axes.add_patch(Polygon([at(place) for place in body.points], closed=True, **look_of(body)))
        if not pose.bodies:
            places[_number_of(pose)] = cylinder(axes, pose, bore)
            piston_at(axes, pose, bore, behind, **view.piston_look(pose))
            bar(axes, (pose.foot, 0.15 * bore), (pose.piston, 0.09 * bore), behind, **view.rod_look)
            slot(axes, pose, bore, behind)
        bar(axes, (pose.crank, 0.2 * bore), (pose.pin, 0.15 * bore), behind + 2.0, **_crank_look(view, pose))
        axes.add_patch(Circle(at(pose.pin), MM * 0.08 * bore, facecolor="white", edgecolor=INK, zorder=7.5))
    for number, place in places.items() if view.is_star else ():
        axes.text(*at(place), number, ha="center", va="center", size=SMALL, zorder=6.0)
    for rotor in view.weights:
        centre, along = complex(rotor.shaft.z, rotor.shaft.y), cmath.phase(rotor.unbalance)
        middle = 90.0 - math.degrees(along)
        radius = MM * half_disc(abs(rotor.unbalance))
        axes.add_patch(Wedge(at(centre), radius, middle - 90.0, middle + 90.0, zorder=3.0, **_weight_look(view, rotor)))
    for shaft in view.engine.shafts:
        axes.add_patch(Circle(at(complex(shaft.z, shaft.y)), MM * 0.08 * bore, facecolor=INK, zorder=8.0))
    for mount in view.engine.mounts:
        _, y, z = mount.position
        axes.plot(MM * y, MM * z, **_mount_look(mount.name in view.mounts))
    axes.set(xlabel="y [mm]", ylabel="z [mm]")


def _side(axes: Axes, view: EngineView) -> None:
    """Draw the view from the left (z up) or from above (y down), the front of the engine at the left."""
    bore = bore_of(view.engine)
    poses = [Pose.at_angle(part, 0.0) for part in view.engine.slider_cranks]
    quarter, pistons = 0.5 * math.pi if view.is_flat else 0.0, list[tuple[Pose, float]]()

    def level(place: complex) -> float:
        return MM * (place.imag if view.is_flat else place.real)

    for shaft in view.engine.shafts:
        places = [pose.part.x for pose in poses if pose.part.shaft is shaft]
        thick = 0.22 if places else 0.1
        places += [rotor.x for rotor in view.engine.rotors if rotor.shaft == shaft]
        ends, middle = (max(places) + 0.6 * bore, min(places) - 0.6 * bore), level(complex(shaft.z, shaft.y))
        box(axes, ends, (middle - MM * 0.5 * thick * bore, middle + MM * 0.5 * thick * bore), 3.0, facecolor=METAL)
    for pose in poses:
        x, pin, crank, piston = pose.part.x, level(pose.pin), level(pose.crank), level(pose.piston)
        reach, sign = MM * 0.15 * bore, math.copysign(1.0, pin - crank)
        for web in (x - WEB * bore, x + WEB * bore):
            ends = (web - 0.06 * bore, web + 0.06 * bore)
            box(axes, ends, (crank - sign * 1.3 * reach, pin + sign * reach), 4.5, **_crank_look(view, pose))
        journal = (pin - 0.7 * reach, pin + 0.7 * reach)
        box(axes, (x - 0.18 * bore, x + 0.18 * bore), journal, 4.4, **_crank_look(view, pose))
        for body in pose.bodies:
            levels = [level(place) for place in body.points]
            corner = (MM * (x - 0.5 * body.width), min(levels))
            axes.add_patch(Rectangle(corner, MM * body.width, max(levels) - min(levels), **look_of(body)))
            piston = 0.5 * (min(levels) + crank)
        if not pose.bodies:
            box(axes, (x - ROD * bore, x + ROD * bore), (pin, piston), 4.6, **view.rod_look)
            high = MM * 0.5 * bore * max(abs(math.cos(pose.part.bank - quarter)), 0.2)
            walls, ends = (x - 0.48 * bore, x + 0.48 * bore), (piston - 0.5 * high, piston + 0.5 * high)
            box(axes, walls, ends, 5.0, **view.piston_look(pose))
        pistons.append((pose, piston))
    if not view.is_star:
        _numbers(axes, pistons, quarter, bore)
    for rotor in view.weights:
        radius, along = half_disc(abs(rotor.unbalance)), cmath.phase(rotor.unbalance) - quarter
        # lowest and highest point of the half disc about its centre
        up, across = math.cos(along), radius * abs(math.sin(along))
        low, high = -radius if up < 0.0 else -across, radius if up > 0.0 else across
        middle = level(complex(rotor.shaft.z, rotor.shaft.y))
        for x, thickness in planes_of(view, rotor):
            ends = (x - 0.5 * thickness, x + 0.5 * thickness)
            box(axes, ends, (middle + MM * low, middle + MM * high), 5.5, **_weight_look(view, rotor))
    for mount in view.engine.mounts:
        x, y, z = mount.position
        axes.plot(MM * x, level(complex(z, y)), **_mount_look(mount.name in view.mounts))
    axes.set(xlabel="x [mm], the front at the left", ylabel="y [mm]" if view.is_flat else "z [mm]")


def planes_of(view: EngineView, rotor: Rotor) -> list[tuple[float, float]]:
    """Return place along the crank and thickness of the parts of a weight [m].

    A weight in the plane of a rod stands in halves on both webs of the throw.
    """
    bore = bore_of(view.engine)
    for part in view.engine.slider_cranks:
        if rotor.shaft == part.shaft and abs(rotor.x - part.x) < ROD * bore + 0.5 * THICKNESS:
            return [(part.x + side * WEB * bore, 0.5 * THICKNESS) for side in (-1.0, 1.0)]
    return [(rotor.x, THICKNESS)]


def _number_of(pose: Pose) -> str:
    return next((word for word in pose.part.name.split() if word.isdecimal()), "")


def _numbers(axes: Axes, pistons: Sequence[tuple[Pose, float]], quarter: float, bore: float) -> None:
    """Write cylinder numbers on pistons that are large enough."""
    inch = abs(float(np.ptp(axes.get_xlim()))) * axes.figure.dpi / axes.bbox.width
    labels: list[tuple[float, float, list[str]]] = []
    for pose, up in pistons:
        number = _number_of(pose)
        # pistons of two banks may stand behind each other
        lean = float(np.sign(round(math.sin(pose.part.bank - quarter), 9)))
        if not number or width_of(number) > (0.45 if lean else 0.9) * 0.96 * MM * bore / inch:
            continue
        place = MM * (pose.part.x - 0.25 * bore * lean)
        names_nearby = (names for x, z, names in labels if max(abs(x - place), abs(z - up)) < 0.16 * inch)
        if (names := next(names_nearby, None)) is None:
            labels.append((place, up, [number]))
        elif number not in names and width_of(", ".join([*names, number])) < 0.9 * MM * bore / inch:
            names.append(number)
    behind = {"facecolor": "white", "edgecolor": "none", "pad": 0.0}
    for place, up, names in labels:
        axes.text(place, up, ", ".join(names), ha="center", va="center_baseline", size=SMALL, zorder=6.0, bbox=behind)


def reaches(view: EngineView) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Return corners of the drawn area in both views, over a whole turn [mm]."""
    front, side = [], []
    for x, centre, radius in _spots(view):
        for y, z in ((centre.imag - radius, centre.real - radius), (centre.imag + radius, centre.real + radius)):
            front.append((MM * y, MM * z))
            side.append((MM * x, MM * (y if view.is_flat else z)))
    bore = MM * bore_of(view.engine)
    side += [(corner + sign * 0.7 * bore, z) for corner, z in side[:] for sign in (-1.0, 1.0)]
    return front, side


def _spots(view: EngineView) -> Iterator[tuple[float, complex, float]]:
    bore = bore_of(view.engine)
    for part in view.engine.slider_cranks:
        for pose in (Pose.at_angle(part, phi) for phi in np.linspace(0.0, math.tau / abs(part.shaft.ratio), 13)):
            spots = [*(place for body in pose.bodies for place in body.points)] or [pose.piston]
            yield from ((part.x, place, 0.0 if pose.bodies else 0.6 * bore) for place in spots)
            yield part.x, pose.pin, 0.15 * bore
    for rotor in view.weights:
        yield rotor.x, complex(rotor.shaft.z, rotor.shaft.y), half_disc(abs(rotor.unbalance))
    for rotor in view.engine.rotors:
        yield rotor.x, complex(rotor.shaft.z, rotor.shaft.y), 0.1 * bore
    for mount in view.engine.mounts:
        yield mount.position[0], complex(mount.position[2], mount.position[1]), 0.1 * bore


def legend_of(view: EngineView) -> list[Line2D | Patch]:
    """Return the entries of the legend."""
    entries: list[Line2D | Patch] = []
    for name, decided in (("crank", view.cranks), ("piston", view.pistons), ("rod", view.rods)):
        if decided:
            entries.append(Patch(label=f"{name}, {view.state}", **DECIDED))
    if not view.cranks >= {part.shaft.name for part in view.engine.slider_cranks}:
        entries.append(Patch(label="crank", **_PLAIN))
    # one entry per kind
    kinds = {rotor.name in view.rotors: rotor for rotor in view.weights}
    entries += [
        Patch(label=f"weight, {view.state}" if decided else "weight", **_weight_look(view, rotor))
        for decided, rotor in sorted(kinds.items())
    ]
    if len(view.mounts) < len(view.engine.mounts):
        entries.append(entry_of_dots("mount", marker="^", color=ORANGE))
    if view.mounts:
        entries.append(entry_of_dots(f"mount, {view.state}", marker="^", color=AFTER))
    return entries


def _mount_look(decided: bool) -> dict[str, Any]:
    return {"marker": "^", "markersize": 9.0, "color": AFTER if decided else ORANGE, "linestyle": "none", "zorder": 9.0}


DECIDED: dict[str, Any] = {"facecolor": PALE, "edgecolor": AFTER}
_PLAIN: dict[str, Any] = {"facecolor": IRON, "edgecolor": INK}


def _crank_look(view: EngineView, pose: Pose) -> dict[str, Any]:
    return DECIDED if pose.part.shaft.name in view.cranks else _PLAIN


def _weight_look(view: EngineView, rotor: Rotor) -> dict[str, Any]:
    # edges separate overlapping weights
    return {"facecolor": (AFTER if rotor.name in view.rotors else GREY, 0.55), "edgecolor": INK, "linewidth": 0.8}
