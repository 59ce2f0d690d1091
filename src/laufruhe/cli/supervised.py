"""A command in a process of its own: interrupted whatever a solver does, and a sudden end is told in a line."""

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
"""Seconds in which an interrupted command may tidy up; a solver that does not listen is ended then."""

_heard: list[int] = []
_HANDED_ON = (signal.SIGINT, signal.SIGTERM, *((signal.SIGHUP,) if hasattr(signal, "SIGHUP") else ()))


def supervised(work: Callable[[], NoReturn]) -> NoReturn:
    """Do work that ends its process, where the system can in another one that is watched over.

    Signals are held there until the work says `listen`, where it minds what they raise.
    """
    if not hasattr(os, "fork"):
        work()
    watching = os.getpid()
    # none comes before it is heard
    signal.pthread_sigmask(signal.SIG_BLOCK, _HANDED_ON)
    child = os.fork()
    if child == 0:
        end_with_parent(watching)
        # a signal to the whole group comes here as well
        for number in _HANDED_ON:
            signal.signal(number, _interrupted)
        work()
    ended_here = False

    def interrupt(*_: object) -> None:
        # it may have just ended
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
        sys.stderr.write("laufruhe: interrupted\n" if ended_here else _sudden(os.WTERMSIG(status)))
    os._exit(os.WEXITSTATUS(status) if os.WIFEXITED(status) else INTERRUPTED if ended_here else FAILED)


def listen() -> None:
    """Hear what asks this process to end, from here on and since it was begun."""
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _HANDED_ON)


def _sudden(number: int) -> str:
    for_want = "most likely for want of memory; ask for less at once"
    why = for_want if number == signal.SIGKILL else "which is a defect; report it"
    return f"laufruhe: the computation was ended by signal {number}, {why}\n"


def _interrupted(number: int, _: FrameType | None) -> None:
    """Once: what tidies up is not interrupted again."""
    first = not is_interrupted()
    _heard.append(number)
    if first:
        raise KeyboardInterrupt


def is_interrupted() -> bool:
    """Whether this command was told to end."""
    return bool(_heard)
