"""Command in a child process, so that interrupts work during solvers, and a crash is reported in a line."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import NoReturn

from laufruhe.cli.screen import FAILED, INTERRUPTED
from laufruhe.numerics.cores import end_with_parent

PATIENCE = 2
"""Seconds in which an interrupted command may clean up before it is killed."""

_heard: list[int] = []
_HANDED_ON = (signal.SIGINT, signal.SIGTERM, *((signal.SIGHUP,) if hasattr(signal, "SIGHUP") else ()))


def supervised(work: Callable[[], NoReturn]) -> NoReturn:
    """Do work that ends its process, in a child process if the system can fork.

    Signals are blocked there until the work calls `listen`.
    """
    if not hasattr(os, "fork"):
        work()
    watching = os.getpid()
    # no signal is lost before the handlers are set
    signal.pthread_sigmask(signal.SIG_BLOCK, _HANDED_ON)
    child = os.fork()
    if child == 0:
        end_with_parent(watching)
        # a signal to the process group comes here too
        for number in _HANDED_ON:
            signal.signal(number, _interrupted)
        work()
    ended_here = False

    def interrupt(*_: object) -> None:
        # the child may have just ended
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGINT)
        signal.alarm(PATIENCE)

    def end(*_: object) -> None:
        nonlocal ended_here
        ended_here = True
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)

    for number in _HANDED_ON:
        signal.signal(number, interrupt)
    signal.signal(signal.SIGALRM, end)
    listen()
    _, status = os.waitpid(child, 0)
    if not os.WIFEXITED(status):
        number = os.WTERMSIG(status)
        for_want = "most likely because memory ran out; use fewer samples, draws or processes"
        why = for_want if number == signal.SIGKILL else "which is a defect of laufruhe; report it"
        sudden = f"laufruhe: the computation was ended by signal {number}, {why}\n"
        sys.stderr.write("laufruhe: interrupted\n" if ended_here else sudden)
    os._exit(os.WEXITSTATUS(status) if os.WIFEXITED(status) else INTERRUPTED if ended_here else FAILED)


def listen() -> None:
    """Receive signals that ask this process to end, earlier ones included."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _HANDED_ON)


def _interrupted(number: int, _: FrameType | None) -> None:
    # a second signal does not interrupt cleaning up
    first = not is_interrupted()
    _heard.append(number)
    if first:
        raise KeyboardInterrupt


def is_interrupted() -> bool:
    """Return True if a signal requested the end of this command."""
    return bool(_heard)
