"""The mass whose pull the crank-pin forces include is stated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import laufruhe
from laufruhe.cli.check import check_problem
from laufruhe.present.measures import displayed_loads
from laufruhe.problem.problem import Problem
from laufruhe.report.sections import loads

SINGLE: dict[str, Any] = {
    "title": "Single",
    "operating_points": [{"speed": "3000 rpm"}],
    "main_bearings": [{"x": "-60 mm"}, {"x": "60 mm"}],
    "engine": {
        "layout": "inline", "cycle": "four-stroke", "stroke": "90 mm", "rod_length": "160 mm", "throws": [0],
        "reciprocating_mass": "0.6 kg", "rotating_mass": "0.5 kg",
    },
}  # fmt: skip
ROD = {"mass": "0.6 kg", "centre_of_gravity": "40 mm", "inertia": "0.003 kg m^2"}


def notes(problem: Problem) -> set[str]:
    return {load.display.note(problem) for load in displayed_loads(problem)} - {""}


@pytest.mark.parametrize(("rod", "mass"), [({}, 0.0), ({"rod": ROD}, 0.45)])
def test_the_note_states_the_mass_at_the_pin(rod: dict[str, Any], mass: float) -> None:
    problem = laufruhe.load(SINGLE | {"engine": SINGLE["engine"] | rod})
    (note,) = notes(problem)
    assert note.startswith("Crank-pin forces have no pull of a big end" if not rod else "Crank-pin forces include")
    assert ("0.45 kg at each pin" in note) == bool(rod)
    assert problem.engine.slider_cranks[0].rotating_mass == pytest.approx(mass)
    tables = {table.title.partition(" at ")[0]: table.note for table in loads.places(laufruhe.evaluate(problem))}
    assert tables["Crank-pin forces"] == note
    assert not tables["Main-bearing forces"]


def test_no_note_without_forces_on_pins() -> None:
    alone = {key: value for key, value in SINGLE.items() if key != "main_bearings"}
    assert not notes(laufruhe.load(alone))
    sized = {**alone["engine"], "big_end": {"diameter": "50 mm", "width": "25 mm"}}
    pressure = {**alone, "engine": sized, "objective": {"minimise": "maximum crank-pin pressure"}}
    assert len(notes(laufruhe.load(pressure))) == 1


def test_check_prints_the_note_once(tmp_path: Path) -> None:
    """Show the note once if bearings and the objective both show crank-pin forces."""
    big_end = '[engine.big_end]\ndiameter = "50 mm"\nwidth = "25 mm"\n'
    file = tmp_path / "single.toml"
    objective = '[objective]\nminimise = "maximum crank-pin pressure"\n'
    file.write_text(laufruhe.load(SINGLE).to_toml() + big_end + objective, encoding="utf-8")
    text, _ = check_problem(file)
    assert text.count("Crank-pin forces have no pull") == 1
    assert "crank-pin force: Crank-pin forces have no pull" in text
