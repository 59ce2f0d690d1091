"""Stored points of a study: damaged ones are solved again, never trusted, and block no run."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path

import pytest
import xarray as xr

from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from laufruhe.studies.stores import FINISHED_POINTS, FinishedPoints
from problem_files import PROBLEMS

MARKS = [f"{k:032x}" for k in range(5)]
RECORDS = [{"objective": 100.125 + k, "status": "optimal", "lower_bound": math.nan} for k in range(5)]
STUDY = """
title = "t"
[study]
[[study.parts]]
name = "p"
kind = "layout comparison"
title = "t"
sweep = [{ quantity = "operating_points.1.mean_piston_speed", from = "6 m/s", to = "12 m/s", points = 4 }]
cases = [{ name = "single", problem = "tractor-single.toml" }]
"""


def written(path: Path, count: int = 5) -> bytes:
    path.unlink(missing_ok=True)
    with FinishedPoints(path, MARKS) as store:
        for mark, record in list(zip(MARKS, RECORDS, strict=True))[:count]:
            store.keep(mark, 0.25, record)
    return path.read_bytes()


def trusted(path: Path) -> list[int]:
    """Return the points that a file gives, after a check that each is as written."""
    with FinishedPoints(path, MARKS) as store:
        for mark, record in ((mark, store.read(mark)) for mark in store.seconds):
            whole = RECORDS[MARKS.index(mark)]
            assert json.dumps(record) == json.dumps(whole)
            assert store.seconds[mark] == 0.25
        return sorted(map(MARKS.index, store.seconds))


def test_points_are_read_as_written(tmp_path: Path) -> None:
    written(tmp_path / FINISHED_POINTS)
    assert trusted(tmp_path / FINISHED_POINTS) == [0, 1, 2, 3, 4]
    with FinishedPoints(tmp_path / FINISHED_POINTS, MARKS[1:3]) as store:
        assert list(store.seconds) == MARKS[1:3]


def test_a_byte_changed_anywhere_costs_one_point(tmp_path: Path) -> None:
    """Check that a changed byte loses one point at most, and a lost line end none."""
    path = tmp_path / FINISHED_POINTS
    content = written(path)
    rng = random.Random(1)
    for place in range(0, len(content), 3):
        spoilt = bytearray(content)
        spoilt[place] = rng.choice([value for value in range(256) if value != content[place]])
        path.write_bytes(spoilt)
        result = trusted(path)
        assert len(result) == 4 or (len(result) == 5 and content[place : place + 1] == b"\n")


@pytest.mark.parametrize("seed", range(40))
def test_lines_in_any_disorder(tmp_path: Path, seed: int) -> None:
    path, rng = tmp_path / FINISHED_POINTS, random.Random(seed)
    lines = [line for line in written(path).splitlines(keepends=True) if line.strip()]
    whole = [*lines, rng.choice(lines)]
    rng.shuffle(whole)
    cut = whole.pop(rng.randrange(len(whole)))
    path.write_bytes(b"".join(whole) + cut[: rng.randrange(len(cut))])
    result = trusted(path)
    assert len(result) >= 4
    # a point added after a line that was cut is not lost with it
    missing = next((k for k in range(5) if k not in result), 0)
    with FinishedPoints(path, MARKS) as store:
        store.keep(MARKS[missing], 0.25, RECORDS[missing])
    assert sorted({*result, missing}) == trusted(path)


@pytest.mark.parametrize(
    "content", [b"", b"\n\n", b"\x00" * 99, b"\xff\xfe\n", b"[" * 5000 + b"\n", b"1\n", b'{"half": \n', b"null\n",
                b'["a", 1, {}]\n', b'["' + b"0" * 32 + b'", 0.25, {"objective": 1.0}]\n', b"9" * 5000 + b"\n"],
)  # fmt: skip
def test_invalid_points_are_skipped(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / FINISHED_POINTS
    path.write_bytes(content)
    assert trusted(path) == []
    with FinishedPoints(path, MARKS) as store:
        store.keep(MARKS[0], 0.25, RECORDS[0])
    assert trusted(path) == [0]


def test_two_at_once_keep_whole_lines(tmp_path: Path) -> None:
    """Check that two writers of one file leave whole lines."""
    path = tmp_path / FINISHED_POINTS
    with FinishedPoints(path, MARKS) as one, FinishedPoints(path, MARKS) as other:
        for k in range(5):
            (one if k % 2 else other).keep(MARKS[k], 0.25, RECORDS[k])
            one.keep(MARKS[0], 0.25, RECORDS[0])
    assert trusted(path) == [0, 1, 2, 3, 4]


def test_a_changed_figure_is_solved_again(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(STUDY, encoding="utf-8")
    study, path = load_study(tmp_path / "s.toml"), tmp_path / "kept" / FINISHED_POINTS

    def computed() -> xr.Dataset:
        return run(study, PROBLEMS, path)[0]["p"]

    whole = computed()
    lines = path.read_bytes()
    for digit in b"123456789":
        path.write_bytes(lines.replace(b'"objective": %c' % digit, b'"objective": 9%c' % digit))
        assert computed().identical(whole)
