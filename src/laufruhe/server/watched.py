"""The problem's file as it is on the disk: the last state that could be read, and what is wrong with a newer one."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from laufruhe.errors import InputError, refused
from laufruhe.files.complaints import key_path
from laufruhe.files.nested import texts_in
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.server.answers import Source

EVERY = 0.4
"""Seconds between two looks."""


class Watched:
    """A file that is looked at while it is served.

    Parameters
    ----------
    path
        Of a problem that can be read (`InputError` else).
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stamp = self._look()
        self.source = self._read()
        self.complaint = ""
        self.version = 1
        self._changed = threading.Condition()
        self._closed = threading.Event()

    def start(self) -> None:
        """Look at it from now on."""
        threading.Thread(target=self._watch, daemon=True).start()

    def close(self) -> None:
        """Whoever waits is told at once."""
        self._closed.set()
        with self._changed:
            self._changed.notify_all()

    @property
    def is_closed(self) -> bool:
        """Whether nothing is served any more."""
        return self._closed.is_set()

    def later(self, version: int, seconds: float) -> int:
        """The version, as soon as it is another one."""
        with self._changed:
            self._changed.wait_for(lambda: self.version != version or self.is_closed, seconds)
            return self.version

    def _watch(self) -> None:
        while not self._closed.wait(EVERY):
            stamp = self._look()
            if stamp == self._stamp:
                continue
            self._stamp = stamp
            try:
                source, complaint = self._read(), ""
            except InputError as error:
                source, complaint = self.source, str(error)
            with self._changed:
                self.source, self.complaint = source, complaint
                self.version += 1
                self._changed.notify_all()

    def _look(self) -> tuple[int, int]:
        try:
            found = self.path.stat()
        except OSError:
            return 0, 0
        return found.st_mtime_ns, found.st_size

    def _read(self) -> Source:
        tables = tables_of(self.path)
        _check_inside(tables, self.path)
        load_tables(tables, self.path)
        return Source(tables, self.path)


def _check_inside(tables: Mapping[str, Any], path: Path) -> None:
    """Refuse files that a problem names beyond its folder: a page reads nothing there."""
    folder = path.parent.resolve()
    for where, name in texts_in(tables):
        is_file = where[-1] == "file" or name.lower().endswith(".csv")
        if is_file and not (folder / name).resolve().is_relative_to(folder):
            rule, remedy = "is outside the folder of the problem, and a page reads nothing there", "copy it beside it"
            raise refused(key_path(where), f'"{name}"', rule, remedy, path)
