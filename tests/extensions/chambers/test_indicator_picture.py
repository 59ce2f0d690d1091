"""Indicator diagrams are drawn as they are computed, with their words apart."""

from __future__ import annotations

import math

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.chambers import picture as indicator
from laufruhe.extensions.chambers.gas import Chambers, Steam
from laufruhe.plots.results import cycle, engine
from laufruhe.solvers import Result
from one_cylinder import mean_pressure_of
from picture_faults import drawn_texts, overlaps
from problem_files import PROBLEMS

READY = PROBLEMS / "waterworks-steam-pump.toml"


@pytest.fixture(scope="module")
def result() -> Result:
    return laufruhe.evaluate(READY)


def test_lines_enclose_the_work_of_their_diagrams(result: Result) -> None:
    assert indicator.applies(result)
    gas = result.problem.points[0].gas
    assert isinstance(gas, Chambers)
    panels = indicator.figure(result).axes
    for k, part in enumerate(result.final.engine.slider_cranks):
        lines = panels[2 * k].lines
        for chamber, line in zip(gas.of(part), lines, strict=True):
            if isinstance(chamber.diagram, Steam):
                x, p = np.asarray(line.get_xydata()).T
                area = chamber.side * float(np.trapezoid(p, x))
                assert area == pytest.approx(1e-5 * mean_pressure_of(chamber.diagram), rel=2e-3)


def test_force_on_the_rod_is_drawn_out_and_back(result: Result) -> None:
    axes = indicator.figure(result).axes[1]
    out, needed, *_ = axes.lines
    x, force = np.asarray(out.get_xydata()).T
    # at the head end the steam presses with 6 at on F', less the exhaust on F'' and both pumps
    assert force[np.argmin(np.abs(x - 0.1))] == pytest.approx(
        9.80665e-3 * (6.0 * 1546.3 - 1.0 * 1511.9 - 3490.0), rel=0.01
    )
    assert np.max(needed.get_ydata()) == pytest.approx(830.0 * 0.4 * (50.0 * math.tau / 60.0) ** 2 * 1.2e-3, rel=1e-3)


def test_words_stand_apart(result: Result) -> None:
    figure = indicator.figure(result)
    assert not overlaps(drawn_texts(figure))


def test_engines_without_chambers_have_none() -> None:
    assert not indicator.applies(laufruhe.evaluate(READY.with_name("tractor-single.toml")))


def test_nothing_is_said_to_fire(result: Result) -> None:
    for picture in (cycle, engine):
        words = " ".join(text.get_text() for text in picture.figure(result).texts)
        assert "fir" not in words.replace("first", "")
        assert "dead centre" in words
