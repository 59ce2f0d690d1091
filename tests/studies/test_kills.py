"""Study that is killed at any moment, goes on with damaged points, and has the results of one run."""

from __future__ import annotations

from pathlib import Path

import pytest

from lanes import first_fast
from studies import kills


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> kills.Whole:
    return kills.uninterrupted(tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("seed", first_fast(range(4), 0, long=(0, 1, 3)))
def test_results_are_those_of_one_run(tmp_path: Path, seed: int, whole: kills.Whole) -> None:
    log = kills.Log()
    kills.attacked(tmp_path / "s", seed, whole, log)
    assert log.wrong == []
    assert set(whole.files) >= {"report.md", "fraction.nc", "fraction.csv", "fraction.svg", "map.nc"}
