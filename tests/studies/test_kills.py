"""A study that is killed at any moment goes on, whatever became of what it kept; its results are those of one run."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from studies import kills


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, bytes], float]:
    """The files of a run that nothing stopped, and what it took [s]."""
    folder = kills.prepared(tmp_path_factory.mktemp("whole"))
    began = time.monotonic()
    process = kills.started(folder)
    assert process.communicate()[1] == ""
    assert process.returncode == 0
    return kills.results(folder), time.monotonic() - began


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_results_are_those_of_one_run(tmp_path: Path, seed: int, whole: tuple[dict[str, bytes], float]) -> None:
    told = kills.Told()
    kills.attacked(tmp_path / "s", seed, *whole, told)
    assert told.wrong == []
    assert set(whole[0]) >= {"report.md", "fraction.nc", "fraction.csv", "fraction.png", "map.nc"}
