"""Letters that the font of pictures lacks: another installed font draws them, or a warning names them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from fontTools.fontBuilder import FontBuilder
from fontTools.pens.ttGlyphPen import TTGlyphPen
from matplotlib.font_manager import fontManager
from PIL import Image

from cli import scenes
from laufruhe.errors import LaufruheWarning
from laufruhe.plots import draw, letters
from laufruhe.plots.style import styled
from laufruhe.plots.words import width_of
from laufruhe.solvers import Result

SUN, MOON = "\u65e5", "\u6708"


def install(folder: Path, name: str, drawn: str) -> None:
    """Install a font with these letters alone, each a square of the height of a line."""
    pen = TTGlyphPen(None)
    for k, corner in enumerate([(0, 0), (0, 900), (900, 900), (900, 0)]):
        (pen.lineTo if k else pen.moveTo)(corner)
    pen.closePath()
    names = [".notdef", *(f"letter{k}" for k in range(len(drawn)))]
    made = FontBuilder(1000, isTTF=True)
    made.setupGlyphOrder(names)
    made.setupCharacterMap({ord(letter): names[1 + k] for k, letter in enumerate(drawn)})
    made.setupGlyf(dict.fromkeys(names, pen.glyph()))
    made.setupHorizontalMetrics(dict.fromkeys(names, (1000, 0)))
    made.setupHorizontalHeader(ascent=900, descent=-100)
    made.setupNameTable({"familyName": name, "styleName": "Regular"})
    made.setupOS2()
    made.setupPost()
    path = folder / f"{name}.ttf"
    made.save(path)
    fontManager.addfont(path)
    letters._other_fonts.cache_clear()


@pytest.fixture(autouse=True)
def few_fonts(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Leave only the fonts of matplotlib, and remove installed fonts after the test."""
    monkeypatch.setattr(fontManager, "ttflist", [e for e in fontManager.ttflist if e.name.startswith("DejaVu")])
    monkeypatch.setattr(letters, "_stand_ins", {})
    letters._other_fonts.cache_clear()
    yield
    letters._other_fonts.cache_clear()


def named(title: str) -> Result:
    result = scenes.stated(scenes.GIVEN)
    return replace(result, problem=replace(result.problem, title=title))


def test_an_installed_font_stands_in(tmp_path: Path) -> None:
    install(tmp_path, "Sun Sans", SUN)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        letters.prepare([f"engine {SUN}"])
    assert letters.families() == [letters.FONT, "Sun Sans"]
    # as wide as the font has it: a square
    assert width_of(SUN, 72.0) == pytest.approx(1.0, abs=0.02)
    with styled():
        assert mpl.rcParams["font.family"] == ["DejaVu Sans", "Sun Sans"]


@pytest.mark.slow
def test_a_picture_has_the_letters_of_that_font(tmp_path: Path) -> None:
    install(tmp_path, "Sun Sans", SUN)
    draw(named(10 * SUN), tmp_path / "sun")
    with pytest.warns(LaufruheWarning, match="no installed font has"):
        draw(named(10 * MOON), tmp_path / "moon")
    places = (tmp_path / name / "spectrum.png" for name in ("sun", "moon"))
    sun, moon = ((np.asarray(Image.open(place).convert("L"))[92:104, 50:240] < 80).mean() for place in places)
    # squares are full, what stands in for a letter is not
    assert sun > 0.7 > moon


def test_the_font_of_a_letter_is_independent_of_earlier_texts(tmp_path: Path) -> None:
    for name, has in (("Both Sans", SUN + MOON), ("A Sun Sans", SUN), ("Moon", MOON)):
        install(tmp_path, name, has)
    for texts in ([MOON, SUN], [SUN, MOON], [SUN + MOON]):
        letters._stand_ins.clear()
        for text in texts:
            letters.prepare([text])
        assert letters.families() == [letters.FONT, "Both Sans"]


def test_letters_that_no_font_has_are_named_once() -> None:
    with pytest.warns(LaufruheWarning, match=f"no installed font has '{SUN}'"):
        letters.prepare([SUN, "engine"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        letters.prepare([SUN, "\u00b5m, 12 m\u00b2, \u03a6"])
    assert letters.families() == [letters.FONT]
