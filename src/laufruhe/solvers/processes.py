"""Shares of a search, each in an interpreter of its own.

Neither forks of a threaded process nor the caller's main module are involved, so it works
from any script, notebook or test.
"""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from typing import Any

from laufruhe.errors import SolverError
from laufruhe.numerics.budget import left, limited


def apart(module: str, task: Any, items: Sequence[Any], count: int) -> list[Any]:
    """What `serve` of a module answers to the task, every item handed to one of `count` processes.

    Raises
    ------
    SolverError
        If a process does not start, or dies.
    """
    program = f"from {module} import serve; serve()"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "OMP_NUM_THREADS": "1"}
    children = []
    try:
        for k in range(count):
            child = subprocess.Popen(
                [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, env=environment,
            )  # fmt: skip
            children.append(child)
            assert child.stdin is not None
            try:
                pickle.dump((left(), task, items[k::count]), child.stdin)
                child.stdin.close()
            except BrokenPipeError:
                raise SolverError("a process of the nonlinear solver could not start; try one worker") from None
        found: list[Any] = []
        for child in children:
            assert child.stdout is not None
            said = child.stdout.read()
            child.stdout.close()
            if child.wait() != 0:
                raise SolverError("a process of the nonlinear solver died; try fewer workers")
            found += pickle.loads(said)
        return found
    finally:
        for child in children:
            if child.poll() is None:
                child.kill()
                child.wait()


def answer(run: Callable[[Any, Sequence[Any]], list[Any]]) -> None:
    """Read a task and a share of its items from standard input, write what `run` makes of them to standard output."""
    answer_to = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    seconds, task, items = pickle.load(sys.stdin.buffer)
    with limited(seconds):
        pickle.dump(run(task, items), answer_to)
    answer_to.close()
