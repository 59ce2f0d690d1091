"""Draws of a study in one Zarr store, with a region for each piece of work.

Values of a piece are written first, then a note with a checksum of both. A region that is cut, changed or foreign
does not match its checksum and is computed again.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import refused
from laufruhe.numerics.locks import folder_lock
from laufruhe.studies.part import Record, Template

VALUES, COLUMNS, DONE = "values", "columns", "done"
MADE_BY = "laufruhe study"
_ROOT = "zarr.json"
_FOREIGN, _ELSEWHERE = "what Laufruhe did not make", "name another place by --out"
_SECONDS = struct.Struct("<d")
_SUM = hashlib.sha256().digest_size


@dataclass(frozen=True)
class Region:
    """A range of draws of one case."""

    case: int
    first: int
    last: int


class Regions:
    """Numbers of one part: `values` along case, draw and quantity, and `done` along case and piece.

    The folder `root` is the store of a whole study; this part is a group in it. `regions` has the region of every
    piece by fingerprint. Raise `InputError` if the folder holds anything else.
    """

    def __init__(self, root: Path, name: str, template: Template, regions: Mapping[str, Region]) -> None:
        self._wanted, self._chunk, self._columns = regions, template.chunk, template.columns
        self._values, self._done = _laid_out(root, name, template)
        self.seconds: dict[str, float] = {}
        for fingerprint, region in regions.items():
            seconds = self._find(fingerprint, region)
            if seconds is not None:
                self.seconds[fingerprint] = seconds

    def keep(self, fingerprint: str, seconds: float, record: Record) -> None:
        """Store the values of a finished batch of draws and its computing time [s]; then note that the batch is done.

        `fingerprint` names the batch. A batch that was stopped before the note counts as missing.
        """
        region, values = self._wanted[fingerprint], np.ascontiguousarray(record[VALUES], dtype="<f8")
        packed = _SECONDS.pack(seconds)
        self._values[region.case, region.first : region.last] = values
        noted = _checksum(fingerprint, packed, values) + packed
        self._done[region.case, region.first // self._chunk] = np.frombuffer(noted, dtype=np.uint8)
        self.seconds[fingerprint] = seconds

    def read(self, fingerprint: str) -> Record:
        """Return the record of the piece of work with a fingerprint."""
        region = self._wanted[fingerprint]
        values = np.asarray(self._values[region.case, region.first : region.last])
        return {VALUES: values, COLUMNS: self._columns}

    def _find(self, fingerprint: str, region: Region) -> float | None:
        # seconds that a piece took; None if it is not done, or damaged
        try:
            noted = bytes(np.asarray(self._done[region.case, region.first // self._chunk]))
            packed = noted[_SUM:]
            if not any(noted):
                return None
            values = np.ascontiguousarray(self.read(fingerprint)[VALUES], dtype="<f8")
        except Exception:
            # damaged files raise any error of their codec
            return None
        return float(_SECONDS.unpack(packed)[0]) if noted[:_SUM] == _checksum(fingerprint, packed, values) else None


def _checksum(fingerprint: str, seconds: bytes, values: NDArray[np.float64]) -> bytes:
    return hashlib.sha256(fingerprint.encode() + seconds + values.tobytes()).digest()


def _laid_out(root: Path, name: str, template: Template) -> tuple[Any, Any]:
    """Return the Zarr arrays that store a part of a study: existing ones if they fit, else new ones."""
    store = _store_at(root)
    columns = {key: asdict(column) for key, column in template.columns.items()}
    about = {"columns": columns, "cases": [*template.cases], "chunk": template.chunk}
    cases, pieces = len(template.cases), -(-template.draws // template.chunk)
    shapes = {VALUES: (cases, template.draws, len(template.columns)), DONE: (cases, pieces, _SUM + _SECONDS.size)}
    forms = {
        VALUES: (np.dtype("float64"), (1, template.chunk, len(template.columns))),
        DONE: (np.dtype("uint8"), (1, 1, shapes[DONE][-1])),
    }
    arrays = _standing(store, name, about, forms)
    if arrays is not None:
        for key, array in zip(shapes, arrays, strict=True):
            # further draws extend existing ones
            if array.shape != shapes[key]:
                array.resize(shapes[key])
        return arrays
    if (root / name).exists() and name not in store.attrs["parts"]:
        raise refused("results", str(root / name), f"is {_FOREIGN}", _ELSEWHERE)
    store.attrs["parts"] = sorted({*store.attrs["parts"], name})
    group = store.create_group(name, overwrite=True, attributes=about)
    values = group.create_array(
        VALUES, shape=shapes[VALUES], dtype="float64", chunks=forms[VALUES][1],
        fill_value=np.nan, dimension_names=("case", "draw", "quantity"),
    )  # fmt: skip
    done = group.create_array(
        DONE, shape=shapes[DONE], dtype="uint8", chunks=forms[DONE][1], fill_value=0,
        dimension_names=("case", "piece", "byte"), compressors=None,
    )  # fmt: skip
    return values, done


def _standing(store: Any, name: str, about: Mapping[str, Any], forms: Mapping[str, Any]) -> tuple[Any, Any] | None:
    with suppress(Exception):
        group = store[name]
        alike = all((group[key].dtype, group[key].chunks) == form for key, form in forms.items())
        if alike and {key: group.attrs.get(key) for key in about} == about:
            return group[VALUES], group[DONE]
    return None


def _store_at(root: Path) -> Any:
    """Return the Zarr group in a folder, new if it is empty; raise `InputError` if it contains other files."""
    import zarr

    if not any(root.iterdir()):
        return zarr.open_group(root, mode="w", zarr_format=3, attributes={"made_by": MADE_BY, "parts": []})
    if not (root / _ROOT).is_file():
        raise refused("results", str(root), f"holds {_FOREIGN}", _ELSEWHERE)
    try:
        store = zarr.open_group(root, mode="r+", zarr_format=3)
        is_ours = store.attrs.get("made_by") == MADE_BY and isinstance(store.attrs.get("parts"), list)
    except Exception:
        # an array, invalid JSON or a number for a name raise different errors of Zarr
        rule, remedy = f"has a '{_ROOT}' that is damaged or no group", f"delete the folder, or {_ELSEWHERE}"
        raise refused("results", str(root), rule, remedy) from None
    if not is_ours:
        raise refused("results", str(root), f"holds {_FOREIGN}", _ELSEWHERE)
    return store


@contextmanager
def locked_store(root: Path) -> Iterator[None]:
    """Lock a store; raise `InputError` if another run has locked it, Zarr is missing, or the folder cannot be made."""
    try:
        import zarr  # noqa: F401
    except ImportError:
        rule = "needs Zarr, which is not installed"
        raise refused("results", str(root), rule, "pip install 'laufruhe[cluster]'") from None
    with ExitStack() as stack:
        try:
            root.mkdir(parents=True, exist_ok=True)
            is_locked = stack.enter_context(folder_lock(root, wait=False))
        except OSError as error:
            rule = f"cannot be written ({error.strerror})"
            raise refused("results", str(root), rule, "name another place by --out") from None
        if is_locked is False:
            rule = "is being written by another run"
            raise refused("results", str(root), rule, "wait for it, or name another --out")
        yield
