"""Progress of a search: how far it is, its best value, and its bound."""

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
    """Report of progress.

    Attributes
    ----------
    within
        Searches that this one is part of, the outermost first.
    what
        Name of the counted pieces.
    done, whole
        Number of pieces; `whole` is zero where the total is not known.
    value, bound
        Best value and lower bound so far, in the unit of the objective; infinite where not known.
    """

    within: tuple[str, ...]
    what: str
    done: int = 0
    whole: int = 0
    value: float = math.inf
    bound: float = -math.inf

    @property
    def gap(self) -> float:
        """Relative gap between value and bound; NaN where either is not known, or the value is zero."""
        known = math.isfinite(self.value) and math.isfinite(self.bound) and self.value
        return max(self.value - self.bound, 0.0) / abs(self.value) if known else math.nan


Listener: TypeAlias = Callable[[Step], None]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)
_within: ContextVar[tuple[str, ...]] = ContextVar("within", default=())


@contextmanager
def progress_listener(listener: Listener | None) -> Iterator[None]:
    """Send the progress of searches within to a listener, or to nobody."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


@contextmanager
def search_scope(what: str) -> Iterator[None]:
    """Name the search that all searches within are part of."""
    before = _within.set((*_within.get(), what))
    try:
        yield
    finally:
        _within.reset(before)


def report_progress(
    what: str, done: int = 0, whole: int = 0, value: float = math.inf, bound: float = -math.inf
) -> None:
    """Report how far a search is; parameters as in `Step`."""
    listener = _listener.get()
    if listener is not None:
        listener(Step(_within.get(), what, done, whole, value, bound))


def with_progress(what: str, items: Sequence[T]) -> Iterator[T]:
    """Yield pieces of work, and report each before it is begun."""
    for k, item in enumerate(items):
        report_progress(what, k, len(items))
        yield item
