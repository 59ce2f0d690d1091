"""Pictures of study parts: axes, points without a design, and points far apart."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from laufruhe.plots.picture import draw
from laufruhe.present.picture import Axis, Panel, Picture, Words
from laufruhe.studies.kinds import KINDS


def part(objective: list[float], proof: list[str], **coords: list[object]) -> xr.Dataset:
    """Return a dataset as studies make it, of these objectives."""
    names = [f"case {k}" for k in range(len(objective))]
    values = {name: ("point", np.array(entries)) for name, entries in {"case": names, **coords}.items()}
    data = xr.Dataset(
        {
            "objective": ("point", objective, {"units": "N"}),
            "objective_given": ("point", [30000.0] * len(objective), {"units": "N"}),
            "lower_bound": ("point", objective, {"units": "N"}),
            "proof": ("point", proof),
        },
        coords=values,
        attrs={"metric": "mean mount force", "title": "t", "source": "", "at": "equal cylinders"},
    )
    for name in coords:
        data[name].attrs.update({"units": "rpm", "long_name": name, "swept": 1})
    return data


def test_a_case_without_a_design_says_so_in_its_place() -> None:
    figure = draw(KINDS["layout comparison"].picture(part([21050.7, np.nan], ["global", "none"])))
    axes = figure.axes[0]
    shown = {text.get_text(): text.get_position()[0] for text in axes.texts}
    low, high = axes.get_xlim()
    assert low < shown["no design"] < high
    assert "21\u2009051" in shown, "no exponents on bars"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["initial", "proven optimum"]


@pytest.mark.parametrize(
    ("speeds", "scale"),
    [([1000.0, 2000.0, 4000.0, 8000.0], "log"), ([1000.0, 2000.0, 3000.0, 4000.0], "linear"), ([1.0, 2.0], "linear")],
)
def test_values_that_grow_by_a_factor_stand_on_a_logarithmic_axis(speeds: list[float], scale: str) -> None:
    data = part([1.0 + speed for speed in speeds], ["nothing open"] * len(speeds), speed=list(speeds))
    data = data.assign_coords(case=("point", ["one"] * len(speeds)))
    axes = draw(KINDS["layout comparison"].picture(data)).axes[0]
    assert axes.get_xscale() == scale
    ticks = [float(label.get_text().replace("−", "-")) for label in axes.get_xticklabels() if label.get_text()]
    assert sum(speeds[0] <= tick <= speeds[-1] for tick in ticks) >= 2


@pytest.mark.parametrize(
    ("cases", "speeds", "at", "words"),
    [
        (["a", "b"], {}, "equal cylinders", "Engines of equal cylinders."),
        (["a", "b"], {}, "the power of 4 cylinders", "At the power of 4 cylinders."),
        (["a", "b"], {"speed": [1.0, 2.0]}, "equal cylinders", "Every point: proven optimum."),
        (["a", "a"], {"speed": [1.0, 2.0]}, "equal cylinders", "Every point: proven optimum."),
        (["a", "b"], {"speed": [1.0, 2.0]}, "the power of 4 cylinders",
         "At the power of 4 cylinders. Every point: proven optimum."),
    ],
)  # fmt: skip
def test_a_sweep_says_what_its_points_are(
    cases: list[str], speeds: dict[str, list[object]], at: str, words: str
) -> None:
    """Check that one engine with two limits is not described as engines of equal cylinders."""
    data = part([2.0, 1.0], ["global"] * 2, **speeds).assign_coords(case=("point", cases)).assign_attrs(at=at)
    assert KINDS["layout comparison"].picture(data).words == words


def test_words_move_apart_by_the_same_length_in_png_and_svg() -> None:
    """A picture is laid out at the resolution of PNG, and SVG is drawn at 72 dots an inch."""
    panel = Panel([Words(0.5, 0.5, "one"), Words(0.5, 0.5, "two")], Axis(ends=(0.0, 1.0)), Axis(ends=(0.0, 1.0)))
    figure = draw(Picture("title", "words", [panel], "credit"))

    def heights() -> list[float]:
        places = (text.get_transform().transform(text.get_position()) for text in figure.axes[0].texts)
        return [float(place[1] / figure.dpi) for place in places]

    first, second = heights()
    assert abs(first - second) > 0.1
    figure.set_dpi(72.0)
    assert heights() == pytest.approx([first, second], abs=1e-3)
