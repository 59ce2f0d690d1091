"""Folders of results: all old or all new after a kill at any moment, with files of others untouched."""

from __future__ import annotations

import errno
import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from laufruhe.errors import InputError
from laufruhe.report import files
from laufruhe.report.files import MADE, FileSet, staged, staged_file
from laufruhe.report.strict_json import strict

NAMES = [f"file-{k}" for k in range(8)]
# makes set after set, each of files that hold its number
MAKER = f"""
import sys, itertools
from pathlib import Path
from laufruhe.report.files import FileSet, staged, write
first = int(sys.argv[2])
for k in itertools.count(first):
    with staged(FileSet(Path(sys.argv[1]), "--out", "solve", {NAMES})) as stage:
        if k == first:
            print("begun", flush=True)
        for name in {NAMES}[: 4 + k % 5]:
            write(stage / name, str(k))
"""


# is killed as soon as one folder, or so many, has got another name
ENDS = """
import os, signal, sys
from pathlib import Path
rename, left = Path.rename, [int(sys.argv[3])]
def renamed(*words):
    done = rename(*words)
    left[0] -= 1
    if left[0] == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return done
Path.rename = renamed
"""


def make(folder: Path, text: str, names: list[str] = NAMES, **more: object) -> None:
    with staged(FileSet(folder, "--out", "solve", NAMES, **more)) as stage:  # type: ignore[arg-type]
        for name in names:
            (stage / name).write_text(text)


def fail(folder: Path) -> None:
    with staged(FileSet(folder, "--out", "solve", NAMES)) as stage:
        (stage / NAMES[0]).write_text("x")
        raise ZeroDivisionError


def add_meanwhile(folder: Path, name: str) -> None:
    with staged(FileSet(folder, "--out", "solve", NAMES)) as stage:
        (stage / name).write_text("new")
        (folder / name).write_text("mine")


def names_and_contents(folder: Path) -> tuple[set[str], set[str]]:
    """Return the names and contents of a set."""
    found = {path.name: path.read_text() for path in folder.glob("file-*")}
    return set(found), set(found.values())


@pytest.mark.parametrize("inside", [False, True])
def test_a_full_disk_names_the_chosen_folder(inside: bool, tmp_path: Path) -> None:
    def full() -> None:
        with staged(FileSet(tmp_path / "out", "--out", "solve", NAMES)) as stage:
            raise OSError(errno.ENOSPC, "No space left on device", *([str(stage / NAMES[0])] if inside else []))

    with pytest.raises(OSError, match="No space left") as caught:
        full()
    assert caught.value.filename == str(tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("makers", [1, 2])
@pytest.mark.parametrize("swaps", [True, False], ids=["swap", "rename"])
def test_a_kill_at_any_moment(makers: int, swaps: bool, tmp_path: Path) -> None:
    rng = random.Random(makers)
    folder = tmp_path / "set"
    # a maker that is killed before its first set leaves this one: as many files as it would write for that number
    make(folder, "4")
    (folder / "notes.txt").write_text("mine")
    no_swap = "" if swaps else "import ctypes; ctypes.CDLL = lambda *_: None\n"
    for kill in range(3):
        running = [
            subprocess.Popen(
                [sys.executable, "-c", no_swap + MAKER, str(folder), str(kill * 10**6 + k)], stdout=subprocess.PIPE
            )
            for k in range(makers)
        ]
        for one in running:
            assert one.stdout is not None
            assert one.stdout.read(5) == b"begun"
        time.sleep(rng.random() * 0.1)
        for one in running:
            one.send_signal(signal.SIGKILL)
        assert [one.wait() for one in running] == [-signal.SIGKILL] * makers
        for one in running:
            one.stdout.close()
        if swaps:
            names, texts = names_and_contents(folder)
            assert len(texts) == 1
            assert names == set(NAMES[: 4 + int(texts.pop()) % 5])
    make(folder, "done")
    assert names_and_contents(folder) == (set(NAMES), {"done"})
    assert (folder / "notes.txt").read_text() == "mine"
    assert {path.name for path in tmp_path.iterdir()} == {"set"}


@pytest.mark.slow
@pytest.mark.parametrize(("swaps", "renamed"), [(True, 1), (False, 1), (False, 2), (False, 3)])
def test_a_kill_after_each_step(swaps: bool, renamed: int, tmp_path: Path) -> None:
    """Check that a kill leaves a whole set if folders can be swapped, else that the next run restores one."""
    folder = tmp_path / "set"
    make(folder, "4")
    once = MAKER.replace("itertools.count(first)", "[first]")
    program = ("" if swaps else "import ctypes; ctypes.CDLL = lambda *_: None\n") + ENDS + once
    words = [sys.executable, "-c", program, str(folder), "9", str(renamed)]
    ended = subprocess.run(words, stdout=subprocess.DEVNULL, check=False)
    assert ended.returncode == (0 if swaps else -signal.SIGKILL)
    if swaps:
        assert names_and_contents(folder) == (set(NAMES), {"9"})
    make(folder, "done")
    assert names_and_contents(folder) == (set(NAMES), {"done"})
    assert {path.name for path in tmp_path.iterdir()} == {"set"}


def test_a_set_is_replaced_as_a_whole(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    make(folder, "old")
    (folder / "notes.txt").write_text("mine")
    (folder / "drafts").mkdir()
    make(folder, "new", NAMES[:2])
    assert {path.name for path in folder.iterdir()} == {MADE, *NAMES[:2], "notes.txt", "drafts"}
    make(folder, "more", NAMES[1:3], adds=True)
    assert [(folder / name).read_text() for name in NAMES[:3]] == ["new", "more", "more"]
    assert {path.name for path in tmp_path.iterdir()} == {"set"}


def test_an_error_leaves_all_as_it_was(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        fail(tmp_path / "a/b")
    assert list(tmp_path.iterdir()) == []
    make(tmp_path / "set", "old")
    with pytest.raises(ZeroDivisionError):
        fail(tmp_path / "set")
    assert names_and_contents(tmp_path / "set") == (set(NAMES), {"old"})


@pytest.mark.parametrize(
    "noted",
    ["{}", "[]", "", '{"made_by": "solve"}', "\0", "[" * 9999, '{"made_by": "solve", "files": 5}',
     '{"made_by": [1], "files": ["file-0"]}'],
)  # fmt: skip
def test_a_damaged_note_owns_no_files(noted: str, tmp_path: Path) -> None:
    make(tmp_path / "set", "old")
    (tmp_path / "set" / MADE).write_text(noted)
    with pytest.raises(InputError, match="did not make"):
        make(tmp_path / "set", "new")
    assert names_and_contents(tmp_path / "set") == (set(NAMES), {"old"})


@pytest.mark.parametrize("named", ['["gone"]', '["../other"]', "[1, null, [2]]", '["a\\u0000b", "/etc/hostname", "."]'])
def test_a_note_of_missing_files_copies_none(named: str, tmp_path: Path) -> None:
    """A file of results that a user took away stood in the way of the next run, and others were copied in."""
    (tmp_path / "other").write_text("mine")
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / MADE).write_text(f'{{"made_by": "trade", "files": {named}}}')
    with staged(FileSet(tmp_path / "set", "--out", "trade", ["new"], adds=True)) as stage:
        files.write(stage / "new", "new")
    assert sorted(path.name for path in (tmp_path / "set").iterdir()) == [MADE, "new"]
    assert json.loads((tmp_path / "set" / MADE).read_text())["files"] == ["new"]


def test_a_file_created_in_the_meantime_stays(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    make(folder, "old", NAMES[:2])
    with pytest.raises(InputError, match=NAMES[3]):
        add_meanwhile(folder, NAMES[3])
    assert (folder / NAMES[3]).read_text() == "mine"


@pytest.mark.parametrize("locks", [True, False])
def test_a_run_that_works_is_not_swept_away(locks: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check a running process, also where no lock shows it."""
    if not locks:
        monkeypatch.setattr("laufruhe.numerics.locks.fcntl", None)
    with staged(FileSet(tmp_path / "set", "--out", "solve", NAMES)) as first:
        (first / NAMES[0]).write_text("first")
        make(tmp_path / "set", "second")
        assert (first / NAMES[0]).exists()
        assert names_and_contents(tmp_path / "set") == (set(NAMES), {"second"})
    assert names_and_contents(tmp_path / "set") == ({NAMES[0]}, {"first"})


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    make(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert names_and_contents(tmp_path / "real") == (set(NAMES), {"new"})


def test_one_file_appears_whole(tmp_path: Path) -> None:
    place = tmp_path / "deep/data.json"
    with staged_file(place, "--json") as path:
        files.write(path, strict({"title": "x"}))
        assert not place.exists()
    assert json.loads(place.read_text()) == {"made_by": "laufruhe", "title": "x"}
    with staged_file(place, "--json"):
        pass
    assert [entry.name for entry in place.parent.iterdir()] == ["data.json"]
