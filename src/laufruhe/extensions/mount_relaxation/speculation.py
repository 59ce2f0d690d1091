"""Bounds of several objectives under the constraints of one box, which worker processes may compute ahead."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Hashable, Iterable, Sequence
from contextlib import AbstractContextManager
from itertools import islice
from typing import TypeAlias
from uuid import uuid4

from laufruhe.extensions.mount_relaxation.cone_program import ConeProgram
from laufruhe.extensions.mount_relaxation.program import SdpProgram
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.workers import Speculation, speculation

_Step: TypeAlias = tuple[str, bytes, Array | int]
Ahead: TypeAlias = Speculation[_Step, tuple[float, Array]]

# seconds of relaxations after which worker processes start: such searches often need dozens
START_SECONDS = 0.25


class _Cache(threading.local):
    """Cone program that this thread built last, by name."""

    name = ""
    program: ConeProgram | None = None


_CACHE = _Cache()


def _bound(step: _Step) -> tuple[float, Array]:
    name, program, objective = step
    if _CACHE.program is None or _CACHE.name != name:
        _CACHE.name, _CACHE.program = name, ConeProgram(pickle.loads(program))
    return _CACHE.program.minimum(objective)


def bounds_ahead() -> AbstractContextManager[Ahead]:
    """Return the speculative executor for all boxes of one search."""
    return speculation(_bound, START_SECONDS)


class Objectives:
    """Objectives of one program; each worker has a copy of it, so that all workers return the same bounds."""

    def __init__(self, program: SdpProgram, ahead: Ahead | None) -> None:
        self._name, self._program, self._ahead = uuid4().hex, pickle.dumps(program), ahead
        if ahead is not None:
            ahead.discard()

    def bound(self, key: Hashable, objective: Array | int) -> tuple[float, Array]:
        """Return the bound and optimum as `ConeProgram.minimum` does; `key` names the objective."""
        step = (self._name, self._program, objective)
        return _bound(step) if self._ahead is None else self._ahead.result((self._name, key), step)

    def all_bounds(self, objectives: Sequence[Array | int]) -> list[float]:
        """Return the bound of each objective; later ones are computed ahead."""
        bounds = []
        for k, objective in enumerate(objectives):
            self.prefetch(islice(enumerate(objectives), k, None))
            bounds.append(self.bound(k, objective)[0])
        return bounds

    def prefetch(self, objectives: Iterable[tuple[Hashable, Array | int]]) -> None:
        """Start objectives that may follow, the most likely first."""
        if self._ahead is not None:
            self._ahead.prefetch(
                ((self._name, key), (self._name, self._program, objective)) for key, objective in objectives
            )
