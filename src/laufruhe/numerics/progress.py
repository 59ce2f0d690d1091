"""Progress of a search: number of finished pieces, best value, and lower bound."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Step:
    """Report of the progress of a search.

    Attributes
    ----------
    within
        Names of the enclosing searches, the outermost first.
    what
        Name of the pieces that are counted, such as starts or boxes.
    done, whole
        Number of finished pieces and of all pieces; `whole` is zero if the total is unknown.
    value, bound
        Best value and lower bound so far, in the unit of the objective; infinite where not known.
    design
        Values of decisions by name [SI], if the step reports a feasible design and not the state of a search.
    """

    within: tuple[str, ...]
    what: str
    done: int = 0
    whole: int = 0
    value: float = math.inf
    bound: float = -math.inf
    design: Mapping[str, complex] | None = None

    @property
    def gap(self) -> float:
        """Relative gap between value and bound; NaN where either is not known, or the value is zero."""
        is_known = math.isfinite(self.value) and math.isfinite(self.bound) and self.value
        return max(self.value - self.bound, 0.0) / abs(self.value) if is_known else math.nan


class SearchState:
    """Last steps of nested searches, one for each depth, and the last feasible design."""

    def __init__(self) -> None:
        self._known: dict[int, Step] = {}
        self.design: Step | None = None

    def add(self, step: Step) -> None:
        """Take a step into account."""
        if step.design is not None:
            self.design = step
            return
        depth = len(step.within)
        self._known = {at: known for at, known in self._known.items() if at < depth} | {depth: step}

    @property
    def valued(self) -> Step:
        """Last step of the outermost search that knows a value; the last step of all if none does."""
        known = list(self._known.values())
        return next((step for step in known if math.isfinite(step.value)), known[-1] if known else Step((), ""))


Listener: TypeAlias = Callable[[Step], None]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)
_within: ContextVar[tuple[str, ...]] = ContextVar("within", default=())


@contextmanager
def progress_listener(listener: Listener | None) -> Iterator[None]:
    """Send progress reports of the work in the block to a listener, or to nobody."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)


@contextmanager
def search_scope(what: str) -> Iterator[None]:
    """Name the search that encloses all searches in the block."""
    before = _within.set((*_within.get(), what))
    try:
        yield
    finally:
        _within.reset(before)


def report_progress(
    what: str, done: int = 0, whole: int = 0, value: float = math.inf, bound: float = -math.inf
) -> None:
    """Send a report to the listener, if there is one; the parameters are attributes of `Step`."""
    listener = _listener.get()
    if listener is not None:
        listener(Step(_within.get(), what, done, whole, value, bound))


def report_design(value: float, names: Iterable[str], values: Iterable[complex]) -> None:
    """Send a feasible design with its objective to the listener, if there is one."""
    listener = _listener.get()
    if listener is not None:
        listener(Step(_within.get(), "evaluated design", value=value, design=dict(zip(names, values, strict=True))))


def with_progress(what: str, items: Sequence[T]) -> Iterator[T]:
    """Yield items, and report the number of finished ones before each; `what` is their name."""
    for k, item in enumerate(items):
        report_progress(what, k, len(items))
        yield item
