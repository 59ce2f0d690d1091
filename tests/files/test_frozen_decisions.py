"""Open numbers that no part would decide, and orders without a load, which are refused by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from files.test_reader import complaint_about
from laufruhe.files.reader import load
from problem_files import changed, open_unbalance, shaft, written

GEARED = """
title = "Two singles on geared counter-rotating cranks"
[engine]
layout = "parts"
cycle = "four-stroke"
stroke = "80 mm"
rod_ratio = 0.28
reciprocating_mass = "0.4 kg"
rotating_mass = "0.5 kg"
shafts = [{ name = "L", position = ["100 mm", "0 mm"] }, { name = "R", position = ["-100 mm", "0 mm"], ratio = -1 }]
slider_cranks = [{ shaft = "L", x = "0 mm" }, { shaft = "R", x = "0 mm", firing_angle = 360 }]
[[operating_points]]
speed = "6000 rpm"
[[counterweights]]
name = "web"
balance_factor = { between = [0, 1] }
[objective]
minimise = "rms shaking force"
"""
TWIN = """
title = "Vee of two, its angles open"
[engine]
layout = "vee"
cycle = "four-stroke"
cylinders = 2
bank_angle = { between = [40, 120] }
stroke = "96.8 mm"
rod_ratio = 0.28
reciprocating_mass = "0.6 kg"
cylinder_spacing = "90 mm"
throws = [0]
[phasing]
intervals = { largest_deviation = "180 deg" }
[[operating_points]]
speed = "5000 rpm"
[[counterweights]]
name = "web"
balance_factor = { between = [0, 1] }
[objective]
minimise = "rms shaking force"
orders = [1]
"""
SPLIT = changed(TWIN, "bank_angle = { between = [40, 120] }", "bank_angle = 60\nsplit_pin_angle = { between = [0, 9] }")


@pytest.mark.parametrize("fraction", ["{ between = [0, 1] }", "{ between = [0.2, 0.8], start = 0.5 }"])
def test_a_balance_factor_without_throws(fraction: str, tmp_path: Path) -> None:
    """Counterweights stand on the crankshaft, and here no throw does."""
    line = complaint_about(written(tmp_path, changed(GEARED, "{ between = [0, 1] }", fraction)))
    assert line == "web.balance_factor: is open but has no effect in this engine; fix or leave it out"


def test_a_balance_factor_of_massless_pistons(tmp_path: Path) -> None:
    light = changed(TWIN, 'reciprocating_mass = "0.6 kg"', 'reciprocating_mass = "0 kg"')
    text = changed(light, "bank_angle = { between = [40, 120] }", "bank_angle = 90")
    assert complaint_about(written(tmp_path, text)).startswith("web.balance_factor: is open but has no effect")


@pytest.mark.parametrize(("text", "key"), [(TWIN, "bank_angle"), (SPLIT, "split_pin_angle")])
def test_an_angle_beside_given_throws(text: str, key: str, tmp_path: Path) -> None:
    """It is a number of the file then; open throws, with bounds or without, decide it with the crank."""
    assert [decision.name for decision in load(written(tmp_path, text)).decisions][-1] == f"engine.{key}"
    for throws in ('"open"', "[{ between = [0, 90] }]"):
        problem = load(written(tmp_path, changed(text, "throws = [0]", f"throws = {throws}")))
        assert f"{key.removesuffix('_angle').replace('_', ' ')} angle" in problem.summary


@pytest.mark.parametrize(
    ("orders", "said"),
    [
        ("[1.0004, 2.0004]", "contains 1.0004, and orders of this cycle are multiples of 1/2; did you mean 1?"),
        ("[0.5, 1.25]", "contains 1.25, and orders of this cycle are multiples of 1/2; did you mean 1?"),
        ("[2.00001]", "contains 2.00001, and orders of this cycle are multiples of 1/2; did you mean 2?"),
    ],
)
def test_orders_that_are_none(orders: str, said: str, tmp_path: Path) -> None:
    text = changed(changed(TWIN, "throws = [0]", 'throws = "open"'), "orders = [1]", f"orders = {orders}")
    assert complaint_about(written(tmp_path, text)) == f"objective.orders = {orders}: {said}"


def test_orders_of_a_two_stroke_are_whole(tmp_path: Path) -> None:
    text = changed(changed(TWIN, "throws = [0]", 'throws = "open"'), "orders = [1]", "orders = [1.5, 2]")
    assert load(written(tmp_path, text)).objective[0].measure.orders == (1.5, 2.0)
    line = complaint_about(written(tmp_path, changed(text, "four-stroke", "two-stroke")))
    assert line.endswith("contains 1.5, and orders of this cycle are multiples of 1; did you mean 2?")


def test_a_shaft_that_follows_an_optional_one_is_optional(tmp_path: Path) -> None:
    """It would be left without a leader where that is not built."""
    leader = shaft("left", 2, "60 mm", open_unbalance()).replace("ratio", "optional = true\nratio", 1)
    text = changed(TWIN, "throws = [0]", 'throws = "open"') + leader
    text += shaft("right", -2, "-60 mm", 'coupled = { to = "left", as = "mirrored" }')
    line = complaint_about(written(tmp_path, text))
    assert line == "balancer_shafts[2].optional: follows a shaft that is optional; make both optional"
