"""A search whose next steps are worked out before they are wanted.

The one who searches decides what is wanted, one step after the other, as a single process would, and tells the best
value with every step; who works side by side only makes answers come sooner. So answers, their order and what is proven
are the same to the last bit, however many work.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Iterable, Iterator
from concurrent.futures import Executor, Future
from contextlib import ExitStack, contextmanager, suppress
from itertools import islice
from pickle import PicklingError
from typing import Any, Generic, TypeVar

from laufruhe.numerics.budget import left
from laufruhe.numerics.processes import Processes
from laufruhe.numerics.workers import WORTH_PROCESSES, Answer, count_of, given, imported, reported, worked

T = TypeVar("T")
A = TypeVar("A")


class Foresight(Generic[T, A]):
    """Answers of one kind of step; processes are started once a search has taken the seconds that they are worth."""

    def __init__(self, work: Callable[[T], A], held: ExitStack, worth: float) -> None:
        self._work, self._held, self._worth = work, held, worth
        self._began = time.perf_counter()
        self._executor: Executor | None = None
        self._starting: list[Future[None]] = []
        self._asked: dict[Hashable, Future[Answer[A]]] = {}
        self.foreseen = 0

    def likely(self, steps: Iterable[tuple[Hashable, T]]) -> None:
        """Steps that may be wanted next, the likeliest first; as many are begun as can be worked at once."""
        executor = self._executor or self._workers()
        if executor is None:
            return
        unasked = ((key, step) for key, step in steps if key not in self._asked)
        # where nobody works any more, all is worked out when it is wanted
        with suppress(RuntimeError, OSError):
            begun: list[Future[Any]] = [*self._starting, *self._asked.values()]
            room = count_of(executor) - sum(not future.done() for future in begun)
            for key, step in islice(unasked, max(room, 0)):
                # and so is what cannot be told to others
                with suppress(PicklingError, AttributeError, TypeError):
                    self._asked[key] = executor.submit(worked, time.time() + left(), self._work, step)

    def _workers(self) -> Executor | None:
        """Those that were given; else processes, once they are worth it: none is waited for while it starts."""
        waited = time.perf_counter() - self._began
        if count_of() == 1 or (given() is None and waited <= self._worth):
            return None
        self._executor = executor = given() or Processes()
        self._held.callback(self._end)
        if given() is None:
            self._starting = [executor.submit(imported, self._work) for _ in range(count_of(executor))]
        return executor

    def wanted(self, key: Hashable, step: T) -> A:
        """The answer to a step: the one foreseen, or worked out now."""
        future = self._asked.pop(key, None)
        if future is None:
            return self._work(step)
        try:
            found = future.result()
        except Exception:
            # lost with its worker, or not understood by it; what fails here too is told by this process
            return self._work(step)
        self.foreseen += 1
        return reported(found)

    def forget(self) -> None:
        """What was foreseen and is not wanted any more."""
        for future in self._asked.values():
            future.cancel()
        self._asked.clear()

    def _end(self) -> None:
        self.forget()
        if self._executor is not None and given() is None:
            # nobody waits for what is at work
            self._executor.shutdown(cancel_futures=True)


@contextmanager
def foresight(work: Callable[[T], A], worth: float = WORTH_PROCESSES) -> Iterator[Foresight[T, A]]:
    """Of one search; workers are let go with it.

    Parameters
    ----------
    worth
        Seconds that a search has taken when processes are started for it.
    """
    with ExitStack() as held:
        yield Foresight(work, held, worth)
