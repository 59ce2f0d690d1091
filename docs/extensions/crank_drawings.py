"""Draw crank stars in first and second order, and the mass ellipse of a single cylinder.

`python docs/extensions/crank_drawings.py` writes `docs/pictures/crank-stars.svg` and `docs/pictures/mass-ellipse.svg`.
All drawings look at the front of the engine: z points up and y to the right, so that the crank turns clockwise (C3).
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

import numpy as np

from laufruhe.physics.crank_stars import star_sums

PICTURES = Path(__file__).parents[1] / "pictures"
INK, SOFT, LINE, FORWARD, BACKWARD = "#14293a", "#33475a", "#9fb3c4", "#1f6fb2", "#b3541e"
CRANKS = {
    "four cylinders: 0, 180, 180, 0 deg": (2, (0, 1, 1, 0)),
    "six cylinders: 0, 120, 240, 240, 120, 0 deg": (3, (0, 1, 2, 2, 1, 0)),
}
"""Steps of a turn, and the step of every throw."""
FACTORS, SHOWN = (0.0, 0.5, 1.0), math.radians(40.0)
"""Balance factors, and the crank angle at which forces are shown."""
NOTHING = 1e-9


def _number(value: float) -> str:
    return f"{value + 0.0 if abs(value) > NOTHING else 0.0:.2f}".rstrip("0").rstrip(".")


def _text(at: complex, words: str, size: int = 13, fill: str = SOFT, anchor: str = "middle") -> str:
    place = f'x="{_number(at.real)}" y="{_number(at.imag)}"'
    return f'<text {place} font-size="{size}" fill="{fill}" text-anchor="{anchor}">{escape(words)}</text>'


def _line(start: complex, end: complex, stroke: str, width: float = 1.0, extra: str = "") -> str:
    ends = f'x1="{_number(start.real)}" y1="{_number(start.imag)}" x2="{_number(end.real)}" y2="{_number(end.imag)}"'
    return f'<line {ends} stroke="{stroke}" stroke-width="{width}"{extra}/>'


def _arrow(start: complex, end: complex, stroke: str) -> str:
    along = (end - start) / abs(end - start)
    corners = (end, end - along * (11 + 5j), end - along * (11 - 5j))
    points = " ".join(f"{_number(c.real)},{_number(c.imag)}" for c in corners)
    return _line(start, end - 8 * along, stroke, 2.5) + f'<polygon points="{points}" fill="{stroke}"/>'


def _circle(at: complex, radius: float, fill: str = "none", stroke: str = LINE) -> str:
    place = f'cx="{_number(at.real)}" cy="{_number(at.imag)}" r="{_number(radius)}"'
    return f'<circle {place} fill="{fill}" stroke="{stroke}"/>'


def _on_page(middle: complex, zeta: complex, scale: float) -> complex:
    """Return the place on the page of z + i y (C4)."""
    return middle + scale * complex(zeta.imag, -zeta.real)


def _sheet(width: int, height: int, label: str, parts: Iterable[str]) -> str:
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'font-family="sans-serif" role="img" aria-label="{escape(label)}">'
    )
    return "\n".join([head, f'<rect width="{width}" height="{height}" fill="#ffffff"/>', *parts, "</svg>", ""])


def _together(steps: Sequence[int], times: int, phases: int) -> dict[int, list[int]]:
    """Return the numbers of the throws that stand at each step of an order."""
    out: dict[int, list[int]] = {}
    for k, step in enumerate(steps, 1):
        out.setdefault(step * times % phases, []).append(k)
    return out


def crank_stars() -> str:
    """Return throws, and their arrows in first and second order, as SVG."""
    parts = []
    for row, (name, (phases, steps)) in enumerate(CRANKS.items()):
        top, count = 40 + 290 * row, len(steps)
        parts.append(_text(complex(30, top), name, 16, INK, "start"))
        places = [0.5 * (count - 1) - k for k in range(count)]
        sums = np.abs(star_sums(np.array([steps], dtype=np.uint8), phases, places, (1, 2))[0])
        titles = ("throws, from the front", "first order", "second order")
        for column, title in enumerate(titles):
            middle, order = complex(150 + 270 * column, top + 130), max(column, 1)
            parts += [_text(middle - 98j, title, 14, INK), _circle(middle, 60.0)]
            for step, throws in _together(steps, order, phases).items():
                zeta = cmath.exp(2j * math.pi * step / phases)
                end = _on_page(middle, zeta, 60.0)
                if column:
                    parts.append(_arrow(middle, end, FORWARD))
                else:
                    parts += [_line(middle, end, SOFT, 4.0), _circle(end, 8.0, "#dcebf7", SOFT)]
                words = ", ".join(map(str, throws))
                parts.append(_text(_on_page(middle, zeta, 80.0) + 5j + 14 * zeta.imag * (len(throws) > 1), words))
            if column:
                force, couple = (_number(float(each)) for each in sums[column - 1])
                parts.append(_text(middle + 118j, f"force {force}, couple {couple}", 14, BACKWARD))
    return _sheet(840, 600, "Crank stars of a four- and a six-cylinder in first and second order", parts)


def mass_ellipse() -> str:
    """Return the first-order force of a single cylinder for three balance factors, as SVG."""
    parts, scale = [], 100.0
    for column, factor in enumerate(FACTORS):
        middle = complex(150 + 270 * column, 190)
        parts.append(_text(middle - 150j, f"balance factor {factor:g}", 16, INK))
        ends = (1.0, -1.0, 1.0j, -1.0j)
        parts += [_line(middle, _on_page(middle, 1.2 * end, scale), LINE) for end in ends]
        parts += [_text(_on_page(middle, 1.24, scale), "z"), _text(_on_page(middle, 1.28j, scale) + 5j, "y")]
        if factor in (0.0, 1.0):
            first = _on_page(middle, complex(1.0 - factor, factor), scale)
            parts.append(_line(first, 2.0 * middle - first, SOFT, 3.0))
        else:
            axes = f'rx="{_number(scale * factor)}" ry="{_number(scale * (1.0 - factor))}"'
            place = f'cx="{_number(middle.real)}" cy="{_number(middle.imag)}"'
            parts.append(f'<ellipse {place} {axes} fill="#f3f3f3" stroke="{SOFT}" stroke-width="2"/>')
        forward = (0.5 - factor) * cmath.exp(1j * SHOWN)
        backward = 0.5 * cmath.exp(-1j * SHOWN)
        corner, tip = _on_page(middle, forward, scale), _on_page(middle, forward + backward, scale)
        if abs(forward) > NOTHING:
            parts.append(_arrow(middle, corner, FORWARD))
        parts += [_arrow(corner, tip, BACKWARD), _circle(tip, 4.0, INK, INK)]
        parts.append(_text(middle + 150j, f"forward {abs(0.5 - factor):g}", 14, FORWARD))
        parts.append(_text(middle + 170j, "backward 0.5", 14, BACKWARD))
    return _sheet(840, 380, "First-order force of a single cylinder over one turn, for three balance factors", parts)


DRAWINGS = {"crank-stars.svg": crank_stars, "mass-ellipse.svg": mass_ellipse}

if __name__ == "__main__":
    for name, drawing in DRAWINGS.items():
        (PICTURES / name).write_text(drawing(), encoding="utf-8")
