"""Store of random draws: millions of rows with equal columns, each piece a file of NumPy arrays."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from laufruhe.errors import refused
from laufruhe.numerics.locks import folder_lock
from laufruhe.studies.part import Record
from laufruhe.studies.scenes import Point

VALUES, COLUMNS = "values", "columns"
"""Keys of the record of a piece of draws: numbers, shape (draws, columns), and columns by name."""


@dataclass(frozen=True)
class Column:
    """Column of a table of draws: one number for every draw."""

    unit: str
    words: str


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
