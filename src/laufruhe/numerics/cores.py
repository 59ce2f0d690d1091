"""Number of processors, and processes that end with their parent."""

from __future__ import annotations

import ctypes
import os
import signal
from contextlib import suppress

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment variables that limit linear algebra to one thread. On small matrices more threads double the processor
time, and sums would depend on their number."""
_DEATH_SIGNAL = 1


def processors() -> int:
    """Return the number of processors of this process."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def end_with_parent(parent: int) -> None:
    """Let the system end this process together with its parent, whose process number is `parent` (Linux only)."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
