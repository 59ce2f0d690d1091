"""Transfer functions of problems/tractor-seat.toml: `python tests/extensions/receivers/tractor_seat.py` writes them.

A rigid hull on its tyres without the engine, and a seat of one degree of freedom in z, as the file states them.
"""

from __future__ import annotations

import csv
import math
import sys
import tomllib
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from extensions.receivers import two_bodies as own
from extensions.receivers.plain_receivers import AXES, PlainReceivers
from laufruhe.units import parse

PROBLEMS = Path(__file__).parents[3] / "problems"
SEAT = np.array([-1.9, 0.0, 0.9])
"""Place of the seat on the hull [m]."""
FREQUENCY, DAMPING = 1.2, 0.3
"""Natural frequency [Hz] and share of critical damping of the seat."""
MEASURED = np.concatenate([np.arange(2.0, 20.0, 0.5), np.arange(20.0, 101.0, 2.0)])


def seat(f: float) -> float | complex:
    """Return the acceleration of the driver over that of the hull under the seat."""
    r = f / FREQUENCY
    return (1.0 + 2j * DAMPING * r) / (1.0 - r**2 + 2j * DAMPING * r)


def functions() -> tuple[list[str], np.ndarray]:
    """Return the names of the mounts, and acceleration per force, shape (frequencies, 3, 3 mounts) [m/s^2/N]."""
    table = tomllib.loads((PROBLEMS / "tractor-seat.toml").read_text(encoding="utf-8"))
    frame, places = PlainReceivers.frame_of(table["frame"]), table["mounts"]["places"]
    centre = np.array(frame.body.centre_of_gravity)
    feet = np.vstack([own.arm(np.array([parse(x, "m") for x in place["position"]]), centre) for place in places])
    answers = []
    for f in MEASURED.tolist():
        w = 2.0 * math.pi * f
        hull = -(w**2) * own.mass(frame.body).astype(complex)
        for spring in frame.springs:
            at = own.arm(np.array(spring.position), centre)
            hull += at.T @ own.stiffness(spring, w) @ at
        moved = -(w**2) * own.arm(SEAT, centre) @ np.linalg.solve(hull, feet.T)
        answers.append(moved * np.array([[1.0], [1.0], [seat(f)]]))
    return [place["name"] for place in places], np.array(answers)


def write(folder: Path) -> None:
    """Write one file for each direction of the response."""
    names, answers = functions()
    head = [f"{name} {axis} {part}" for name in names for axis in AXES for part in ("real", "imaginary")]
    for k, axis in enumerate(AXES):
        with (folder / f"tractor-seat-{axis}.csv").open("w", encoding="utf-8", newline="") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(["frequency [Hz]", *head])
            for f, row in zip(MEASURED.tolist(), answers[:, k], strict=True):
                parts = (part for value in row for part in (value.real, value.imag))
                writer.writerow([f"{f:g}", *(f"{part + 0.0:.4e}" for part in parts)])


if __name__ == "__main__":
    write(PROBLEMS)
