"""Check of lower bounds by witnesses: a bound above the value of a known design is an error.

Bounds are never lowered to the value of a design. Each is compared with known values, and a contradiction is reported
to the current solve, which then gives no certificate. Without a collector of reports, or with LAUFRUHE_STRICT in the
environment, the error is raised.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from laufruhe.errors import BoundError

EXCESS = 1e-9
"""Relative excess of a bound over a value that counts as rounding error."""
STRICT = "LAUFRUHE_STRICT"
"""Environment variable; if it is set, a contradiction is raised at once."""

_reports: ContextVar[list[BoundError] | None] = ContextVar("reports", default=None)


def is_over(bound: float, value: float, zero_level: float = 0.0) -> bool:
    """Return True if a lower bound exceeds the value of a known design by more than `zero_level`, or is NaN."""
    return not bound <= value + EXCESS * abs(value) + zero_level


def check_bound(what: str, bound: float, value: float, zero_level: float = 0.0) -> bool:
    """Return True if a lower bound does not exceed a known design's objective; else report a contradiction.

    `what` names the bound in the report. An absolute difference up to `zero_level` counts as zero.
    """
    if not is_over(bound, value, zero_level):
        return True
    report(BoundError(what, bound, value))
    return False


def report(error: BoundError) -> None:
    """Report a contradiction to the collector of the current solve.

    Raises
    ------
    BoundError
        Without a collector, or with LAUFRUHE_STRICT in the environment.
    """
    reports = _reports.get()
    if reports is None or os.environ.get(STRICT):
        raise error
    reports.append(error)


@contextmanager
def collected() -> Iterator[list[BoundError]]:
    """Yield a list that collects the contradictions reported in the block."""
    reports: list[BoundError] = []
    before = _reports.set(reports)
    try:
        yield reports
    finally:
        _reports.reset(before)
