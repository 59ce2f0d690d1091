"""Number of processors, and processes that end with their parent."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from threading import Lock
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment variables that limit linear algebra to one thread. On small matrices more threads double the processor
time, and sums would depend on their number."""
_DEATH_SIGNAL = 1


class _Blocks:
    # number of blocks on one thread, nested or simultaneous, and the end of their common limit
    lock, count, end = Lock(), 0, ExitStack()


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit linear algebra to one thread within the block, unless the environment states a number of threads."""
    if ONE_THREAD.keys() & os.environ.keys():
        yield
        return
    with _Blocks.lock:
        if not _Blocks.count:
            _Blocks.end.enter_context(_controller(len(sys.modules)).limit(limits=1, user_api="blas"))
        _Blocks.count += 1
    try:
        yield
    finally:
        with _Blocks.lock:
            _Blocks.count -= 1
            if not _Blocks.count:
                _Blocks.end.close()


@lru_cache(maxsize=1)
def _controller(_modules: int) -> ThreadpoolController:
    # a search for libraries takes milliseconds, so it is repeated only after an import
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def processors() -> int:
    """Return the number of processors of this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def end_with_parent(parent: int) -> None:
    """Let the system end this process together with its parent, whose process number is `parent` (Linux only)."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
