"""The store of many draws: what is damaged is worked out again, never trusted, and never in the way."""

from __future__ import annotations

import errno
import os
import random
import shutil
from pathlib import Path

import numpy as np
import pytest

from lanes import of_clusters
from laufruhe.errors import InputError
from laufruhe.studies.part import Column, Template
from laufruhe.studies.regions import VALUES, Region, Regions, locked_store

pytestmark = of_clusters("zarr")

TEMPLATE = Template(("a", "b"), 25, 10, {"objective": Column("N", "force"), "x": Column("1", "x")})
WANTED = {
    f"{case}{k}": Region(case, k * 10, min(k * 10 + 10, 25)) for case in range(2) for k in range(3)
}  # fmt: skip


def rows(mark: str) -> np.ndarray:
    region = WANTED[mark]
    return np.random.default_rng(int(mark)).normal(size=(region.last - region.first, 2))


def opened(root: Path, template: Template = TEMPLATE, wanted: dict[str, Region] = WANTED) -> Regions:
    return Regions(root, "part", template, wanted)


def written(root: Path) -> Path:
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir()
    store = opened(root)
    for mark in WANTED:
        store.keep(mark, 0.25, {VALUES: rows(mark)})
    return root


def trusted(root: Path) -> list[str]:
    """Which pieces are taken from a store; each as it was kept, or the test fails."""
    store = opened(root)
    for mark in store.seconds:
        assert store.read(mark)[VALUES].tobytes() == rows(mark).tobytes()
        assert store.seconds[mark] == 0.25
    return sorted(store.seconds)


def files(root: Path) -> list[Path]:
    """Of the regions, not of what describes the arrays."""
    return sorted(path for path in root.rglob("*") if path.is_file() and path.name != "zarr.json")


def contents(root: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_pieces_are_read_as_they_were_kept(tmp_path: Path) -> None:
    root = written(tmp_path / "s.zarr")
    assert trusted(root) == sorted(WANTED)
    assert len(files(root)) == 2 * len(WANTED)


def test_any_file_damaged_costs_one_piece(tmp_path: Path) -> None:
    root, rng = written(tmp_path / "s.zarr"), random.Random(3)
    for path in files(root):
        whole = path.read_bytes()
        place = rng.randrange(len(whole))
        spoilt = [whole[:place], whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :], b""]
        for content in spoilt:
            path.write_bytes(content)
            assert len(trusted(root)) == 5
        path.unlink()
        assert len(trusted(root)) == 5
        path.write_bytes(whole)
    assert trusted(root) == sorted(WANTED)


def test_files_exchanged_are_not_trusted(tmp_path: Path) -> None:
    """Each has a sound checksum of its own codec, and stands in the wrong place."""
    root = written(tmp_path / "s.zarr")
    one, other = (root / "part" / "values" / "c" / str(case) / "0" / "0" for case in range(2))
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)
    assert trusted(root) == sorted(set(WANTED) - {"00", "10"})


def test_another_mark_is_another_piece(tmp_path: Path) -> None:
    root = written(tmp_path / "s.zarr")
    renamed = {f"new{mark}" if mark == "01" else mark: region for mark, region in WANTED.items()}
    assert set(opened(root, wanted=renamed).seconds) == set(WANTED) - {"01"}


def test_more_draws_go_on_from_those_that_are_there(tmp_path: Path) -> None:
    root = written(tmp_path / "s.zarr")
    more = Template(TEMPLATE.cases, 45, 10, TEMPLATE.columns)
    # what was the short end is a whole piece now, of another fingerprint
    wanted = {mark: region for mark, region in WANTED.items() if mark[1] != "2"}
    store = opened(root, more, {**wanted, "end": Region(1, 40, 45)})
    assert sorted(store.seconds) == sorted(wanted)
    store.keep("end", 1.0, {VALUES: np.ones((5, 2))})
    assert opened(root, more, {"end": Region(1, 40, 45)}).read("end")[VALUES].sum() == 10.0


def test_another_layout_begins_anew(tmp_path: Path) -> None:
    root = written(tmp_path / "s.zarr")
    other = Template(TEMPLATE.cases, 25, 10, {**TEMPLATE.columns, "y": Column("1", "y")})
    assert len(opened(root, other).seconds) == 0


def test_what_is_not_ours_is_left_alone(tmp_path: Path) -> None:
    root = tmp_path / "s.zarr"
    root.mkdir()
    (root / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="holds what Laufruhe did not make"):
        opened(root)
    assert [path.name for path in root.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(
    "damage",
    ["", "{", "[]", "\x00", '{"zarr_format": 3}', '{"zarr_format": 3, "node_type": 5}', "[" * 5000,
     '{"zarr_format": 3, "node_type": "group", "attributes": 1}',
     '{"zarr_format": 3, "node_type": "group", "attributes": {"made_by": "laufruhe study", "parts": 1}}',
     '{"zarr_format": 2}'],
)  # fmt: skip
def test_a_damaged_root_is_one_line_and_stays(damage: str, tmp_path: Path) -> None:
    root = written(tmp_path / "s.zarr")
    (root / "zarr.json").write_text(damage, encoding="utf-8")
    before = contents(root)
    with pytest.raises(InputError, match="another place by --out") as caught:
        opened(root)
    assert len(str(caught.value).splitlines()) == 1
    assert contents(root) == before


@pytest.mark.parametrize("kind", ["group", "array", "empty group", "old group", "old array"])
def test_a_store_of_others_is_left_alone(kind: str, tmp_path: Path) -> None:
    import zarr

    root, form = tmp_path / "s.zarr", 2 if "old" in kind else 3
    if "array" in kind:
        zarr.create_array(root, shape=(3,), dtype="float64", zarr_format=form)[:] = 1.0
    else:
        group = zarr.open_group(root, mode="w", zarr_format=form, attributes={"whose": "mine"})
        if kind != "empty group":
            group.create_array("part", shape=(3,), dtype="float64")[:] = 1.0
    before = contents(root)
    with pytest.raises(InputError, match="another place by --out"):
        opened(root)
    assert contents(root) == before


@pytest.mark.parametrize("kind", ["group", "array", "file"])
def test_a_stranger_in_our_store_is_left_alone(kind: str, tmp_path: Path) -> None:
    import zarr

    root = written(tmp_path / "s.zarr")
    whole = zarr.open_group(root, mode="r+")
    if kind == "group":
        whole.create_group("other").create_array("values", shape=(3,), dtype="float64")[:] = 1.0
    elif kind == "array":
        whole.create_array("other", shape=(3,), dtype="float64")[:] = 1.0
    else:
        (root / "other").write_text("mine")
    before = contents(root)
    with pytest.raises(InputError, match="did not make"):
        Regions(root, "other", TEMPLATE, WANTED)
    assert contents(root) == before
    assert trusted(root) == sorted(WANTED)


@pytest.mark.parametrize("key", ["values", "done"])
def test_arrays_of_another_form_are_not_written_into(key: str, tmp_path: Path) -> None:
    """Whole numbers would cut off what is behind the point."""
    import zarr

    root = written(tmp_path / "s.zarr")
    group = zarr.open_group(root, mode="r+")["part"]
    form = {"shape": group[key].shape, "chunks": group[key].chunks}
    group.create_array(key, **form, dtype="int64", overwrite=True)
    store = opened(root)
    assert store.seconds == {}
    store.keep("00", 0.25, {VALUES: rows("00")})
    assert trusted(root) == ["00"]


def test_two_runs_do_not_write_at_once(tmp_path: Path) -> None:
    root = tmp_path / "s.zarr"
    with locked_store(root), pytest.raises(InputError, match="is being written by another run"):
        locked_store(root).__enter__()
    with locked_store(root):
        pass


def test_a_system_without_locks_keeps_a_study_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("laufruhe.numerics.locks.fcntl", None)
    with locked_store(tmp_path / "s.zarr"):
        assert (tmp_path / "s.zarr").is_dir()


def test_a_full_disk_loses_the_piece_at_hand_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever the disk gets full: in the values, or in the mark that they are done."""
    import zarr.storage._local as local

    put = local._put
    for full_at in range(2 * len(WANTED)):
        root = tmp_path / f"{full_at}.zarr"
        root.mkdir()
        store, count = opened(root), iter(range(99))

        def full(*words: object, count: object = count, full_at: int = full_at, **more: object) -> int:
            if next(count) >= full_at:  # type: ignore[call-overload]
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return put(*words, **more)  # type: ignore[arg-type]

        with monkeypatch.context() as patched:
            patched.setattr(local, "_put", full)
            marks, kept = iter(WANTED), []
            for mark in marks:
                try:
                    store.keep(mark, 0.25, {VALUES: rows(mark)})
                except OSError:
                    break
                kept.append(mark)
            assert list(marks) == [*WANTED][len(kept) + 1 :]
        assert trusted(root) == kept
