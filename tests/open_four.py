"""A four in line whose crank is open, and all cranks that it may have."""

from __future__ import annotations

import laufruhe
from laufruhe.solvers.result import Result
from problem_files import changed

FOUR = """
title = "Four in line"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "80 mm"
rod_ratio = 0.28
reciprocating_mass = "0.5 kg"
rotating_mass = "0.3 kg"
cylinder_spacing = "100 mm"
cylinders = 4
throws = "open"
[[operating_points]]
name = "rated"
speed = "3000 rpm"
[mounts]
positions = [["100 mm", "200 mm", "0 mm"], ["100 mm", "-200 mm", "0 mm"], ["-450 mm", "200 mm", "0 mm"],
             ["-450 mm", "-200 mm", "0 mm"]]
[[counterweights]]
name = "web"
opposite_throw = 1
mass = { between = ["0 kg", "1 kg"] }
angle = { between = [0, 360] }
radius = "60 mm"
[objective]
minimise = "mean mount force"
"""
CRANKS = ("[0, 180, 180, 0]", "[0, 180, 0, 180]", "[0, 0, 180, 180]")


def solved_each(text: str) -> list[Result]:
    """Return the results of a problem with each crank in place of the open one."""
    return [laufruhe.solve(changed(text, 'throws = "open"', f"throws = {crank}")) for crank in CRANKS]
