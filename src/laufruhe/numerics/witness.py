"""Known designs as witnesses of bounds: a lower bound above the value of a design that exists is an error.

Bounds are raw: nobody lowers one to a value. Each is compared with what is known, and what contradicts is reported
to the solve that asked, which then withholds its proof. Where nobody collects reports, and wherever the environment
has LAUFRUHE_STRICT, the error is raised.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from laufruhe.errors import BoundError

EXCESS = 1e-9
"""Relative excess of a bound over a value that is a rounding."""
STRICT = "LAUFRUHE_STRICT"
"""Environment variable; where it is set, a contradiction is raised."""

_reports: ContextVar[list[BoundError] | None] = ContextVar("reports", default=None)


def is_over(bound: float, value: float, nothing: float = 0.0) -> bool:
    """Return whether a bound lies over a value, or is no number.

    Parameters
    ----------
    nothing
        Difference that counts as zero.
    """
    return not bound <= value + EXCESS * abs(value) + nothing


def check_bound(what: str, bound: float, value: float, nothing: float = 0.0) -> bool:
    """Return whether a bound agrees with the value of a design that it is of; report it where it does not."""
    if not is_over(bound, value, nothing):
        return True
    report(BoundError(what, bound, value))
    return False


def report(error: BoundError) -> None:
    """Tell the solve that asked of a contradiction.

    Raises
    ------
    BoundError
        Where nobody collects reports, or the environment is strict.
    """
    reports = _reports.get()
    if reports is None or os.environ.get(STRICT):
        raise error
    reports.append(error)


@contextmanager
def collected() -> Iterator[list[BoundError]]:
    """Collect the contradictions that are reported within."""
    reports: list[BoundError] = []
    before = _reports.set(reports)
    try:
        yield reports
    finally:
        _reports.reset(before)
