"""Shadow prices of limits with throws that may leave their even steps."""

from __future__ import annotations

from pathlib import Path

import pytest

import laufruhe

FIVE = """
title = "Five throws that may be uneven"
[engine]
layout = "inline"
cycle = "four-stroke"
cylinders = 5
stroke = "100 mm"
rod_ratio = 0.28
reciprocating_mass = "1 kg"
cylinder_spacing = "100 mm"
throws = "open"
firing_order = [1, 2, 4, 5, 3]
[phasing]
intervals = { largest_deviation = "8 deg" }
[[operating_points]]
speed = "3000 rpm"
[objective]
minimise = "rms rocking couple"
orders = [1, 2]
[[constraints]]
limit = "rms shaking force"
orders = [1, 2]
"""


def solved(folder: Path, maximum: float) -> laufruhe.solvers.result.Result:
    path = folder / "five.toml"
    path.write_text(f'{FIVE}max = "{maximum} N"\n[search]\nboxes = 2\n', encoding="utf-8")
    return laufruhe.solve(laufruhe.load(path))


@pytest.mark.slow
def test_price_is_what_a_looser_limit_brings(tmp_path: Path) -> None:
    low, middle, high = (solved(tmp_path, maximum) for maximum in (95.0, 100.0, 105.0))
    assert low.objective is not None
    assert high.objective is not None
    slope = (low.objective.value - high.objective.value) / 10.0
    assert slope > 0.05
    (limit,) = middle.limits
    assert limit.active
    assert limit.shadow_price == pytest.approx(slope, rel=0.02)


def test_slack_limit_has_no_price(tmp_path: Path) -> None:
    (limit,) = solved(tmp_path, 5000.0).limits
    assert not limit.active
    assert limit.shadow_price == 0.0
