"""Files of the study part on tolerances, and lines that refuse bad files."""

from __future__ import annotations

from pathlib import Path

import pytest

from laufruhe.extensions.robust.study import verdicts
from laufruhe.plots.picture import draw
from laufruhe.studies.kinds import KINDS
from problem_files import PROBLEMS
from studies.parts import part_of, refused, text_of_study

TOLERANCE = f"""
title = "t"
[study]
[[study.parts]]
name = "tolerances"
kind = "tolerance"
title = "Tolerances"
engines = 200
tolerances = {{ reciprocating_mass = "10 g", unbalance = "50 g cm", alignment = "0.05 mm", aligned_masses = ["40 kg"] }}
marks = [{{ name = "the study", force = "100 kp" }}]
[[study.parts.cases]]
name = "four"
problem = "{PROBLEMS}/tractor-four-lanchester.toml"
claim = "promises nothing"
[[study.parts.cases]]
name = "six"
problem = "{PROBLEMS}/tractor-six.toml"
claim = "matters"
"""


@pytest.mark.slow
def test_tolerances_keep_to_the_file(tmp_path: Path) -> None:
    data = part_of(tmp_path, TOLERANCE)
    assert data.attrs["engines"] == 200
    speed = float(data["speed"].sel(case="four"))
    alignment = float(data["worst_alignment"].sel(case="four"))
    assert alignment == pytest.approx(40.0 * 5e-5 * speed**2)
    assert float(data["worst_unbalance"].sel(case="four")) == pytest.approx(2 * 5e-4 * speed**2)
    four, six = verdicts(data)
    assert four.agrees
    assert not six.agrees
    table = text_of_study("tolerance", data)
    assert "| finer balancing, six | matters |" in table
    draw(KINDS["tolerance"].picture(data))


BAD_TOLERANCES = [
    ('reciprocating_mass = "10 g"', 'reciprocating_mass = "-10 g"', "must be at least 0 kg"),
    ('alignment = "0.05 mm"', 'alignment = "-0.05 mm"', "must be at least 0 mm"),
    ('unbalance = "50 g cm"', 'unbalanse = "50 g cm"', "did you mean 'unbalance'"),
    ('unbalance = "50 g cm"', 'unbalance = "50 g"', "is not a unit of an unbalance"),
    ('reciprocating_mass = "10 g", unbalance = "50 g cm", alignment = "0.05 mm", ', "", "are all zero"),
    ("engines = 200", "engines = 0", "engines"),
    ('force = "100 kp"', 'force = "0 kp"', "must be more than 0 N"),
    ('claim = "promises nothing"', 'claim = "promises nothin"', "use one of: promises nothing, matters"),
    ('tractor-six.toml"', 'tractor-seven.toml"', "tractor-seven.toml"),
]


@pytest.mark.parametrize(("old", "new", "said"), BAD_TOLERANCES)
def test_bad_tolerances_are_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    refused(tmp_path, TOLERANCE.replace(old, new, 1), said)


def test_several_operating_points_have_no_tolerance(tmp_path: Path) -> None:
    text = (PROBLEMS / "tractor-six.toml").read_text(encoding="utf-8")
    text = text.replace("[gas]", '[[operating_points]]\nmean_piston_speed = "8 m/s"\n\n[gas]')
    (tmp_path / "two-points.toml").write_text(text, encoding="utf-8")
    part = TOLERANCE.replace(f"{PROBLEMS}/tractor-six.toml", "two-points.toml")
    refused(tmp_path, part, "has several in 'six', and tolerances are studied at one")
