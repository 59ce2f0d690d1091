"""Random fronts of shaft mass fall, and stand over their bounds."""

from __future__ import annotations

import copy
import json
import random
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from faults.damage import as_toml
from lanes import first_fast
from laufruhe.cli import app
from problem_files import PROBLEMS

_STUDY = tomllib.loads((PROBLEMS / "tractor-economics.toml").read_text(encoding="utf-8"))["study"]
ECONOMICS = [part for part in _STUDY["parts"] if part["kind"] == "economics"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", first_fast([0, 3, 5], 0, long=(3, 5)))
def test_random_economics_have_fronts_that_fall(seed: int, tmp_path: Path) -> None:
    """Check that more mass and more shafts are never worse, and that every bound is below its value."""
    rng = random.Random(seed)
    part = copy.deepcopy(rng.choice(ECONOMICS))
    part |= {"name": "p", "mass_limits": [f"{m:.3g} kg" for m in sorted(rng.uniform(0.0, 3.0) for _ in range(3))]}
    part["builds"] = [{**build, "claim": {"says": "noticeable"}} for build in part["builds"]]
    part.pop("readings", None)
    ratio = round(rng.uniform(0.22, 0.3), 3)
    for case in (*part["cases"], *part["more_cylinders"]):
        case["set"] = {**case.get("set", {}), "engine.rod_ratio": ratio}
        tables = tomllib.loads((PROBLEMS / case["problem"]).read_text(encoding="utf-8"))
        (tmp_path / case["problem"]).write_text(as_toml({**tables, "fidelity": {"samples": 144}}), encoding="utf-8")
    (tmp_path / "s.toml").write_text(as_toml({"title": "t", "study": {"parts": [part]}}), encoding="utf-8")
    answer = CliRunner().invoke(app, ["study", str(tmp_path / "s.toml"), "--out", str(tmp_path / "out"), "--json", "-"])
    assert answer.exit_code == 0, answer.output
    data = json.loads(answer.stdout)["parts"]["p"]["data_vars"]
    force, optimum = data["force"]["data"], data["optimum"]["data"]
    for row, bounds, free in zip(force, data["lower_bound"]["data"], optimum, strict=True):
        assert all(bound <= value * (1.0 + 1e-9) for bound, value in zip(bounds, row, strict=True))
        assert all(more <= less * (1.0 + 2e-4) for less, more in zip(row, [*row[1:], free], strict=True))
    built = [set(build.get("shafts", [])) for build in part["builds"]]
    cases = [build.get("case", part["cases"][0]["name"]) for build in part["builds"]]
    for one, own, value in zip(built, cases, optimum[1:], strict=False):
        for other, its, maximum in zip(built, cases, optimum[1:], strict=False):
            assert own != its or not one <= other or maximum <= value * (1.0 + 2e-4)
