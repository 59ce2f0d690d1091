"""Draw the figures of the theory pages: axes of the engine, slider-crank, cycle of the gas.

`python docs/extensions/figures.py` writes them to `docs/pictures/`. The curves of the gas are computed by the package.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from html import escape
from pathlib import Path
from typing import TypeAlias

import numpy as np

from laufruhe.machine import Cycle, Seiliger, SliderCrank, Wiebe
from laufruhe.machine.gas.base import OneChamber
from laufruhe.machine.gas.charge import swept_volume
from laufruhe.physics.gas_loads import chamber_torque
from laufruhe.plots.style import BLUE, GREY, ORANGE, VERMILION
from laufruhe.plots.words import FAINT, INK

PICTURES = Path(__file__).parents[1] / "pictures"
STEEL, PAPER = "#dcebf7", "#ffffff"
GUIDE, BOLD = "4 3", 2.0
HEAD = 8.0
"""Length of an arrow's head [px]."""

Point: TypeAlias = tuple[float, float]
Parts: TypeAlias = list[str]


def picture(width: int, height: int, words: str, parts: Iterable[str]) -> str:
    """Return an SVG picture of these parts."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'font-family="sans-serif" font-size="15" role="img" aria-label="{escape(words)}">'
    )
    return "\n".join([head, f'<rect width="{width}" height="{height}" fill="{PAPER}"/>', *parts, "</svg>", ""])


def path(points: Sequence[Point], colour: str = INK, width: float = 1.2, dash: str = "", fill: str = "none") -> str:
    """Return a line through points [px]."""
    places = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    look = f'fill="{fill}" stroke="{colour}" stroke-width="{width}"{dashed} stroke-linejoin="round"'
    return f'<polyline points="{places}" {look}/>'


def circle(x: float, y: float, radius: float, fill: str = PAPER, colour: str = INK, dash: str = "") -> str:
    """Return a circle [px]."""
    dashed = f' stroke-dasharray="{dash}"' if dash else ""
    look = f'fill="{fill}" stroke="{colour}" stroke-width="1.2"{dashed}'
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" {look}/>'


def box(x: float, y: float, width: float, height: float, fill: str = STEEL, colour: str = INK) -> str:
    """Return a rectangle by its upper left corner [px]."""
    return (
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" '
        f'fill="{fill}" stroke="{colour}" stroke-width="1.2"/>'
    )


def text(x: float, y: float, words: str, colour: str = INK, anchor: str = "middle", size: int = 15) -> str:
    """Return words about a place [px]."""
    look = f'fill="{colour}" text-anchor="{anchor}" font-size="{size}"'
    return f'<text x="{x:.1f}" y="{y:.1f}" {look}>{escape(words)}</text>'


def symbol(x: float, y: float, letter: str, index: str = "", colour: str = INK, anchor: str = "middle") -> str:
    """Return a letter of a formula, with an index below."""
    below = f'<tspan dy="4" font-size="12" font-style="normal">{escape(index)}</tspan>' if index else ""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" text-anchor="{anchor}" font-family="serif" font-size="19" '
        f'font-style="italic">{escape(letter)}{below}</text>'
    )


def arrow(start: Point, end: Point, colour: str = INK, width: float = 1.2, both: bool = False) -> Parts:
    """Return a line with a head at its end, or at both ends [px]."""
    parts = [path([start, end], colour, width)]
    for tip, tail in [(end, start), (start, end)][: 2 if both else 1]:
        parts.append(_head(tip, math.atan2(tip[1] - tail[1], tip[0] - tail[0]), colour))
    return parts


def _head(tip: Point, angle: float, colour: str) -> str:
    sides = [(tip[0] - HEAD * math.cos(angle + side), tip[1] - HEAD * math.sin(angle + side)) for side in (0.35, -0.35)]
    return path([tip, *sides, tip], colour, 0.5, fill=colour)


def arc(centre: Point, radius: float, begin: float, end: float, colour: str = INK, head: bool = True) -> Parts:
    """Return an arc clockwise from the upward direction between two angles [deg], with a head at its end."""
    angles = np.radians(np.linspace(begin, end, 40))
    points = [(centre[0] + radius * math.sin(a), centre[1] - radius * math.cos(a)) for a in angles.tolist()]
    # a head is straight, so that it leans inwards by half of its angle
    turn = math.radians(end) - 0.5 * HEAD / radius * math.copysign(1.0, end - begin)
    heading = turn if end > begin else turn + math.pi
    return [path(points, colour), *([_head(points[-1], heading, colour)] if head else [])]


def axes_of_engine() -> str:
    """Return the axes and senses of C2 to C5, from the front and from the right-hand side."""
    return picture(
        860,
        360,
        "Axes of the engine. From the front: y to the right, z up, x towards the reader, the crank turns clockwise. "
        "From the right-hand side: x to the right, z up, cylinder 1 at the front.",
        [*_front_view((190.0, 230.0)), *_side_view((610.0, 230.0))],
    )


def _front_view(centre: Point) -> Parts:
    x, y = centre
    radius, phi = 70.0, 40.0
    pin = x + radius * math.sin(math.radians(phi)), y - radius * math.cos(math.radians(phi))
    return [
        text(x, 34, "Front end, seen from ahead", size=16),
        circle(x, y, radius, "none", FAINT, GUIDE),
        *arrow((x, y), (x + 135, y), BLUE, BOLD),
        symbol(x + 150, y + 6, "y", colour=BLUE),
        text(x + 122, y + 26, "left", BLUE, size=14),
        *arrow((x, y), (x, y - 150), BLUE, BOLD),
        symbol(x, y - 160, "z", colour=BLUE),
        text(x - 12, y - 140, "up", BLUE, "end", 14),
        path([(x, y), pin], INK, 5.0),
        circle(*pin, 8),
        text(pin[0] + 14, pin[1] + 2, "crank pin", anchor="start", size=14),
        symbol(x + 34, y - 22, "r"),
        circle(x, y, 9),
        circle(x, y, 3, BLUE, BLUE),
        path([(x - 14, y), (x - 78, y)], BLUE, 0.8, GUIDE),
        symbol(x - 94, y + 5, "x", colour=BLUE),
        text(x - 116, y + 26, "towards you", BLUE, size=14),
        *arc(centre, 102, 3, 37, VERMILION),
        symbol(x + 40, y - 104, "φ", colour=VERMILION),
        *arc(centre, 88, 130, 230, VERMILION),
        text(x, y + 112, "crank turns clockwise", VERMILION, size=14),
    ]


def _side_view(centre: Point) -> Parts:
    x, y = centre
    places = [x + 60.0 * k for k in (1.5, 0.5, -0.5, -1.5)]
    cranks = [x + 150.0]
    levels = [y]
    for place, up in zip(places, (1, -1, -1, 1), strict=True):
        # webs of a throw stand at both sides of its pin
        cranks += [place + 16, place + 16, place - 16, place - 16]
        levels += [y, y - 26 * up, y - 26 * up, y]
    return [
        text(x, 34, "Seen from its right-hand side", size=16),
        box(x - 130, y - 120, 260, 160, "#f3f3f3", FAINT),
        *(box(place - 22, y - 108, 44, 58) for place in places),
        *(text(place, y - 74, str(k), size=16) for k, place in enumerate(places, 1)),
        path([*zip(cranks, levels, strict=True), (x - 150, y)], INK, 4.0),
        path([(x - 205, y), (x + 175, y)], FAINT, 1.0, "12 3 2 3"),
        box(x - 163, y - 50, 14, 100),
        text(x - 156, y + 72, "flywheel,", size=14),
        text(x - 156, y + 90, "power take-off", size=14),
        text(x + 120, y + 72, "front end", size=14),
        *arrow((x, y), (x + 205, y), BLUE, BOLD),
        symbol(x + 217, y + 6, "x", colour=BLUE),
        text(x + 206, y + 26, "forward", BLUE, size=14),
        *arrow((x, y), (x, y - 150), BLUE, BOLD),
        symbol(x, y - 160, "z", colour=BLUE),
        circle(x, y, 9),
        path([(x - 6, y - 6), (x + 6, y + 6)], BLUE),
        path([(x - 6, y + 6), (x + 6, y - 6)], BLUE),
        text(x, y + 58, "y away from you", BLUE, size=14),
    ]


def slider_crank() -> str:
    """Return a slider-crank with an offset and the symbols of K1 to K6."""
    radius, rod, offset, alpha = 95.0, 250.0, 24.0, math.radians(55.0)
    x, y = 210.0, 400.0
    pin = x + radius * math.sin(alpha), y - radius * math.cos(alpha)
    psi = math.asin((radius * math.sin(alpha) - offset) / rod)
    piston = x + offset, pin[1] - rod * math.cos(psi)
    middle = 0.5 * (pin[0] + piston[0]), 0.5 * (pin[1] + piston[1])
    return picture(
        470,
        535,
        "Slider-crank: crank radius r at the angle alpha from the cylinder axis, rod length l leaning by psi, "
        "offset e, piston position s",
        [
            *(path([(piston[0] + side, 34), (piston[0] + side, 215)], FAINT, 2.5) for side in (-51.0, 51.0)),
            box(piston[0] - 48, piston[1] - 46, 96, 84),
            path([(piston[0], 14), (piston[0], 520)], FAINT, 1.0, "12 3 2 3"),
            path([(x, y + 120), (x, y - 150)], FAINT, 1.0, GUIDE),
            circle(x, y, radius, "none", FAINT, GUIDE),
            path([(x, y), pin], INK, 6.0),
            path([pin, piston], INK, 4.0),
            circle(x, y, 10, GREY),
            circle(*pin, 9),
            circle(*piston, 8),
            symbol(x + 56, y - 20, "r"),
            symbol(middle[0] + 14, middle[1], "l"),
            *arc((x, y), 55, 0, math.degrees(alpha) - 6, VERMILION),
            symbol(x + 40, y - 68, "α", colour=VERMILION),
            *arc(piston, 96, 180, 180 - math.degrees(psi), VERMILION, head=False),
            symbol(piston[0] + 13, piston[1] + 117, "ψ", colour=VERMILION),
            path([(x, y), (60, y)], FAINT, 1.0, GUIDE),
            path([(piston[0] - 48, piston[1]), (60, piston[1])], FAINT, 1.0, GUIDE),
            *arrow((72, y), (72, piston[1]), BLUE, both=True),
            symbol(58, 0.5 * (y + piston[1]), "s", colour=BLUE),
            *arrow((x - 34, y + 112), (x, y + 112), BLUE),
            *arrow((piston[0] + 34, y + 112), (piston[0], y + 112), BLUE),
            symbol(piston[0] + 44, y + 117, "e", colour=BLUE),
            text(piston[0] + 8, 22, "cylinder axis", FAINT, "start", 14),
            text(pin[0] + 16, pin[1] + 6, "crank pin", anchor="start", size=14),
            text(piston[0] + 62, piston[1] + 5, "piston", anchor="start", size=14),
            *arc((x, y), 112, 100, 140, VERMILION),
            text(x + 112, y + 84, "sense of turning", VERMILION, "start", 14),
        ],
    )


def gas_cycle() -> str:
    """Return pressure over volume, and torque over crank angle, of one cylinder of the tractor study."""
    part = SliderCrank("cylinder", 0.0, 0.06, 0.06 / 0.26, 0.0, bore=0.1)
    gases: dict[str, tuple[OneChamber, str]] = {
        "mixed cycle (Seiliger)": (Seiliger(peak_pressure=7.845e6, imep=5.394e5), BLUE),
        "finite heat release (Wiebe)": (
            Wiebe(imep=5.394e5, start=math.radians(-10.0), duration=math.radians(60.0)),
            ORANGE,
        ),
    }
    left = Frame((70.0, 60.0), (330.0, 250.0), (0.0, 1.1), (0.0, 85.0))
    right = Frame((490.0, 60.0), (330.0, 250.0), (-360.0, 360.0), (-600.0, 1200.0))
    parts = [
        *left.axes([0.0, 0.5, 1.0], [0.0, 20.0, 40.0, 60.0, 80.0], "volume over displacement", "pressure [bar]"),
        *right.axes([-360.0, -180.0, 0.0, 180.0, 360.0], [-600.0, -300.0, 0.0, 300.0, 600.0, 900.0, 1200.0],
                    "crank angle from the firing dead centre [deg]", "torque of one cylinder [N m]"),
    ]  # fmt: skip
    for k, (name, (gas, colour)) in enumerate(gases.items()):
        angles = _angles(gas.breaks(part, Cycle.FOUR_STROKE))
        volume = 1.0 / (gas.compression_ratio - 1.0) + swept_volume(part, angles)  # type: ignore[union-attr]
        pressure = 1e-5 * gas.pressure(part, Cycle.FOUR_STROKE, angles)
        torque = chamber_torque(gas, part, Cycle.FOUR_STROKE, angles)
        parts.append(path(left.at(volume, pressure), colour, 1.8))
        parts.append(path(right.at(np.degrees(angles), torque), colour, 1.8))
        parts.append(path([(150 + 260 * k, 26), (180 + 260 * k, 26)], colour, 3.0))
        parts.append(text(188 + 260 * k, 31, name, anchor="start", size=14))
    gas = next(iter(gases.values()))[0]
    smallest = 1.0 / (gas.compression_ratio - 1.0)  # type: ignore[union-attr]
    end = 1e-5 * gas.intake_pressure * gas.compression_ratio**gas.compression_exponent  # type: ignore[union-attr]
    for letter, index, place in (("p̂", "", 78.45), ("p", "c", end)):
        ((x, y),) = left.at(np.array([smallest]), np.array([place]))
        parts.append(symbol(x - 6, y - 4 if index else y + 18, letter, index, anchor="end"))
    return picture(860, 370, "Pressure over volume, and torque over crank angle, of the two computed cycles", parts)


def _angles(breaks: Iterable[float]) -> np.ndarray:
    """Return crank angles over the cycle about the firing dead centre, both sides of every break among them [rad]."""
    full = 4.0 * math.pi
    near = [(angle + full / 2.0) % full - full / 2.0 + side for angle in breaks for side in (-1e-6, 1e-6)]
    return np.sort(np.concatenate([np.linspace(-full / 2.0, full / 2.0, 361), near]).clip(-full / 2.0, full / 2.0))


def _number(value: float) -> str:
    return f"{value:g}".replace("-", "\u2212")


class Frame:
    """A panel with two axes of numbers."""

    def __init__(self, corner: Point, size: Point, x: Point, y: Point) -> None:
        self.corner, self.size, self.x, self.y = corner, size, x, y

    def at(self, x: np.ndarray, y: np.ndarray) -> list[Point]:
        """Return the places of numbers [px]."""
        across = self.corner[0] + self.size[0] * (x - self.x[0]) / (self.x[1] - self.x[0])
        down = self.corner[1] + self.size[1] * (self.y[1] - y) / (self.y[1] - self.y[0])
        return list(zip(across.tolist(), down.tolist(), strict=True))

    def axes(self, x: Sequence[float], y: Sequence[float], below: str, above: str) -> Parts:
        """Return lines and numbers of both axes, and their names."""
        parts = []
        for value in y:
            ends = self.at(np.array(self.x), np.full(2, value))
            parts.append(path(ends, "#cccccc" if value else FAINT, 0.8))
            parts.append(text(ends[0][0] - 8, ends[0][1] + 5, _number(value), FAINT, "end", 13))
        for value in x:
            ((across, down),) = self.at(np.array([value]), np.array([self.y[0]]))
            parts.append(path([(across, down), (across, down + 5)], FAINT))
            parts.append(text(across, down + 20, _number(value), FAINT, size=13))
        middle, bottom = self.corner[0] + 0.5 * self.size[0], self.corner[1] + self.size[1]
        parts.append(text(middle, bottom + 44, below, size=14))
        return [*parts, text(self.corner[0], self.corner[1] - 10, above, anchor="start", size=14)]


FIGURES: dict[str, Callable[[], str]] = {
    "engine-axes": axes_of_engine,
    "slider-crank": slider_crank,
    "gas-cycle": gas_cycle,
}

if __name__ == "__main__":
    for name, drawing in FIGURES.items():
        (PICTURES / f"{name}.svg").write_text(drawing(), encoding="utf-8")
