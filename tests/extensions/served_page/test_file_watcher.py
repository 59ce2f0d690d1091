"""File that changes under a page: the last good state stays, and the wrong line is named."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from laufruhe.errors import InputError
from laufruhe.extensions.served_page.file_watcher import FileWatcher
from problem_files import FOUR, MOUNTS, PROBLEMS, written

TEXT = FOUR + '[[operating_points]]\nspeed = "2500 rpm"\n' + MOUNTS
INPUTS = Path(__file__).parent / "inputs"
PATIENCE = 120.0


def saved(path: Path, text: str) -> None:
    """Save a text at once, so that a reader sees the old text or the new one."""
    new = path.with_suffix(".new")
    new.write_text(text, encoding="utf-8")
    new.replace(path)


@pytest.fixture
def watched(tmp_path: Path) -> Iterator[FileWatcher]:
    made = FileWatcher(written(tmp_path, TEXT))
    made.start()
    yield made
    made.close()


def test_a_bad_file_leaves_the_last_good_state(watched: FileWatcher) -> None:
    first = watched.source
    saved(watched.path, TEXT.replace('"2500 rpm"', "2500 rpm"))
    assert watched.later(1, PATIENCE) == 2
    assert watched.source is first
    line = TEXT.splitlines().index('speed = "2500 rpm"') + 1
    assert f"line {line}, " in watched.complaint
    saved(watched.path, TEXT.replace("2500", "10000000"))
    assert watched.later(2, PATIENCE) == 3
    assert "rpm" in watched.complaint or watched.source is not first
    saved(watched.path, TEXT.replace("2500", "2600"))
    assert watched.later(3, PATIENCE) == 4
    assert watched.complaint == ""
    assert watched.source.tables["operating_points"][0]["speed"] == "2600 rpm"
    watched.path.unlink()
    assert watched.later(4, PATIENCE) == 5
    assert "does not exist" in watched.complaint


def test_a_closed_watcher_releases_waiting_requests(watched: FileWatcher) -> None:
    watched.close()
    assert watched.later(watched.version, PATIENCE) == watched.version
    assert watched.is_closed


def test_an_unreadable_file_is_not_served(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        FileWatcher(tmp_path / "missing.toml")


@pytest.mark.parametrize("name", ["../trace.csv", "/etc/passwd", "inner/../../trace.csv"])
def test_nothing_beyond_the_folder_is_read(name: str, tmp_path: Path) -> None:
    (tmp_path / "trace.csv").write_text("0, 1\n360, 2\n", encoding="utf-8")
    folder = tmp_path / "own"
    folder.mkdir()
    gas = f'[gas]\nmodel = "trace"\nfile = "{name}"\n'
    with pytest.raises(InputError, match=r"gas\.file = .*outside the folder of the problem"):
        FileWatcher(written(folder, TEXT + gas))


@pytest.mark.parametrize(
    ("name", "beside"),
    [
        ("rank-all-cranks", "page-trace.csv"),
        ("car-four-willans", "car-four-fuel.csv"),
        ("powertrain-measured-mount", "hydraulic-mount.csv"),
        ("selective-assembly", "selective-assembly-rods.csv"),
    ],
)
def test_every_file_that_a_problem_names_is_watched(name: str, beside: str, tmp_path: Path) -> None:
    """Check a pressure trace, a fuel test, a dynamic stiffness and a list of parts."""
    folder = INPUTS if name == "rank-all-cranks" else PROBLEMS
    for path in folder.glob("*.csv"):
        shutil.copy(path, tmp_path)
    shutil.copy(folder / f"{name}.toml", tmp_path)
    made = FileWatcher(tmp_path / f"{name}.toml")
    made.start()
    try:
        first, other = made.source, tmp_path / beside
        text = other.read_text(encoding="utf-8")
        saved(other, text + "# measured again\n")
        assert made.later(1, PATIENCE) == 2
        assert made.complaint == ""
        assert made.source.tables == first.tables
        assert made.source.content != first.content
        other.unlink()
        assert made.later(2, PATIENCE) == 3
        assert beside in made.complaint
        saved(other, text)
        assert made.later(3, PATIENCE) == 4
        assert made.complaint == ""
        assert made.source.content == first.content
    finally:
        made.close()
