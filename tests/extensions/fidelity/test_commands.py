"""`explain` and `trade`: printed text and files."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import laufruhe
from cli import scenes
from laufruhe.cli import app
from laufruhe.report.screen import PIPE_WIDTH
from problem_files import PROBLEMS, written

RUN = CliRunner()
pytestmark = pytest.mark.usefixtures("small_trade")


def test_explain_says_what_is_left_out(tmp_path: Path) -> None:
    path = written(tmp_path, scenes.SHAKING_ONLY)
    answer = RUN.invoke(app, ["explain", str(path), "--tolerance", "1e-2"])
    assert answer.exit_code == 0, answer.output
    for text in ("Computed:", "Neglected:", "Cost:", "gas: the problem describes none", "loads Fx"):
        assert text in answer.output
    assert re.search(r"samples of force components, one in \d+\n", answer.output)
    assert list(tmp_path.iterdir()) == [path]


def test_explain_as_json(tmp_path: Path) -> None:
    path, out = written(tmp_path, scenes.GIVEN), tmp_path / "explain.json"
    assert RUN.invoke(app, ["explain", str(path), "--json", str(out)]).exit_code == 0
    data = json.loads(out.read_text(encoding="utf-8"))
    assert data["error_estimate"] <= data["tolerance"] == 1e-3
    assert data["numbers"]["kept"] < data["numbers"]["exact"]
    assert data["fidelity"]["crank_inertia"] is None


@pytest.mark.parametrize("tolerance", ["0", "-1", "nan", "1", "2"])
def test_a_tolerance_is_a_share(tolerance: str, tmp_path: Path) -> None:
    path = written(tmp_path, scenes.GIVEN)
    answer = RUN.invoke(app, ["explain", str(path), "--tolerance", tolerance])
    assert answer.exit_code == 2


@pytest.mark.slow
def test_trade_measures_every_fidelity(tmp_path: Path) -> None:
    path, out = written(tmp_path, scenes.TIGHT), tmp_path / "trade"
    answer = RUN.invoke(app, ["trade", str(path), "--out", str(out), "--json", str(tmp_path / "trade.json")])
    assert answer.exit_code == 0, answer.output
    assert {p.name for p in out.iterdir()} == {".laufruhe.json", "scene.html", "scene.md", "scene.png"}
    # tables as every command draws them, not as Markdown has them
    assert "|" not in answer.output
    assert "auto 0.001 " in answer.output
    assert answer.output.endswith("(begin with scene.html)\n")
    assert max(map(len, answer.output.splitlines()[:-1])) <= PIPE_WIDTH
    (data,) = json.loads((tmp_path / "trade.json").read_text(encoding="utf-8"))
    assert len(data["rows"]) >= 10
    for row in data["rows"]:
        assert row["error"] <= row["estimate"], row["name"]
        assert row["regret"] >= 0.0, row["name"]
        assert row["regret_bound"] is None or row["regret"] <= row["regret_bound"] + 1e-7, row["name"]
        assert row["optimum"] == pytest.approx((1.0 + row["regret"]) * data["reference"]["optimum"])
        assert min(row[key] for key in ("evaluation", "solve", "scene", "batch", "memory")) > 0.0
    named = {row["name"]: row for row in data["rows"]}
    assert named["two-order, 720 steps"]["error"] > 1e-4 > named["exact, 2880 steps"]["error"]
    assert named["auto 0.001"]["error"] <= 1e-3


@pytest.mark.slow
def test_trade_of_several_problems_names_each(tmp_path: Path) -> None:
    paths = [written(tmp_path, text, name) for name, text in (("given", scenes.GIVEN), ("open", scenes.TIGHT))]
    out = tmp_path / "trade.json"
    answer = RUN.invoke(app, ["trade", *map(str, paths), "--out", str(tmp_path / "trade"), "--json", str(out)])
    assert answer.exit_code == 0, answer.output
    assert "|" not in answer.output
    report = json.loads(out.read_text(encoding="utf-8"))
    assert [one["problem"] for one in report] == ["given", "open"]
    assert [one["reference"]["optimum"] is None for one in report] == [True, False]
    for one, path in zip(report, paths, strict=True):
        assert one["reference"]["objective"] == pytest.approx(laufruhe.evaluate(path).objective.value, rel=1e-3)
        assert one["problem"] in (tmp_path / f"trade/{path.stem}.md").read_text(encoding="utf-8")


def test_trade_of_a_damaged_file(tmp_path: Path) -> None:
    path = written(tmp_path, "title = 3")
    answer = RUN.invoke(app, ["trade", str(path), "--out", str(tmp_path / "trade")])
    assert answer.exit_code == 2
    assert not (tmp_path / "trade").exists()


@pytest.mark.slow
def test_trade_of_a_question_about_modes(tmp_path: Path) -> None:
    """Check that a trade without loads chooses the mounts alone, the cheapest fidelity."""
    path, out = PROBLEMS / "powertrain-torque-roll.toml", tmp_path / "trade.json"
    answer = RUN.invoke(app, ["trade", str(path), "--out", str(tmp_path / "trade"), "--json", str(out)])
    assert answer.exit_code == 0, answer.output
    (data,) = json.loads(out.read_text(encoding="utf-8"))
    assert {row["error"] for row in data["rows"]} == {0.0}
    assert min(data["rows"], key=lambda row: row["evaluation"])["name"] == "mounts alone, no loads"
    assert max(abs(row["regret"]) for row in data["rows"]) < 1e-6
    assert data["uneven_speed"] is None
    # all dots would lie on one line
    pages = {f"powertrain-torque-roll.{end}" for end in ("html", "md")}
    assert {p.name for p in (tmp_path / "trade").iterdir()} == {".laufruhe.json", *pages}


@pytest.mark.slow
def test_trade_of_elastic_mounts(tmp_path: Path) -> None:
    """Check rows and regret of a trade with open unbalances on given elastic mounts."""
    path, out = written(tmp_path, _elastic_with_a_shaft()), tmp_path / "trade.json"
    answer = RUN.invoke(app, ["trade", str(path), "--out", str(tmp_path / "trade"), "--json", str(out)])
    assert answer.exit_code == 0, answer.output
    (data,) = json.loads(out.read_text(encoding="utf-8"))
    rows = {row["name"]: row for row in data["rows"]}
    for row in rows.values():
        assert row["error"] <= row["estimate"], row["name"]
        assert row["regret"] is None or row["regret"] >= -1e-6, row["name"]
    assert rows["rigid mounts, 720 steps"]["error"] > 0.1
    assert rows["in time, orders to 12"]["regret"] is None
    assert rows["rigid mounts, 720 steps"]["regret"] is not None


def test_trade_where_a_star_is_open(tmp_path: Path) -> None:
    path, out = PROBLEMS / "inline-five-open.toml", tmp_path / "trade.json"
    answer = RUN.invoke(app, ["trade", str(path), "--out", str(tmp_path / "trade"), "--json", str(out)])
    assert answer.exit_code == 0, answer.output
    (data,) = json.loads(out.read_text(encoding="utf-8"))
    # no fidelity is so wrong that it takes another star
    assert all(row["regret"] == pytest.approx(0.0, abs=1e-9) for row in data["rows"])


def _elastic_with_a_shaft() -> str:
    """Return the text of the tractor on given elastic mounts at idle, with open shafts."""
    text = (PROBLEMS / "tractor-four-elastic.toml").read_text(encoding="utf-8")
    text = re.sub(r"\{ between = [^}]*start = (\"[^\"]*\") \}", r"\1", text)
    text = text.replace("turned    = [{ between = [0, 60] }, 0, 0]", "turned    = [0, 0, 0]")
    idle, rest = text.split('[[operating_points]]\nname  = "work"', 1)
    text = idle + rest[rest.index("[gas]") :]
    return text[: text.index("[[constraints]]")]
