"""Small problem files on elastic mounts."""

from __future__ import annotations

from pathlib import Path

from laufruhe.files.reader import load
from laufruhe.problem.problem import Problem

ENGINE = """
title = "test"
[engine]
layout = "inline"
cycle  = "four-stroke"
stroke = "120 mm"
rod_ratio = 0.26
reciprocating_mass = "1.25 kg"
cylinder_spacing = "125 mm"
throws = [0, 180, 180, 0]
[[operating_points]]
name  = "idle"
speed = "700 rpm"
"""
BLOCK = """
[block]
mass = "420 kg"
centre_of_gravity = ["0 mm", "0 mm", "120 mm"]
inertia = ["27 kg m^2", "62 kg m^2", "50 kg m^2"]
"""
OPEN = '{ between = ["20 N/mm", "4000 N/mm"], start = "400 N/mm" }'
MOUNTS = f"""
[mounts]
kind = "elastic"
loss_factor = 0.1
[[mounts.places]]
name = "front left"
position  = ["300 mm", "200 mm", "0 mm"]
stiffness = ["120 N/mm", "120 N/mm", {OPEN}]
[[mounts.places]]
name = "front right"
mirror_of = "front left"
[[mounts.places]]
name = "rear left"
position  = ["-300 mm", "200 mm", "0 mm"]
stiffness = ["120 N/mm", "120 N/mm", {OPEN}]
[[mounts.places]]
name = "rear right"
mirror_of = "rear left"
"""
SAG = """
[objective]
minimise = "static sag"
[[constraints]]
limit = "natural frequencies"
max = "40/3 Hz"
"""


def problem_of(folder: Path, *parts: str, **changes: str) -> Problem:
    """Return a problem from parts of a file; `changes` replaces text in them."""
    text = "\n".join(parts)
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "problem.toml"
    path.write_text(text)
    return load(path)


def changed(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text
