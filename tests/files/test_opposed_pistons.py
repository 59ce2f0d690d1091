"""Opposed pistons in a problem file, compared with a list of parts, and refused input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from laufruhe.errors import InputError
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value
from problem_files import written

SHARED = """
title = "Two pistons in each of two cylinders"
[engine]
cycle = "two-stroke"
bore = "60 mm"
stroke = "70 mm"
rod_ratio = 0.24
reciprocating_mass = "0.9 kg"
rotating_mass = "0.4 kg"
"""
AS_LAYOUT = """
layout = "opposed-piston"
cylinder_spacing = "90 mm"
crank_distance = "500 mm"
firing_order = [1, 2]
"""
AS_PARTS = """
layout = "parts"
[[engine.shafts]]
name = "upper"
position = ["0 mm", "500 mm"]
ratio = -1
""" + "".join(
    f'[[engine.slider_cranks]]\nshaft = "{shaft}"\nx = "{x} mm"\nbank_angle = {bank}\nthrow = {throw}\n'
    for shaft, bank in (("crankshaft", 0), ("upper", 180))
    for x, throw in ((45, bank), (-45, 180 - bank))
)
REST = """
[[operating_points]]
speed = "2500 rpm"
[gas]
model = "seiliger"
peak_pressure = "80 bar"
imep = "5 bar"
[objective]
minimise = "rms roll moment"
"""


def test_the_layout_is_its_list_of_parts(tmp_path: Path) -> None:
    problems = [load(written(tmp_path, SHARED + engine + REST)) for engine in (AS_LAYOUT, AS_PARTS)]
    loads = [evaluate(problem).loads[0].wrench.sample(360) for problem in problems]
    assert np.abs(loads[0][:, 3]).max() > 100.0
    np.testing.assert_allclose(loads[0], loads[1], atol=1e-9 * np.abs(loads[0]).max())
    for problem in problems:
        assert "2 cylinders" in problem.summary
        assert np.degrees(problem.engine.firing_intervals) == pytest.approx([180.0, 180.0])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('crank_distance = "500 mm"\n', "", "engine.crank_distance: is missing"),
        ('"500 mm"', '"500 mm"\ncrank_ratio = 2', "engine.crank_ratio = 2: is not allowed"),
        ('"500 mm"', '"500 mm"\ncrank_lead = 120', "bring them within 90 deg"),
        ('"500 mm"', '"500 mm"\noffset = "5 mm"', "engine.offset"),
        ('"500 mm"', '"500 mm"\nbank_angle = 60', "engine.bank_angle"),
        ("[1, 2]", '"open"', "engine.firing_order"),
        ('"opposed-piston"', '"inline"', "engine.crank_distance: means nothing in layout 'inline'"),
    ],
)
def test_refusals(old: str, new: str, said: str, tmp_path: Path) -> None:
    text = SHARED + AS_LAYOUT.replace(old, new) + REST
    with pytest.raises(InputError) as caught:
        load(written(tmp_path, text))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_lead_goes_without_gas(tmp_path: Path) -> None:
    """Out of step by delta, pistons and pins leave 2 sin(delta / 2) of one of them (m r w^2 each)."""
    engine = AS_LAYOUT.replace("[1, 2]", "[1]") + "crank_lead = 10\ncrank_ratio = 1\n"
    without_gas = '[[operating_points]]\nspeed = "2500 rpm"\n[objective]\nminimise = "rms shaking force"\n'
    problem = load(written(tmp_path, SHARED + engine + without_gas))
    first = abs(evaluate(problem).loads[0].wrench.at(1)[2])
    one = (0.9 + 0.4) * 0.035 * problem.points[0].speed ** 2
    assert first == pytest.approx(2.0 * np.sin(np.radians(5.0)) * one, rel=1e-9)


TWIN = """
title = "Vee twin on one throw"
[engine]
layout = "parts"
cycle = "four-stroke"
stroke = "80 mm"
rod_ratio = 0.25
reciprocating_mass = "0 kg"
rotating_mass = "1 kg"
[[engine.slider_cranks]]
x = "0 mm"
bank_angle = 45
[[engine.slider_cranks]]
x = "0 mm"
bank_angle = -45
throw = 360
[[engine.slider_cranks]]
x = "100 mm"
throw = 180
[[operating_points]]
speed = "1000 rpm"
[objective]
minimise = "mean shaking force"
"""


def test_slider_cranks_on_one_throw_share_its_rotating_mass(tmp_path: Path) -> None:
    """Check that each throw has its rotating mass once for any number of rods, and that opposite throws balance."""
    problem = load(written(tmp_path, TWIN))
    assert [abs(rotor.unbalance) / 0.04 for rotor in problem.engine.rotors] == pytest.approx([0.5, 0.5, 1.0])
    assert objective_value(problem, evaluate(problem)) == pytest.approx(0.0, abs=1e-9)
    variant = load(written(tmp_path, TWIN.replace("bank_angle = 45", 'bank_angle = 45\nrotating_mass = "0.2 kg"')))
    assert [abs(rotor.unbalance) / 0.04 for rotor in variant.engine.rotors] == pytest.approx([0.2, 1.0, 1.0])
