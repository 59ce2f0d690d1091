"""Locks on folders that one process writes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:
    # a system without locks: what a killed run leaves behind stays, and two runs at once are not told apart
    fcntl = None  # type: ignore[assignment]


_KEPT: set[int] = set()
"""Handles of folders that this process keeps."""


def _let_go() -> None:
    while _KEPT:
        os.close(_KEPT.pop())


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_let_go)


@contextmanager
def folder_lock(folder: Path, wait: bool = True) -> Iterator[bool | None]:
    """Lock a folder; yield True if locked, False if another process holds it (without `wait`), None if unknown."""
    if fcntl is None:
        yield None
        return
    handle = os.open(folder, os.O_RDONLY)
    _KEPT.add(handle)
    try:
        yield _locked(handle, wait)
    finally:
        if handle in _KEPT:
            _KEPT.discard(handle)
            os.close(handle)


def _locked(handle: int, wait: bool) -> bool | None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        return False
    except OSError:
        # a file system without locks
        return None
    return True
