"""Concurrent maps over pieces of work, on processes of this machine, a cluster, or any other executor.

All concurrent work uses this module: points of studies, problems of a comparison of fidelities, boxes, crank stars and
start points. The executor changes the time of a search, never its result.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import closing, contextmanager
from contextvars import ContextVar
from itertools import count, takewhile
from typing import ParamSpec, TypeVar

from laufruhe.errors import BoundError, SolverError
from laufruhe.numerics.budget import is_time_over, limit_time, seconds_left, until_time_limit
from laufruhe.numerics.cores import processors
from laufruhe.numerics.processes import Processes
from laufruhe.numerics.progress import report_progress
from laufruhe.numerics.witness import collected, report

P = ParamSpec("P")
T = TypeVar("T")
A = TypeVar("A")

AHEAD = 3
"""Number of pieces submitted in advance for each worker, so that no worker waits."""
LOSSES = 3
"""Number of times that one piece may be lost with its worker before the search fails."""
WORTH_PROCESSES = 4.0
"""Work for which starting processes pays [s of processor time]."""
LONGEST_WAIT = 1e9

_current: ContextVar[Executor | None] = ContextVar("current", default=None)


class SerialExecutor(Executor):
    """Executor in this thread: `submit` runs the call before it returns."""

    count = 1

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Run the call, and return its future."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


SERIAL = SerialExecutor()


class TimeIsOver(SolverError):
    """Error: the time limit ended before all pieces of work were done."""


class WorkersGone(SolverError):
    """Error: all workers, or every worker that had tried one piece of work, died."""


@contextmanager
def working_on(executor: Executor | None) -> Iterator[None]:
    """Use an executor for all concurrent work in the block; with None each search starts its own processes."""
    before = _current.set(executor)
    try:
        yield
    finally:
        _current.reset(before)


def current_executor() -> Executor | None:
    """Return the executor of the enclosing `working_on`, or None."""
    return _current.get()


@contextmanager
def executor_for(maximum: int | None = None) -> Iterator[Executor]:
    """Yield the current executor, or else up to `maximum` processes of this machine."""
    executor = _current.get()
    if executor is not None:
        yield executor
        return
    with Processes(maximum) as processes:
        yield processes


def worker_count(executor: Executor | None = None) -> int:
    """Return the number of workers of an executor, by default of the current one, else the number of processors."""
    executor = _current.get() if executor is None else executor
    if executor is None:
        return processors()
    workers = getattr(executor, "count", None) or getattr(executor, "_max_workers", None)
    return workers if isinstance(workers, int) else processors()


def unordered_map(
    work: Callable[[T], A], pieces: Iterable[T], executor: Executor, patient: bool = False
) -> Generator[tuple[int, A], None, None]:
    """Yield (index, result) of each piece of work in the order of completion; raise the error of the first failure.

    A piece that is lost with its worker is submitted again.

    Parameters
    ----------
    work
        Picklable function of one piece of work.
    pieces
        Arguments of the calls, taken as workers become free.
    patient
        True to wait at the time limit (`laufruhe.numerics.budget`) for running pieces and to drop the others.

    Raises
    ------
    TimeIsOver
        At the time limit, unless patient.
    WorkersGone
        If one piece is lost `LOSSES` times, or no worker is left.
    """
    remaining = enumerate(until_time_limit(pieces) if patient else pieces)
    pending: dict[Future[tuple[A, list[BoundError]]], tuple[int, T, int]] = {}

    def submit(number: int, piece: T, losses: int = 0) -> None:
        try:
            future = executor.submit(_answer_of, time.time() + seconds_left(), work, piece)
        except (RuntimeError, OSError) as error:
            raise _workers_gone(executor, error) from None
        pending[future] = (number, piece, losses)

    try:
        while True:
            while len(pending) < AHEAD * worker_count(executor) and (next_piece := next(remaining, None)) is not None:
                submit(*next_piece)
            if not pending:
                return
            seconds = LONGEST_WAIT if patient and is_time_over() else min(max(seconds_left(), 0.0), LONGEST_WAIT)
            for future in wait(pending, seconds, FIRST_COMPLETED).done:
                number, piece, losses = pending.pop(future)
                try:
                    answer, reports = future.result()
                except (CancelledError, BrokenExecutor, *getattr(executor, "losses", ())) as lost:
                    if losses + 1 >= LOSSES:
                        raise _workers_gone(executor, lost) from None
                    submit(number, piece, losses + 1)
                else:
                    for error in reports:
                        report(error)
                    yield number, answer
            if is_time_over() and pending:
                if not patient:
                    raise TimeIsOver("the time limit is over")
                pending = {future: piece for future, piece in pending.items() if not future.cancel()}
    finally:
        for future in pending:
            future.cancel()


def ordered_map(work: Callable[[T], A], pieces: Sequence[T], what: str) -> list[A]:
    """Return the results of work(piece) in the order of the pieces, up to the time limit.

    The first pieces run here; their time decides whether processes are started for the others. `what` is the name of
    the pieces in progress reports.
    """
    began, answers = time.process_time(), list[A]()
    for piece in until_time_limit(pieces):
        remaining = len(pieces) - len(answers)
        pays = (time.process_time() - began) * remaining > WORTH_PROCESSES * len(answers)
        if answers and pays and worker_count() > 1 and seconds_left() > WORTH_PROCESSES:
            break
        report_progress(what, len(answers), len(pieces))
        answers.append(work(piece))
    if answers and len(answers) < len(pieces) and not is_time_over():
        later: dict[int, A] = {}
        remaining_pieces = pieces[len(answers) :]
        with (
            executor_for(min(len(remaining_pieces), worker_count())) as executor,
            closing(unordered_map(work, remaining_pieces, executor, patient=True)) as results,
        ):
            for number, answer in results:
                later[number] = answer
                report_progress(what, len(answers) + len(later), len(pieces))
        # at the time limit, the results before the first missing one
        answers += [later[number] for number in takewhile(later.__contains__, count())]
    return answers


def _answer_of(until: float, work: Callable[[T], A], piece: T) -> tuple[A, list[BoundError]]:
    # runs in the worker, which starts no workers of its own and collects contradictions of bounds
    with limit_time(until - time.time()), working_on(SERIAL), collected() as reports:
        return work(piece), reports


def _workers_gone(executor: Executor, error: BaseException) -> WorkersGone:
    text = getattr(executor, "gone", "workers died repeatedly")
    return WorkersGone(f"{text} ({error})" if str(error) else str(text))
