"""Executor on processes of this machine: new Python interpreters that do not import the caller's main module.

So it works from any script, notebook or test. If a process dies, its current call fails with `WorkerDied`, and the next
call starts a new process.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from contextlib import suppress
from pkgutil import resolve_name
from queue import SimpleQueue
from types import TracebackType
from typing import Any, ParamSpec, TypeAlias, TypeVar

from laufruhe.errors import SolverError
from laufruhe.numerics.cores import ONE_THREAD, end_with_parent, processors

P = ParamSpec("P")
T = TypeVar("T")
_Child: TypeAlias = subprocess.Popen[bytes]
_PROGRAM = "from laufruhe.numerics.processes import serve; serve({})"


def call_by_name(name: str, *args: Any) -> Any:
    """Call a function by its address `package.module:function`, so that the caller need not import it."""
    return resolve_name(name)(*args)


class WorkerDied(BrokenExecutor):
    """Death of the process of a call before its result."""


class Processes(ThreadPoolExecutor):
    """Executor on up to `count` processes, which start with the first calls and end with the executor.

    A thread for each process passes calls to it. Each process uses one thread for linear algebra and does not receive
    Ctrl-C; the owner of the executor ends them. By default there is one for each processor.
    """

    def __init__(self, count: int | None = None) -> None:
        self.count = count if count is not None else processors()
        super().__init__(self.count)
        self._children: set[_Child] = set()
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
    answers = os.fdopen(os.dup(1), "wb")
    # a library that prints must not write between the answers
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    end_with_parent(parent)
    calls: SimpleQueue[bytes] = SimpleQueue()

    def listen() -> None:
        # runs in its own thread, so that the end of the parent ends a running call too
        while True:
            try:
                calls.put(pickle.load(sys.stdin.buffer))
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
