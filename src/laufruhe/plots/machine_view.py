"""The engine to scale at any crank angle, from the front and the left: cranks, pistons, weights, shafts, mounts."""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle, Wedge

from laufruhe.machine import Engine, Rotor, Shaft, SliderCrank
from laufruhe.machine.rotor import Role
from laufruhe.machine.slider_crank import Outline
from laufruhe.plots.style import AFTER, GREY, ORANGE, entry, entry_of_dots
from laufruhe.plots.words import FAINT, INK
from laufruhe.present.measures import changed
from laufruhe.solvers.result import Result

STEEL = 7850.0
THICKNESS = 0.02
"""Of the half discs that stand for weights [m]."""
LONG_ROD = 4.0
_METAL = "#c9ced3"
_PISTON: Any = {"facecolor": "white", "edgecolor": INK, "linewidth": 1.0, "alpha": 0.9}
_MM = 1e3


@dataclass(frozen=True)
class Scene:
    """An engine, and what of it was open.

    Attributes
    ----------
    rotors, mounts
        Names of those that were decided.
    throws
        Whether the crank was.
    state
        "decided", or "open" in a design as given.
    """

    engine: Engine
    rotors: frozenset[str]
    mounts: frozenset[str]
    throws: bool
    state: str

    @classmethod
    def of(cls, result: Result) -> Scene:
        """Of the design of a result."""
        engine, problem = result.final.engine, result.problem
        drives = [drive for decision in problem.decisions for drive in decision.drives]
        rotors = {name for name in (getattr(drive, "rotor", None) for drive in drives) if name is not None}
        numbers = {number for number in (getattr(drive, "mount", None) for drive in drives) if number is not None}
        mounts = {mount.name for k, mount in enumerate(engine.mounts) if k in numbers}
        state = "decided" if changed(result) else "open"
        return cls(engine, frozenset(rotors), frozenset(mounts), problem.phasing is not None, state)

    @property
    def weights(self) -> list[Rotor]:
        """Unbalances that are there, but for the throws themselves."""
        return [rotor for rotor in self.engine.rotors if rotor.role is not Role.THROW and abs(rotor.unbalance) > 0.0]

    @property
    def balancers(self) -> list[Shaft]:
        """Shafts beside the cranks."""
        cranks = {part.shaft for part in self.engine.slider_cranks}
        return [shaft for shaft in self.engine.shafts if shaft not in cranks]

    @property
    def is_flat(self) -> bool:
        """Whether its cylinders lie: such an engine is seen from above, others from the left."""
        leaning = [abs(math.cos(part.bank)) for part in self.engine.slider_cranks]
        return max(leaning) < 0.5

    @property
    def beside(self) -> str:
        """From where the second view is taken."""
        return "from above" if self.is_flat else "from the left"

    def colour(self, rotor: Rotor) -> str:
        """Of a weight: whether it was decided."""
        return AFTER if rotor.name in self.rotors else GREY


@dataclass(frozen=True)
class _Pose:
    """Where a slider-crank is, zeta = z + i y [m] (C4), and the bodies of one that has no piston."""

    part: SliderCrank
    crank: complex
    pin: complex
    piston: complex
    bodies: tuple[Outline, ...]

    @classmethod
    def of(cls, part: SliderCrank, phi: float) -> _Pose:
        """At a crank angle (C5)."""
        centre, axis = complex(part.shaft.z, part.shaft.y), cmath.exp(1j * part.bank)
        turn = part.throw + part.shaft.ratio * phi
        rod = part.rod_length if math.isfinite(part.rod_length) else LONG_ROD * part.crank_radius
        moved = complex(part.motion(np, np.float64(turn - part.bank)).points[0][1][0])
        way = part.crank_radius + rod + moved
        bodies = tuple(
            replace(body, points=centre + axis * body.points) for body in part.outlines(float(turn - part.bank))
        )
        return cls(part, centre, centre + part.crank_radius * cmath.exp(1j * turn), centre + way * axis, bodies)


def half_disc(unbalance: float) -> float:
    """Radius of a half disc of steel with this unbalance [m]: its area centre lies 4 R / 3 pi off."""
    return math.cbrt(1.5 * unbalance / (STEEL * THICKNESS))


def front_view(axes: Axes, scene: Scene, phi: float = 0.0) -> None:
    """From the front: y to the right, z up, turning clockwise (C3)."""
    poses = [_Pose.of(part, phi) for part in scene.engine.slider_cranks]
    bore = _bore(scene.engine)
    for pose in poses:
        if pose.bodies:
            _bodies(axes, pose)
        else:
            _line(axes, [pose.pin, pose.piston], color=_METAL, linewidth=2.6, zorder=2)
            _piston(axes, pose, bore)
        _line(axes, [pose.crank, pose.pin], color=_crank_colour(scene), linewidth=3.2, zorder=4)
        axes.add_patch(Circle(_at(pose.pin), _MM * 0.12 * bore, facecolor="white", edgecolor=INK, zorder=5))
    for rotor in scene.weights:
        centre, along = complex(rotor.shaft.z, rotor.shaft.y), _direction(rotor, phi)
        middle = 90.0 - math.degrees(along)
        radius = _MM * half_disc(abs(rotor.unbalance))
        look: Any = {"facecolor": scene.colour(rotor), "edgecolor": INK, "linewidth": 0.6, "alpha": 0.75, "zorder": 3}
        axes.add_patch(Wedge(_at(centre), radius, middle - 90.0, middle + 90.0, **look))
    for shaft in scene.engine.shafts:
        axes.add_patch(Circle(_at(complex(shaft.z, shaft.y)), _MM * 0.08 * bore, facecolor=INK, zorder=6))
    for mount in scene.engine.mounts:
        _, y, z = mount.position
        axes.plot(_MM * y, _MM * z, **_mount_look(mount.name in scene.mounts))
    axes.set(xlabel="y [mm]", ylabel="z [mm]")


def side_view(axes: Axes, scene: Scene, phi: float = 0.0) -> None:
    """From the left, z up, or from above, y down: the front of the engine at the left."""
    bore, parts = _bore(scene.engine), scene.engine.slider_cranks
    quarter = 0.5 * math.pi if scene.is_flat else 0.0

    def level(place: complex) -> float:
        return _MM * (place.imag if scene.is_flat else place.real)

    for shaft in scene.engine.shafts:
        places = [part.x for part in parts if part.shaft is shaft]
        places += [rotor.x for rotor in scene.engine.rotors if rotor.shaft == shaft]
        ends = (max(places) + 0.6 * bore, min(places) - 0.6 * bore)
        axes.plot([_MM * x for x in ends], [level(complex(shaft.z, shaft.y))] * 2, color=FAINT, linewidth=1.0, zorder=2)
    for pose in (_Pose.of(part, phi) for part in parts):
        x, wide, pin = _MM * pose.part.x, _MM * 0.18 * bore, level(pose.pin)
        look: Any = {"color": _crank_colour(scene), "linewidth": 2.6, "zorder": 4}
        crank, piston = level(pose.crank), level(pose.piston)
        axes.plot([x - wide, x - wide, x + wide, x + wide], [crank, pin, pin, crank], **look)
        for body in pose.bodies:
            heights = [level(place) for place in body.points]
            corner = (x - 0.5 * _MM * body.width, min(heights))
            axes.add_patch(Rectangle(corner, _MM * body.width, max(heights) - min(heights), **_look_of(body)))
            piston = 0.5 * (min(heights) + crank)
        if not pose.bodies:
            axes.plot([x, x], [pin, piston], color=_METAL, linewidth=2.6, zorder=3)
            height = _MM * 0.5 * bore * max(abs(math.cos(pose.part.bank - quarter)), 0.2)
            place = (x - 0.48 * _MM * bore, piston - 0.5 * height)
            axes.add_patch(Rectangle(place, 0.96 * _MM * bore, height, **_PISTON, zorder=5))
        number = next((word for word in pose.part.name.split() if word.isdecimal()), "")
        # pistons of two banks may stand behind each other
        aside = -0.25 * _MM * bore * float(np.sign(round(math.sin(pose.part.bank - quarter), 9)))
        axes.text(x + aside, piston, number, ha="center", va="center", size=7.5, zorder=6)
    for rotor in scene.weights:
        low, high = _heights(half_disc(abs(rotor.unbalance)), _direction(rotor, phi) - quarter)
        place = (_MM * (rotor.x - 0.5 * THICKNESS), level(complex(rotor.shaft.z, rotor.shaft.y)) + _MM * low)
        look = {"facecolor": scene.colour(rotor), "edgecolor": INK, "linewidth": 0.6, "alpha": 0.75, "zorder": 5.5}
        axes.add_patch(Rectangle(place, _MM * THICKNESS, _MM * (high - low), **look))
    for mount in scene.engine.mounts:
        x, y, z = mount.position
        axes.plot(_MM * x, level(complex(z, y)), **_mount_look(mount.name in scene.mounts))
    axes.set(xlabel="x [mm], the front at the left", ylabel="y [mm]" if scene.is_flat else "z [mm]")


def framed(axes: Axes, points: Sequence[tuple[float, float]], backwards: bool = False, down: bool = False) -> None:
    """One scale both ways, with room around what is seen at any angle [mm]; x to the left, or y down, where told."""
    corners = np.array([np.min(points, axis=0), np.max(points, axis=0)])
    panel = np.array(axes.bbox.size)
    wide, high = 0.5 * 1.12 * float(((corners[1] - corners[0]) / panel).max()) * panel
    x, y = corners.mean(axis=0)
    across, up = (x - wide, x + wide), (y - high, y + high)
    axes.set(xlim=across[::-1] if backwards else across, ylim=up[::-1] if down else up)


def reaches(scene: Scene) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Corners of what is seen from the front and from beside, over a whole turn [mm]."""
    front, side = [], []
    for x, centre, radius in _spots(scene):
        for y, z in ((centre.imag - radius, centre.real - radius), (centre.imag + radius, centre.real + radius)):
            front.append((_MM * y, _MM * z))
            side.append((_MM * x, _MM * (y if scene.is_flat else z)))
    bore = _MM * _bore(scene.engine)
    side += [(corner + sign * 0.7 * bore, z) for corner, z in side[:] for sign in (-1.0, 1.0)]
    return front, side


def _spots(scene: Scene) -> Iterator[tuple[float, complex, float]]:
    bore = _bore(scene.engine)
    for part in scene.engine.slider_cranks:
        for pose in (_Pose.of(part, phi) for phi in np.linspace(0.0, math.tau / abs(part.shaft.ratio), 13)):
            spots = [*(place for body in pose.bodies for place in body.points)] or [pose.piston]
            yield from ((part.x, place, 0.0 if pose.bodies else 0.4 * bore) for place in spots)
            yield part.x, pose.pin, 0.15 * bore
    for rotor in scene.weights:
        yield rotor.x, complex(rotor.shaft.z, rotor.shaft.y), half_disc(abs(rotor.unbalance))
    for rotor in scene.engine.rotors:
        yield rotor.x, complex(rotor.shaft.z, rotor.shaft.y), 0.1 * bore
    for mount in scene.engine.mounts:
        yield mount.position[0], complex(mount.position[2], mount.position[1]), 0.1 * bore


def legend_of(scene: Scene) -> list[Line2D | Patch]:
    """What stands for what."""
    crank = f"crank, {scene.state}" if scene.throws else "crank"
    found: list[Line2D | Patch] = [entry(crank, color=_crank_colour(scene), linewidth=3.0)]
    colours = {scene.colour(rotor) for rotor in scene.weights}
    words = {GREY: "weight", AFTER: f"weight, {scene.state}"}
    found += [Patch(facecolor=colour, edgecolor=INK, alpha=0.75, label=words[colour]) for colour in sorted(colours)]
    if len(scene.mounts) < len(scene.engine.mounts):
        found.append(entry_of_dots("mount", marker="^", color=ORANGE))
    if scene.mounts:
        found.append(entry_of_dots(f"mount, {scene.state}", marker="^", color=AFTER))
    return found


def _mount_look(decided: bool) -> dict[str, Any]:
    return {"marker": "^", "markersize": 9.0, "color": AFTER if decided else ORANGE, "linestyle": "none", "zorder": 6.5}


def _crank_colour(scene: Scene) -> str:
    return AFTER if scene.throws else INK


def _direction(rotor: Rotor, phi: float) -> float:
    """Angle of its unbalance from z towards y [rad]."""
    return cmath.phase(rotor.unbalance) + rotor.shaft.ratio * phi


def _heights(radius: float, along: float) -> tuple[float, float]:
    """Lowest and highest point of a half disc about its centre [m]."""
    up, across = math.cos(along), radius * abs(math.sin(along))
    return (-radius if up < 0.0 else -across), (radius if up > 0.0 else across)


def _bore(engine: Engine) -> float:
    """Of the largest cylinder; as wide as the stroke where it is not told [m]."""
    return max(part.bore or part.stroke for part in engine.slider_cranks)


def _at(place: complex) -> tuple[float, float]:
    return _MM * place.imag, _MM * place.real


def _line(axes: Axes, places: Sequence[complex], **look: Any) -> None:
    xs, ys = zip(*(_at(place) for place in places), strict=True)
    axes.plot(xs, ys, solid_capstyle="round", **look)


def _look_of(body: Outline) -> dict[str, Any]:
    if body.moves:
        return {**_PISTON, "zorder": 2.2}
    return {"fill": False, "edgecolor": GREY, "linewidth": 1.4, "zorder": 1.8}


def _bodies(axes: Axes, pose: _Pose) -> None:
    for body in pose.bodies:
        xs, ys = zip(*(_at(place) for place in body.points), strict=True)
        axes.fill(xs, ys, **_look_of(body))


def _piston(axes: Axes, pose: _Pose, bore: float) -> None:
    turn = cmath.exp(1j * pose.part.bank)
    ways = ((-0.25, -0.48), (-0.25, 0.48), (0.25, 0.48), (0.25, -0.48))
    corners = (pose.piston + turn * bore * complex(up, side) for up, side in ways)
    xs, ys = zip(*(_at(corner) for corner in corners), strict=True)
    axes.fill(xs, ys, **_PISTON, zorder=3.5)
