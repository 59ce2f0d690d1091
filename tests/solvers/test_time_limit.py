"""A time limit ends every search with the best design that it has, and with a bound that holds."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cli import scenes
from laufruhe.cli import app
from laufruhe.files.reader import load
from laufruhe.numerics.budget import is_time_over, limit_time, seconds_left, timed_rounds, until_time_limit
from laufruhe.solvers.methods import TIME_LIMIT_NOTE, Status, solve
from problem_files import PROBLEMS, written

# a problem of every kind of search, and what its whole search finds
OPTIMA = {
    "tractor-four-lanchester": 227.3,
    "vee-eight-open": 444.51220,
    "two-stroke-four-open": 440.97076,
    "tractor-four-shaft-heights": 204.43,
    "vee-twenty-open": 1690.7138,
    "inline-five-uneven-gas": 285.7,
    "tractor-four-elastic": math.inf,
    "inline-five-elastic": math.inf,
}


def test_a_limit_within_a_limit() -> None:
    assert seconds_left() == math.inf
    with limit_time(100.0):
        with limit_time(1e-9):
            time.sleep(1e-3)
            assert is_time_over()
            assert list(until_time_limit(range(5))) == [0]
            assert list(timed_rounds(5)) == []
        with limit_time(None):
            assert 99.0 < seconds_left() <= 100.0
            assert list(until_time_limit(range(5))) == list(timed_rounds(5)) == list(range(5))
    assert not is_time_over()


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) for name in OPTIMA])
def test_the_best_so_far_with_a_bound_that_holds(name: str) -> None:
    started = time.perf_counter()
    result = solve(load(PROBLEMS / f"{name}.toml"), time_limit=1e-3)
    assert time.perf_counter() - started < 60.0
    assert result.status in (Status.FEASIBLE, Status.OPTIMAL)
    assert result.objective is not None
    assert result.certificate is not None
    assert result.certificate.lower_bound <= result.objective.value
    assert result.certificate.lower_bound <= OPTIMA[name]
    if result.status is Status.FEASIBLE:
        assert TIME_LIMIT_NOTE in result.certificate.method


def test_a_limit_that_is_not_reached_changes_nothing() -> None:
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    limited_, free = solve(problem, time_limit=1e3), solve(problem)
    assert limited_.objective == free.objective
    assert limited_.decisions == free.decisions


@pytest.mark.parametrize("command", ["solve", "study", "trade"])
@pytest.mark.parametrize("limit", ["0", "-1", "nan"])
def test_a_limit_is_above_zero(command: str, limit: str, tmp_path: Path) -> None:
    path = written(tmp_path, scenes.TIGHT)
    answer = CliRunner().invoke(app, [command, str(path), "--time-limit", limit, "--out", str(tmp_path / "out")])
    assert answer.exit_code == 2
    assert "--time-limit" in answer.stderr
    assert list(tmp_path.iterdir()) == [path]


def test_solve_by_command(tmp_path: Path) -> None:
    path, out = PROBLEMS / "vee-eight-open.toml", tmp_path / "out"
    words = ["solve", str(path), "--time-limit", "0.001", "--out", str(out), "--no-plots"]
    assert CliRunner().invoke(app, words).exit_code == 0
    data = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert data["status"] == "feasible"
    assert TIME_LIMIT_NOTE in data["certificate"]["method"]


SWEEP = f"""
title = "t"
[[study.parts]]
name = "p"
kind = "counterweight fraction"
title = "t"
[[study.parts.sweep]]
quantity = "operating_points.1.mean_piston_speed"
from = "6 m/s"
to = "12 m/s"
points = 5
[[study.parts.cases]]
name = "single"
problem = "{PROBLEMS / "tractor-single.toml"}"
"""


@pytest.mark.slow
def test_a_study_keeps_what_is_finished(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["study", str(written(tmp_path, SWEEP)), "--out", str(tmp_path / "out"), "--jobs", "1"]
    calls = iter(range(100))
    with monkeypatch.context() as patched:
        patched.setattr("laufruhe.studies.runner.is_time_over", lambda: next(calls) >= 3)
        stopped = CliRunner().invoke(app, words)
    assert stopped.exit_code == 1
    assert "the same command goes on" in stopped.stderr
    points_file = tmp_path / "out/.unfinished-points.jsonl"
    assert points_file.read_bytes().count(b"\n\n") == 2
    assert {entry.name for entry in (tmp_path / "out").iterdir()} == {points_file.name}
    assert CliRunner().invoke(app, words).exit_code == 0
    assert not points_file.exists()
    assert (tmp_path / "out/report.md").is_file()


@pytest.mark.slow
@pytest.mark.usefixtures("small_trade")
def test_a_trade_keeps_what_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, out = written(tmp_path, scenes.TIGHT), tmp_path / "trade"
    stopped = CliRunner().invoke(app, ["trade", str(path), "--out", str(out), "--time-limit", "1e-3"])
    assert stopped.exit_code == 1
    assert "time limit" in stopped.stderr
    assert not out.exists()
    calls = iter(range(100))
    monkeypatch.setattr("laufruhe.extensions.fidelity.trade.is_time_over", lambda: next(calls) >= 3)
    some = CliRunner().invoke(app, ["trade", str(path), "--out", str(out)])
    assert some.exit_code == 0
    assert "Stopped at the time limit" in (out / "scene.md").read_text(encoding="utf-8")
