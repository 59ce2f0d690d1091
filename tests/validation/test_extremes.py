"""Guarantees of all entries of results/benchmarks/extremes.md."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from validation import extremes


@pytest.mark.parametrize("make", extremes.ENTRIES, ids=lambda make: make.__name__)
def test_guarantee_is_kept(make: Callable[[], extremes.Entry]) -> None:
    entry = make()
    assert entry.measured <= entry.limit, entry
