"""Running a study: points on one core or several, each kept on disk, so that one that stopped goes on."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import threading
import time
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass
from functools import cache
from io import FileIO
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from pathlib import Path
from typing import TypeAlias

import xarray as xr

from laufruhe.errors import SolverError
from laufruhe.numerics.budget import left, passed
from laufruhe.studies.part import Part, Record
from laufruhe.studies.reader import StudyFile
from laufruhe.studies.scenes import Point, Scenes

KEPT = ".unfinished-points.jsonl"
# of a line: enough to tell it from any other, and from itself with anything changed
_SUM = 32
# a worker imports everything anew: two seconds, so a pool has to save more
POOL_PAYS = 4.0
LONGEST_WAIT = 1e9
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def run(
    study: StudyFile,
    folder: Path,
    kept: Path,
    say: Callable[[int, int], None] = lambda _done, _all: None,
    jobs: int = 1,
) -> tuple[dict[str, xr.Dataset], dict[str, float]]:
    """All parts of a study, each as one dataset, and the seconds that its points took on one core.

    `InputError` where a scene is bad.

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


class KeptPoints(AbstractContextManager["KeptPoints"]):
    """Those records of a file that are wanted, by fingerprint; each is on disk as soon as it is known.

    Every line begins with a checksum of the rest of it. What is cut, changed or no point at all does not fit its
    checksum, counts as not there, and is left alone: its point is solved again. Lines are added whole, between two ends
    of line, so that neither a cut line nor another study in the same folder spoils them.
    """

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        self.path = path
        self.records: Record = {}
        self.seconds: dict[str, float] = {}
        self._stream: FileIO | None = None
        for mark, seconds, record in _sound(path):
            if mark in wanted:
                self.records[mark], self.seconds[mark] = record, seconds

    def keep(self, mark: str, seconds: float, record: Record) -> None:
        """Write a record and what it took; it has left the process when this returns."""
        if self._stream is None:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._stream = FileIO(self.path, "a")
        line = json.dumps([mark, round(seconds, 6), record]).encode()
        rest = memoryview(b"\n%b %b\n" % (_checksum(line), line))
        while rest:
            # a full disk takes a part, and then complains
            rest = rest[self._stream.write(rest) :]
        self.records[mark], self.seconds[mark] = record, seconds

    def __exit__(self, *_: object) -> None:
        if self._stream is not None:
            os.fsync(self._stream.fileno())
            self._stream.close()


def _sound(path: Path) -> Iterator[tuple[str, float, Record]]:
    """Fingerprint, seconds and record of every line that is as it was written."""
    if path.is_file():
        with path.open("rb") as lines:
            for line in lines:
                found, _, rest = line.rstrip(b"\n").partition(b" ")
                if found == _checksum(rest):
                    yield json.loads(rest)


def _checksum(line: bytes) -> bytes:
    return hashlib.sha256(line).hexdigest()[:_SUM].encode()


Task: TypeAlias = tuple[Part, Point]


@dataclass(frozen=True)
class Answer:
    """What became of a task, and how long it took on one core [s]."""

    task: int
    record: Record
    seconds: float


def answers(tasks: Sequence[Task], scenes: Scenes, jobs: int) -> Generator[Answer, None, None]:
    """Every task's answer as it comes, in any order; the error of the first task that fails.

    Workers are started once what is left would take them clearly less time.
    """
    started = time.perf_counter()
    for k, task in enumerate(tasks):
        ahead = (time.perf_counter() - started) / k * (len(tasks) - k) if k else 0.0
        if jobs > 1 and ahead * (1.0 - 1.0 / jobs) > POOL_PAYS:
            yield from _pooled(tasks, k, scenes.folder, jobs)
            return
        answer = _answer(k, task, scenes)
        if passed():
            # what a limit may have cut short is no answer
            raise _over()
        yield answer


def _over() -> SolverError:
    return SolverError("the time limit is over; finished points are kept, the same command goes on")


def _answer(k: int, task: Task, scenes: Scenes) -> Answer:
    started = time.perf_counter()
    part, point = task
    record = part.answer(point, scenes)
    return Answer(k, record, time.perf_counter() - started)


def _pooled(tasks: Sequence[Task], first: int, folder: Path, jobs: int) -> Iterator[Answer]:
    others = set(active_children())
    pool = ProcessPoolExecutor(jobs, get_context("spawn"), _end_with_parent)
    try:
        with _as_workers_start():
            asked = [pool.submit(_served, k, tasks[k], folder) for k in range(first, len(tasks))]
        for answer in as_completed(asked, min(max(left(), 0.0), LONGEST_WAIT)):
            yield answer.result()
    except TimeoutError:
        raise _over() from None
    except BrokenProcessPool:
        raise SolverError("a worker of the study was killed; the same command goes on where it stopped") from None
    finally:
        # what workers are at is not wanted any more
        for process in set(active_children()) - others:
            process.terminate()
        pool.shutdown(cancel_futures=True)


def _served(k: int, task: Task, folder: Path) -> Answer:
    return _answer(k, task, _scenes_in(folder))


@cache
def _scenes_in(folder: Path) -> Scenes:
    """A worker's own scenes: each file is read once."""
    return Scenes(folder)


def _end_with_parent() -> None:
    """No worker is left behind when a study is killed."""
    parent = parent_process()

    def end() -> None:
        wait([parent.sentinel] if parent else [])
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


@contextmanager
def _as_workers_start() -> Iterator[None]:
    """Processes started here have one thread for their linear algebra, and never hear Ctrl-C.

    It is the parent that keeps what is finished.
    """
    before = {name: os.environ.get(name) for name in _THREADS}
    heard = threading.current_thread() is threading.main_thread()
    interrupt = signal.signal(signal.SIGINT, signal.SIG_IGN) if heard else None
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})
        if heard:
            signal.signal(signal.SIGINT, interrupt)
