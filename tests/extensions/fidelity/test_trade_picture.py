"""Names of all fidelities in the picture of a trade, also where points coincide."""

from __future__ import annotations

import math
from itertools import combinations, pairwise
from typing import Any, cast

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from cli import scenes
from laufruhe.extensions.fidelity import trade_picture
from laufruhe.extensions.fidelity.trade import Trade, TradeRow
from picture_faults import faults_of

ROWS = 16


def _trade(errors: list[float]) -> Trade:
    rows = tuple(
        TradeRow(f"fidelity {k}, 720 steps", error, 2.0 * error, 1e-5 * (k + 1.0), math.nan, math.nan,
                 0.01 * (k + 1.0), error, 1e5, math.nan, math.nan, math.nan)
        for k, error in enumerate(errors)
    )  # fmt: skip
    unused = cast(Any, None)
    return Trade(scenes.problem_of(scenes.PARTS), rows, 1.0, 0.5, unused)


@pytest.mark.parametrize(
    "errors", [[0.0] * (ROWS - 1) + [1.0], [1e-3] * ROWS, [10.0 ** (-0.4 * k) for k in range(ROWS)], [0.02]]
)
def test_names_cover_neither_each_other_nor_the_panel(errors: list[float]) -> None:
    figure = trade_picture.figure(_trade(errors))
    assert faults_of(figure) == []
    canvas = cast(FigureCanvasAgg, figure.canvas)
    canvas.draw()
    renderer = canvas.get_renderer()
    assert len(figure.axes) == 2
    for axes in figure.axes:
        names = [text for text in axes.texts if text.get_text().startswith("fidelity")]
        assert [name.get_text() for name in names] == [f"fidelity {k}, 720 steps" for k in range(len(errors))]
        places = [name.get_window_extent(renderer) for name in names]
        assert not any(one.overlaps(other) for one, other in combinations(places, 2))
        panel = axes.get_window_extent()
        assert all(box.x0 > panel.x1 and box.x1 < figure.bbox.x1 for box in places)


def test_names_stand_in_the_order_of_their_errors() -> None:
    errors = [1e-2, 1e-5, 1e-2, 1e-4, 0.5]
    figure = trade_picture.figure(_trade(errors))
    heights = {error: text.get_position()[1] for error, text in zip(errors, figure.axes[0].texts, strict=True)}
    assert all(heights[low] < heights[high] for low, high in pairwise(sorted(heights)))
