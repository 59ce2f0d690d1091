"""Running a study: every finished point is kept on disk, and one that stopped goes on."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from laufruhe.errors import Complaint, InputError
from laufruhe.problem.study_models import PartTable, StudyFile
from laufruhe.studies.points import Point, PointResult, answer, points_of

if TYPE_CHECKING:
    import xarray as xr

UNFINISHED = ".unfinished-points"


def run(
    study: StudyFile, folder: Path, kept: Path, say: Callable[[int, int], None] = lambda _done, _all: None
) -> dict[str, xr.Dataset]:
    """All parts of a study, each as one dataset.

    Parameters
    ----------
    folder
        That the study's problem files are named from.
    kept
        Folder of the finished points; points in it are not solved again.
    say
        Told how many points are done, of how many.
    """
    parts = study.study.parts
    todo = [(part, point) for part in parts for point in points_of(part)]
    kept.mkdir(parents=True, exist_ok=True)
    done: dict[str, list[PointResult]] = {part.name: [] for part in parts}
    for k, (part, point) in enumerate(todo):
        say(k, len(todo))
        file = kept / f"{_fingerprint(point, folder)}.json"
        result = _kept(file) if file.exists() else _solved(point, folder, file)
        done[part.name].append(result)
    say(len(todo), len(todo))
    return {part.name: dataset(part, done[part.name]) for part in parts}


def _fingerprint(point: Point, folder: Path) -> str:
    """Of everything that a point hangs on, so that a changed problem file is solved anew."""
    text = json.dumps([point.case.model_dump(), point.changes], sort_keys=True)
    path = folder / point.case.problem
    source = path.read_bytes() if path.is_file() else b""
    return hashlib.sha256(text.encode() + source).hexdigest()[:32]


def _solved(point: Point, folder: Path, file: Path) -> PointResult:
    result = answer(point, folder)
    beside = file.with_suffix(".part")
    beside.write_text(json.dumps(result.as_dict()), encoding="utf-8")
    os.replace(beside, file)
    return result


def _kept(file: Path) -> PointResult:
    try:
        return PointResult(**json.loads(file.read_text(encoding="utf-8")))
    except (ValueError, TypeError):
        rule = "is no finished point of a study"
        raise InputError(
            str(file), (Complaint("file", "", rule, "remove it, and the point is solved again"),)
        ) from None


def dataset(part: PartTable, results: list[PointResult]) -> xr.Dataset:
    """One labelled dataset of a part, along its points.

    Engines of one part may have different mounts; those that one lacks are NaN.
    """
    import numpy as np
    import xarray as xr

    mounts = list(dict.fromkeys(name for result in results for name in result.mounts))

    def per_mount(name: str) -> tuple[tuple[str, str], object, dict[str, str]]:
        rows = [dict(zip(r.mounts, getattr(r, name), strict=True)) for r in results]
        values = np.array([[row.get(mount, np.nan) for mount in mounts] for row in rows])
        return ("point", "mount"), values, {"units": "N", "long_name": f"{name.replace('_', ' ')} of the mount's force"}

    def each(name: str, words: str) -> tuple[str, object, dict[str, str]]:
        return "point", np.array([getattr(r, name) for r in results]), {"units": "N", "long_name": words}

    swept = {
        sweep.quantity: ("point", [r.changes[sweep.quantity] for r in results], {"units": "as in the problem file"})
        for sweep in part.sweep
    }
    return xr.Dataset(
        {
            "objective_given": each("objective_given", "objective of the design as given"),
            "objective": each("objective", "objective of the design as decided"),
            "lower_bound": each("lower_bound", "what no design falls below"),
            **{name: per_mount(name) for name in ("mean_given", "maximum_given", "mean", "maximum")},
        },
        coords={
            "mount": mounts,
            "case": ("point", [r.case for r in results]),
            "status": ("point", [r.status for r in results]),
            **swept,
        },
        attrs={"title": part.title, "kind": part.kind, "source": part.source},
    )
