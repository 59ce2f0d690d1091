"""Executors of pieces of work: processes of this machine, a cluster, or any other executor.

All concurrent work goes through here: points of studies, problems of a trade, boxes, stars, starts. The executor
changes how long a search takes, never what it finds.

`Speculation` works out the likely next steps of a search ahead. One process still decides which step follows, and
takes the answer that others may have made already, so answers, their order and proofs are the same to the last bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import closing, contextmanager, suppress
from contextvars import ContextVar
from importlib import import_module
from itertools import count, islice, takewhile
from pickle import PicklingError
from typing import Any, Generic, NamedTuple, ParamSpec, TypeVar

from laufruhe.errors import BoundError, SolverError
from laufruhe.numerics.budget import is_time_over, limit_time, seconds_left, until_time_limit
from laufruhe.numerics.cores import processors
from laufruhe.numerics.processes import ForkedWorker, Processes
from laufruhe.numerics.progress import report_progress
from laufruhe.numerics.witness import collected, report

P = ParamSpec("P")
T = TypeVar("T")
A = TypeVar("A")

AHEAD = 3
"""Pieces that are submitted at once for each worker, so that none waits for the next one."""
LOSSES = 3
"""Times that one piece may be lost with its worker before the piece is to blame."""
WORTH_PROCESSES = 4.0
"""Processor seconds of work that pay for starting processes."""
LONGEST_WAIT = 1e9

_current: ContextVar[Executor | None] = ContextVar("current", default=None)


class SerialExecutor(Executor):
    """Executor without workers: `submit` returns when the call is done."""

    count = 1

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Do the call."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


SERIAL = SerialExecutor()


class TimeIsOver(SolverError):
    """The time limit was reached before all pieces were done."""


class WorkersGone(SolverError):
    """Loss of all workers, or of every worker that had one piece."""


@contextmanager
def working_on(executor: Executor | None) -> Iterator[None]:
    """Hand the pieces of all work within to an executor; with None each search starts processes as it needs."""
    before = _current.set(executor)
    try:
        yield
    finally:
        _current.reset(before)


def current_executor() -> Executor | None:
    """Return the executor of `working_on`, or None."""
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


def _import(*_: Callable[..., object], libraries: Sequence[str] = ()) -> None:
    # unpickling the works has imported their modules already
    for name in libraries:
        import_module(name)


@contextmanager
def worker_pool(*works: Callable[..., object], libraries: Sequence[str] = ()) -> Iterator[None]:
    """Start processes at once for searches that follow one another, and end them with the last one.

    Nothing is started where an executor is current, or there is one processor.

    Parameters
    ----------
    works
        Functions that the processes will be asked for.
    libraries
        Names of what these import late.
    """
    workers = processors()
    if _current.get() is not None or workers == 1:
        yield
        return
    # a copy has imported all that the search needs, and begins at once
    pool = Processes(workers, ForkedWorker.several(workers))
    try:
        for _ in range(workers):
            pool.submit(_import, *works, libraries=libraries)
        with working_on(pool):
            yield
    finally:
        pool.shutdown(cancel_futures=True)


def worker_count(executor: Executor | None = None) -> int:
    """Return how many pieces an executor does side by side: the given one, the current one, or processes."""
    executor = _current.get() if executor is None else executor
    if executor is None:
        return processors()
    known = getattr(executor, "count", None) or getattr(executor, "_max_workers", None)
    return known if isinstance(known, int) else processors()


def unordered_map(
    work: Callable[[T], A], pieces: Iterable[T], executor: Executor, patient: bool = False
) -> Generator[tuple[int, A], None, None]:
    """Yield (number, answer) of every piece as it comes; raise the error of the first piece that fails.

    Pieces are taken as workers become free. A piece that is lost with its worker is submitted again.

    Parameters
    ----------
    patient
        At the time limit (`laufruhe.numerics.budget`) wait for pieces that were begun, and drop the others.

    Raises
    ------
    TimeIsOver
        At the time limit, unless patient.
    WorkersGone
        If a piece is lost again and again, or no worker is left.
    """
    rest = enumerate(until_time_limit(pieces) if patient else pieces)
    pending: dict[Future[Answer[A]], tuple[int, T, int]] = {}

    def submit(number: int, piece: T, losses: int = 0) -> None:
        try:
            future = executor.submit(_answer_of, time.time() + seconds_left(), work, piece)
        except (RuntimeError, OSError) as error:
            raise _workers_gone(executor, error) from None
        pending[future] = (number, piece, losses)

    try:
        while True:
            while len(pending) < AHEAD * worker_count(executor) and (following := next(rest, None)) is not None:
                submit(*following)
            if not pending:
                return
            seconds = LONGEST_WAIT if patient and is_time_over() else min(max(seconds_left(), 0.0), LONGEST_WAIT)
            for future in wait(pending, seconds, FIRST_COMPLETED).done:
                number, piece, losses = pending.pop(future)
                try:
                    answer = _reported(future.result())
                except (CancelledError, BrokenExecutor, *getattr(executor, "losses", ())) as lost:
                    if losses + 1 >= LOSSES:
                        raise _workers_gone(executor, lost) from None
                    submit(number, piece, losses + 1)
                else:
                    yield number, answer
            if is_time_over() and pending:
                if not patient:
                    raise TimeIsOver("the time limit is over")
                pending = {future: piece for future, piece in pending.items() if not future.cancel()}
    finally:
        for future in pending:
            future.cancel()


def ordered_map(work: Callable[[T], A], pieces: Sequence[T], what: str) -> list[A]:
    """Return the answers in the order of the pieces, as many as time allows.

    The time of the first pieces decides whether processes are started.

    Parameters
    ----------
    what
        Name of the pieces in reports of progress.
    """
    began, answers = time.process_time(), list[A]()
    for piece in until_time_limit(pieces):
        rest = len(pieces) - len(answers)
        pays = (time.process_time() - began) * rest > WORTH_PROCESSES * len(answers)
        if answers and pays and worker_count() > 1 and seconds_left() > WORTH_PROCESSES:
            break
        report_progress(what, len(answers), len(pieces))
        answers.append(work(piece))
    if answers and len(answers) < len(pieces) and not is_time_over():
        later: dict[int, A] = {}
        others = pieces[len(answers) :]
        with (
            executor_for(min(len(others), worker_count())) as executor,
            closing(unordered_map(work, others, executor, patient=True)) as results,
        ):
            for number, answer in results:
                later[number] = answer
                report_progress(what, len(answers) + len(later), len(pieces))
        # at the time limit, those before the first piece without an answer
        answers += [later[number] for number in takewhile(later.__contains__, count())]
    return answers


class Answer(NamedTuple, Generic[A]):
    """An answer with the contradictions that its worker met, which no other channel brings out of its process."""

    answer: A
    reports: tuple[BoundError, ...]


def _answer_of(until: float, work: Callable[[T], A], piece: T) -> Answer[A]:
    # runs in the worker, which starts no workers itself
    with limit_time(until - time.time()), working_on(SERIAL), collected() as reports:
        answer = work(piece)
    return Answer(answer, tuple(reports))


def _reported(answer: Answer[A]) -> A:
    for error in answer.reports:
        report(error)
    return answer.answer


def _workers_gone(executor: Executor, error: BaseException) -> WorkersGone:
    text = getattr(executor, "gone", "a worker was killed again and again")
    return WorkersGone(f"{text} ({error})" if str(error) else str(text))


class Speculation(Generic[T, A]):
    """Answers to one kind of step, some made ahead; processes start once the search has taken `worth` seconds."""

    def __init__(self, work: Callable[[T], A], worth: float) -> None:
        self._work, self._worth = work, worth
        self._began = time.perf_counter()
        self._executor: Executor | None = None
        self._processes: Processes | None = None
        self._starting: list[Future[None]] = []
        self._pending: dict[Hashable, Future[Answer[A]]] = {}
        self.hits = 0

    def prefetch(self, steps: Iterable[tuple[Hashable, T]]) -> None:
        """Begin steps that may follow, the likeliest first, as many as workers are free."""
        executor = self._executor or self._workers()
        if executor is None:
            return
        new = ((key, step) for key, step in steps if key not in self._pending)
        # without workers, and for steps that cannot be pickled, `result` does the work
        with suppress(RuntimeError, OSError):
            begun: list[Future[Any]] = [*self._starting, *self._pending.values()]
            free = worker_count(executor) - sum(not future.done() for future in begun)
            for key, step in islice(new, max(free, 0)):
                with suppress(PicklingError, AttributeError, TypeError):
                    self._pending[key] = executor.submit(_answer_of, time.time() + seconds_left(), self._work, step)

    def _workers(self) -> Executor | None:
        current = current_executor()
        if worker_count() == 1 or (current is None and time.perf_counter() - self._began <= self._worth):
            return None
        if current is None:
            current = self._processes = Processes()
            # no step waits for a process that still starts
            self._starting = [current.submit(_import, self._work) for _ in range(worker_count(current))]
        self._executor = current
        return current

    def result(self, key: Hashable, step: T) -> A:
        """Return the answer to a step, made ahead or now."""
        future = self._pending.pop(key, None)
        if future is None:
            return self._work(step)
        try:
            answer = future.result()
        except Exception:
            # a step that was lost with its worker; an error of the step itself comes again here
            return self._work(step)
        self.hits += 1
        return _reported(answer)

    def discard(self) -> None:
        """Drop the steps that were begun and are not needed any more."""
        for future in self._pending.values():
            future.cancel()
        self._pending.clear()

    def end(self) -> None:
        """Drop all steps, and end the processes that were started for them."""
        self.discard()
        if self._processes is not None:
            self._processes.shutdown(cancel_futures=True)


@contextmanager
def speculation(work: Callable[[T], A], worth: float = WORTH_PROCESSES) -> Iterator[Speculation[T, A]]:
    """Yield the speculation of one search; its processes end with it.

    Parameters
    ----------
    worth
        Seconds that a search has taken when processes are started for it.
    """
    ahead = Speculation(work, worth)
    try:
        yield ahead
    finally:
        ahead.end()
