"""Watch a problem file and the files that it names; keep the last valid state."""

from __future__ import annotations

import hashlib
import stat
import threading
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from laufruhe.errors import InputError, refused
from laufruhe.extensions.served_page.answers import Source
from laufruhe.files.complaints import key_path
from laufruhe.files.nested import texts_in
from laufruhe.files.reader import load_tables, tables_of

EVERY = 0.4
"""Seconds between two checks."""


class FileWatcher:
    """Watcher that polls a problem file and all files that it names; `InputError` if the file is not valid at first."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stamps: dict[Path, tuple[int, int]] = {}
        self.source = self._read()
        self.complaint = ""
        self.version = 1
        self._changed = threading.Condition()
        self._closed = threading.Event()

    def start(self) -> None:
        """Start polling."""
        threading.Thread(target=self._watch, daemon=True).start()

    def close(self) -> None:
        """Stop polling and wake all waiting threads."""
        self._closed.set()
        with self._changed:
            self._changed.notify_all()

    @property
    def is_closed(self) -> bool:
        """True after closing."""
        return self._closed.is_set()

    def later(self, version: int, seconds: float) -> int:
        """Wait until the version differs from `version`, at most some seconds, and return it."""
        with self._changed:
            self._changed.wait_for(lambda: self.version != version or self.is_closed, seconds)
            return self.version

    def _watch(self) -> None:
        while not self._closed.wait(EVERY):
            if all(_stamp_of(path) == stamp for path, stamp in self._stamps.items()):
                continue
            try:
                source, complaint = self._read(), ""
            except InputError as error:
                source, complaint = self.source, str(error)
            with self._changed:
                self.source, self.complaint = source, complaint
                self.version += 1
                self._changed.notify_all()

    def _read(self) -> Source:
        # take stamps before reading, so that no change is missed
        self._stamps[self.path] = _stamp_of(self.path)
        tables = tables_of(self.path)
        _check_inside(tables, self.path)
        named = [self.path.parent / text for text in sorted({text for _, text in texts_in(tables)})]
        self._stamps = {self.path: self._stamps[self.path], **{path: _stamp_of(path) for path in named}}
        digest = hashlib.sha256()
        for path in named:
            with suppress(OSError, ValueError):
                if path.is_file():
                    with path.open("rb") as stream:
                        digest.update(hashlib.file_digest(stream, "sha256").digest())
        load_tables(tables, self.path)
        return Source(tables, self.path, digest.hexdigest())


def _stamp_of(path: Path) -> tuple[int, int]:
    # a text may be no valid file name
    with suppress(OSError, ValueError):
        status = path.stat()
        if stat.S_ISREG(status.st_mode):
            return status.st_mtime_ns, status.st_size
    return 0, 0


def _check_inside(tables: Mapping[str, Any], path: Path) -> None:
    folder = path.parent.resolve()
    for where, name in texts_in(tables):
        is_file = where[-1] == "file" or name.lower().endswith(".csv")
        if is_file and not (folder / name).resolve().is_relative_to(folder):
            rule, remedy = "is outside the folder of the problem, and a page reads nothing there", "copy it beside it"
            raise refused(key_path(where), f'"{name}"', rule, remedy, path)
