"""No picture of a study is cut, covered, small or pale; crowded bars stand in rows of one scale."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from lanes import first_fast
from laufruhe.plots.picture import draw
from laufruhe.present.picture import WIDEST, Bars, Picture
from laufruhe.present.pictures import rows_of
from laufruhe.studies.kinds import KINDS
from picture_faults import faults_of


def cases(names: list[str]) -> Picture:
    """Return the bars as a comparison of layouts draws them."""
    count = len(names)
    data = xr.Dataset(
        {
            "objective": ("point", np.linspace(100.0, 900.0, count), {"units": "N"}),
            "objective_given": ("point", np.full(count, 950.0), {"units": "N"}),
            "lower_bound": ("point", np.linspace(100.0, 900.0, count), {"units": "N"}),
            "proof": ("point", ["global"] * count),
        },
        coords={"case": ("point", names)},
        attrs={"metric": "mean mount force", "title": "t", "source": "", "at": "equal cylinders"},
    )
    return KINDS["layout comparison"].picture(data)


@pytest.mark.parametrize("count", first_fast([2, 5, 13, 29], 2))
def test_bars_of_many_cases_have_no_fault(count: int) -> None:
    picture = cases([f"case {k} with a name as long as this" for k in range(count)])
    assert picture.width <= WIDEST
    shown = [mark for panel in picture.panels for mark in panel.marks if isinstance(mark, Bars)]
    assert len(shown) == 2 * count
    assert len({panel.y.ends for panel in picture.panels}) == 1
    assert faults_of(draw(picture)) == []


def test_rows_are_about_as_long() -> None:
    rows, side = rows_of(13, 6)
    assert [len(row) for row in rows] == [5, 5, 3]
    assert side == 5
    assert [list(row) for row in rows_of(4, 9)[0]] == [[0, 1, 2, 3]]
