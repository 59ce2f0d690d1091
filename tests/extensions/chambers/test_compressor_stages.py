"""Pressures between compressor stages: closed form of isothermal stages, and balance of every link."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from laufruhe.extensions.chambers.stages import Stage, links_of, matched_pressures
from laufruhe.present.gas_figures import gas_note
from problem_files import PROBLEMS, loaded

STAGES = [
    Stage("first", 4e-3, 1e5, 3e5, 0.05, 1.3),
    Stage("second", 1.5e-3, 3e5, 9e5, 0.07, 1.2),
    Stage("third", 0.5e-3, 9e5, 30e5, 0.06, 1.35),
]


def test_isothermal_stages_have_the_pressure_of_a_linear_equation() -> None:
    """Compare two stages of exponent 1 with their closed form: the amount is p_s V (1 + c) - c p_a V."""
    first, second = (replace(stage, exponent=1.0) for stage in STAGES[:2])
    (pressure,) = matched_pressures([first, second])
    (v, c), (w, d) = ((stage.volume, stage.clearance) for stage in (first, second))
    expected = ((1.0 + c) * 1e5 * v + d * 9e5 * w) / (c * v + (1.0 + d) * w)
    assert pressure == pytest.approx(expected, rel=1e-9)


def test_every_link_is_balanced_at_its_pressure() -> None:
    """Check both links of three stages, of which the first has two chambers."""
    halves = [replace(STAGES[0], name=name, volume=2e-3) for name in ("head", "crank")]
    low, high = matched_pressures([*halves, *STAGES[1:]])
    moved = [replace(stage, delivery=low) for stage in halves]
    moved += [replace(STAGES[1], suction=low, delivery=high), replace(STAGES[2], suction=high)]
    assert [link.excess for link in links_of(moved)] == pytest.approx([0.0, 0.0], abs=1e-8)
    assert matched_pressures(STAGES) == pytest.approx([low, high], rel=1e-9)
    assert [abs(link.excess) > 0.01 for link in links_of([*halves, *STAGES[1:]])] == [True, True]


def test_stages_far_too_small_have_no_pressure_that_matches() -> None:
    """A second stage that takes in too little at any pressure below its delivery is named as such."""
    assert matched_pressures([STAGES[0], replace(STAGES[1], volume=1e-6)]) is None


def test_the_note_of_a_problem_names_a_mismatch_until_it_is_removed(tmp_path: Path) -> None:
    """The note gives the pressure that removes its own sentence."""
    text = (PROBLEMS / "compressor-two-stage.toml").read_text().replace("3.06 bar", "3.2 bar")
    (sentence,) = [line for line in gas_note(loaded(tmp_path, text)) if "delivers" in line]
    pressure = sentence.split("; at ")[1].split(" bar")[0]
    assert not [
        line for line in gas_note(loaded(tmp_path, text.replace("3.2 bar", f"{pressure} bar"))) if "delivers" in line
    ]
