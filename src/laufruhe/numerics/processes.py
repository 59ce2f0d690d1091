"""Processes on this machine as an executor: each an interpreter of its own.

Neither forks of a threaded process nor the caller's main module are involved, so it works from any script, notebook
or test. A process that dies takes with it the one call that it was at; the next call gets a new one.
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


def called(name: str, *args: Any) -> Any:
    """Call what stands under a name as `package.module:function`; who asks another process to need not import it."""
    return resolve_name(name)(*args)


def in_twins(work: Callable[[int], T], count: int) -> list[T]:
    """Answers to 0 ... count - 1: the first by this process, each other by a twin that has all that this one imported.

    Only a process that serves has twins: its other thread waits for calls, and holds nothing that a twin needs.
    """
    with ExitStack() as ends:
        twins = _SERVES and hasattr(os, "fork")
        rest = [ends.enter_context(_twin(own)) if twins else own for own in (partial(work, k) for k in range(1, count))]
        return [work(0), *(answer() for answer in rest)]


@contextmanager
def meanwhile(work: Callable[[], T], pays: bool) -> Iterator[Callable[[], T]]:
    """Gives what waits for the answer of a twin, which works meanwhile; this process works first where it has none.

    Parameters
    ----------
    pays
        Whether it takes longer than a twin takes to begin, some milliseconds.
    """
    if pays and processors() > 1 and Copy.can_be():
        with _twin(work) as answer:
            yield answer
    else:
        found = work()
        yield lambda: found


@contextmanager
def _twin(work: Callable[[], T]) -> Iterator[Callable[[], T]]:
    """What waits for the answer of a twin; where that has died, the work is done here."""
    read, write = os.pipe()
    parent, (twin, heard) = os.getpid(), _forked()
    if twin == 0:
        try:
            signal.pthread_sigmask(signal.SIG_SETMASK, heard)
            end_with_parent(parent)
            with os.fdopen(write, "wb") as answers:
                pickle.dump(work(), answers)
        finally:
            os._exit(0)
    signal.pthread_sigmask(signal.SIG_SETMASK, heard)
    os.close(write)

    def answer() -> T:
        try:
            found: T = pickle.load(answers_of_twin)
        except (EOFError, pickle.UnpicklingError):
            return work()
        return found

    try:
        with os.fdopen(read, "rb") as answers_of_twin:
            yield answer
    except BaseException:
        # nobody waits for what is at work
        os.kill(twin, signal.SIGKILL)
        raise
    finally:
        os.waitpid(twin, 0)


def _forked() -> tuple[int, set[int | signal.Signals]]:
    """What fork says, all signals held back, and those that were: neither process is ended as if it were the other."""
    held = signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    return os.fork(), held


class WorkerDied(BrokenExecutor):
    """The process that a call was in has ended without an answer."""


class Copy:
    """A process that begins as a copy of this one, with all that it has imported, and serves.

    Only a process without other threads can be copied: what they hold would never be let go.
    """

    def __init__(self) -> None:
        there, asking = os.pipe()
        answering, back = os.pipe()
        parent, (self.pid, heard) = os.getpid(), _forked()
        if self.pid == 0:
            try:
                os.setsid()
                for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                    signal.signal(number, signal.SIG_DFL)
                signal.pthread_sigmask(signal.SIG_SETMASK, heard)
                os.close(asking)
                os.close(answering)
                # nobody listens to it, and it works for nobody else
                Context().run(_serve, parent, os.fdopen(there, "rb"), os.fdopen(back, "wb"))
            finally:
                os._exit(1)
        signal.pthread_sigmask(signal.SIG_SETMASK, heard)
        os.close(there)
        os.close(back)
        self.stdin: IO[bytes] = os.fdopen(asking, "wb")
        self.stdout: IO[bytes] = os.fdopen(answering, "rb")
        self._is_over = False

    @staticmethod
    def can_be() -> bool:
        """Whether this process can be copied."""
        return hasattr(os, "fork") and threading.active_count() == 1

    @classmethod
    def several(cls, count: int) -> tuple[Copy, ...]:
        """So many, to share work that this process has begun; none where a library has threads, or may have some."""
        try:
            threads = len(os.listdir("/proc/self/task"))
        except OSError:
            return ()
        return tuple(cls() for _ in range(count if threads == 1 and cls.can_be() else 0))

    def kill(self) -> None:
        """End it at once."""
        if not self._is_over:
            os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> None:
        """Until it has ended."""
        if not self._is_over:
            self._is_over = True
            os.waitpid(self.pid, 0)


_Child: TypeAlias = subprocess.Popen[bytes] | Copy


class Processes(Executor):
    """Up to `count` processes, started as calls come, ended with the executor or whoever has it.

    They have one thread each for their linear algebra and never hear Ctrl-C: who has them says when they end.

    Parameters
    ----------
    first
        Those that are there already, no more than `count`.
    """

    def __init__(self, count: int | None = None, first: Sequence[Copy] = ()) -> None:
        self.count = count if count is not None else processors()
        self._first = list(first)
        self._calls: SimpleQueue[_Call | None] = SimpleQueue()
        self._lock = threading.Lock()
        self._tenders: list[threading.Thread] = []
        self._children: set[_Child] = set(first)
        self._open = 0
        self._closed = False

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Ask for a call; what is called, and with what, has to be picklable."""
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
        """End the processes when all calls are answered, or at once where these are cancelled."""
        with self._lock:
            self._closed = True
            children, tenders = tuple(self._children), tuple(self._tenders)
        if cancel_futures:
            # others take calls too, so that one that was there may be gone
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
            self._ended(child)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # after an error nobody waits for the other calls
        self.shutdown(cancel_futures=kind is not None)

    @property
    def pids(self) -> tuple[int, ...]:
        """Of the processes that run."""
        with self._lock:
            return tuple(child.pid for child in self._children)

    def _tend(self) -> None:
        """Hand call after call to one process; in one thread, for the process ends with the thread that started it."""
        child: _Child | None = None
        while (call := self._calls.get()) is not None:
            future, asked = call
            if future.set_running_or_notify_cancel():
                try:
                    child = self._started() if child is None else child
                    is_answer, found = _exchanged(child, asked)
                except (OSError, EOFError, pickle.UnpicklingError) as error:
                    self._ended(child)
                    child = None
                    died = WorkerDied("a process that was at work has died; is there memory enough?")
                    died.__cause__ = error
                    future.set_exception(died)
                else:
                    future.set_result(found) if is_answer else future.set_exception(found)
            with self._lock:
                self._open -= 1
        self._ended(child)

    def _started(self) -> _Child:
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

    def _ended(self, child: _Child | None) -> None:
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


def _exchanged(child: _Child, asked: bytes) -> tuple[bool, Any]:
    assert child.stdin is not None
    assert child.stdout is not None
    pickle.dump(asked, child.stdin)
    child.stdin.flush()
    is_answer, found = pickle.load(child.stdout)
    return bool(is_answer), found


def serve(parent: int) -> None:
    """Answer calls from standard input on standard output, until whoever asks is gone."""
    _serve(parent, sys.stdin.buffer, os.fdopen(os.dup(1), "wb"))


def _serve(parent: int, asked: IO[bytes], answers: IO[bytes]) -> NoReturn:
    global _SERVES
    _SERVES = True
    # what a library prints is no answer
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    end_with_parent(parent)
    calls: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(asked, calls), daemon=True).start()
    while True:
        answers.write(_answered(calls.get()))
        answers.flush()


def _listen(asked: IO[bytes], calls: SimpleQueue[bytes]) -> None:
    """Take calls in, in a thread of its own: that nobody asks any more is noticed in the middle of a call too."""
    while True:
        try:
            calls.put(pickle.load(asked))
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
