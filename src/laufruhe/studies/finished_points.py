"""Points of a study that are finished, each on disk as soon as it is known."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection
from contextlib import AbstractContextManager
from io import FileIO
from pathlib import Path

from laufruhe.studies.part import Record

FINISHED_POINTS = ".unfinished-points.jsonl"
# length of a line's checksum
_SUM = 32


class FinishedPoints(AbstractContextManager["FinishedPoints"]):
    """Finished points of a file by fingerprint; each is on disk as soon as it is known.

    Every line begins with a checksum of the rest of it. What is cut, changed or no point at all does not fit its
    checksum, counts as not there, and is left alone: its point is solved again. Lines are added whole, between two ends
    of line, so that neither a cut line nor another study in the same folder spoils them.
    """

    def __init__(self, path: Path, marks: Collection[str]) -> None:
        self.path = path
        self._records: Record = {}
        self.seconds: dict[str, float] = {}
        self._stream: FileIO | None = None
        for line in path.read_bytes().split(b"\n") if path.is_file() else []:
            checksum, _, content = line.partition(b" ")
            if checksum == _checksum(content):
                mark, seconds, record = json.loads(content)
                if mark in marks:
                    self._records[mark], self.seconds[mark] = record, seconds

    def read(self, mark: str) -> Record:
        """Return the record of a point."""
        return dict(self._records[mark])

    def keep(self, mark: str, seconds: float, record: Record) -> None:
        """Write a record and its seconds; it has left the process when this returns."""
        if self._stream is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = FileIO(self.path, "a")
        line = json.dumps([mark, round(seconds, 6), record]).encode()
        unwritten = memoryview(b"\n%b %b\n" % (_checksum(line), line))
        while unwritten:
            # a full disk writes a part before it fails
            unwritten = unwritten[self._stream.write(unwritten) :]
        self._records[mark], self.seconds[mark] = record, seconds

    def __exit__(self, *_: object) -> None:
        if self._stream is not None:
            os.fsync(self._stream.fileno())
            self._stream.close()


def _checksum(line: bytes) -> bytes:
    return hashlib.sha256(line).hexdigest()[:_SUM].encode()
