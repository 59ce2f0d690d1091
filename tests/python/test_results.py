"""What Python calls add to a result: numbers by name, progress, pictures and files."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

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
        found = laufruhe.solve("powertrain-least-force", callback=stop)
    assert found.status.has_design
    assert found.certificate is not None
    assert found.certificate.method.endswith("stopped at the time limit")
    assert [progress.time for progress in seen] == sorted(progress.time for progress in seen)
    assert seen[-1].design
    assert found.history
    assert caplog.messages == [progress.text for progress in found.history]


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
