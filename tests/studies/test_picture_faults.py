"""No picture of a study is cut, covered, small or pale; crowded bars stand in rows of one scale."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr
from tests.studies.conftest import parts_of

from lanes import first_fast
from laufruhe.plots.picture import draw
from laufruhe.present.pictures import rows_of
from laufruhe.studies.kinds import KINDS
from laufruhe.studies.picture import WIDEST, Bars, Picture
from picture_faults import faults_of

FIGURES = ("fig-25", "fig-10", "fig-08-09", "fig-22", "fig-32", "reciprocating-mass")


@pytest.mark.parametrize("name", first_fast(FIGURES, 0))
def test_no_figure_of_the_tractor_study_has_a_fault(name: str, figure: Callable[[str], xr.Dataset]) -> None:
    assert faults_of(draw(parts_of("tractor-study")[name].picture(figure(name)))) == []


@pytest.mark.slow
def test_crowded_bars_stand_in_rows(figure: Callable[[str], xr.Dataset]) -> None:
    """Six series for five places: 30 bars in a row leave no room for their numbers."""
    picture = parts_of("tractor-study")["fig-25"].picture(figure("fig-25"))
    assert len(picture.panels) == 4
    for first, second in zip(picture.panels[::2], picture.panels[1::2], strict=True):
        assert first.y.ends == second.y.ends
        places = [len(next(mark for mark in panel.marks if isinstance(mark, Bars)).places) for panel in (first, second)]
        assert places == [3, 2]


def cases(names: list[str]) -> Picture:
    """Bars as a comparison of layouts draws them."""
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
