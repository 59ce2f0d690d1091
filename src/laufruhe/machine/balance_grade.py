"""Balance grades of rotors (ISO 21940-11): what unbalance a balanced shaft may keep."""

from __future__ import annotations

import re

_GRADE = re.compile(r"^\s*G\s*(\d+\.?\d*|\.\d+)\s*$")


def grade_of(text: str) -> float | None:
    """The grade [m/s] of a text such as "G 6.3", which is in mm/s; None where it is none."""
    match = _GRADE.match(text)
    return float(match.group(1)) * 1e-3 if match else None


def permitted_unbalance(grade: float, mass: float, speed: float) -> float:
    """Unbalance that a rotor may keep on all its planes together [kg m] (R1).

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
