"""Pictures of cranks and mounts are those that their scripts draw, and show what the pages say of them."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / "docs"
sys.path.append(str(DOCS / "extensions"))

import crank_drawings  # noqa: E402
import mount_drawings  # noqa: E402

DRAWINGS = crank_drawings.DRAWINGS | mount_drawings.DRAWINGS


@pytest.mark.parametrize("name", DRAWINGS)
def test_pictures_are_up_to_date(name: str) -> None:
    """`python docs/extensions/crank_drawings.py` and `mount_drawings.py` draw them."""
    assert (DOCS / "pictures" / name).read_text(encoding="utf-8") == DRAWINGS[name]()


def test_a_six_cylinder_has_no_force_and_no_couple() -> None:
    picture = crank_drawings.crank_stars()
    assert picture.count("force 0, couple 0") == 3
    assert picture.count("force 4, couple 0") == 1


@pytest.mark.parametrize(("low", "high"), list(pairwise(mount_drawings.ENDS.tolist())))
def test_lines_of_boxes_lie_below_the_objective(low: float, high: float) -> None:
    stiffness = np.linspace(low, high, 101)
    line = np.interp(stiffness, [low, high], mount_drawings.lower_line(low, high))
    assert np.all(line < mount_drawings.transmitted(stiffness))
