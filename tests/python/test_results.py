"""Additions of the Python interface to a result: numbers by name, progress, pictures and files."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import laufruhe
from laufruhe.errors import InputError

NAME = "tractor-four-lanchester"


@pytest.fixture(scope="module")
def result() -> laufruhe.Result:
    return laufruhe.solve(NAME)


def test_numbers_by_name_with_and_without_units(result: laufruhe.Result) -> None:
    assert result.objective is not None
    assert result["mean mount force"] == result.objective.value
    assert result.quantity("left.unbalance", "g mm").magnitude == pytest.approx(1e6 * result["left.unbalance"])
    vector = result["left.unbalance"] * np.exp(1j * result["left.angle"])
    assert result.unbalances["left"] == pytest.approx(vector, rel=1e-12)
    with pytest.raises(InputError, match="is no number of this result; it has"):
        result["lft"]


def test_decided_values_evaluate_to_the_result(result: laufruhe.Result) -> None:
    values = {decision.name: decision.value for decision in result.decisions}
    again = laufruhe.evaluate(NAME, values=values)
    assert again["mean mount force"] == pytest.approx(result["mean mount force"], rel=2e-5)


@pytest.mark.slow
def test_a_callback_sees_the_search_and_ends_it(caplog: pytest.LogCaptureFixture) -> None:
    seen: list[laufruhe.Progress] = []

    def stop(progress: laufruhe.Progress) -> bool:
        seen.append(progress)
        return bool(progress.design)

    with caplog.at_level(logging.INFO, "laufruhe"):
        result = laufruhe.solve("powertrain-joined-springs", callback=stop)
    assert result.status.has_design
    assert result.certificate is not None
    assert result.certificate.method.endswith("stopped at the time limit")
    assert [progress.time for progress in seen] == sorted(progress.time for progress in seen)
    assert seen[-1].design
    assert result.history
    assert caplog.messages == [progress.text for progress in result.history]


@pytest.mark.slow
def test_pictures_report_and_file(result: laufruhe.Result, tmp_path: Path) -> None:
    assert {"polar", "bars"} <= set(dir(result.plot))
    assert result.plot.polar().axes
    with pytest.raises(AttributeError, match="has no picture 'poler'"):
        result.plot.poler()
    result.report(tmp_path / "report.html")
    assert "<svg" in (tmp_path / "report.html").read_text() or "data:image" in (tmp_path / "report.html").read_text()
    result.report(tmp_path / "report.md")
    assert (tmp_path / "polar.svg").exists()
    result.save(tmp_path / "result.json")
    assert laufruhe.read_result(tmp_path / "result.json")["left.unbalance"] == result["left.unbalance"]


@pytest.mark.slow
def test_pictures_are_drawn_on_axes_and_figures_of_the_caller(result: laufruhe.Result) -> None:
    whole = Figure(figsize=(14.0, 6.0))
    left, right = whole.subfigures(1, 2)
    (axes, other) = left.subplots(1, 2)
    result.plot.bars(ax=axes)
    assert axes.get_title(loc="left") == "Mean and maximum mount forces"
    assert axes.get_legend() is not None
    assert not other.has_data()
    for name in ("polar", "cycle", "engine"):
        part = Figure(figsize=(9.0, 11.0)).subfigures()
        result.plot(name, figure=part)
        assert part.get_figure().get_size_inches() == pytest.approx((9.0, 11.0))
        for panel in part.axes:
            box = panel.get_tightbbox()
            assert box is not None
            assert part.bbox.contains(box.x0, box.y0)
            assert part.bbox.contains(box.x1, box.y1)
    # pictures to scale keep their scale
    scale = [panel.transData.get_matrix() for panel in part.axes]
    assert scale[0][0, 0] == pytest.approx(scale[0][1, 1])
    assert abs(scale[1][0, 0]) == pytest.approx(scale[0][0, 0])
    with pytest.raises(InputError, match="is one panel, and this picture has 4; give figure="):
        result.plot.polar(ax=axes)
    with pytest.raises(InputError, match="leaves no room for the panels, which need"):
        result.plot.polar(figure=Figure(figsize=(2.0, 2.0)))
    with pytest.raises(InputError, match="stands beside ax; give one of both"):
        result.plot.bars(ax=axes, figure=right)


def test_a_notebook_shows_tables(result: laufruhe.Result) -> None:
    text = result._repr_html_()
    assert "the proven optimum" in text
    assert ">left.unbalance</th>" in text
    assert ">front left</th>" in text
    problem = laufruhe.load(NAME)._repr_html_()
    assert "Minimise mean mount force." in problem
    assert "<td>0 to 0.05 kg m</td>" in problem
    assert "<td>4 kg</td>" in problem
    named = laufruhe.load({**laufruhe.load(NAME).origin.tables, "title": "<script>"})  # type: ignore[union-attr]
    assert "<script" not in named._repr_html_()
