"""Processes of this machine as an executor, each an interpreter of its own or a forked copy of this process.

The executor forks no threaded process and does not import the caller's main module, so it works from any script,
notebook or test. A process that dies takes with it the one call that it was at; the next call gets a new one.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import ExitStack, contextmanager, suppress
from contextvars import Context
from functools import partial
from pkgutil import resolve_name
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import IO, Any, NoReturn, ParamSpec, TypeAlias, TypeVar

from laufruhe.errors import SolverError
from laufruhe.numerics.cores import ONE_THREAD, end_with_parent, processors

P = ParamSpec("P")
T = TypeVar("T")
_Call: TypeAlias = tuple[Future[Any], bytes]
_SERVES = False
_PROGRAM = "from laufruhe.numerics.processes import serve; serve({})"


def call_by_name(name: str, *args: Any) -> Any:
    """Call a function by its address `package.module:function`, which the caller then need not import."""
    return resolve_name(name)(*args)


def _fork(child: Callable[[], object], detached: bool = False) -> int:
    """Start a copy of this process that runs `child` and ends, and return its process number.

    Signals are blocked meanwhile, so that neither process is ended in place of the other. A detached copy has a
    session of its own, and the default handlers of signals.
    """
    parent, blocked = os.getpid(), signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    pid = os.fork()
    if pid == 0:
        try:
            if detached:
                os.setsid()
                for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                    signal.signal(number, signal.SIG_DFL)
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
            end_with_parent(parent)
            child()
        finally:
            os._exit(0)
    signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
    return pid


@contextmanager
def run_concurrently(work: Callable[[], T], pays: bool = True) -> Iterator[Callable[[], T]]:
    """Run `work` in a forked copy of this process, and yield a function that waits for its answer.

    Where nothing can be forked, the work is done first; where the copy dies, it is done when the answer is asked for.

    Parameters
    ----------
    pays
        True if the work takes longer than a fork, some milliseconds.
    """
    # the other thread of a process that serves holds nothing that a copy needs
    if not (pays and processors() > 1 and hasattr(os, "fork") and (_SERVES or ForkedWorker.is_possible())):
        done = work()
        yield lambda: done
        return
    read, write = os.pipe()

    def child() -> None:
        with os.fdopen(write, "wb") as stream:
            pickle.dump(work(), stream)

    pid = _fork(child)
    os.close(write)

    def answer() -> T:
        try:
            received: T = pickle.load(answers)
        except (EOFError, pickle.UnpicklingError):
            return work()
        return received

    try:
        with os.fdopen(read, "rb") as answers:
            yield answer
    except BaseException:
        os.kill(pid, signal.SIGKILL)
        raise
    finally:
        os.waitpid(pid, 0)


def fork_map(work: Callable[[int], T], count: int) -> list[T]:
    """Return work(0) ... work(count - 1): in a process that serves, a forked copy does each but the first."""
    with ExitStack() as stack:
        others = [stack.enter_context(run_concurrently(partial(work, k), _SERVES)) for k in range(1, count)]
        return [work(0), *(answer() for answer in others)]


class WorkerDied(BrokenExecutor):
    """The process of a call has ended without an answer."""


class ForkedWorker:
    """A forked copy of this process that serves calls, with all that this process has imported.

    Only a process without other threads can be forked: their locks would never be released.
    """

    def __init__(self) -> None:
        calls, self_calls = os.pipe()
        self_answers, answers = os.pipe()
        parent = os.getpid()

        def child() -> None:
            os.close(self_calls)
            os.close(self_answers)
            # in a fresh context: neither listener nor executor of this process reach it
            Context().run(_serve, parent, os.fdopen(calls, "rb"), os.fdopen(answers, "wb"))

        self.pid = _fork(child, detached=True)
        os.close(calls)
        os.close(answers)
        self.stdin: IO[bytes] = os.fdopen(self_calls, "wb")
        self.stdout: IO[bytes] = os.fdopen(self_answers, "rb")
        self._is_over = False

    @staticmethod
    def is_possible() -> bool:
        """Return True if this process can be forked."""
        return hasattr(os, "fork") and threading.active_count() == 1

    @classmethod
    def several(cls, count: int) -> tuple[ForkedWorker, ...]:
        """Return `count` copies to share work that this process has begun; none where a library may have threads."""
        try:
            threads = len(os.listdir("/proc/self/task"))
        except OSError:
            return ()
        return tuple(cls() for _ in range(count if threads == 1 and cls.is_possible() else 0))

    def kill(self) -> None:
        """End it at once."""
        if not self._is_over:
            os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> None:
        """Wait until it has ended."""
        if not self._is_over:
            self._is_over = True
            os.waitpid(self.pid, 0)


_Child: TypeAlias = subprocess.Popen[bytes] | ForkedWorker


class Processes(Executor):
    """Up to `count` processes, started as calls come, and ended with the executor or its process.

    Each has one thread for linear algebra, and ignores Ctrl-C: the owner of the executor ends them.

    Parameters
    ----------
    first
        Processes that exist already, `count` at most.
    """

    def __init__(self, count: int | None = None, first: Sequence[ForkedWorker] = ()) -> None:
        self.count = count if count is not None else processors()
        self._first = list(first)
        self._calls: SimpleQueue[_Call | None] = SimpleQueue()
        self._lock = threading.Lock()
        self._tenders: list[threading.Thread] = []
        self._children: set[_Child] = set(first)
        self._open = 0
        self._closed = False

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Schedule a call of picklable arguments."""
        future: Future[T] = Future()
        call = pickle.dumps((fn, args, kwargs))
        with self._lock:
            if self._closed:
                raise RuntimeError("cannot schedule new futures after shutdown")
            self._open += 1
            if len(self._tenders) < min(self.count, self._open):
                tender = threading.Thread(target=self._tend, daemon=True)
                self._tenders.append(tender)
                tender.start()
        self._calls.put((future, call))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes when all calls are answered, or at once with `cancel_futures`."""
        with self._lock:
            self._closed = True
            children, tenders = tuple(self._children), tuple(self._tenders)
        if cancel_futures:
            # a worker may take the last call meanwhile
            with suppress(Empty):
                while True:
                    call = self._calls.get_nowait()
                    if call is not None:
                        call[0].cancel()
            for child in children:
                child.kill()
        for _ in tenders:
            self._calls.put(None)
        for tender in tenders if wait else ():
            tender.join()
        with self._lock:
            idle, self._first = self._first, []
        for child in idle:
            self._end(child)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # after an error nobody waits for the other calls
        self.shutdown(cancel_futures=kind is not None)

    @property
    def pids(self) -> tuple[int, ...]:
        """Return the numbers of the processes that run."""
        with self._lock:
            return tuple(child.pid for child in self._children)

    def _tend(self) -> None:
        """Hand call after call to one process, from the thread that it ends with."""
        child: _Child | None = None
        while (call := self._calls.get()) is not None:
            future, request = call
            if future.set_running_or_notify_cancel():
                try:
                    child = self._start() if child is None else child
                    is_answer, answer = _exchange(child, request)
                except (OSError, EOFError, pickle.UnpicklingError) as error:
                    self._end(child)
                    child = None
                    died = WorkerDied("a process that was at work has died; is there memory enough?")
                    died.__cause__ = error
                    future.set_exception(died)
                else:
                    future.set_result(answer) if is_answer else future.set_exception(answer)
            with self._lock:
                self._open -= 1
        self._end(child)

    def _start(self) -> _Child:
        with self._lock:
            if self._first:
                return self._first.pop()
        path = os.pathsep.join(p for p in sys.path if p)
        child = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM.format(os.getpid())],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
            env={**os.environ, **ONE_THREAD, "PYTHONPATH": path},
        )  # fmt: skip
        with self._lock:
            self._children.add(child)
            closed = self._closed
        if closed:
            child.kill()
        return child

    def _end(self, child: _Child | None) -> None:
        if child is not None:
            with self._lock:
                self._children.discard(child)
            child.kill()
            child.wait()
            for stream in (child.stdin, child.stdout):
                # what was not written any more
                with suppress(OSError):
                    if stream is not None:
                        stream.close()


def _exchange(child: _Child, request: bytes) -> tuple[bool, Any]:
    assert child.stdin is not None
    assert child.stdout is not None
    pickle.dump(request, child.stdin)
    child.stdin.flush()
    is_answer, answer = pickle.load(child.stdout)
    return bool(is_answer), answer


def serve(parent: int) -> None:
    """Answer calls from standard input on standard output, until the parent process is gone."""
    _serve(parent, sys.stdin.buffer, os.fdopen(os.dup(1), "wb"))


def _serve(parent: int, requests: IO[bytes], answers: IO[bytes]) -> NoReturn:
    global _SERVES
    _SERVES = True
    # a library that prints must not write between the answers
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    end_with_parent(parent)
    calls: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(requests, calls), daemon=True).start()
    while True:
        answers.write(_answered(calls.get()))
        answers.flush()


def _listen(requests: IO[bytes], calls: SimpleQueue[bytes]) -> None:
    # in a thread of its own, so that the end of the parent ends a call too
    while True:
        try:
            calls.put(pickle.load(requests))
        except BaseException:
            os._exit(1)


def _answered(call: bytes) -> bytes:
    try:
        fn, args, kwargs = pickle.loads(call)
        return pickle.dumps((True, fn(*args, **kwargs)))
    except BaseException as error:
        try:
            error.add_note(traceback.format_exc())
            pickle.loads(failed := pickle.dumps((False, error)))
        except Exception:
            failed = pickle.dumps((False, SolverError(f"{type(error).__name__}: {error}")))
        return failed
