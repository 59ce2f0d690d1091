"""Running a study: every finished point is kept on disk, and one that stopped goes on."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import xarray as xr

from laufruhe.studies.kept import KeptPoints
from laufruhe.studies.reader import StudyFile
from laufruhe.studies.scenes import Scenes
from laufruhe.studies.work import answers


def run(
    study: StudyFile,
    folder: Path,
    kept: Path,
    say: Callable[[int, int], None] = lambda _done, _all: None,
    jobs: int = 1,
) -> tuple[dict[str, xr.Dataset], dict[str, float]]:
    """All parts of a study, each as one dataset, and the seconds that the points of each took on one core.

    Parameters
    ----------
    folder
        That the study's problem files are named from.
    kept
        File of the finished points; points in it are not solved again.
    say
        Told how many points are done, of how many.
    jobs
        Processes that may be used; the results do not depend on it.

    Raises
    ------
    InputError
        If a scene of the study is bad.
    """
    scenes = Scenes(folder)
    work = [(part, point) for part in study.study.parts for point in part.points(scenes)]
    marks = [scenes.fingerprint(point, part.settings()) for part, point in work]
    # a scene that stands in two parts of one kind is solved once
    wanted = dict(zip(marks, work, strict=True))
    with KeptPoints(kept, wanted.keys()) as store:
        todo = {mark: task for mark, task in wanted.items() if mark not in store.records}
        names, whole = list(todo), len(wanted)
        say(whole - len(todo), whole)
        with closing(answers(list(todo.values()), scenes, jobs)) as found:
            for count, answer in enumerate(found, 1):
                store.keep(names[answer.task], answer.seconds, answer.record)
                say(whole - len(todo) + count, whole)
    datasets, seconds = {}, {}
    for part in study.study.parts:
        own = [(mark, point) for mark, (of, point) in zip(marks, work, strict=True) if of is part]
        datasets[part.name] = part.dataset([point for _, point in own], [store.records[mark] for mark, _ in own])
        seconds[part.name] = sum(store.seconds[mark] for mark in {mark for mark, _ in own})
    return datasets, seconds
