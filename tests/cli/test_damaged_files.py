"""A damaged problem file is read or refused line by line; nothing else ever happens."""

from __future__ import annotations

import random
import tomllib
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

from cli import damage, scenes
from laufruhe.errors import InputError, LaufruheError
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem

TIMES = 1000
BATCHES = 3


def read(path: Path) -> Problem | None:
    """The problem, or nothing if it was refused as it should be."""
    try:
        return load(path)
    except InputError as error:
        refused = error
    lines = str(refused).splitlines()
    assert len(lines) == len(refused.complaints) >= 1
    for line in lines:
        assert line.startswith(f"{path}: ")
        assert line.isprintable()
    return None


def run(problem: Problem) -> None:
    """Evaluate a problem that could be read, however strange."""
    if problem.fidelity.samples > 2000:
        return
    complaint = ""
    try:
        evaluate(problem)
    except LaufruheError as error:
        complaint = str(error)
    assert "\n" not in complaint


def survivors(path: Path, spoilt: Callable[[random.Random], bytes], seeds: range) -> int:
    """How many of the files that these seeds spoil are read and run; all others are refused as they should be."""
    found = 0
    for seed in seeds:
        path.write_bytes(spoilt(random.Random(seed)))
        try:
            problem = read(path)
            if problem is not None:
                found += 1
                run(problem)
        except Exception as error:
            raise AssertionError(f"seed {seed}: {type(error).__name__}: {error}") from error
    return found


TEXTS = pytest.mark.parametrize(
    "text", [scenes.READY.read_text(encoding="utf-8"), scenes.PARTS], ids=["ready", "parts"]
)


@pytest.mark.slow
@TEXTS
@pytest.mark.parametrize("batch", range(BATCHES))
def test_damaged_tables(text: str, batch: int, tmp_path: Path) -> None:
    tables = tomllib.loads(text)
    seeds = range(batch * TIMES, (batch + 1) * TIMES)
    found = survivors(
        tmp_path / "spoilt.toml", lambda rng: damage.as_toml(damage.damaged_tables(tables, rng)).encode(), seeds
    )
    # damage that is always found, or never, tests nothing
    assert 0.05 * TIMES < found < 0.7 * TIMES


@TEXTS
def test_damaged_text(text: str, tmp_path: Path) -> None:
    found = survivors(tmp_path / "spoilt.toml", lambda rng: damage.damaged_text(text, rng), range(TIMES))
    assert 0.01 * TIMES < found < 0.7 * TIMES


@TEXTS
def test_the_undamaged_file_is_read(text: str, tmp_path: Path) -> None:
    path = tmp_path / "whole.toml"
    path.write_text(damage.as_toml(tomllib.loads(text)), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        problem = read(path)
    assert problem is not None
    assert problem.decisions


@pytest.mark.parametrize(
    "content",
    [b"", b"\x00", b"\xff\xfe", b"[" * 3000, b"a = " + b"[" * 3000, b"title = 'x'\n" * 2, b"\xef\xbb\xbf", b"=" * 99],
)
def test_what_is_no_problem_at_all(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "spoilt.toml"
    path.write_bytes(content)
    assert read(path) is None


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbf" + scenes.GIVEN.encode().replace(b"\n", b"\r\n"))
    assert read(path) is not None
