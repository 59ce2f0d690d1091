"""Claims about random problems on elastic mounts, judged by searches that know only the exact model."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from lanes import first_fast
from mounts.random_mounts import FAMILIES, complaints, drawn_problem

CASES = list(itertools.product(range(100, 103), FAMILIES))
LONG = [
    (100, "gas"),
    (100, "four"),
    (100, "tied"),
    (100, "joint"),
    (100, "one"),
    (101, "lossy"),
    (101, "tied"),
    (102, "gas"),
    (102, "lossy"),
    (102, "one"),
    (101, "four"),
    (101, "two"),
    (101, "placed"),
    (101, "joint"),
]


@pytest.mark.parametrize(("seed", "family"), first_fast(CASES, 3, LONG))
def test_no_claim_is_beaten(seed: int, family: str, tmp_path: Path) -> None:
    """No design under a bound, none allowed where none is said to be, none worse than the one given, no traceback."""
    assert not complaints(drawn_problem(family, seed, tmp_path), seed, budget=90)
