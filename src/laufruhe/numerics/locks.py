"""Locks on folders that one process writes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:
    # systems without file locks: concurrent runs are not detected, and files of killed runs remain
    fcntl = None  # type: ignore[assignment]


_OPEN_FILES: set[int] = set()
"""File handles of the folders that this process has locked."""


def _close_all() -> None:
    while _OPEN_FILES:
        os.close(_OPEN_FILES.pop())


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_close_all)


@contextmanager
def folder_lock(folder: Path, wait: bool = True) -> Iterator[bool | None]:
    """Lock a folder for the block.

    Yields True if it is locked, False if another process has locked it (without `wait`), None if the system has no
    locks.
    """
    if fcntl is None:
        yield None
        return
    handle = os.open(folder, os.O_RDONLY)
    _OPEN_FILES.add(handle)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            is_locked: bool | None = True
        except BlockingIOError:
            is_locked = False
        except OSError:
            # a file system without locks
            is_locked = None
        yield is_locked
    finally:
        if handle in _OPEN_FILES:
            _OPEN_FILES.discard(handle)
            os.close(handle)
