"""Assemble the crankshaft as discs and shafts with openTorsion, and compare its twist with that of Laufruhe.

Run `python FILE`; it needs `pip install opentorsion numpy`. Inertia, stiffness and damping of geared branches count at
crank speed: they are those of the part times the square of its speed ratio. Units are SI.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np

DATA: dict[str, Any] = {}
TOLERANCE = 1e-6


def main() -> int:
    """Print natural frequencies and twist amplitudes at each operating point; return 1 if they differ."""
    worst = 0.0
    for point in DATA["points"]:
        frequencies, twists = response(**point["shaft"], torques=np.array(point["torques"]), speed=point["speed"])
        print(f"{DATA['title']}: {point['name']}, {30.0 / math.pi * point['speed']:.6g} rpm")
        # rigid motions come first
        frequencies = frequencies[-len(point["frequencies"]) :]
        print("natural frequencies [Hz]:", *(f"{hertz:.6g}" for hertz in frequencies))
        print("order", *(f"{section[:14]:>14s}" for section in DATA["sections"]), " twist amplitude [rad]")
        for order, row in zip(DATA["orders"], twists, strict=True):
            print(f"{order:5g}", *(f"{abs(value):14.6e}" for value in row))
        expected = np.array(point["twists"])
        modes = abs(frequencies / np.array(point["frequencies"]) - 1.0).max()
        error = abs(twists - expected).max() / abs(expected).max()
        print(f"largest difference from Laufruhe: frequencies {modes:.1e}, twist {error:.1e} of the largest\n")
        worst = max(worst, modes, error)
    print("agrees" if worst < TOLERANCE else "DIFFERS", f"within {TOLERANCE:g}")
    return int(not worst < TOLERANCE)


def response(stiffness: Any, loss: Any, damping: Any, torques: Any, speed: float) -> tuple[Any, Any]:
    """Return natural frequencies [Hz], and the complex twist of each section by order, shape (orders, sections)."""
    springs, losses = assembly(stiffness, damping), assembly(loss, [0.0] * len(loss))
    squares, _ = springs.undamped_modal_analysis()
    twists = []
    for order, torque in zip(DATA["orders"], torques, strict=True):
        rate = order * speed
        dynamic = springs.K + 1j * losses.K + 1j * rate * springs.C - rate**2 * springs.M
        angles = np.linalg.solve(dynamic, np.pad(torque, (0, len(dynamic) - len(torque))))
        links = DATA["links"][: len(DATA["sections"])]
        twists.append([ratio * (angles[front] - angles[rear]) for front, rear, ratio in links])
    return np.sqrt(np.sort(abs(squares))) / math.tau, np.array(twists)


def assembly(stiffness: Any, damping: Any) -> Any:
    """Return the assembly of all discs, with links of these stiffnesses [N m/rad] and dampings [N m s/rad]."""
    import opentorsion

    values = zip(DATA["links"], stiffness, damping, strict=True)
    shafts = [opentorsion.Shaft(front, rear, k=k, c=c) for (front, rear, _), k, c in values]
    discs = [opentorsion.Disk(k, I=inertia, c=c) for k, (_, inertia, c) in enumerate(DATA["discs"])]
    return opentorsion.Assembly(shafts, disk_elements=discs)


if __name__ == "__main__":
    sys.exit(main())
