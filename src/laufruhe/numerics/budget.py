"""Time limit of a search: one deadline for all its loops, which then stop with the best result so far."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

T = TypeVar("T")
# deadline on the monotonic clock [s]
_until: ContextVar[float] = ContextVar("until", default=math.inf)


@contextmanager
def limit_time(seconds: float | None) -> Iterator[None]:
    """Limit the work in the block to some seconds and to the enclosing limit; None adds no limit."""
    deadline = math.inf if seconds is None else time.monotonic() + seconds
    before = _until.set(min(_until.get(), deadline))
    try:
        yield
    finally:
        _until.reset(before)


@contextmanager
def minimum_time(seconds: float) -> Iterator[None]:
    """Give the work in the block at least some seconds, even beyond the enclosing limit."""
    before = _until.set(max(_until.get(), time.monotonic() + seconds))
    try:
        yield
    finally:
        _until.reset(before)


def seconds_left() -> float:
    """Return the seconds until the deadline; infinite without a limit."""
    return _until.get() - time.monotonic()


def is_time_over() -> bool:
    """Return True if the deadline is over."""
    return seconds_left() <= 0.0


def until_time_limit(items: Iterable[T]) -> Iterator[T]:
    """Yield the first item, and further ones while time is left."""
    for k, item in enumerate(items):
        if k and is_time_over():
            return
        yield item


def timed_rounds(maximum: int) -> Iterator[int]:
    """Yield 0 ... maximum - 1 while time is left."""
    for k in range(maximum):
        if is_time_over():
            return
        yield k
