"""Study parts of free forces: files and texts."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from laufruhe.extensions.sweeps.free_forces import count_agreeing
from laufruhe.plots.picture import draw
from laufruhe.studies.kinds import KINDS
from problem_files import PROBLEMS
from studies.parts import part_of, text_of_study

LAYOUTS = f"""
title = "t"
[study]
[[study.parts]]
name = "layouts"
kind = "free forces"
title = "Layouts"
spacing = "125 mm"
[[study.parts.cases]]
name = "five"
problem = "{PROBLEMS}/inline-five.toml"
literature = {{ couple_1 = 0.449, couple_2 = 4.9798, force_2 = 0.001 }}
"""


def test_free_forces_count_what_agrees(tmp_path: Path) -> None:
    data = part_of(tmp_path, LAYOUTS)
    assert count_agreeing(data) == (2, 3)
    assert np.isnan(float(data["force_printed"].sel(case="five", order=1)))
    table = text_of_study("free forces", data)
    assert "| five | 144 | 0 | 0.4490 (0.449) | 0 (0.001) | 4.9798 (4.9798) |" in table
    assert "2 of 3 printed values" in table
    draw(KINDS["free forces"].picture(data))
