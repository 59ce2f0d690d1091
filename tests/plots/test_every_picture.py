"""No picture of any result is cut, covered, small or pale; and all can be read by those who see fewer colours."""

from __future__ import annotations

import importlib
from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.text import Annotation, Text
from scipy.optimize import isotonic_regression

import ready
from lanes import first_fast
from laufruhe.extensions.flywheel import picture as torque
from laufruhe.plots import figure, names, style
from laufruhe.plots.results import firings
from laufruhe.plots.style import page
from laufruhe.plots.words import (
    FAINT,
    INK,
    READ,
    contrast,
    grouped,
    ink_on,
    label_lines,
    legible,
    spread,
    typeset,
    wrap_lines,
)
from laufruhe.present import picture
from laufruhe.present.pictures import PICTURES, rows_of
from picture_faults import faults_of

# layouts, cycles, mounts, what is open: each fills other pictures
MODELS = (
    "vee-two-90", "rotary-two", "soft-mounts-run-up", "waterworks-steam-pump", "radial-seven",
    "tractor-four-bearings", "inline-five-torsion", "inline-seven-uneven", "car-four-willans",
    "twin-parallel-360",
)  # fmt: skip
# the first of these that has a picture of a kind is looked at for it; `make test-long` looks at all that each has


@pytest.mark.parametrize(
    ("name", "whole"), first_fast([(name, k > 0) for k in (0, 1) for name in MODELS], 3, len(MODELS))
)
def test_no_picture_has_a_fault(name: str, whole: bool) -> None:
    result = ready.solved(name)
    earlier = {of for other in MODELS[: MODELS.index(name)] for of in names(ready.solved(other))}
    kinds = [of for of in names(result) if whole or of not in earlier]
    assert {of: found for of in kinds if (found := faults_of(figure(result, of), result.problem.title))} == {}


@pytest.mark.slow
def test_every_picture_is_looked_at() -> None:
    kinds = {of: importlib.import_module(picture.module) for of, picture in PICTURES.items() if not picture.home}
    assert {of for of, kind in kinds.items() if any(kind.applies(ready.solved(name)) for name in MODELS)} == set(kinds)


# Machado, Oliveira and Fernandes 2009, of severity 1, on linear RGB
SEEN = {
    "all": np.eye(3),
    "no red cones": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no green cones": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(colour: str, eye: str) -> np.ndarray:
    """Return the CIE L*a*b* of a colour as an eye sees it."""
    rgb = np.array(to_rgb(colour))
    linear = np.clip(SEEN[eye] @ np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4), 0.0, 1.0)
    x, y, z = np.cbrt(np.maximum(TO_XYZ @ linear / (0.9505, 1.0, 1.089), 1e-4))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


SIDE_BY_SIDE = {
    "before and after": (style.BEFORE, style.AFTER),
    "torque": tuple(torque.COLOURS.values()),
    "firings": (*firings.BEST, *firings.NEXT),
    "series of studies": tuple(getattr(style, str(name).upper()) for name in picture.SERIES[:6]),
}


@pytest.mark.parametrize("eye", SEEN)
@pytest.mark.parametrize("name", SIDE_BY_SIDE)
def test_colours_side_by_side_differ(name: str, eye: str) -> None:
    for one, other in combinations(SIDE_BY_SIDE[name], 2):
        assert np.linalg.norm(lab(one, eye) - lab(other, eye)) > 12.0, (one, other)


def test_letters_are_read_on_every_colour() -> None:
    for colour in ("#8a8a8a", "#56B4E9", "#0072B2", "#E69F00", "#D55E00", "#009E73", "#CC79A7", "#8fc4e8", "#ffffff"):
        assert contrast(legible(colour), "#ffffff") >= READ
        assert contrast(ink_on(colour), colour) >= READ - 0.6
    assert contrast(FAINT, "#ffffff") >= READ
    assert legible(INK) == INK


def test_places_are_spread_as_little_as_may_be() -> None:
    places = np.array([0.5, 0.52, 0.9, 0.1])
    moved = spread(places, 0.1)
    assert moved == pytest.approx([0.46, 0.56, 0.9, 0.1])
    assert np.diff(np.sort(spread(np.full(9, 1.0), 0.1))) == pytest.approx(np.full(8, 0.1))
    assert spread(np.full(9, 1.0), 0.1).max() <= 1.0 + 1e-12
    assert spread(np.array([]), 0.1).size == 0


@pytest.mark.parametrize("count", [1, 2, 7, 30])
def test_spread_places_are_moved_by_the_least_squares(count: int) -> None:
    """Compare spread places with isotonic regression of SciPy."""
    places = np.sort(np.random.default_rng(count).random(count))
    steps = 0.01 * np.arange(count)
    other = np.clip(isotonic_regression(places - steps).x, 0.0, 1.0 - steps[-1]) + steps
    assert spread(places, 0.01) == pytest.approx(other, abs=1e-12)


def test_words_are_set_as_print_sets_them() -> None:
    assert typeset("inertia [kg m^2]") == "inertia [kg m²]"
    assert typeset("throw [deg]") == "throw [°]"
    assert grouped("−12500.5") == "−12\u2009500.5"
    assert grouped("2500") == "2500"
    assert [rows_of(count, 6)[1] for count in (0, 1, 6, 7, 8, 13)] == [1, 1, 6, 4, 4, 5]
    assert " ".join(wrap_lines("one two three four", 0.6)) == "one two three four"
    assert len(wrap_lines("one two three four", 0.6)) > 1


def test_leaders_of_crowded_names_run_under_no_word() -> None:
    axes = page(1, 1, (4.0, 3.0)).panels[0]
    axes.set_ylim(0.0, 20.0)
    label_lines(axes, [6.0, 6.18, 6.38, 6.58, 14.0], ["lateral", "bounce", "bounce-fore-aft", "yaw", "roll"])
    axes.figure.draw_without_rendering()
    notes = [text for text in axes.texts if isinstance(text, Annotation)]
    assert len(notes) == 5
    for note in notes:
        assert note.arrow_patch is not None
        path = note.arrow_patch.get_transform().transform_path(note.arrow_patch.get_path())
        words = Text.get_window_extent(note)
        assert path.vertices[:, 0].max() <= words.x0 + 1.0
