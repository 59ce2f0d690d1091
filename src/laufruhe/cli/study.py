"""Command `study`: run the parts of a study and write their files."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from laufruhe.cli.screen import Ask, pace
from laufruhe.errors import printed, refused
from laufruhe.files.reader import display_path
from laufruhe.numerics.cores import processors
from laufruhe.present.picture import Picture
from laufruhe.report import files
from laufruhe.report.strict_json import strict
from laufruhe.report.study_report import as_json, file_names, write_study
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from laufruhe.studies.scenes import ProblemFiles
from laufruhe.studies.stores import FINISHED_POINTS


def run_study(
    path: Path,
    out: Path | None,
    jobs: int | None,
    say: Callable[[str], None],
    ask: Ask,
    kinds: Sequence[str],
    command: str,
) -> tuple[str, Callable[[], str]]:
    """Compute a study and write its files; return the message about them, and a function that returns it as JSON.

    `ask` runs a function, here one that draws a picture, in another process; `command` makes the study again.
    """
    if jobs is not None and jobs < 1:
        raise refused("--jobs", str(jobs), "must be one or more", "leave it out to use every core")
    started = time.perf_counter()
    study = load_study(path)
    folder = out if out is not None else Path("results") / display_path(path).stem
    points = folder / FINISHED_POINTS
    option, file_list = "--out" if out is not None else "results", file_names(study)
    with files.staged(files.FileSet(folder, option, "study", file_list, kept_names=[FINISHED_POINTS])) as stage:
        datasets, seconds = run(study, path.parent, points, _Progress(say), jobs or processors())

        def draw(picture: Picture, place: Path) -> Callable[[], str]:
            return ask("laufruhe.plots.picture:save_picture", picture, place, kinds)

        write_study(study, datasets, seconds, stage, command, say, draw, f".{kinds[0]}")
    points.unlink(missing_ok=True)
    spent = "".join(f"{duration:8.1f} s on one core  {name}\n" for name, duration in seconds.items())
    text = f"{spent}done in {time.perf_counter() - started:.1f} s\n{files.results_line(folder, files.PAGE)}\n"
    return text, lambda: as_json(study, datasets, seconds)


def check_study(path: Path) -> tuple[str, Callable[[], str]]:
    """Return the number of points of a study as text, and a function that returns it as JSON."""
    study, problem_files = load_study(path), ProblemFiles(path.parent)
    points = {part.name: len(part.points(problem_files)) for part in study.study.parts}
    text = f"ok: {printed(study.title)}, {sum(points.values())} points\n"
    return text, lambda: strict({"title": study.title, "points": points})


class _Progress:
    """Reports the number of finished points and the remaining time, at a readable pace."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._first: tuple[float, int] | None = None
        self._last = 0.0

    def __call__(self, done: int, total: int) -> None:
        now = time.perf_counter()
        if self._first is None:
            self._first = (now, done)
        elif now - self._last < pace() and done < total:
            return
        self._last, remaining = now, ""
        began, before = self._first
        if before < done < total:
            seconds = (now - began) / (done - before) * (total - done)
            time_left = f"{seconds / 60.0:.0f} min" if seconds >= 100.0 else f"{seconds:.0f} s"
            remaining = f", about {time_left} left"
        self._say(f"{done} of {total} points{remaining}")
