"""The pictures of crank stars and of the mass ellipse are those that their script draws."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
SCRIPT = runpy.run_path(str(DOCS / "extensions" / "crank_drawings.py"))


@pytest.mark.parametrize("name", SCRIPT["DRAWINGS"])
def test_pictures_are_up_to_date(name: str) -> None:
    """`python docs/extensions/crank_drawings.py` draws them."""
    assert (DOCS / "pictures" / name).read_text(encoding="utf-8") == SCRIPT["DRAWINGS"][name]()


def test_a_six_cylinder_has_no_force_and_no_couple() -> None:
    picture = SCRIPT["crank_stars"]()
    assert picture.count("force 0, couple 0") == 3
    assert picture.count("force 4, couple 0") == 1
