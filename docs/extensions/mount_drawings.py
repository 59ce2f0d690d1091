"""Draw transmissibility over frequency, and lower bounds on boxes of stiffness.

`python docs/extensions/mount_drawings.py` writes `docs/pictures/transmissibility.svg` and
`docs/pictures/stiffness-boxes.svg`.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from figures import PICTURES, Frame, path, picture, text

from laufruhe.numerics.arrays import Array
from laufruhe.physics.elastic_mounts import single_transmissibility
from laufruhe.plots.style import BLUE, GREEN, ORANGE, VERMILION
from laufruhe.plots.words import FAINT, INK

LOSSES = {0.1: BLUE, 0.3: GREEN, 0.6: ORANGE}
"""Loss factors, and colours of their curves."""
LOW, HIGH = 1.0, 9.0
"""Squares of two exciting frequencies times the mass, in units of stiffness."""
ENDS = np.array([2.0, 3.0, 4.0, 5.0, 6.0])
"""Ends of the boxes of stiffness."""


def transmissibility() -> str:
    """Return transmissibility over the frequency ratio for three loss factors, as SVG."""
    frame, top = Frame((80.0, 60.0), (520.0, 290.0), (0.0, 4.0), (0.0, 5.0)), 5.0
    parts = frame.axes([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
                       "exciting frequency over natural frequency", "transmissibility")  # fmt: skip
    parts.append(path(frame.at(np.full(2, math.sqrt(2.0)), np.array([0.0, top])), FAINT, 1.0, "4 3"))
    parts.append(path(frame.at(np.array([0.0, 4.0]), np.ones(2)), FAINT, 1.2, "4 3"))
    ratio = np.linspace(0.0, 4.0, 801)
    for k, (loss, colour) in enumerate(LOSSES.items()):
        values = single_transmissibility(ratio, loss)
        for side in (ratio <= 1.0, ratio >= 1.0):
            shown = side & (values <= top)
            parts.append(path(frame.at(ratio[shown], values[shown]), colour, 2.0))
        parts.append(path([(420.0, 90.0 + 24 * k), (450.0, 90.0 + 24 * k)], colour, 3.0))
        parts.append(text(458, 95 + 24 * k, f"loss factor {loss:g}", anchor="start", size=14))
    ((x, y),) = frame.at(np.array([math.sqrt(2.0)]), np.zeros(1))
    parts.append(text(x, y + 20, "\u221a2", FAINT, size=13))
    ((x, y),) = frame.at(np.array([2.6]), np.array([1.0]))
    parts.append(text(x, y - 10, "isolation below this line", FAINT, size=13))
    return picture(640, 420, "Transmissibility of one mass on one spring for three loss factors", parts)


def transmitted(stiffness: Array) -> Array:
    """Return the sum of the two transmissibilities of an undamped mass, shape of `stiffness`."""
    return np.asarray(sum(np.abs(stiffness / (stiffness - square)) for square in (LOW, HIGH)))


def lower_line(low: float, high: float) -> tuple[float, float]:
    """Return a line below that sum at the ends of a box, by the series of one number (E37, E38)."""
    centre, half, left, right = 0.5 * (low + high), 0.5 * (high - low), 0.0, 0.0
    for square in (LOW, HIGH):
        motion = 1.0 / (centre - square)
        gain = half * motion
        pull = 1.0 - centre * motion
        first, second = pull * half * motion, -pull * gain * half * motion
        rest = 0.5 * abs(second) + abs(second) * abs(gain) / (1.0 - abs(gain))
        value = centre * motion + 0.5 * second
        sign = math.copysign(1.0, value)
        left += sign * (value - first) - rest
        right += sign * (value + first) - rest
    return left, right


def stiffness_boxes() -> str:
    """Return an objective over stiffness, and lines below it on four boxes, as SVG."""
    frame, bottom = Frame((80.0, 60.0), (520.0, 290.0), (2.0, 6.0), (1.5, 3.5)), 1.5
    parts = frame.axes(ENDS.tolist(), [1.5, 2.0, 2.5, 3.0, 3.5], "stiffness", "force")
    best = float(transmitted(0.5 * (ENDS[:-1] + ENDS[1:])).min())
    parts.append(path(frame.at(ENDS[[0, -1]], np.full(2, best)), FAINT, 1.2, "4 3"))
    for end in ENDS:
        parts.append(path(frame.at(np.full(2, end), np.array([bottom, 3.5])), "#cccccc", 0.8))
    stiffness = np.linspace(2.0, 6.0, 201)
    parts.append(path(frame.at(stiffness, transmitted(stiffness)), BLUE, 2.0))
    for low, high in pairwise(ENDS.tolist()):
        line = lower_line(low, high)
        dropped = min(line) > best
        parts.append(path(frame.at(np.array([low, high]), np.array(line)), FAINT if dropped else VERMILION, 2.0))
        ((x, _),) = frame.at(np.array([0.5 * (low + high)]), np.array([bottom]))
        parts.append(text(x, 342, "dropped" if dropped else "stays", FAINT if dropped else VERMILION, size=13))
    ((_, y),) = frame.at(np.array([2.0]), np.array([best]))
    parts.append(text(596, y + 18, "best design known", INK, "end", 13))
    for k, (words, colour) in enumerate({"objective": BLUE, "lower bound of a box": VERMILION}.items()):
        parts.append(path([(100.0, 80.0 + 24 * k), (130.0, 80.0 + 24 * k)], colour, 3.0))
        parts.append(text(138, 85 + 24 * k, words, anchor="start", size=14))
    return picture(640, 420, "An objective over stiffness, and linear lower bounds on four boxes", parts)


DRAWINGS = {"transmissibility.svg": transmissibility, "stiffness-boxes.svg": stiffness_boxes}

if __name__ == "__main__":
    for name, drawing in DRAWINGS.items():
        (PICTURES / name).write_text(drawing(), encoding="utf-8")
