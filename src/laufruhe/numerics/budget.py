"""Time limit of a search: one deadline for all its loops, which stop there with the best result so far."""

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
def limit_time(seconds: float | None) -> Iterator[None]:
    """Limit the work within to some seconds, and to those left outside; None sets no further limit."""
    own = math.inf if seconds is None else time.monotonic() + seconds
    before = _until.set(min(_until.get(), own))
    try:
        yield
    finally:
        _until.reset(before)


@contextmanager
def minimum_time(seconds: float) -> Iterator[None]:
    """Give work within at least some seconds: a result needs it."""
    before = _until.set(max(_until.get(), time.monotonic() + seconds))
    try:
        yield
    finally:
        _until.reset(before)


def seconds_left() -> float:
    """Return the seconds left; infinite without a limit."""
    return _until.get() - time.monotonic()


def is_time_over() -> bool:
    """Return True if the time is over."""
    return seconds_left() <= 0.0


def until_time_limit(items: Iterable[T]) -> Iterator[T]:
    """Yield the first piece, and further ones while time is left."""
    for k, item in enumerate(items):
        if k and is_time_over():
            return
        yield item


def timed_rounds(maximum: int) -> Iterator[int]:
    """Yield numbers of optional rounds while time is left."""
    for k in range(maximum):
        if is_time_over():
            return
        yield k
