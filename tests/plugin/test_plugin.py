"""An installed package adds a norm, a channel, a layout, a decision and a study kind to every command."""

from __future__ import annotations

import importlib.util
import json
import math
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from laufruhe.numerics.norms import Grid
from laufruhe.numerics.spectrum import Spectrum

HERE = Path(__file__).parent
UNBALANCE = (3.0 * 0.8 + 0.6) * 0.045
"""Unbalance of half the reciprocating mass of six pistons and the rotating mass of the throw [kg m]."""
SHAKING = UNBALANCE * (3000.0 * math.pi / 30.0) ** 2
"""Rotating force that it makes, the same all the cycle [N]."""
PEAK = 0.5 * SHAKING
"""The single mount at one end takes half of it, and its sideways part is a sine [N]."""
TOP = 0.15 * math.pi / 2.0
"""Half the angle about a peak that the largest twentieth of three mounts takes of the sine of that mount [rad]."""
PROBLEM, STUDY = HERE / "six-bank.toml", HERE / "study.toml"


def installed(folder: Path, points: str | None = None) -> dict[str, str]:
    """Install the package into a folder as pip does, and return the environment of its processes."""
    about = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    shutil.copytree(HERE / "laufruhe_example", folder / "laufruhe_example", dirs_exist_ok=True)
    metadata = folder / f"laufruhe_example-{about['version']}.dist-info"
    metadata.mkdir(parents=True)
    named = f"Metadata-Version: 2.1\nName: {about['name']}\nVersion: {about['version']}\n"
    (metadata / "METADATA").write_text(named, encoding="utf-8")
    ((group, own),) = about["entry-points"].items()
    lines = points or "\n".join(f"{name} = {value}" for name, value in own.items())
    (metadata / "entry_points.txt").write_text(f"[{group}]\n{lines}\n", encoding="utf-8")
    paths = [str(folder), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in paths if path)}


def laufruhe(environment: dict[str, str], *words: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "laufruhe", *map(str, words)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_the_norm_of_a_package_stays_below_its_bound() -> None:
    """Check a sine of two amplitudes whose orders add up at one angle."""
    path = HERE / "laufruhe_example" / "worst_twentieth.py"
    spec = importlib.util.spec_from_file_location("worst_twentieth", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    norm, signal = module.WorstTwentieth(), Spectrum(1, np.array([[0.0], [3.0], [1.0]]))
    rows = signal.sample(720)
    value = norm.value(Grid(np.full(len(rows), 1.0 / len(rows)), len(rows)), rows)
    assert 0.9 * norm.upper_bound([signal], np.ones(1)) <= value <= norm.upper_bound([signal], np.ones(1))


@pytest.mark.slow
def test_a_problem_of_a_package_is_checked_and_solved(tmp_path: Path) -> None:
    """Six banks on one throw shake with a vector of three reciprocating masses, which one weight balances."""
    environment = installed(tmp_path / "site")
    checked = laufruhe(environment, "check", PROBLEM)
    assert checked.returncode == 0, checked.stderr
    assert "6 cylinders" in checked.stdout
    out, file = tmp_path / "out", tmp_path / "result.json"
    solved = laufruhe(environment, "solve", PROBLEM, "--no-plots", "--out", out, "--json", file)
    assert solved.returncode == 0, solved.stderr
    record = json.loads(file.read_text(encoding="utf-8"))
    assert record["objective"]["name"] == "worst twentieth horizontal mount force"
    assert record["objective"]["initial"] == pytest.approx(PEAK * math.sin(TOP) / TOP, rel=1e-3)
    assert record["objective"]["value"] < 1e-6 * SHAKING
    assert record["decisions"]["web.unbalance"]["value"] == pytest.approx(UNBALANCE, rel=1e-9)
    # nothing is less than zero; no other bound is told of a norm that claims nothing
    assert record["certificate"]["lower_bound"] == 0.0
    assert "worst twentieth horizontal mount force" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_decision_of_a_package_is_decided(tmp_path: Path) -> None:
    """Check that the decided weight balances a crank radius of 45 mm."""
    text = PROBLEM.read_text(encoding="utf-8").replace('{ between = ["0 kg m", "0.3 kg m"] }', f'"{UNBALANCE} kg m"')
    text += '\n[quantities]\ncrank_radius = { between = ["40 mm", "50 mm"], start = "41 mm" }\n'
    (tmp_path / "radius.toml").write_text(text, encoding="utf-8")
    file = tmp_path / "result.json"
    solved = laufruhe(
        installed(tmp_path / "site"), "solve", tmp_path / "radius.toml", "--no-plots", "--out", tmp_path / "out",
        "--json", file,
    )  # fmt: skip
    assert solved.returncode == 0, solved.stderr
    record = json.loads(file.read_text(encoding="utf-8"))
    assert record["decisions"]["quantities.crank_radius"]["value"] == pytest.approx(0.045, rel=1e-4)


@pytest.mark.slow
def test_a_study_of_a_package_runs(tmp_path: Path) -> None:
    environment = installed(tmp_path / "site")
    done = laufruhe(environment, "study", STUDY, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "crests.svg").exists()
    text = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert "crest factor" in text
    # a sine of half the force at one mount, of a quarter at two
    data = (tmp_path / "out" / "crests.csv").read_text(encoding="utf-8")
    assert float(data.split(",")[-1]) == pytest.approx(2.0, rel=1e-6)


@pytest.mark.slow
def test_without_the_package_its_words_are_refused() -> None:
    refused = laufruhe(dict(os.environ), "check", PROBLEM)
    assert refused.returncode == 2
    assert "engine.layout" in refused.stderr + refused.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("points", "said"),
    [
        ("example = laufruhe_example:NOTHING", "laufruhe_example:NOTHING cannot be imported"),
        ("example = json:dumps", "is no laufruhe.extension.Extension"),
    ],
)
def test_a_broken_package_is_named_in_one_line(points: str, said: str, tmp_path: Path) -> None:
    refused = laufruhe(installed(tmp_path / "site", points), "check", PROBLEM)
    assert refused.returncode == 2
    assert said in refused.stderr
    assert "Traceback" not in refused.stderr
