"""Running a study: every finished point is kept on disk, and one that stopped goes on."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from laufruhe.problem.study_models import StudyFile
from laufruhe.studies.kept import KeptPoints
from laufruhe.studies.kinds import kind_of
from laufruhe.studies.scenes import Scenes

if TYPE_CHECKING:
    import xarray as xr


def run(
    study: StudyFile, folder: Path, kept: Path, say: Callable[[int, int], None] = lambda _done, _all: None
) -> tuple[dict[str, xr.Dataset], dict[str, float]]:
    """All parts of a study, each as one dataset, and the seconds that each took.

    Parameters
    ----------
    folder
        That the study's problem files are named from.
    kept
        File of the finished points; points in it are not solved again.
    say
        Told how many points are done, of how many.
    """
    parts, scenes = study.study.parts, Scenes(folder)
    points = {part.name: kind_of(part).points(part, scenes) for part in parts}
    whole, done = sum(map(len, points.values())), 0
    datasets, seconds = {}, {}
    with KeptPoints(kept) as store:
        for part in parts:
            started, kind, records = time.perf_counter(), kind_of(part), []
            for point in points[part.name]:
                say(done, whole)
                mark = scenes.fingerprint(point, part.settings())
                if mark not in store.records:
                    store.keep(mark, kind.answer(part, point, scenes))
                records.append(store.records[mark])
                done += 1
            datasets[part.name] = kind.dataset(part, points[part.name], records)
            seconds[part.name] = time.perf_counter() - started
    say(done, whole)
    return datasets, seconds
