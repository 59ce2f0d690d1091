"""Processors that work may be shared among, and processes that do not outlive who started them."""

from __future__ import annotations

import ctypes
import os
import signal
from contextlib import suppress

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Variables by which a process begins whose linear algebra takes one thread: on matrices as small as ours more only
wait in a loop, which takes twice the processor time, and sums depend on how many they are."""
_DEATH_SIGNAL = 1


def processors() -> int:
    """As many processes as may run side by side."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def end_with_parent(parent: int) -> None:
    """Be ended with the process that started this one, where the system can do that (Linux)."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)
