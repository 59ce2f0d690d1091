"""What a search tells of itself while it goes on: how far it is, the best value that it has, and its bound."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Step:
    """How far a search is.

    Attributes
    ----------
    within
        Searches that this one is part of, the outermost first.
    what
        It counts, in words.
    done, whole
        How many; none are known to come where `whole` is zero.
    value, bound
        Best value so far, and what no design goes under, in the unit of the objective; infinite where not known.
    """

    within: tuple[str, ...]
    what: str
    done: int = 0
    whole: int = 0
    value: float = math.inf
    bound: float = -math.inf

    @property
    def gap(self) -> float:
        """Share of the value that is not proven; not a number where either is not known, or the value is zero."""
        known = math.isfinite(self.value) and math.isfinite(self.bound) and self.value
        return max(self.value - self.bound, 0.0) / abs(self.value) if known else math.nan


Listener: TypeAlias = Callable[[Step], None]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)
_within: ContextVar[tuple[str, ...]] = ContextVar("within", default=())


@contextmanager
def listening(listener: Listener | None) -> Iterator[None]:
    """Searches within tell this listener; nobody where it is None."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


@contextmanager
def within(what: str) -> Iterator[None]:
    """Searches within are part of this."""
    before = _within.set((*_within.get(), what))
    try:
        yield
    finally:
        _within.reset(before)


def tell(what: str, done: int = 0, whole: int = 0, value: float = math.inf, bound: float = -math.inf) -> None:
    """Say how far a search is, to whoever listens; fields as in `Step`."""
    listener = _listener.get()
    if listener is not None:
        listener(Step(_within.get(), what, done, whole, value, bound))


def telling(what: str, items: Sequence[T]) -> Iterator[T]:
    """Pieces of work, each told of before it is begun."""
    for k, item in enumerate(items):
        tell(what, k, len(items))
        yield item
