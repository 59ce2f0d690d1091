"""A copy of the package that lacks the folder of an extension, and processes that see it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import laufruhe

SOURCE = Path(laufruhe.__file__).parent


def without(names: Sequence[str], folder: Path) -> dict[str, str]:
    """Copy the package without extensions, and return the environment of processes that see the copy."""
    # compiled modules come along, for compiling all of them takes seconds
    shutil.copytree(SOURCE, folder / "laufruhe")
    for name in names:
        shutil.rmtree(folder / "laufruhe" / "extensions" / name)
    return {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}


def run(environment: dict[str, str], *words: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
