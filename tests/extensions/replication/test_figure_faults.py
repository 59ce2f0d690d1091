"""No picture of the tractor study is cut, covered, small or pale; crowded bars stand in rows of one scale."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import xarray as xr
from tests.extensions.replication.conftest import parts_of

from lanes import first_fast
from laufruhe.plots.picture import draw
from laufruhe.present.picture import Bars
from picture_faults import faults_of

FIGURES = ("fig-25", "fig-10", "fig-08-09", "fig-22", "fig-32", "reciprocating-mass")


@pytest.mark.parametrize("name", first_fast(FIGURES, 0))
def test_no_figure_of_the_tractor_study_has_a_fault(name: str, figure: Callable[[str], xr.Dataset]) -> None:
    assert faults_of(draw(parts_of("tractor-study")[name].picture(figure(name)))) == []


@pytest.mark.slow
def test_crowded_bars_stand_in_rows(figure: Callable[[str], xr.Dataset]) -> None:
    """Check that six series of five groups, 30 bars too narrow for numbers, stand in rows."""
    picture = parts_of("tractor-study")["fig-25"].picture(figure("fig-25"))
    assert len(picture.panels) == 4
    for first, second in zip(picture.panels[::2], picture.panels[1::2], strict=True):
        assert first.y.ends == second.y.ends
        places = [len(next(mark for mark in panel.marks if isinstance(mark, Bars)).places) for panel in (first, second)]
        assert places == [3, 2]
