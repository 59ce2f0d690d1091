"""`explain` and `trade`: what they print and write."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cli import scenes
from laufruhe.cli import app

RUN = CliRunner()


def test_explain_says_what_is_left_out(tmp_path: Path) -> None:
    path = scenes.written(tmp_path, scenes.SHAKING_ONLY)
    answer = RUN.invoke(app, ["explain", str(path), "--tolerance", "1e-2"])
    assert answer.exit_code == 0, answer.output
    for text in ("kept:", "left out:", "saved:", "gas: the problem describes none", "Fx, Fy"):
        assert text in answer.output
    assert list(tmp_path.iterdir()) == [path]


def test_explain_as_json(tmp_path: Path) -> None:
    path, out = scenes.written(tmp_path, scenes.GIVEN), tmp_path / "explain.json"
    assert RUN.invoke(app, ["explain", str(path), "--json", str(out)]).exit_code == 0
    data = json.loads(out.read_text(encoding="utf-8"))
    assert data["error_estimate"] <= data["tolerance"] == 1e-3
    assert data["numbers"]["kept"] < data["numbers"]["exact"]
    assert data["fidelity"]["crank_inertia"] is None


@pytest.mark.parametrize("tolerance", ["0", "-1", "nan"])
def test_tolerance_must_be_positive(tolerance: str, tmp_path: Path) -> None:
    path = scenes.written(tmp_path, scenes.GIVEN)
    answer = RUN.invoke(app, ["explain", str(path), "--tolerance", tolerance])
    assert answer.exit_code == 2


def test_trade_measures_every_fidelity(tmp_path: Path) -> None:
    path, out = scenes.written(tmp_path, scenes.TIGHT), tmp_path / "trade"
    answer = RUN.invoke(app, ["trade", str(path), "--out", str(out), "--json", str(tmp_path / "trade.json")])
    assert answer.exit_code == 0, answer.output
    assert {p.name for p in out.iterdir()} == {"scene.md", "scene.png", "scene.json"}
    (data,) = json.loads((tmp_path / "trade.json").read_text(encoding="utf-8"))
    assert len(data["rows"]) >= 10
    assert data["rigid_part_error"] < 1e-15
    for row in data["rows"]:
        assert row["error"] <= row["estimate"], row["name"]
        assert row["regret"] >= -1e-7, row["name"]
        assert min(row["evaluation"], row["gradient"], row["solve"], row["fresh"], row["memory"]) > 0.0
    named = {row["name"]: row for row in data["rows"]}
    assert named["two-order, 720 steps"]["error"] > 1e-4 > named["exact, 2880 steps"]["error"]
    assert named["auto 0.001"]["error"] <= 1e-3


def test_trade_of_a_damaged_file(tmp_path: Path) -> None:
    path = scenes.written(tmp_path, "title = 3")
    answer = RUN.invoke(app, ["trade", str(path), "--out", str(tmp_path / "trade")])
    assert answer.exit_code == 2
    assert not (tmp_path / "trade").exists()
