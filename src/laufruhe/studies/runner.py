"""Run a study: its points on one core or several, each saved on disk, so that a stopped study resumes."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from laufruhe.errors import SolverError
from laufruhe.numerics.budget import is_time_over
from laufruhe.numerics.workers import (
    TimeIsOver,
    WorkersGone,
    current_executor,
    executor_for,
    unordered_map,
    worker_count,
)
from laufruhe.problem.curves import labelled
from laufruhe.studies.part import Record
from laufruhe.studies.reader import StudyFile
from laufruhe.studies.scenes import ProblemFiles
from laufruhe.studies.stores import Records, Task, stores_of

if TYPE_CHECKING:
    import xarray as xr

# a worker imports everything anew, which takes two seconds
POOL_PAYS = 4.0
NEAR, FAR = 0.5, 30.0
"""Seconds that one piece of work takes, on this machine and on others.

A worker that dies loses one piece, and handing out a piece takes far less time."""
SHARES = 4
"""Pieces that each worker gets at least, so that all end together."""


def run(
    study: StudyFile,
    folder: Path,
    finished: Path,
    say: Callable[[int, int], None] = lambda _done, _all: None,
    jobs: int = 1,
) -> tuple[dict[str, xr.Dataset], dict[str, float]]:
    """Return all parts of a study as datasets, and the seconds that their points took on one core.

    Raise `InputError` for a faulty problem file. The results do not depend on the number of processes `jobs`.

    Parameters
    ----------
    folder
        Folder that the paths of problem files are relative to.
    finished
        File of the finished points; points in it are not solved again.
    say
        Function called with the number of finished points and of all points.
    """
    problem_files = ProblemFiles(folder)
    work = [(part, point) for part in study.study.parts for point in part.points(problem_files)]
    fingerprints = [problem_files.fingerprint(point, part.settings()) for part, point in work]
    # equal problems of several parts are solved once
    tasks = dict(zip(fingerprints, work, strict=True))
    with ExitStack() as stores:
        store = {
            fingerprint: points_of
            for points_of, marked in stores_of(study, problem_files, finished, tasks, stores)
            for fingerprint in marked
        }
        todo = {key: task for key, task in tasks.items() if key not in store[key].seconds}
        names, total = list(todo), len(tasks)
        say(total - len(todo), total)
        with closing(answers(list(todo.values()), problem_files, jobs)) as results:
            for count, answer in enumerate(results, 1):
                fingerprint = names[answer.task]
                if answer.fingerprint != fingerprint:
                    where = f"on {answer.host}" if current_executor() is not None else "while it was worked at"
                    rule = f"'{todo[fingerprint][1]}' had other files, another Laufruhe or other libraries {where}"
                    remedy = "install the same versions and files everywhere, and the same command goes on"
                    raise SolverError(f"{rule}, so the result of this point is not kept; {remedy}")
                try:
                    store[fingerprint].keep(fingerprint, answer.seconds, answer.record)
                except OSError as error:
                    why = f"a point cannot be kept ({error.strerror or error})"
                    remedy = "finished points are kept; make room, and the same command goes on"
                    raise SolverError(f"{why}; {remedy}") from None
                say(total - len(todo) + count, total)
        datasets, seconds = {}, {}
        for part in study.study.parts:
            points_of = [
                (fingerprint, point)
                for fingerprint, (owner, point) in zip(fingerprints, work, strict=True)
                if owner is part
            ]
            fingerprints_of_part = [fingerprint for fingerprint, _ in points_of]
            records = Records(fingerprints_of_part, store)
            datasets[part.name] = labelled(part.dataset([point for _, point in points_of], records))
            seconds[part.name] = sum(store[key].seconds[key] for key in set(fingerprints_of_part))
    return datasets, seconds


@dataclass(frozen=True)
class PointResult:
    """Record of the task with the index `task`, and the fingerprint of its point as computed on the machine `host`."""

    task: int
    fingerprint: str
    host: str
    record: Record
    seconds: float


@dataclass(frozen=True)
class _Piece:
    """Several tasks for one worker, with the problem files and the folder to which their paths are relative."""

    numbers: Sequence[int]
    tasks: Sequence[Task]
    problem_files: ProblemFiles
    folder: Path


def answers(tasks: Sequence[Task], problem_files: ProblemFiles, jobs: int) -> Generator[PointResult, None, None]:
    """Yield the result of every point of a study in any order; raise the error of the first point that fails.

    If an executor such as a Dask cluster is set, it computes all points. Otherwise this process begins, and worker
    processes start as soon as they would finish the remaining points clearly earlier.
    """
    started, first = time.perf_counter(), 0
    if current_executor() is None:
        for k, task in enumerate(tasks):
            ahead = (time.perf_counter() - started) / k * (len(tasks) - k) if k else 0.0
            if jobs > 1 and ahead * (1.0 - 1.0 / jobs) > POOL_PAYS:
                break
            answer = _answer(k, task, problem_files)
            if is_time_over():
                # a time limit may have cut the answer short
                raise _time_limit_error()
            yield answer
            first = k + 1
    if first < len(tasks):
        yield from _distributed(tasks, first, problem_files, jobs)


def _time_limit_error() -> SolverError:
    return TimeIsOver("the time limit is over; finished points are kept, the same command goes on")


def _answer(k: int, task: Task, problem_files: ProblemFiles) -> PointResult:
    started = time.perf_counter()
    part, point = task
    with problem_files.blamed(point):
        record = part.answer(point, problem_files)
    seconds = time.perf_counter() - started
    return PointResult(k, problem_files.fingerprint(point, part.settings()), socket.gethostname(), record, seconds)


def _distributed(tasks: Sequence[Task], first: int, problem_files: ProblemFiles, jobs: int) -> Iterator[PointResult]:
    """Yield the results of the tasks from `first` on, computed by workers; batches grow with the measured speed."""
    done, spent = 0, 0.0
    worth = NEAR if current_executor() is None else FAR
    folder = Path.cwd()

    def pieces() -> Iterator[_Piece]:
        start = first
        while start < len(tasks):
            fair = (len(tasks) - start) // (SHARES * worker_count(executor))
            size = max(min(int(worth * done / spent) if spent > 0.0 else 1, fair), 1)
            numbers = range(start, min(start + size, len(tasks)))
            yield _Piece(numbers, [tasks[k] for k in numbers], problem_files, folder)
            start = numbers.stop

    with executor_for(jobs) as executor:
        try:
            with closing(unordered_map(_work, pieces(), executor)) as results:
                for _, done_now in results:
                    done, spent = done + len(done_now), spent + sum(answer.seconds for answer in done_now)
                    if is_time_over():
                        raise _time_limit_error()
                    yield from done_now
        except TimeIsOver:
            raise _time_limit_error() from None
        except WorkersGone as error:
            raise WorkersGone(f"{error}; finished points are kept, the same command goes on") from None


def _work(piece: _Piece) -> list[PointResult]:
    if Path.cwd() != piece.folder:
        piece.problem_files.folder = piece.folder / piece.problem_files.folder
    return [_answer(k, task, piece.problem_files) for k, task in zip(piece.numbers, piece.tasks, strict=True)]
