"""Write files whole or not at all, into folders that list the files made in them."""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from laufruhe.errors import InputError, printed, refused
from laufruhe.numerics.locks import folder_lock
from laufruhe.present.pictures import PICTURES
from laufruhe.report.section import EXTENSION_SECTIONS
from laufruhe.report.strict_json import is_ours

RESULT = "result.json"
REPORT = "report.md"
PAGE, BOOK = "report.html", "tables.xlsx"
KINDS = ("png", "svg")
"""Endings of picture files."""
TABLES = (
    "decisions", "limits", "measures", "forces", "orders", "modes", "transmissibility", "rankings",
    "uneven-firing", "willans", "mount-critical-speeds", "mounts", "mounting",
    "reach", "objectives-in-order", "equal-optima", "weights", "shafts", "balance-factors",
    "gas-pressure", "load-cases",
)  # fmt: skip
"""Names of the tables of a result that are CSV files; extensions add theirs."""
MADE = ".laufruhe.json"
"""File in a folder of results with the command that made them, and their names."""
_NEXT = f"{MADE}-next"
_SWAP = 2
_HERE = -100


def result_files() -> tuple[str, ...]:
    """Return the names of all files that a result may have."""
    added = [(*section.printed, *section.number_tables) for section in EXTENSION_SECTIONS.values()]
    return (
        RESULT, REPORT, PAGE, BOOK,
        *(f"{name}.{kind}" for name in PICTURES for kind in KINDS),
        *(f"{name}.csv" for name in (*TABLES, *sum(added, ()))),
    )  # fmt: skip


@dataclass(frozen=True)
class FileSet:
    """Files that one command makes in a folder.

    Attributes
    ----------
    folder
        Target folder; created if missing.
    option
        Name of the option for error messages.
    verb
        Command; a folder holds the results of one command.
    adds
        True if files of earlier runs stay, unless they are made again.
    kept_names
        Files of this command that are no results and stay where they are.
    """

    folder: Path
    option: str
    verb: str
    names: Collection[str] = field(default_factory=result_files)
    adds: bool = False
    kept_names: Collection[str] = ()

    def checked(self) -> frozenset[str]:
        """Return the files that earlier runs made; raise `InputError` if foreign files are in the way."""
        folder = self.folder
        above = next(path for path in (folder, *folder.parents) if path.exists())
        if not above.is_dir():
            raise self.refused(f"cannot be written ('{above}' is not a folder)")
        if folder in (working_folder := Path.cwd(), *working_folder.parents) or os.path.ismount(folder):
            raise self.refused("cannot be replaced, because it contains the working folder or is a mount point")
        if not folder.exists():
            return frozenset()
        verb, made = _made(folder)
        foreign = sorted({entry.name for entry in folder.iterdir()} - made - {MADE, *self.kept_names})
        if verb not in ("", self.verb):
            raise self.refused(f"holds the results of laufruhe {verb}")
        in_the_way = [name for name in foreign if not verb or name in self.names]
        if in_the_way:
            raise self.refused(f"holds '{in_the_way[0]}', which Laufruhe did not make there")
        return made

    def refused(self, rule: str) -> InputError:
        """Return an error about the folder."""
        return refused(self.option, str(self.folder), rule, "name another place")


@contextmanager
def staged(target: FileSet) -> Iterator[Path]:
    """Yield a hidden folder that replaces the target folder atomically when all files are made.

    After an error, an interrupt or a kill at any moment the folder is unchanged or complete; the next run
    removes what a killed run left behind. Raise `InputError` on entry if the folder cannot be written, holds what
    Laufruhe did not make and would overwrite, or holds the results of another command.
    """
    target = replace(target, folder=Path(os.path.realpath(target.folder)))
    with ExitStack() as stack:
        with _reporting(target):
            above = target.folder.parent
            # wait while another run swaps the folder
            with folder_lock(above) if above.is_dir() else nullcontext():
                target.checked()
            stage = stack.enter_context(_stage_for(target.folder))
            # the folder may be missing, also while another run swaps it
            with suppress(FileNotFoundError):
                shutil.copymode(target.folder, stage)
        with _with_final_name(stage, target.folder):
            yield stage
        with folder_lock(target.folder.parent):
            made = target.checked()
            if target.adds:
                for name in made - {entry.name for entry in stage.iterdir()}:
                    shutil.copy2(target.folder / name, stage)
            _note(stage, target.verb, sorted({entry.name for entry in stage.iterdir()} - {MADE}))
            _swap(stage, target.folder)
            _clear(stage, target.folder)


@contextmanager
def _reporting(target: FileSet) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise target.refused(f"cannot be written ({error.strerror or error})") from None


@contextmanager
def _with_final_name(stage: Path, target: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        if error.filename is None or stage in Path(os.fsdecode(error.filename)).parents:
            error.filename = str(target)
        raise


@contextmanager
def staged_file(path: Path, option: str) -> Iterator[Path]:
    """Yield a path to write data to; it replaces `path` when it is complete.

    Raise `InputError` if `path` cannot be written, or is a file that Laufruhe did not make.
    """
    path = path.resolve()
    place = FileSet(path, option, "", ())
    if path.exists() and not path.is_file() and not path.is_dir():
        # a device or a pipe takes text, and must not be replaced by a file
        yield path
        return
    if path.is_dir():
        raise refused(option, str(path), "is a folder", "name a file in it")
    if path.is_file() and not os.access(path, os.W_OK):
        raise refused(option, str(path), "cannot be written", "check its permissions")
    if path.is_file() and not is_ours(path):
        raise place.refused("is a file that Laufruhe did not make")
    with ExitStack() as stack:
        with _reporting(place):
            stage = stack.enter_context(_stage_for(path))
        with _with_final_name(stage, path):
            yield stage / path.name
        if (stage / path.name).exists():
            os.replace(stage / path.name, path)


def results_line(folder: Path, page: str) -> str:
    """Return a line that names the folder of the files and the file to open first."""
    return f"Results: {printed(str(folder))} (begin with {printed(page)})"


def write(path: Path, text: str) -> None:
    """Write text as UTF-8, the same on every system."""
    # a file name that is no text leaves lone surrogates behind; JSON writes them as \udcxx
    path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def write_all(texts: Mapping[Path, str]) -> None:
    """Write all texts as files, or none; create folders."""
    with ExitStack() as stack:
        staged = {}
        for path, text in texts.items():
            missing = [above for above in path.parents if not above.exists()]
            stack.callback(_remove_empty, missing)
            path.parent.mkdir(parents=True, exist_ok=True)
            stage = staged[path] = path.with_name(f".unfinished-{secrets.token_hex(8)}")
            stack.callback(stage.unlink, missing_ok=True)
            try:
                write(stage, text)
            except OSError as error:
                error.filename = str(path)
                raise
        for path, stage in staged.items():
            os.replace(stage, path)


@contextmanager
def _stage_for(place: Path) -> Iterator[Path]:
    """Yield an unfinished folder next to a path; remove those that killed runs left there."""
    missing = [path for path in place.parents if not path.exists() and not path.is_symlink()]
    mark = f".unfinished-{hashlib.sha256(place.name.encode(errors='surrogateescape')).hexdigest()[:8]}-"
    with ExitStack() as stack:
        stack.callback(_remove_empty, missing)
        place.parent.mkdir(parents=True, exist_ok=True)
        with folder_lock(place.parent):
            for abandoned in place.parent.glob(f"{mark}*"):
                with folder_lock(abandoned, wait=False) as is_free:
                    if is_free:
                        _clear(abandoned, place)
            stage = place.parent / f"{mark}{secrets.token_hex(4)}"
            stage.mkdir()
            stack.callback(_clear, stage, place)
            _note(stage, "", None)
            stack.enter_context(folder_lock(stage))
        yield stage


def _note(folder: Path, verb: str, names: list[str] | None) -> None:
    write(folder / _NEXT, json.dumps({"made_by": verb, "files": names}, ensure_ascii=False) + "\n")
    os.replace(folder / _NEXT, folder / MADE)


def _made(folder: Path) -> tuple[str, frozenset[str]]:
    # command that made the files in a folder, and their names; empty for a foreign folder
    try:
        record: Any = json.loads((folder / MADE).read_text(encoding="utf-8"))
        verb, names = record["made_by"], record["files"]
        entries = {entry.name for entry in folder.iterdir() if names is None or entry.is_file()}
        if isinstance(verb, str) and isinstance(names, list | None):
            # ignore names that are not in this folder
            return verb, frozenset(entries if names is None else entries.intersection(map(str, names)))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        pass
    return "", frozenset()


def _clear(abandoned: Path, place: Path) -> None:
    """Delete files that Laufruhe made in an abandoned folder; move all others back to their place."""
    if not abandoned.is_dir():
        return
    verb, made = _made(abandoned)
    with suppress(OSError):
        if verb and not place.exists():
            # killed between two renames: this is the only whole set
            abandoned.rename(place)
            return
        for entry in [entry for entry in abandoned.iterdir() if entry.name != MADE]:
            if entry.name in made or entry.name == _NEXT:
                entry.unlink()
            elif not (place / entry.name).exists():
                entry.rename(place / entry.name)
        # this file goes last, because it identifies the others
        (abandoned / MADE).unlink(missing_ok=True)
        abandoned.rmdir()


def _swap(stage: Path, folder: Path) -> None:
    """Swap a folder with another."""
    with suppress(OSError):
        # the target is missing or empty
        stage.rename(folder)
        return
    if os.name == "posix":
        libc, source, destination = ctypes.CDLL(None), os.fsencode(stage), os.fsencode(folder)
        for call, words in (
            ("renameat2", (_HERE, source, _HERE, destination, _SWAP)),
            ("renamex_np", (source, destination, _SWAP)),
        ):
            if hasattr(libc, call) and getattr(libc, call)(*words) == 0:
                return
    # on a file system that cannot swap, the next run repairs what a kill between the renames leaves
    aside = stage.with_name(f"{stage.name}-before")
    folder.rename(aside)
    stage.rename(folder)
    aside.rename(stage)


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()
