"""Executor on processes of this machine: new Python interpreters, or forked copies of this process.

It never forks a process with threads and does not import the caller's main module, so it works from any script,
notebook or test. If a process dies, its current call fails with `WorkerDied`, and the next call starts a new process.
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
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from contextvars import Context
from functools import partial
from pkgutil import resolve_name
from queue import SimpleQueue
from types import TracebackType
from typing import IO, Any, NoReturn, ParamSpec, TypeAlias, TypeVar

from laufruhe.errors import SolverError
from laufruhe.numerics.cores import ONE_THREAD, end_with_parent, processors

P = ParamSpec("P")
T = TypeVar("T")
_SERVES = False
_PROGRAM = "from laufruhe.numerics.processes import serve; serve({})"


def call_by_name(name: str, *args: Any) -> Any:
    """Call a function by its address `package.module:function`, so that the caller need not import it."""
    return resolve_name(name)(*args)


def _fork(child: Callable[[], object], detached: bool = False) -> int:
    """Start a forked copy of this process that runs `child` and ends; return its process number.

    Signals are blocked during the fork, so that each reaches the right process. A detached copy has its own session
    and the default signal handlers.
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
    """Run `work` in a forked copy of this process, and yield a function that waits for its result.

    If this process cannot be forked, `work` runs here before the block. If the copy dies, it runs here when the result
    is requested.

    Parameters
    ----------
    work
        Function without arguments; its result must be picklable.
    pays
        True if the work takes longer than a fork, which takes some milliseconds.
    """
    # the listener thread of a worker holds no lock that a copy needs
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
    """Return work(0) ... work(count - 1); in a worker process, forked copies compute all but the first."""
    with ExitStack() as stack:
        pending = [stack.enter_context(run_concurrently(partial(work, k), _SERVES)) for k in range(1, count)]
        return [work(0), *(answer() for answer in pending)]


class WorkerDied(BrokenExecutor):
    """Death of the process of a call before its result."""


class ForkedWorker:
    """Forked copy of this process that runs calls, with all modules of this process imported.

    Only a process with one thread can be forked: in the copy, locks of other threads would never be released.
    """

    def __init__(self) -> None:
        calls, self_calls = os.pipe()
        self_answers, answers = os.pipe()
        parent = os.getpid()

        def child() -> None:
            os.close(self_calls)
            os.close(self_answers)
            # a new context, without the progress listener and executor of this process
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
        """Return `count` forked copies of this process; none if it, or one of its libraries, may have threads."""
        try:
            threads = len(os.listdir("/proc/self/task"))
        except OSError:
            return ()
        return tuple(cls() for _ in range(count if threads == 1 and cls.is_possible() else 0))

    def kill(self) -> None:
        """Kill the process."""
        # another thread may have waited for it
        with suppress(ProcessLookupError):
            if not self._is_over:
                os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> None:
        """Wait until the process has ended."""
        if not self._is_over:
            self._is_over = True
            os.waitpid(self.pid, 0)


_Child: TypeAlias = subprocess.Popen[bytes] | ForkedWorker


class Processes(ThreadPoolExecutor):
    """Executor on up to `count` processes, which start with the first calls and end with the executor.

    A thread for each process passes calls to it. Each process uses one thread for linear algebra and does not receive
    Ctrl-C; the owner of the executor ends them.

    Parameters
    ----------
    count
        Largest number of processes; by default the number of processors.
    first
        Existing processes to use first, at most `count`.
    """

    def __init__(self, count: int | None = None, first: Sequence[ForkedWorker] = ()) -> None:
        self.count = count if count is not None else processors()
        super().__init__(self.count)
        self._first = list(first)
        self._children: set[_Child] = set(first)
        self._of_thread = threading.local()
        self._lock = threading.Lock()
        self._is_over = False

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Schedule a call of picklable arguments."""
        return super().submit(self._answer, pickle.dumps((fn, args, kwargs)))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes when all calls are done, or at once with `cancel_futures`.

        Without `wait` and `cancel_futures` they end with this object.
        """
        try:
            super().shutdown(wait and not cancel_futures, cancel_futures=cancel_futures)
        finally:
            # also where Ctrl-C ends the wait
            with self._lock:
                self._is_over = True
                children = tuple(self._children) if wait or cancel_futures else ()
            for child in children:
                child.kill()
            # a thread ends when its process is dead
            super().shutdown(wait or cancel_futures)
            for child in children:
                self._end(child)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # after an error nobody needs the other results
        self.shutdown(cancel_futures=kind is not None)

    @property
    def pids(self) -> tuple[int, ...]:
        """Numbers of the running processes."""
        with self._lock:
            return tuple(child.pid for child in self._children)

    def _answer(self, request: bytes) -> Any:
        """Return the answer of the process of this thread to a call."""
        child: _Child | None = getattr(self._of_thread, "child", None)
        try:
            child = self._of_thread.child = child or self._start()
            is_answer, answer = _exchange(child, request)
        except (OSError, EOFError, pickle.UnpicklingError) as error:
            self._of_thread.child = None
            self._end(child)
            raise WorkerDied("a worker process died during a call; check that there is enough memory") from error
        if is_answer:
            return answer
        raise answer

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
            is_over = self._is_over
        if is_over:
            child.kill()
        return child

    def _end(self, child: _Child | None) -> None:
        if child is not None:
            with self._lock:
                self._children.discard(child)
            child.kill()
            child.wait()
            for stream in (child.stdin, child.stdout):
                # closing flushes data that the dead process cannot read
                with suppress(OSError):
                    if stream is not None:
                        stream.close()


def _exchange(child: _Child, request: bytes) -> tuple[bool, Any]:
    assert child.stdin is not None
    assert child.stdout is not None
    pickle.dump(request, child.stdin)
    child.stdin.flush()
    is_answer, answer = pickle.load(child.stdout)
    return is_answer, answer


def serve(parent: int) -> None:
    """Run calls from standard input and write their results to standard output, until the parent process ends."""
    _serve(parent, sys.stdin.buffer, os.fdopen(os.dup(1), "wb"))


def _serve(parent: int, requests: IO[bytes], answers: IO[bytes]) -> NoReturn:
    global _SERVES
    _SERVES = True
    # a library that prints must not write between the answers
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    end_with_parent(parent)
    calls: SimpleQueue[bytes] = SimpleQueue()

    def listen() -> None:
        # runs in its own thread, so that the end of the parent ends a running call too
        while True:
            try:
                calls.put(pickle.load(requests))
            except BaseException:
                os._exit(1)

    threading.Thread(target=listen, daemon=True).start()
    while True:
        answers.write(_answered(calls.get()))
        answers.flush()


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
