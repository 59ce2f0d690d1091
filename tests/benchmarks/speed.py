"""Times that users wait, by pytest-benchmark: `make speed`; `SPEED=--benchmark-compare` adds the last run.

Pytest collects no benchmark with the tests, because times depend on the machine.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from laufruhe import evaluate, load, solve

PROBLEMS = Path(__file__).parents[2] / "problems"
FOUR = PROBLEMS / "tractor-four-lanchester.toml"


def command(*words: str, folder: Path) -> None:
    subprocess.run([sys.executable, "-m", "laufruhe", *words], cwd=folder, check=True, capture_output=True)


def test_check(benchmark: Any, tmp_path: Path) -> None:
    benchmark.pedantic(command, ("check", str(FOUR)), {"folder": tmp_path}, rounds=5)


def test_solve_with_report_and_pictures(benchmark: Any, tmp_path: Path) -> None:
    benchmark.pedantic(command, ("solve", str(FOUR)), {"folder": tmp_path}, rounds=3)


def test_load(benchmark: Any) -> None:
    benchmark(load, FOUR)


def test_evaluate(benchmark: Any) -> None:
    benchmark(evaluate, load(FOUR))


@pytest.mark.parametrize("name", ["tractor-single", "tractor-four-lanchester", "inline-five-open"])
def test_solve(benchmark: Any, name: str) -> None:
    problem = load(PROBLEMS / f"{name}.toml")
    assert benchmark(solve, problem).status == "optimal"
