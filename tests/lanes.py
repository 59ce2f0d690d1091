"""What the fast lane takes of many."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def first_fast(values: Iterable[Any], fast: int) -> list[Any]:
    """Parameters of a test, of which all but the first few are slow; a tuple is several of one case."""
    cases = [value if isinstance(value, tuple) else (value,) for value in values]
    return [pytest.param(*case, marks=pytest.mark.slow if k >= fast else ()) for k, case in enumerate(cases)]
