"""Pictures of stars, firings and the trade, and the command that makes them."""

import math

import numpy as np
import pytest
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.plots.results import firings, star, trade
from laufruhe.solvers import solve
from phasing import engines
from problem_files import PROBLEMS


@pytest.fixture(scope="module")
def uneven(tmp_path_factory):
    folder = tmp_path_factory.mktemp("uneven")
    allowed = 'intervals = { largest_deviation = "5 deg" }\nbest = 2'
    return solve(engines.problem(folder, 5, "four-stroke", phasing=allowed))


def test_pins_stand_where_the_throws_do(uneven):
    axes = star.figure(uneven).axes[0]
    best = uneven.phasing.ranking[0]
    pins = [patch.center for patch in axes.patches if patch.get_edgecolor() != (0.0, 0.0, 0.0, 0.0)][1:]
    expected = [(math.sin(angle), math.cos(angle)) for angle in best.throws]
    for place in expected:
        assert min(math.dist(place, pin) for pin in pins) < 1e-12


def test_firings_fill_the_cycle(uneven):
    axes = firings.figure(uneven).axes[0]
    first = [bar for bar in axes.patches if bar.get_y() + 0.5 * bar.get_height() == pytest.approx(0.0)]
    assert sum(bar.get_width() for bar in first) == pytest.approx(720.0)
    intervals = np.degrees(uneven.phasing.ranking[0].firing_orders[0].intervals)
    assert [bar.get_width() for bar in first] == pytest.approx(list(intervals))


def test_the_trade_lies_above_its_bound(uneven):
    design, dots, bound = trade.figure(uneven).axes[0].lines[:3]
    del dots
    assert np.all(np.diff(design.get_ydata()) <= 0.0)
    assert bound.get_ydata()[0] <= design.get_ydata()[0]


def test_command_writes_rankings_and_pictures(tmp_path):
    answer = CliRunner().invoke(app, ["solve", str(PROBLEMS / "inline-five-open.toml"), "--out", str(tmp_path)])
    assert answer.exit_code == 0
    assert {"star.svg", "firings.svg", "report.md", "result.json"} <= {path.name for path in tmp_path.iterdir()}
    report = (tmp_path / "report.md").read_text(encoding="utf-8")
    assert "## Crank stars" in report
    assert "1-3-5-4-2" in report


def test_command_fails_on_what_cannot_be(tmp_path):
    text = (PROBLEMS / "inline-five-open.toml").read_text(encoding="utf-8")
    path = tmp_path / "bad.toml"
    path.write_text(text.replace("best = 8", 'best = 8\nintervals = { max = "100 deg" }'), encoding="utf-8")
    answer = CliRunner().invoke(app, ["solve", str(path), "--out", str(tmp_path / "out"), "--no-plots"])
    assert answer.exit_code == 1
    assert "no crank star can keep the firing intervals" in answer.output
