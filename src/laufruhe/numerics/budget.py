"""Time limit of a search: one deadline for all its loops, which then stop with the best result so far."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Event
from typing import TypeVar

T = TypeVar("T")
# true once the caller has ended the work, whatever deadlines its parts have
_ended: ContextVar[Event | None] = ContextVar("ended", default=None)
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
def stoppable() -> Iterator[Callable[[], None]]:
    """Yield a function that ends the work in the block now, as a deadline does."""
    event = Event()
    before = _ended.set(event)
    try:
        yield event.set
    finally:
        _ended.reset(before)


@contextmanager
def minimum_time(seconds: float) -> Iterator[None]:
    """Give the work in the block at least some seconds, even beyond the enclosing limit."""
    before = _until.set(max(_until.get(), time.monotonic() + seconds))
    try:
        yield
    finally:
        _until.reset(before)


def seconds_left() -> float:
    """Return the seconds until the deadline; infinite without a limit, negative once the work is ended."""
    event = _ended.get()
    if event is not None and event.is_set():
        return -1.0
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
