"""Throws, bank angle and split pin that move from a star, as numbers of the design."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from laufruhe.files.reader import load_tables
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.problem.phasing import Candidate

TABLE = {
    "title": "vee two", "operating_points": [{"speed": "2000 rpm"}], "objective": {"minimise": "rms shaking force"},
    "engine": {"layout": "vee", "cycle": "four-stroke", "cylinders": 2, "stroke": "80 mm", "rod_ratio": 0.28,
               "reciprocating_mass": "0.5 kg", "throws": "open", "bank_angle": {"between": [60, 100]},
               "split_pin_angle": {"between": [-20, 20]}},
    "phasing": {"intervals": {"min": "0 deg", "max": "720 deg"}},
}  # fmt: skip


def test_a_bank_and_a_split_pin_move_by_what_they_are_moved() -> None:
    """Check that both move up with their number, within bounds, half of each with the first throw."""
    phasing = load_tables(TABLE, Path("vee.toml")).phasing
    assert phasing is not None
    bank, split = math.radians(70.0), math.radians(5.0)
    start = Candidate((0.5,), (1, 2), bank, split)
    moves = ThrowMoves(phasing, phasing.layout(bank, split), start, phasing.intervals)
    assert moves.size == 2
    moved = moves.candidate(np.array([0.1, -0.2]))
    assert (moved.bank_angle, moved.split_pin) == pytest.approx((bank + 0.1, split - 0.2))
    assert moved.throws == pytest.approx((0.5 + 0.5 * 0.1 - 0.5 * 0.2,))
    ends = [moves.candidate(end) for end in (moves.lower, moves.upper)]
    found = [(end.bank_angle, end.split_pin) for end in ends]
    assert np.degrees(found) == pytest.approx(np.array([[60.0, -20.0], [100.0, 20.0]]))
