"""Economics from study files: results, and messages for bad files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import xarray as xr
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.extensions.economics.worth import worths
from mounts.files import BLOCK, ENGINE, MOUNTS, SAG, changed
from problem_files import PROBLEMS, written
from studies.parts import refused

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


@pytest.mark.slow
def test_economics_by_its_command(tmp_path: Path) -> None:
    """Check files, proofs, the worth of the shaft, and the larger engine rebuilt at equal power."""
    path, out = written(tmp_path, ECONOMICS, "study"), tmp_path / "out"
    answer = CliRunner().invoke(app, ["study", str(path), "--out", str(out), "--json", str(tmp_path / "s.json")])
    assert answer.exit_code == 0, answer.output
    assert {file.name for file in out.glob("[!.]*")} == {
        "report.md",
        "report.html",
        "tables.xlsx",
        "three.nc",
        "three.csv",
        "three.svg",
    }
    data = xr.open_dataset(out / "three.nc")
    assert data["standing"].values.tolist() == ["plain", "with shafts", "more cylinders"]
    assert data["cylinders"].values.tolist() == [3, 3, 5]
    assert float(data["gap"].max()) < 1e-4
    # five cylinders at the power of three: forces 3/5 of those of the five as drawn (eq. 23)
    assert float(data["optimum"].sel(build="five cylinders")) == pytest.approx(0.6 * 515.0, rel=1e-3)
    assert not next(iter(worths(data).values()))[0]
    report = (out / "report.md").read_text(encoding="utf-8")
    assert "| first order: against plain (Fig. 17) | noticeable | -15.2 % of the force | yes |" in report
    assert "five cylinders, no shafts, equal power" in report
    assert len((out / "three.csv").read_text(encoding="utf-8").splitlines()) == 1 + 3 * 2
    record = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))
    assert record["parts"]["three"]["attrs"]["kind"] == "economics"


SHAFT = """
[[balancer_shafts]]
name = "shaft"
ratio = 2
position = ["90 mm", "-60 mm"]
[[balancer_shafts.unbalances]]
x = "0 mm"
unbalance = { between = ["0 kg m", "0.05 kg m"] }
"""
MINIMISED = '"objective.minimise"'
BAD_ECONOMICS = [
    ('shafts = ["shaft"]', "shafts = []", "name shafts"),
    ('shafts = ["shaft"]', 'shafts = ["shaft", "shaft"]', "names one shaft twice"),
    (
        'shafts = ["shaft"]',
        'shafts = ["shafd"]',
        "has no shaft 'shafd', which 'first order' builds; did you mean 'shaft'",
    ),
    ("tractor-three-shafts.toml", "tractor-six.toml", "no shafts to compare; add them"),
    ('["0 kg", "1 kg"]', "[]", "mass_limits = []: needs two masses or more"),
    ('["0 kg", "1 kg"]', '["-1 kg", "1 kg"]', "must be at least 0 kg"),
    ('["0 kg", "1 kg"]', '["1 kg", "1 kg"]', "must rise"),
    ('["0 kg", "1 kg"]', '["0 kg", 1]', "has no unit"),
    ('says = "noticeable", ', "", "states no claim"),
    ('says = "noticeable"', 'says = "noticable"', "did you mean 'noticeable'"),
    ('says = "noticeable"', 'says = "better", against = "second"', "compares 'first order' with 'second'"),
    ('name = "five cylinders"', 'name = "first order"', "two engines called 'first order'"),
    ("inline-five.toml", "tractor-two.toml", "are present, but 'five cylinders' is compared without"),
    ("inline-five.toml", "tractor-single.toml", "no more cylinders"),
    ("inline-five.toml", "two-stroke-five.toml", "differ in cycle and gas, so"),
    ('inline-five.toml"', 'inline-five.toml"\nset = { "engine.stroke" = "110 mm" }', "differ in stroke"),
    ('shafts.toml"', 'shafts.toml"\nequal_power_to = 4', "remove equal_power_to"),
    ('name = "first order"\n', 'name = "first order"\ncase = "four"\n', "on case 'four'; use one of: three cylinders"),
    ('kind = "economics"', 'kind = "economy"', "is not allowed"),
    ("tractor-three-shafts.toml", "study-soft-mounts.toml", "is missing"),
    ('shafts.toml"', f'shafts.toml"\nset = {{ {MINIMISED} = "balancer mass" }}', "is balancer mass, which is no load"),
    ('shafts.toml"', f'shafts.toml"\nset = {{ {MINIMISED} = "maximum mount force" }}', "objective: differs between"),
]


@pytest.mark.parametrize(("old", "new", "said"), BAD_ECONOMICS)
def test_bad_economics_is_one_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    refused(tmp_path, ECONOMICS.replace(old, new, 1), said)


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


def test_economics_of_a_sag_says_that_it_is_no_load(tmp_path: Path) -> None:
    on_mounts = BLOCK + MOUNTS + SAG
    (tmp_path / "four.toml").write_text(ENGINE + on_mounts + SHAFT, encoding="utf-8")
    six = changed(ENGINE, ("[0, 180, 180, 0]", "[0, 120, 240, 240, 120, 0]")) + on_mounts
    (tmp_path / "six.toml").write_text(six, encoding="utf-8")
    text = ECONOMICS.replace(f"{PROBLEMS}/tractor-three-shafts.toml", "four.toml")
    text = text.replace(f"{PROBLEMS}/inline-five.toml", "six.toml")
    refused(tmp_path, text, "objective: is static sag, which is no load, so balancer shafts have nothing to lower")
