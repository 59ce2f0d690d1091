"""Problem files that tests of the command line, reports and pictures share."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

from laufruhe.problem.problem import Problem
from laufruhe.solvers import Result, evaluate_only, solve
from problem_files import FOUR, MOUNTS, PROBLEMS, SECOND_ORDER_SHAFTS, loaded

READY = PROBLEMS / "tractor-four-lanchester.toml"

_SPEED = '[[operating_points]]\nspeed = "2500 rpm"\n'

SHAKING_ONLY = (
    FOUR
    + _SPEED
    + SECOND_ORDER_SHAFTS
    + """
[objective]
minimise = "mean shaking force"
"""
)

TIGHT = (
    FOUR
    + _SPEED
    + MOUNTS
    + SECOND_ORDER_SHAFTS
    + """
[[constraints]]
limit = "balancer mass"
max = "0.5 kg"
"""
)

IMPOSSIBLE = (
    FOUR
    + _SPEED
    + MOUNTS
    + SECOND_ORDER_SHAFTS
    + """
[[constraints]]
name = "light shafts"
limit = "balancer mass"
max = "0.1 kg"
[[constraints]]
name = "quiet mounts"
limit = "mean mount force"
max = "600 N"
[[constraints]]
name = "idle limit"
limit = "maximum mount force"
max = "1e6 N"
"""
)

TWO_POINTS = (
    FOUR
    + """
[[operating_points]]
name = "idle"
speed = "800 rpm"
[[operating_points]]
name = "rated"
speed = "2500 rpm"
weight = 3
"""
    + MOUNTS
    + SECOND_ORDER_SHAFTS
)

GIVEN = FOUR + _SPEED + MOUNTS

UNCARRIED = (
    FOUR
    + _SPEED
    + """
[mounts]
relative_stiffness = [0, 1, 0]
positions = [["0 mm", "0 mm", "0 mm"]]
"""
)

PARTS = """
title = "Opposed cranks, part by part"
source = "nowhere"
assumptions = ["none"]
tolerance = 1e-3
[engine]
layout = "parts"
cycle = "two-stroke"
bore = "80 mm"
stroke = "90 mm"
rod_length = "170 mm"
offset = "2 mm"
reciprocating_mass = "0.6 kg"
rotating_mass = "0.5 kg"
shafts = [{ name = "second", ratio = -1, position = ["0 mm", "400 mm"] }]
[engine.rod]
mass = "0.9 kg"
centre_of_gravity = "50 mm"
inertia = "40 kg cm^2"
[[engine.slider_cranks]]
x = "-50 mm"
throw = 0
firing_angle = 0
[[engine.slider_cranks]]
x = "50 mm"
bank_angle = 180
throw = "1/2 turn"
shaft = "second"
rod_ratio = 0.27
[[operating_points]]
name = "low"
mean_piston_speed = "4 m/s"
motored = true
[[operating_points]]
name = "high"
speed = "3000 rpm"
imep = "6 bar"
weight = 2
[gas]
model = "wiebe"
imep = "8 bar"
start = -10
duration = 60
shape = 2.0
[mounts]
relative_stiffness = [1, 1, 1]
[[mounts.places]]
name = "a"
position = ["300 mm", "200 mm", "-100 mm"]
turned = [0, 0, 45]
[[mounts.places]]
name = "b"
position = ["300 mm", "-200 mm", "-100 mm"]
[[mounts.places]]
name = "c"
position = ["-300 mm", "0 mm", "-100 mm"]
relative_stiffness = [1, 2, 3]
[[counterweights]]
name = "webs"
balance_factor = { between = [0, 1], start = 0.5 }
radius = "40 mm"
[[balancer_shafts]]
name = "front"
ratio = -1
position = ["80 mm", "0 mm"]
[[balancer_shafts.unbalances]]
name = "one"
x = "-100 mm"
mass = { between = ["0 kg", "1 kg"] }
radius = "20 mm"
angle = 180
[[balancer_shafts.unbalances]]
name = "two"
x = "100 mm"
coupled = { to = "front.one", as = "mirrored opposite" }
[[objective.terms]]
quantity = "rms mount force"
weight = 2
orders = [1, 2]
[[objective.terms]]
quantity = "maximum mount force"
mounts = ["a", "b"]
direction_weights = [1, 1, 0.5]
[[constraints]]
name = "light"
limit = "added mass"
max = "3 kg"
of = ["front.one", "front.two"]
[fidelity]
kinematics = "two-order"
samples = 360
"""


def problem_of(text: str) -> Problem:
    """Return the problem that a text describes."""
    with tempfile.TemporaryDirectory() as folder:
        return loaded(Path(folder), text)


@cache
def solved(text: str) -> Result:
    """Return the result of a text, solved once for all tests."""
    return solve(problem_of(text))


@cache
def stated(text: str) -> Result:
    """Return the design of a text as given."""
    return evaluate_only(problem_of(text))
