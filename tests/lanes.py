"""What the lanes take of many: the fast one the first few, the usual one what is quick, `make test-long` the rest."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from importlib.util import find_spec
from typing import Any

import pytest


def first_fast(values: Iterable[Any], fast: int, long: Collection[Any] = ()) -> list[Any]:
    """Parameters of a test, of which all but the first few are slow; a tuple is several of one case.

    Of random families those named `long` take seconds each and guard no defect that is known;
    `make test-long` runs them.
    """
    cases = [(value, value if isinstance(value, tuple) else (value,)) for value in values]
    left_out = [marked for marked in long if marked not in [value for value, _ in cases]]
    assert not left_out, f"no such case: {left_out}"
    return [
        pytest.param(*case, marks=pytest.mark.long if value in long else pytest.mark.slow if k >= fast else ())
        for k, (value, case) in enumerate(cases)
    ]


def of_clusters(*libraries: str) -> pytest.MarkDecorator:
    """Skipped where one of these is not installed; imported only where a test runs, which takes every process time."""
    missing = [name for name in libraries if find_spec(name) is None]
    return pytest.mark.skipif(bool(missing), reason=f"without {' and '.join(missing)}: pip install 'laufruhe[cluster]'")
