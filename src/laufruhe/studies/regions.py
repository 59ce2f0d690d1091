"""Many numbers of a study in one Zarr store: laid out before anything is known, a region for each piece of work.

What is known of a piece is written first, that it is done last, with a checksum of both. A region that was cut, changed
or belongs to something else does not fit its checksum, counts as not done, and is worked out again.
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
from laufruhe.numerics.locks import held
from laufruhe.studies.part import Record, Template

VALUES, COLUMNS, DONE = "values", "columns", "done"
MADE_BY = "laufruhe study"
_SECONDS = struct.Struct("<d")
_SUM = hashlib.sha256().digest_size


@dataclass(frozen=True)
class Region:
    """Draws of one case, from one number to another."""

    case: int
    first: int
    last: int


class Regions:
    """The numbers of one part: `values` along case, draw and quantity, and `done` along case and piece.

    Parameters
    ----------
    root
        Folder of the store, which all parts of a study share; this part is a group in it.
    wanted
        Where the pieces stand, by their fingerprints.

    Raises
    ------
    InputError
        If something else stands there.
    """

    def __init__(self, root: Path, name: str, template: Template, wanted: Mapping[str, Region]) -> None:
        self._wanted, self._chunk, self._columns = wanted, template.chunk, template.columns
        self._values, self._done = _laid_out(root, name, template)
        self.seconds: dict[str, float] = {}
        for mark, region in wanted.items():
            seconds = self._found(mark, region)
            if seconds is not None:
                self.seconds[mark] = seconds

    def keep(self, mark: str, seconds: float, record: Record) -> None:
        """Write the values of a piece, then that it is done."""
        region, values = self._wanted[mark], np.ascontiguousarray(record[VALUES], dtype="<f8")
        told = _SECONDS.pack(seconds)
        self._values[region.case, region.first : region.last] = values
        found = _checksum(mark, told, values) + told
        self._done[region.case, region.first // self._chunk] = np.frombuffer(found, dtype=np.uint8)
        self.seconds[mark] = seconds

    def read(self, mark: str) -> Record:
        """What was kept of a piece."""
        region = self._wanted[mark]
        values = np.asarray(self._values[region.case, region.first : region.last])
        return {VALUES: values, COLUMNS: self._columns}

    def _found(self, mark: str, region: Region) -> float | None:
        """Seconds that a piece took; None where it is not done, or not as it was written."""
        try:
            noted = bytes(np.asarray(self._done[region.case, region.first // self._chunk]))
            told = noted[_SUM:]
            if not any(noted):
                return None
            values = np.ascontiguousarray(self.read(mark)[VALUES], dtype="<f8")
        except Exception:
            # a damaged file ends in whatever its codec makes of it
            return None
        return float(_SECONDS.unpack(told)[0]) if noted[:_SUM] == _checksum(mark, told, values) else None


def _checksum(mark: str, seconds: bytes, values: NDArray[np.float64]) -> bytes:
    return hashlib.sha256(mark.encode() + seconds + values.tobytes()).digest()


def _laid_out(root: Path, name: str, template: Template) -> tuple[Any, Any]:
    """Arrays of a part, as they stand there or new."""
    import zarr

    whole = zarr.open_group(root, mode="a", zarr_format=3)
    if whole.attrs.get("made_by") != MADE_BY and any(entry.name != "zarr.json" for entry in root.iterdir()):
        raise refused("results", str(root), "holds what Laufruhe did not make", "name another place by --out")
    whole.attrs["made_by"] = MADE_BY
    about = {"columns": {key: asdict(column) for key, column in template.columns.items()}, "cases": [*template.cases]}
    cases, pieces = len(template.cases), -(-template.draws // template.chunk)
    shapes = {VALUES: (cases, template.draws, len(template.columns)), DONE: (cases, pieces, _SUM + _SECONDS.size)}
    with suppress(KeyError, ValueError, OSError, TypeError):
        group = whole[name]
        if {key: group.attrs.get(key) for key in about} == about and group.attrs.get("chunk") == template.chunk:
            for key, shape in shapes.items():
                # more draws go on from those that are there
                if group[key].shape != shape:
                    group[key].resize(shape)
            return group[VALUES], group[DONE]
    group = whole.create_group(name, overwrite=True, attributes={**about, "chunk": template.chunk})
    values = group.create_array(
        VALUES, shape=shapes[VALUES], dtype="float64", chunks=(1, template.chunk, len(template.columns)),
        fill_value=np.nan, dimension_names=("case", "draw", "quantity"),
    )  # fmt: skip
    done = group.create_array(
        DONE, shape=shapes[DONE], dtype="uint8", chunks=(1, 1, shapes[DONE][-1]), fill_value=0,
        dimension_names=("case", "piece", "byte"), compressors=None,
    )  # fmt: skip
    return values, done


@contextmanager
def kept_to_one(root: Path) -> Iterator[None]:
    """A store that no other run writes to at once.

    Raises
    ------
    InputError
        If another does, Zarr is not installed, or the folder cannot be made.
    """
    try:
        import zarr  # noqa: F401
    except ImportError:
        rule = "needs Zarr, which is not installed"
        raise refused("results", str(root), rule, "pip install 'laufruhe[cluster]'") from None
    with ExitStack() as until_then:
        try:
            root.mkdir(parents=True, exist_ok=True)
            ours = until_then.enter_context(held(root, wait=False))
        except OSError as error:
            rule = f"cannot be written ({error.strerror})"
            raise refused("results", str(root), rule, "name another place by --out") from None
        if ours is False:
            rule = "is being written by another run"
            raise refused("results", str(root), rule, "wait for it, or name another --out")
        yield
