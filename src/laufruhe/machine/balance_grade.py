"""Balance grades of rotors (ISO 21940-11)."""

from __future__ import annotations

import re

_GRADE = re.compile(r"^\s*G\s*(\d+\.?\d*|\.\d+)\s*$")


def grade_of(text: str) -> float | None:
    """Return the grade [m/s] of a text such as "G 6.3" (in mm/s), or None."""
    match = _GRADE.match(text)
    return float(match.group(1)) * 1e-3 if match else None


def permitted_unbalance(grade: float, mass: float, speed: float) -> float:
    """Return the permitted unbalance of a rotor, summed over its planes [kg m] (R1).

    Parameters
    ----------
    grade
        e_per times the speed of rotation [m/s].
    mass
        Of the rotor [kg].
    speed
        Its fastest in service [rad/s].
    """
    return grade * mass / speed
