"""Worker process that runs only the newest request of one kind."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError
from typing import ParamSpec, TypeVar

from laufruhe.errors import SolverError
from laufruhe.numerics.processes import Processes

P = ParamSpec("P")
T = TypeVar("T")


class Superseded(Exception):
    """A newer request came, or the page was closed."""


class Late(SolverError):
    """The work exceeded its time."""


class LatestWorker:
    """Runs the newest request in its own process; older waiting requests are dropped.

    A newer request waits `patience` seconds for the request at work, which is then ended with its process.
    """

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._changed = threading.Condition()
        self._newest = 0
        self._workers: Processes | None = None
        self._busy = False
        self._closed = False

    def ask(self, seconds: float, work: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Return the result of `work`, which the worker process computes.

        Raise `Superseded` if a newer request came before the answer, and `Late` if the work exceeds `seconds`.
        """
        request_number, workers = self._next_request()
        try:
            try:
                future = workers.submit(work, *args, **kwargs)
            except RuntimeError:
                # a newer request has just ended the process
                raise Superseded from None
            return future.result(seconds)
        except TimeoutError:
            self._end(workers)
            raise Late(f"the request took longer than {seconds:.0f} s and was ended") from None
        except (BrokenExecutor, CancelledError):
            if request_number != self._newest or self._closed:
                raise Superseded from None
            self._end(workers)
            raise
        finally:
            with self._changed:
                if self._workers is workers or self._workers is None:
                    self._busy = False
                self._changed.notify_all()

    def _next_request(self) -> tuple[int, Processes]:
        """Return the number of this request and the worker process, once the process is free.

        Work of an earlier request that takes too long is ended.
        """
        with self._changed:
            self._newest += 1
            request_number = self._newest
            self._changed.notify_all()
            deadline = time.monotonic() + self._patience
            while self._busy and request_number == self._newest and not self._closed:
                if not self._changed.wait(max(deadline - time.monotonic(), 0.0)) and time.monotonic() >= deadline:
                    self._end(self._workers)
            if request_number != self._newest or self._closed:
                raise Superseded
            self._busy = True
            if self._workers is None:
                self._workers = Processes(1)
            return request_number, self._workers

    def _end(self, workers: Processes | None) -> None:
        with self._changed:
            if workers is not None and workers is self._workers:
                workers.shutdown(wait=False, cancel_futures=True)
                self._workers, self._busy = None, False

    def close(self) -> None:
        """End the worker process at once."""
        with self._changed:
            self._closed = True
            self._end(self._workers)
            self._changed.notify_all()
