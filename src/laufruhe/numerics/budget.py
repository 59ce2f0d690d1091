"""How long work may take: one deadline for all loops of a search, which stop at it with the best that they have."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")
# reading of the clock at which time is over
_until: ContextVar[float] = ContextVar("until", default=math.inf)


@contextmanager
def limited(seconds: float | None) -> Iterator[None]:
    """Work within may take so many seconds, and no more than what it stands in may; None sets no limit of its own."""
    own = math.inf if seconds is None else time.monotonic() + seconds
    before = _until.set(min(_until.get(), own))
    try:
        yield
    finally:
        _until.reset(before)


@contextmanager
def at_least(seconds: float) -> Iterator[None]:
    """Work within has so many seconds where less is left, or none: for what a result cannot do without."""
    before = _until.set(max(_until.get(), time.monotonic() + seconds))
    try:
        yield
    finally:
        _until.reset(before)


def left() -> float:
    """Seconds that are left, infinite where nothing limits them."""
    return _until.get() - time.monotonic()


def passed() -> bool:
    """Whether time is over."""
    return left() <= 0.0


def in_time(items: Iterable[T]) -> Iterator[T]:
    """The first of some pieces of work, and the others as long as time is left."""
    for k, item in enumerate(items):
        if k and passed():
            return
        yield item


def rounds(most: int) -> Iterator[int]:
    """Numbers of rounds that may be left out, as long as time is left."""
    for k in range(most):
        if passed():
            return
        yield k
