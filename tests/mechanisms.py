"""Mechanism of the cylinders of an engine by radius, rod length and masses."""

from __future__ import annotations

from typing import Any

from laufruhe.machine import SliderCrank
from laufruhe.machine.layouts import Mechanism


def mechanism_of(
    radius: float, rod_length: float, mass: float, *, rotating_mass: float = 0.0, rod_rotating_mass: float = 0.0,
    **numbers: Any,
) -> Mechanism:  # fmt: skip
    part = SliderCrank("cylinder 1", 0.0, radius, rod_length, mass, rotating_mass=rod_rotating_mass, **numbers)
    return Mechanism(part, rotating_mass)
