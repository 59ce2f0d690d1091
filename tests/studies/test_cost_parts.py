"""Study parts on what balancing costs: their files, what they say, and what bad ones are told."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.errors import InputError
from laufruhe.plots.picture import draw
from laufruhe.report.document import Document
from laufruhe.report.study_report import told as blocks_of
from laufruhe.studies.kinds import KINDS
from laufruhe.studies.kinds.free_forces import printed_agree
from laufruhe.studies.kinds.tolerance import verdicts
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from laufruhe.studies.worth import worths
from problem_files import PROBLEMS, written

ECONOMICS = f"""
title = "t"
[study]
[[study.parts]]
name = "three"
kind = "economics"
title = "Three"
alternating = false
mass_limits = ["0 kg", "1 kg"]
[[study.parts.cases]]
name = "three cylinders"
problem = "{PROBLEMS}/tractor-three-shafts.toml"
[[study.parts.builds]]
name = "first order"
shafts = ["shaft"]
claim = {{ says = "noticeable", where = "Fig. 17" }}
[[study.parts.more_cylinders]]
name = "five cylinders"
problem = "{PROBLEMS}/inline-five.toml"
"""
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


def part_of(folder: Path, text: str) -> xr.Dataset:
    datasets, _ = run(load_study(written(folder, text, "study")), folder, folder / "kept")
    return next(iter(datasets.values()))


def told(kind: str, data: xr.Dataset) -> str:
    blocks = tuple(block for text in KINDS[kind].table(data) for block in blocks_of(text))
    return Document("part", blocks).as_markdown(".png")


@pytest.mark.slow
def test_economics_by_its_command(tmp_path: Path) -> None:
    """Files, proofs, the worth of the shaft, and the engine with more cylinders rebuilt at equal power."""
    path, out = written(tmp_path, ECONOMICS, "study"), tmp_path / "out"
    answer = CliRunner().invoke(app, ["study", str(path), "--out", str(out), "--json", str(tmp_path / "s.json")])
    assert answer.exit_code == 0, answer.output
    assert {file.name for file in out.glob("[!.]*")} == {
        "report.md",
        "report.html",
        "tables.xlsx",
        "three.nc",
        "three.csv",
        "three.png",
    }
    data = xr.open_dataset(out / "three.nc")
    assert data["standing"].values.tolist() == ["plain", "with shafts", "more cylinders"]
    assert data["cylinders"].values.tolist() == [3, 3, 5]
    assert float(data["gap"].max()) < 1e-4
    # five cylinders at the power of three: forces 3/5 of those of the five as drawn (eq. 23)
    assert float(data["optimum"].sel(build="five cylinders")) == pytest.approx(0.6 * 515.0, rel=1e-3)
    assert not worths(data)[0].worth
    report = (out / "report.md").read_text(encoding="utf-8")
    assert "| first order: beside plain (Fig. 17) | noticeable | -15.2 % of the force | yes |" in report
    assert "five cylinders, no shafts, equal power" in report
    assert len((out / "three.csv").read_text(encoding="utf-8").splitlines()) == 1 + 3 * 2
    told = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))
    assert told["parts"]["three"]["attrs"]["kind"] == "economics"


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
    table = told("tolerance", data)
    assert "| finer balancing, six | matters |" in table
    draw(KINDS["tolerance"].picture(data))


def test_free_forces_count_what_agrees(tmp_path: Path) -> None:
    data = part_of(tmp_path, LAYOUTS)
    assert printed_agree(data) == (2, 3)
    assert np.isnan(float(data["force_printed"].sel(case="five", order=1)))
    table = told("free forces", data)
    assert "| five | 144 | 0 | 0.4490 (0.449) | 0 (0.001) | 4.9798 (4.9798) |" in table
    assert "2 of 3 printed values" in table
    draw(KINDS["free forces"].picture(data))


MINIMISED = '"objective.minimise"'
BAD_ECONOMICS = [
    ('shafts = ["shaft"]', "shafts = []", "name its shafts"),
    ('shafts = ["shaft"]', 'shafts = ["shaft", "shaft"]', "names a shaft twice"),
    (
        'shafts = ["shaft"]',
        'shafts = ["shafd"]',
        "has no shaft 'shafd', which 'first order' builds; did you mean 'shaft'",
    ),
    ("tractor-three-shafts.toml", "tractor-six.toml", "no shafts can be weighed; add them"),
    ('["0 kg", "1 kg"]', "[]", "mass_limits = []: needs two masses or more"),
    ('["0 kg", "1 kg"]', '["-1 kg", "1 kg"]', "must be at least 0 kg"),
    ('["0 kg", "1 kg"]', '["1 kg", "1 kg"]', "must ascend"),
    ('["0 kg", "1 kg"]', '["0 kg", 1]', "has no unit"),
    ('says = "noticeable", ', "", "has no claim"),
    ('says = "noticeable"', 'says = "noticable"', "did you mean 'noticeable'"),
    ('says = "noticeable"', 'says = "better", against = "second"', "compares 'first order' with 'second'"),
    ('name = "five cylinders"', 'name = "first order"', "two engines called 'first order'"),
    ("inline-five.toml", "tractor-two.toml", "is there, and 'five cylinders' is compared without"),
    ("inline-five.toml", "tractor-single.toml", "no more cylinders"),
    ("inline-five.toml", "two-stroke-five.toml", "differ in cycle and gas, so"),
    ('inline-five.toml"', 'inline-five.toml"\nset = { "engine.stroke" = "110 mm" }', "differ in stroke"),
    ('shafts.toml"', 'shafts.toml"\nequal_power_to = 4', "leave equal_power_to out"),
    ('name = "first order"\n', 'name = "first order"\ncase = "four"\n', "on case 'four'; use one of: three cylinders"),
    ('kind = "economics"', 'kind = "economy"', "is not allowed"),
    ("tractor-three-shafts.toml", "study-soft-mounts.toml", "is missing"),
    ('shafts.toml"', f'shafts.toml"\nset = {{ {MINIMISED} = "balancer mass" }}', "is balancer mass, which is no load"),
    ('shafts.toml"', f'shafts.toml"\nset = {{ {MINIMISED} = "maximum mount force" }}', "objective: differs between"),
]


@pytest.mark.parametrize(("old", "new", "said"), BAD_ECONOMICS)
def test_bad_economics_is_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    refused(tmp_path, ECONOMICS.replace(old, new, 1), said)


BAD_TOLERANCES = [
    ('reciprocating_mass = "10 g"', 'reciprocating_mass = "-10 g"', "must be at least 0 kg"),
    ('alignment = "0.05 mm"', 'alignment = "-0.05 mm"', "must be at least 0 mm"),
    ('unbalance = "50 g cm"', 'unbalanse = "50 g cm"', "did you mean 'unbalance'"),
    ('unbalance = "50 g cm"', 'unbalance = "50 g"', "is not a unit of an unbalance"),
    ('reciprocating_mass = "10 g", unbalance = "50 g cm", alignment = "0.05 mm", ', "", "leave nothing to chance"),
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


def test_open_stars_are_left_to_solve(tmp_path: Path) -> None:
    text = (PROBLEMS / "tractor-three-shafts.toml").read_text(encoding="utf-8")
    (tmp_path / "open.toml").write_text(
        text.replace("firing_order = [1, 3, 2]", 'cylinders = 3\nthrows = "open"'), encoding="utf-8"
    )
    refused(tmp_path, ECONOMICS.replace(f"{PROBLEMS}/tractor-three-shafts.toml", "open.toml"), "use laufruhe solve")


def test_limits_that_no_design_keeps_are_one_line(tmp_path: Path) -> None:
    text = (PROBLEMS / "tractor-three-shafts.toml").read_text(encoding="utf-8")
    quiet = '\n[[constraints]]\nlimit = "maximum mount force"\nmax = "1 N"\n'
    (tmp_path / "quiet.toml").write_text(text + quiet, encoding="utf-8")
    refused(tmp_path, ECONOMICS.replace(f"{PROBLEMS}/tractor-three-shafts.toml", "quiet.toml"), "has no design")


def refused(folder: Path, text: str, said: str) -> None:
    """One line, exit status 2, no results."""
    path = written(folder, text, "study")
    with pytest.raises(InputError) as caught:
        run(load_study(path), folder, folder / "kept")
    line = str(caught.value)
    assert said in line
    assert "\n" not in line
    answer = CliRunner().invoke(app, ["study", str(path), "--out", str(folder / "out")])
    assert answer.exit_code == 2
    assert not (folder / "out").exists()
