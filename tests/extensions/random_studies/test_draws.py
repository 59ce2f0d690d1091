"""Store of many draws: damaged pieces are computed again, never trusted, and block no run."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pytest

from laufruhe.errors import InputError
from laufruhe.extensions.random_studies.draws import VALUES, Column, Draws
from laufruhe.files.study_tables import CaseTable
from laufruhe.studies.scenes import Point

COLUMNS = {"objective": Column("N", "force"), "x": Column("1", "x")}
CASE = CaseTable(name="c", problem="c.toml")
POINTS = {f"{k}": Point(CASE, span=(10 * k, 10 * k + 10)) for k in range(6)}


def rows(mark: str) -> np.ndarray:
    return np.random.default_rng(int(mark)).normal(size=(10, 2))


def trusted(folder: Path, points: dict[str, Point] = POINTS) -> list[str]:
    """Return the pieces that a store accepts, after a check that each is as written."""
    with Draws(folder, COLUMNS, points) as store:
        for mark in store.seconds:
            assert store.read(mark)[VALUES].tobytes() == rows(mark).tobytes()
            assert store.seconds[mark] == 0.25
        return sorted(store.seconds)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    with Draws(tmp_path / "out.draws/part", COLUMNS, POINTS) as store:
        assert store.seconds == {}
        for mark in POINTS:
            store.keep(mark, 0.25, {VALUES: rows(mark)})
    return tmp_path / "out.draws/part"


def test_pieces_say_what_they_hold(folder: Path) -> None:
    assert trusted(folder) == sorted(POINTS)
    with np.load(folder / "3.npz") as piece:
        assert piece["draws"].tolist() == [30, 40]
        assert (piece["case"], piece["quantities"].tolist(), piece["units"].tolist()) == (
            "c",
            ["objective", "x"],
            ["N", "1"],
        )


def test_a_damaged_file_costs_one_piece(folder: Path) -> None:
    rng = random.Random(3)
    for path in sorted(folder.glob("*.npz")):
        whole = path.read_bytes()
        for _ in range(2):
            place = rng.randrange(len(whole))
            for content in (whole[:place], whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :], b""):
                path.write_bytes(content)
                assert len(trusted(folder)) >= 5
        path.write_bytes(whole[: len(whole) // 2])
        assert len(trusted(folder)) == 5
        path.unlink()
        assert len(trusted(folder)) == 5
        path.write_bytes(whole)
    assert trusted(folder) == sorted(POINTS)


def test_misplaced_files_are_not_trusted(folder: Path) -> None:
    one, other = ((folder / f"{k}.npz").read_bytes() for k in (1, 4))
    (folder / "1.npz").write_bytes(other)
    (folder / "4.npz").write_bytes(one)
    assert trusted(folder) == sorted(set(POINTS) - {"1", "4"})


def test_another_mark_is_another_piece(folder: Path) -> None:
    assert trusted(folder, {"new": POINTS["1"], "2": POINTS["2"]}) == ["2"]


def test_two_runs_do_not_write_at_once(folder: Path) -> None:
    with Draws(folder, COLUMNS, POINTS), pytest.raises(InputError, match="is being written by another run"):
        Draws(folder, COLUMNS, POINTS)
    assert trusted(folder) == sorted(POINTS)


def test_a_file_in_the_place_of_the_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "out.draws").write_text("mine")
    with pytest.raises(InputError, match="cannot be written"):
        Draws(tmp_path / "out.draws/part", COLUMNS, POINTS)
