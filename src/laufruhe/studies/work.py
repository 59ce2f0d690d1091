"""Points answered one after the other, or on several cores where that pays.

A worker is fed through a pipe of its own and ends when that pipe does, so none is left
behind when a study is killed.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

from laufruhe.errors import LaufruheError, SolverError
from laufruhe.studies.part import Part, Record
from laufruhe.studies.scenes import Point, Scenes

# a worker imports everything anew: two seconds, so a pool has to save more
POOL_PAYS = 4.0
MOST_IN_CHUNK = 32
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Task:
    """A point of a part."""

    part: Part
    point: Point


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
    record = task.part.answer(task.point, scenes)
    return Answer(k, record, time.perf_counter() - started)


def _pooled(tasks: Sequence[Task], first: int, folder: Path, jobs: int) -> Iterator[Answer]:
    # a message a chunk, and chunks small enough that no worker waits long for another
    size = min(MOST_IN_CHUNK, max(1, (len(tasks) - first) // (8 * jobs)))
    chunks = iter([range(k, min(k + size, len(tasks))) for k in range(first, len(tasks), size)])
    with _workers(folder, jobs) as pipes:
        busy = [pipe for pipe in pipes if _feed(pipe, tasks, next(chunks, None))]
        while busy:
            for pipe in wait(busy):
                answer = _received(pipe)
                if answer is not None:
                    yield answer
                elif not _feed(pipe, tasks, next(chunks, None)):
                    busy.remove(pipe)


def _feed(pipe: Any, tasks: Sequence[Task], chunk: range | None) -> bool:
    if chunk is None:
        return False
    pipe.send([(k, tasks[k]) for k in chunk])
    return True


def _received(pipe: Any) -> Answer | None:
    """An answer; None when the chunk is done."""
    try:
        found = pipe.recv()
    except (EOFError, OSError):
        raise SolverError("a worker of the study was killed; the same command goes on where it stopped") from None
    if isinstance(found, LaufruheError):
        raise found
    answer: Answer | None = found
    return answer


@contextmanager
def _workers(folder: Path, jobs: int) -> Iterator[list[Any]]:
    """Pipes to so many fresh processes, each with one thread for its linear algebra."""
    context = get_context("spawn")
    pipes, processes = [], []
    try:
        with _one_thread(), _no_interrupt():
            for _ in range(jobs):
                ours, theirs = context.Pipe()
                process = context.Process(target=_serve, args=(theirs, folder), daemon=True)
                process.start()
                theirs.close()
                pipes.append(ours)
                processes.append(process)
        yield pipes
    finally:
        for pipe in pipes:
            pipe.close()
        for process in processes:
            process.terminate()
            process.join()


@contextmanager
def _one_thread() -> Iterator[None]:
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Processes started here never hear Ctrl-C: it is the parent that keeps what is finished."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _serve(pipe: Connection[Any, Any], folder: Path) -> None:
    """A worker: chunks in, one answer a task and a None a chunk out, until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    scenes = Scenes(folder)
    try:
        while True:
            for k, task in pipe.recv():
                try:
                    pipe.send(_answer(k, task, scenes))
                except LaufruheError as error:
                    pipe.send(error)
                    return
            pipe.send(None)
    except (EOFError, OSError):
        return
