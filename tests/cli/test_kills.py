"""A solve that is killed at any moment leaves the old results or the new ones; another makes what one run makes."""

from __future__ import annotations

from pathlib import Path

import pytest

from cli import solve_kills
from lanes import first_fast
from studies.kills import Log, Whole


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    return solve_kills.uninterrupted(tmp_path_factory.mktemp("kills") / "whole")


@pytest.mark.parametrize("seed", first_fast(range(4), 0, long=(0, 2, 3)))
def test_results_are_those_of_one_run(seed: int, whole: Whole, tmp_path: Path) -> None:
    log = Log()
    solve_kills.attacked(tmp_path / "s", seed, whole, log)
    assert log.wrong == []
    assert {".laufruhe.json", "result.json", "report.md", "cycle.svg"} <= set(whole.files)
