"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from laufruhe.errors import Complaint, InputError
from laufruhe.present.pictures import CAPTIONS

RESULT = "result.json"
REPORT = "report.md"
RESULT_FILES = (RESULT, REPORT, *CAPTIONS)


@contextmanager
def staged(folder: Path, option: str, names: Collection[str] = RESULT_FILES) -> Iterator[Path]:
    """A hidden folder whose files move into `folder` when all of them are made.

    Whether `folder` can be written is found out on entry. After an error or an
    interrupt it is as it was before.

    Parameters
    ----------
    folder
        Made if it does not exist.
    option
        Names the culprit in a complaint.
    names
        The files that may be made. One that is not made this time is removed from
        `folder`: it would show another result.

    Raises
    ------
    InputError
        If nothing can be written to `folder`.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists() and not path.is_symlink()]
    with ExitStack() as undone:
        # deepest first; what holds files by then stays
        undone.callback(_remove_empty, missing)
        try:
            stage = _stage(folder, names)
        except OSError as error:
            why = f"cannot be written ({error.strerror or error})"
            raise InputError("laufruhe", (Complaint(option, str(folder), why, "name another place"),)) from None
        undone.callback(shutil.rmtree, stage, ignore_errors=True)
        yield stage
        _move(stage, folder, names)


@contextmanager
def staged_file(path: Path, option: str) -> Iterator[Path]:
    """A place to write one file to; it becomes `path` when it is whole.

    Raises
    ------
    InputError
        If `path` cannot be written.
    """
    path = path.resolve()
    if path.exists() and not path.is_file() and not path.is_dir():
        # a device or a pipe takes text, and must not be replaced by a file
        yield path
        return
    if path.is_dir():
        raise InputError("laufruhe", (Complaint(option, str(path), "is a folder", "name a file in it"),))
    if path.is_file() and not os.access(path, os.W_OK):
        raise InputError("laufruhe", (Complaint(option, str(path), "cannot be written", "check its permissions"),))
    with staged(path.parent, option, (path.name,)) as stage:
        yield stage / path.name


def write(path: Path, text: str) -> None:
    """Text as UTF-8, the same on every system."""
    # a file name that is no text leaves lone surrogates behind; JSON writes them as \udcxx
    path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def _stage(folder: Path, names: Collection[str]) -> Path:
    above = next(path for path in (folder, *folder.parents) if path.exists() or path.is_symlink())
    if not above.is_dir():
        raise NotADirectoryError(f"'{above}' is not a folder")
    folder.mkdir(parents=True, exist_ok=True)
    taken = [name for name in names if (folder / name).is_dir()]
    if taken:
        raise IsADirectoryError(f"'{taken[0]}' is a folder there")
    return Path(tempfile.mkdtemp(prefix=".unfinished-", dir=folder))


def _move(stage: Path, folder: Path, names: Collection[str]) -> None:
    ready = sorted(stage.iterdir())
    for file in ready:
        os.replace(file, folder / file.name)
    for name in set(names) - {file.name for file in ready}:
        (folder / name).unlink(missing_ok=True)


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()
