"""Lanes of tests: the fast one takes the first few of many, the usual one some more, `make test-long` the rest."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

LONG = Path(__file__).with_name("long.txt")
"""Costly tests of `make test-long`, each with the test, or the number of cases, of `make test` that shows the same."""


def long_and_shorter() -> dict[str, str]:
    """Return the listed tests, a whole function or one of its cases, and what stands in for each."""
    lines = LONG.read_text(encoding="utf-8").splitlines()
    return dict(line.split(" <- ") for line in lines if line and not line.startswith("#"))


def mark_long(items: Iterable[pytest.Item]) -> None:
    listed = long_and_shorter()
    families: dict[str, list[pytest.Item]] = {}
    for item in items:
        function = item.nodeid.partition("[")[0]
        if item.nodeid in listed or (function in listed and not listed[function].isdecimal()):
            item.add_marker("long")
        elif function in listed and item.get_closest_marker("long") is None:
            families.setdefault(function, []).append(item)
    for function, cases in families.items():
        for case in left_out(cases, int(listed[function])):
            case.add_marker("long")


def left_out(cases: Sequence[Any], count: int) -> list[Any]:
    """Return all cases of a family but so many, which stand at equal steps."""
    chosen = {k * len(cases) // count for k in range(count)}
    return [case for k, case in enumerate(cases) if k not in chosen]


def first_fast(values: Iterable[Any], fast: int, usual: int | None = None, long: Collection[Any] = ()) -> list[Any]:
    """Return parameters of a test, of which all but the first few are slow; a tuple is several of one case.

    Of a random family the first `usual` alone run in `make test`, as do all that `long` does not name where each stands
    for something of its own; `make test-long` runs the rest.
    """
    cases = [(value, value if isinstance(value, tuple) else (value,)) for value in values]
    left_out = [marked for marked in long if marked not in [value for value, _ in cases]]
    assert not left_out, f"no such case: {left_out}"
    last = len(cases) if usual is None else usual
    return [
        pytest.param(
            *case, marks=pytest.mark.long if k >= last or value in long else pytest.mark.slow if k >= fast else ()
        )
        for k, (value, case) in enumerate(cases)
    ]


def of_clusters(*libraries: str) -> pytest.MarkDecorator:
    """Return a mark that skips a test without these libraries, imported only when the test runs."""
    missing = [name for name in libraries if find_spec(name) is None]
    return pytest.mark.skipif(bool(missing), reason=f"without {' and '.join(missing)}: pip install 'laufruhe[cluster]'")
