"""Claims about random problems on elastic mounts, judged by searches that know only the exact model."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from lanes import first_fast
from mounts.random_mounts import FAMILIES, complaints, drawn_problem

# the cheapest of each family
FIRST = {
    "two": 100, "one": 101, "four": 102, "convex": 100, "tied": 102, "lossy": 103, "placed": 100, "joint": 102,
    "gas": 101,
}  # fmt: skip
CASES = [(seed, family) for family, seed in FIRST.items()]
CASES += [case for case in itertools.product(range(100, 103), FAMILIES) if case not in CASES]


@pytest.mark.parametrize(("seed", "family"), first_fast(CASES, 1, len(FIRST)))
def test_no_claim_is_beaten(seed: int, family: str, tmp_path: Path) -> None:
    """Check that no design is below a bound, allowed where infeasible, or better than the result."""
    assert set(FIRST) == set(FAMILIES)
    assert not complaints(drawn_problem(family, seed, tmp_path), seed, budget=90)
