"""A design as given that has no load at all stays, and is proven."""

from __future__ import annotations

from pathlib import Path

from laufruhe.files.reader import load
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve

SINGLE = """
title = "one cylinder, whose couple is none"
[engine]
layout = "inline"
cycle = "two-stroke"
stroke = "90 mm"
rod_ratio = 0.27
reciprocating_mass = "0.8 kg"
throws = [0]
[[operating_points]]
speed = "3000 rpm"
[[counterweights]]
name = "front"
x = "70 mm"
unbalance = { between = ["0 kg m", "0.1 kg m"] }
angle = { between = [0, 360] }
[[counterweights]]
name = "rear"
x = "-30 mm"
unbalance = { between = ["0 kg m", "0.1 kg m"] }
[objective]
minimise = "peak to peak rocking couple"
"""


def test_a_design_without_load_is_left_and_proven(tmp_path: Path) -> None:
    file = tmp_path / "single.toml"
    file.write_text(SINGLE)
    result = solve(load(file))
    assert result.objective is not None
    assert result.certificate is not None
    assert result.objective.value == 0.0
    assert result.certificate.kind is Proof.GLOBAL
