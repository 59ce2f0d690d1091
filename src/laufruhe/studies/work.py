"""Points answered one after the other, or on several cores where that pays."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from multiprocessing import active_children, get_context, parent_process
from multiprocessing.connection import wait
from pathlib import Path
from typing import TypeAlias

from laufruhe.errors import SolverError
from laufruhe.studies.part import Part, Record
from laufruhe.studies.scenes import Point, Scenes

# a worker imports everything anew: two seconds, so a pool has to save more
POOL_PAYS = 4.0
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


Task: TypeAlias = tuple[Part, Point]


@dataclass(frozen=True)
class Answer:
    """What became of a task, and how long it took on one core [s]."""

    task: int
    record: Record
    seconds: float


def answers(tasks: Sequence[Task], scenes: Scenes, jobs: int) -> Generator[Answer, None, None]:
    """Every task's answer as it comes, in any order.

    Workers are started once what is left would take them clearly less time.

    Raises
    ------
    LaufruheError
        As the first task that fails.
    """
    started = time.perf_counter()
    for k, task in enumerate(tasks):
        left = (time.perf_counter() - started) / k * (len(tasks) - k) if k else 0.0
        if jobs > 1 and left * (1.0 - 1.0 / jobs) > POOL_PAYS:
            yield from _pooled(tasks, k, scenes.folder, jobs)
            return
        yield _answer(k, task, scenes)


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
        for answer in as_completed(asked):
            yield answer.result()
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
