"""Work that tests of one run share, whichever of its processes needs it first."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

_FOLDER = "LAUFRUHE_TESTS_SHARED"


def prepare(config: pytest.Config) -> None:
    """Prepare a folder for this run; its processes inherit the name."""
    if _FOLDER not in os.environ:
        folder = tempfile.TemporaryDirectory(prefix="shared-")
        os.environ[_FOLDER] = folder.name
        config.add_cleanup(lambda: os.environ.pop(_FOLDER, None))
        config.add_cleanup(folder.cleanup)


def once(name: str, make: Callable[[Path], object]) -> Path:
    """Return a folder that `make` has filled, once in this run."""
    folder = Path(os.environ[_FOLDER]) / name
    done = folder / "done"
    with folder.with_name(f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            folder.mkdir(exist_ok=True)
            make(folder)
            done.touch()
    return folder
