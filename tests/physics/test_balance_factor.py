"""Balance factor (L9) of [[counterweights]], and of weights at other places."""

from __future__ import annotations

import cmath
import math

import pytest

from laufruhe import load
from laufruhe.machine import Engine
from laufruhe.physics.balance_factor import balance_factors

BASE = """
title = "Engine"
[engine]
layout = "{layout}"
cycle = "four-stroke"
stroke = "90 mm"
rod_ratio = 0.28
reciprocating_mass = "0.6 kg"
rotating_mass = "0.4 kg"
{own}
[[operating_points]]
speed = "3000 rpm"
"""
SINGLE = BASE.format(layout="inline", own="throws = [40]")
THREE = BASE.format(layout="inline", own='throws = [0, 240, 120]\ncylinder_spacing = "100 mm"')
VEE = BASE.format(layout="vee", own='throws = [0]\nbank_angle = 90\ncylinder_spacing = "90 mm"\nbank_stagger = "30 mm"')


def engine(text: str, *weights: str) -> Engine:
    return load(text + "".join(f"[[counterweights]]\n{weight}\n" for weight in weights)).engine


@pytest.mark.parametrize(("text", "throws"), [(SINGLE, 1), (THREE, 3), (VEE, 2)])
def test_it_is_what_the_key_of_that_name_makes(text: str, throws: int) -> None:
    result = balance_factors(engine(text, 'name = "web"\nbalance_factor = 0.37'))
    assert len(result) == throws
    assert [one.factor for one in result] == pytest.approx([0.37] * throws, rel=1e-12)


def test_a_workshop_counts_the_same() -> None:
    """Check 1.3 kg at 50 mm on a throw of 45 mm: (65 - 0.4 45) / (0.6 45), in kg mm."""
    result = balance_factors(engine(SINGLE, 'name = "web"\nopposite_throw = 1\nmass = "1.3 kg"\nradius = "50 mm"'))
    assert [one.factor for one in result] == pytest.approx([(65.0 - 18.0) / 27.0], rel=1e-12)


def test_a_weight_of_zero_is_none() -> None:
    assert balance_factors(engine(SINGLE, 'name = "web"\nopposite_throw = 1\nunbalance = "0 kg m"')) == ()


def test_only_what_stands_opposite_counts() -> None:
    aside = 'name = "web"\nopposite_throw = 1\nunbalance = "0.03 kg m"\nangle = 30'
    turned = (0.03 * cmath.exp(1j * math.radians(30.0))).real
    assert balance_factors(engine(SINGLE, aside))[0].factor == pytest.approx((turned - 0.018) / 0.027, rel=1e-9)


def test_weights_between_throws_are_shared_and_others_have_none() -> None:
    result = balance_factors(engine(THREE, 'name = "web"\nx = "50 mm"\nunbalance = "0.02 kg m"\nangle = 180'))
    assert [one.cylinders for one in result] == [("cylinder 1",), ("cylinder 2",)]
    assert balance_factors(engine(THREE)) == ()


def test_turning_the_crank_changes_nothing() -> None:
    weight = 'name = "web"\nopposite_throw = 1\nunbalance = "0.03 kg m"\nangle = 12'
    both = [balance_factors(engine(SINGLE.replace("[40]", f"[{angle}]"), weight))[0].factor for angle in (0, 77)]
    assert both[0] == pytest.approx(both[1], rel=1e-12)
