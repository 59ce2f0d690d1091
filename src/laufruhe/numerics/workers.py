"""Who does pieces of work: processes on this machine, a cluster, or whatever has the interface of an executor.

All that runs side by side asks here: points of studies, problems of a trade, boxes, stars, starts. Who works changes
how long it takes, never what is found.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import closing, contextmanager
from contextvars import ContextVar
from importlib import import_module
from itertools import count, takewhile
from typing import Generic, NamedTuple, ParamSpec, TypeVar

from laufruhe.errors import BoundError, SolverError
from laufruhe.numerics.budget import in_time, left, limited, passed
from laufruhe.numerics.cores import processors
from laufruhe.numerics.processes import Copy, Processes
from laufruhe.numerics.progress import tell
from laufruhe.numerics.witness import collected, report

P = ParamSpec("P")
T = TypeVar("T")
A = TypeVar("A")

AHEAD = 3
"""Pieces that are asked for at once, for each worker: none waits for the next one."""
LOSSES = 3
"""Times that one piece may be lost with its worker; what ends several is the fault of the piece."""
WORTH_PROCESSES = 4.0
"""Processor seconds of work that pay for starting processes."""
LONGEST_WAIT = 1e9

_given: ContextVar[Executor | None] = ContextVar("given", default=None)


class Here(Executor):
    """The process itself: a call is answered when it is asked for."""

    count = 1

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """The call, done."""
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


HERE = Here()


class TimeIsOver(SolverError):
    """The time limit was reached before all pieces were done."""


class WorkersGone(SolverError):
    """Nobody works any more, or a piece ends each of its workers."""


@contextmanager
def working_on(executor: Executor | None) -> Iterator[None]:
    """Pieces of what is done within are handed to an executor; with None each search starts processes as it needs."""
    before = _given.set(executor)
    try:
        yield
    finally:
        _given.reset(before)


def given() -> Executor | None:
    """The executor that the work within was given to."""
    return _given.get()


@contextmanager
def executor_for(most: int | None = None) -> Iterator[Executor]:
    """The executor that was given, or up to `most` processes of this machine."""
    executor = _given.get()
    if executor is not None:
        yield executor
        return
    with Processes(most) as own:
        yield own


def imported(*_: Callable[..., object], libraries: Sequence[str] = ()) -> None:
    """Import libraries; a process that is asked for this has imported what the works come from, too."""
    for name in libraries:
        import_module(name)


@contextmanager
def at_hand(*works: Callable[..., object], libraries: Sequence[str] = ()) -> Iterator[None]:
    """For searches that follow one another: processes of this machine that start at once and end with the last search.

    Where an executor was given, or there is one processor, nothing is started.

    Parameters
    ----------
    works
        What they will be asked for.
    libraries
        Names of what the works import late.
    """
    if _given.get() is not None or processors() == 1:
        yield
        return
    # what has imported all that the search needs begins at once
    count = processors()
    own = Processes(count, Copy.several(count))
    try:
        for _ in range(count):
            own.submit(imported, *works, libraries=libraries)
        with working_on(own):
            yield
    finally:
        # nobody waits for what is at work
        own.shutdown(cancel_futures=True)


def count_of(executor: Executor | None = None) -> int:
    """How many pieces an executor does side by side; of the one given, or the processes that would be, when None."""
    executor = _given.get() if executor is None else executor
    if executor is None:
        return processors()
    known = getattr(executor, "count", None) or getattr(executor, "_max_workers", None)
    return known if isinstance(known, int) else processors()


def each(
    work: Callable[[T], A], pieces: Iterable[T], executor: Executor, patient: bool = False
) -> Generator[tuple[int, A], None, None]:
    """What becomes of every piece, with its number, as it comes; the error of the first one that fails.

    Pieces are taken as workers get free. One that is lost with its worker is asked for again.

    Parameters
    ----------
    patient
        At the time limit (`laufruhe.numerics.budget`) wait for the pieces that were begun, which know of it; there are
        no answers of the others.

    Raises
    ------
    TimeIsOver
        At the time limit, unless patient.
    WorkersGone
        If a piece is lost again and again, or nobody works any more.
    """
    rest = enumerate(in_time(pieces) if patient else pieces)
    asked = _Asked(work, executor)
    try:
        while True:
            while len(asked.pieces) < AHEAD * count_of(executor) and (following := next(rest, None)) is not None:
                asked.ask(*following)
            if not asked.pieces:
                return
            seconds = LONGEST_WAIT if patient and passed() else min(max(left(), 0.0), LONGEST_WAIT)
            for future in wait(asked.pieces, seconds, FIRST_COMPLETED).done:
                yield from asked.answers(future)
            if passed() and asked.pieces and not patient:
                raise TimeIsOver("the time limit is over")
            if passed():
                asked.leave()
    finally:
        for future in asked.pieces:
            future.cancel()


def in_turn(work: Callable[[T], A], pieces: Sequence[T], what: str) -> list[A]:
    """Answers in the order of the pieces, those that time allows; the first ones tell whether processes are worth it.

    Parameters
    ----------
    what
        They are, in words, for who listens to progress.
    """
    began, found = time.process_time(), list[A]()
    for piece in in_time(pieces):
        rest = len(pieces) - len(found)
        pays = (time.process_time() - began) * rest > WORTH_PROCESSES * len(found)
        if found and pays and count_of() > 1 and left() > WORTH_PROCESSES:
            break
        tell(what, len(found), len(pieces))
        found.append(work(piece))
    if found and len(found) < len(pieces) and not passed():
        later: dict[int, A] = {}
        others = pieces[len(found) :]
        with (
            executor_for(min(len(others), count_of())) as executor,
            closing(each(work, others, executor, patient=True)) as answers,
        ):
            for number, answer in answers:
                later[number] = answer
                tell(what, len(found) + len(later), len(pieces))
        # where time was over, those before the first that nobody began
        found += [later[number] for number in takewhile(later.__contains__, count())]
    return found


class _Asked(Generic[T, A]):
    """Pieces that an executor was asked for, their numbers, and how often each was lost."""

    def __init__(self, work: Callable[[T], A], executor: Executor) -> None:
        self._work, self._executor = work, executor
        self.pieces: dict[Future[Answer[A]], tuple[int, T, int]] = {}

    def ask(self, number: int, piece: T, losses: int = 0) -> None:
        """Hand a piece out."""
        try:
            future = self._executor.submit(worked, time.time() + left(), self._work, piece)
        except (RuntimeError, OSError) as error:
            raise _nobody(self._executor, error) from None
        self.pieces[future] = (number, piece, losses)

    def leave(self) -> None:
        """Leave out what nobody has begun."""
        self.pieces = {future: piece for future, piece in self.pieces.items() if not future.cancel()}

    def answers(self, future: Future[Answer[A]]) -> Iterator[tuple[int, A]]:
        """What has become of a piece; nothing where it was lost and is asked for again."""
        number, piece, losses = self.pieces.pop(future)
        try:
            answer = reported(future.result())
        except (CancelledError, BrokenExecutor, *getattr(self._executor, "losses", ())) as lost:
            if losses + 1 >= LOSSES:
                raise _nobody(self._executor, lost) from None
            self.ask(number, piece, losses + 1)
        else:
            yield number, answer


class Answer(NamedTuple, Generic[A]):
    """An answer, and the contradictions that its worker met: no report leaves its process by itself."""

    answer: A
    reports: tuple[BoundError, ...]


def worked(until: float, work: Callable[[T], A], piece: T) -> Answer[A]:
    """A piece, where it is done, until a time of day: there it starts no workers of its own."""
    with limited(until - time.time()), working_on(HERE), collected() as reports:
        answer = work(piece)
    return Answer(answer, tuple(reports))


def reported(found: Answer[A]) -> A:
    """Return an answer; what its worker had to report is reported here."""
    for error in found.reports:
        report(error)
    return found.answer


def _nobody(executor: Executor, error: BaseException) -> WorkersGone:
    said = getattr(executor, "gone", "a worker was killed again and again")
    return WorkersGone(f"{said} ({error})" if str(error) else str(said))
