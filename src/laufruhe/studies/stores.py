"""Stores of finished points of a study, by fingerprint.

There are two stores, for two shapes of records. A point of most kinds takes milliseconds to minutes, and the shape of
its record depends on its engine. Such a record is one line of a file. A changed study keeps the lines of unchanged
points. Random draws are millions of rows with equal columns; each piece of them is a file of NumPy arrays.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from io import FileIO
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np

from laufruhe.errors import refused
from laufruhe.numerics.locks import folder_lock
from laufruhe.studies.part import COLUMNS, VALUES, Column, Part, Record
from laufruhe.studies.reader import StudyFile
from laufruhe.studies.scenes import Point, ProblemFiles

Task: TypeAlias = tuple[Part, Point]
FINISHED_POINTS = ".unfinished-points.jsonl"
# length of a line's checksum
_SUM = 32


class Store(Protocol):
    """Records of finished points by fingerprint."""

    @property
    def seconds(self) -> Mapping[str, float]:
        """Computing time of every point [s], by fingerprint."""

    def read(self, fingerprint: str) -> Record:
        """Return the record of the point with a fingerprint; all records together may exceed the memory."""

    def keep(self, fingerprint: str, seconds: float, record: Record) -> None:
        """Store the record and the computing time [s] of the point with a fingerprint, before this returns."""


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


class Draws(AbstractContextManager["Draws"]):
    """Finished pieces of random draws of one part, each a file of NumPy arrays in a folder that stays.

    A file appears whole under the fingerprint of its piece. A file that is cut, changed or misplaced does not match
    the checksums or the fingerprint in it, and its piece is computed again.
    """

    def __init__(self, folder: Path, columns: Mapping[str, Column], points: Mapping[str, Point]) -> None:
        self._folder, self._columns, self._points, self._locked = folder, columns, points, ExitStack()
        remedy = "name another place by --out"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            is_locked = self._locked.enter_context(folder_lock(folder, wait=False))
        except OSError as error:
            raise refused("results", str(folder), f"cannot be written ({error.strerror})", remedy) from None
        if is_locked is False:
            raise refused("results", str(folder), "is being written by another run", f"wait for it, or {remedy}")
        self.seconds: dict[str, float] = {}
        for fingerprint in points:
            # damaged files raise any error of their codec
            with suppress(Exception), (folder / f"{fingerprint}.npz").open("rb") as stream:
                piece = np.load(stream)
                if piece["fingerprint"] == fingerprint and len(piece[VALUES]):
                    self.seconds[fingerprint] = float(piece["seconds"])

    def read(self, fingerprint: str) -> Record:
        """Return the record of a piece."""
        with np.load(self._folder / f"{fingerprint}.npz") as piece:
            return {VALUES: piece[VALUES], COLUMNS: self._columns}

    def keep(self, fingerprint: str, seconds: float, record: Record) -> None:
        """Write the file of a finished piece and its computing time [s]."""
        point, unfinished = self._points[fingerprint], self._folder / "unfinished"
        arrays: dict[str, Any] = {
            VALUES: record[VALUES], "quantities": list(self._columns), "case": point.case.name, "draws": point.span,
            "units": [column.unit for column in self._columns.values()], "fingerprint": fingerprint, "seconds": seconds,
        }  # fmt: skip
        with unfinished.open("wb") as stream:
            np.savez_compressed(stream, **arrays)
        unfinished.replace(self._folder / f"{fingerprint}.npz")
        self.seconds[fingerprint] = seconds

    def __exit__(self, *_: object) -> None:
        self._locked.close()


def stores_of(
    study: StudyFile, problem_files: ProblemFiles, finished: Path, tasks: Mapping[str, Task], stores: ExitStack
) -> Iterator[tuple[Store, Collection[str]]]:
    """Yield each store of results, with the fingerprints of all points that belong to it, finished or not.

    A range of random draws is a file of its own (`Draws`). The record of any other point is a line of the file
    `finished` (`FinishedPoints`).
    """
    others = set(tasks)
    for part in study.study.parts:
        if columns := part.columns(problem_files):
            drawn = {
                fingerprint: point for fingerprint, (owner, point) in tasks.items() if owner is part and point.span
            }
            yield stores.enter_context(Draws(draws_in(finished.parent) / part.name, columns, drawn)), drawn
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
