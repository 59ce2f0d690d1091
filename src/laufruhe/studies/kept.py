"""The finished points of a study that has not ended: one file, one line a point, only ever added to."""

from __future__ import annotations

import json
import os
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, BinaryIO

from laufruhe.errors import Complaint, InputError

NAME = ".unfinished-points.jsonl"


class KeptPoints(AbstractContextManager["KeptPoints"]):
    """Records by fingerprint, on disk as soon as they are known, in a file made with the first.

    A line that was cut when the study was killed is dropped: its point is solved again.

    Raises
    ------
    InputError
        If a whole line is no finished point.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.records: dict[str, Any] = {}
        self.seconds: dict[str, float] = {}
        self._stream: BinaryIO | None = None
        content = path.read_bytes() if path.is_file() else b""
        self._whole = content.rfind(b"\n") + 1
        for number, line in enumerate(content[: self._whole].splitlines(), 1):
            try:
                mark, seconds, record = json.loads(line)
                self.records[str(mark)], self.seconds[str(mark)] = dict(record), float(seconds)
            except (ValueError, TypeError):
                rule, remedy = "is no finished point of a study", "remove this line, and the point is solved again"
                raise InputError(str(path), (Complaint(f"line {number}", "", rule, remedy),)) from None

    def keep(self, mark: str, seconds: float, record: dict[str, Any]) -> None:
        """Write a record and what it took; it has left the process when this returns."""
        if self._stream is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            # not in append mode: what follows the last whole line is cut off
            self._stream = self.path.open("r+b" if self.path.is_file() else "wb")
            self._stream.truncate(self._whole)
            self._stream.seek(self._whole)
        self._stream.write(json.dumps([mark, round(seconds, 6), record]).encode() + b"\n")
        self._stream.flush()
        self.records[mark], self.seconds[mark] = record, seconds

    def __exit__(self, *_: object) -> None:
        if self._stream is not None:
            os.fsync(self._stream.fileno())
            self._stream.close()
