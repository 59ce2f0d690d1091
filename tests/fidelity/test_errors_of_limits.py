"""Error estimates of limited values from samples, which the true error must not exceed."""

from __future__ import annotations

import math

import laufruhe
from laufruhe.report.sections.values import limits

SIX = """
title = "Six in line: of a force along one line only order 6 is left"
[engine]
layout = "inline"
cylinders = 6
cycle = "four-stroke"
stroke = "100 mm"
rod_length = "150 mm"
reciprocating_mass = "1 kg"
cylinder_spacing = "120 mm"
throws = [0, 120, 240, 240, 120, 0]
[[operating_points]]
name = "rated"
speed = "3000 rpm"
[objective]
minimise = "rms shaking force"
[[constraints]]
name = "left"
limit = "mean shaking force"
max = "1 kN"
[fidelity]
samples = 240
"""


def test_the_error_estimate_of_a_mean_with_corners_is_not_exceeded() -> None:
    # 40 samples a turn see |cos(6 phi)| seven times between two zeros; its mean is 2 / pi of the amplitude
    result = laufruhe.evaluate(laufruhe.load(SIX))
    (limit,) = result.limits
    assert result.objective is not None
    truth = result.objective.value * math.sqrt(2.0) * 2.0 / math.pi
    error = abs(limit.value / truth - 1.0)
    assert 1e-4 < error <= limit.error_estimate < 10.0 * error
    (grid,) = limits(result)
    assert "from sampling the cycle" in grid.note
