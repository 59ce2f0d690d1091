"""Least values of aims under the conditions of one box, which others may work out ahead."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Hashable, Iterable, Sequence
from contextlib import AbstractContextManager
from itertools import islice
from typing import TypeAlias
from uuid import uuid4

from laufruhe.extensions.mount_relaxation.bound import Program
from laufruhe.extensions.mount_relaxation.program import Stated
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.workers import Speculation, speculation

_Step: TypeAlias = tuple[str, bytes, Array | int]
Ahead: TypeAlias = Speculation[_Step, tuple[float, Array]]

# seconds of relaxations after which processes are worth starting: where there is one, there are often dozens
WORTH = 0.25


class _Kept(threading.local):
    """The program that this thread stated last."""

    name = ""
    stated: Stated | None = None


_KEPT = _Kept()


def _least(step: _Step) -> tuple[float, Array]:
    name, program, aim = step
    if _KEPT.stated is None or _KEPT.name != name:
        _KEPT.name, _KEPT.stated = name, Stated(pickle.loads(program))
    return _KEPT.stated.least(aim)


def ends_ahead() -> AbstractContextManager[Ahead]:
    """Of all boxes of one search."""
    return speculation(_least, WORTH)


class Aims:
    """Of one program; whoever answers has a copy of it, so that all count alike."""

    def __init__(self, program: Program, ahead: Ahead | None) -> None:
        self._name, self._program, self._ahead = uuid4().hex, pickle.dumps(program), ahead
        if ahead is not None:
            ahead.discard()

    def least(self, key: Hashable, aim: Array | int) -> tuple[float, Array]:
        """As `Stated.least`."""
        step = (self._name, self._program, aim)
        return _least(step) if self._ahead is None else self._ahead.result((self._name, key), step)

    def all_least(self, aims: Sequence[Array | int]) -> list[float]:
        """Of each of some aims."""
        found = []
        for k, aim in enumerate(aims):
            self.prefetch(islice(enumerate(aims), k, None))
            found.append(self.least(k, aim)[0])
        return found

    def prefetch(self, aims: Iterable[tuple[Hashable, Array | int]]) -> None:
        """What may be asked next."""
        if self._ahead is not None:
            self._ahead.prefetch(((self._name, key), (self._name, self._program, aim)) for key, aim in aims)
