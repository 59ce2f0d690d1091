"""Stores of finished points of a study, by fingerprint.

A point of most kinds takes milliseconds to minutes, and the shape of its record depends on its engine. Such a record is
one line of a file. A changed study keeps the lines of unchanged points. A part of many draws has a store of its own.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from io import FileIO
from pathlib import Path
from typing import Any, TypeAlias

from laufruhe.studies.part import Part, Record, Store
from laufruhe.studies.reader import StudyFile
from laufruhe.studies.scenes import Point, ProblemFiles

Task: TypeAlias = tuple[Part, Point]
FINISHED_POINTS = ".unfinished-points.jsonl"
# length of a line's checksum
_SUM = 32


class FinishedPoints(AbstractContextManager["FinishedPoints"]):
    """Finished points of a file by fingerprint; each is on disk as soon as it is known.

    Every line begins with a checksum of the rest of the line. A line that is cut, changed or foreign does not match
    its checksum; it stays in the file, and its point is solved again. Each line is added whole between two line feeds,
    so that neither a cut line nor another study in the same folder spoils it.
    """

    def __init__(self, path: Path, fingerprints: Collection[str]) -> None:
        self.path = path
        self._records: Record = {}
        self.seconds: dict[str, float] = {}
        self._stream: FileIO | None = None
        if path.is_file():
            # line by line: the file may exceed memory
            with path.open("rb") as lines:
                for line in lines:
                    checksum, _, content = line.rstrip(b"\n").partition(b" ")
                    if checksum == _checksum(content):
                        fingerprint, seconds, record = json.loads(content)
                        if fingerprint in fingerprints:
                            self._records[fingerprint], self.seconds[fingerprint] = record, seconds

    def read(self, fingerprint: str) -> Record:
        """Return the record of a point."""
        return dict(self._records[fingerprint])

    def keep(self, fingerprint: str, seconds: float, record: Record) -> None:
        """Append the record of a finished point and its computing time [s] to the file, under its fingerprint.

        Both are written when this returns.
        """
        if self._stream is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = FileIO(self.path, "a")
        line = json.dumps([fingerprint, round(seconds, 6), record]).encode()
        unwritten = memoryview(b"\n%b %b\n" % (_checksum(line), line))
        while unwritten:
            # a full disk writes a part before it fails
            unwritten = unwritten[self._stream.write(unwritten) :]
        self._records[fingerprint], self.seconds[fingerprint] = record, seconds

    def __exit__(self, *_: object) -> None:
        if self._stream is not None:
            os.fsync(self._stream.fileno())
            self._stream.close()


def _checksum(line: bytes) -> bytes:
    return hashlib.sha256(line).hexdigest()[:_SUM].encode()


def stores_of(
    study: StudyFile, problem_files: ProblemFiles, finished: Path, tasks: Mapping[str, Task], stores: ExitStack
) -> Iterator[tuple[Store, Collection[str]]]:
    """Yield each store of results, with the fingerprints of all points that belong to it, finished or not.

    Ranges of draws belong to the store of their part, in a folder that stays. The record of any other point is a line
    of the file `finished` (`FinishedPoints`).
    """
    others = set(tasks)
    for part in study.study.parts:
        drawn = {fingerprint: point for fingerprint, (owner, point) in tasks.items() if owner is part and point.span}
        if drawn:
            folder = draws_in(finished.parent) / part.name
            yield stores.enter_context(part.store(folder, drawn, problem_files)), drawn
            others -= set(drawn)
    yield stores.enter_context(FinishedPoints(finished, others)), others


def draws_in(folder: Path) -> Path:
    """Return the folder of the draws, next to the folder of results."""
    return folder.with_name(f"{folder.name}.draws")


class Records(Sequence[Record]):
    """Records in the order of points, read on access."""

    def __init__(self, fingerprints: Sequence[str], stores: Mapping[str, Store]) -> None:
        self._fingerprints, self._stores = fingerprints, stores

    def __getitem__(self, k: Any) -> Any:
        fingerprint = self._fingerprints[k]
        return self._stores[fingerprint].read(fingerprint)

    def __len__(self) -> int:
        return len(self._fingerprints)
