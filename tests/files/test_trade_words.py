"""Words of the trade lead to the key that they mean, and units of the trade are read."""

from __future__ import annotations

import pytest
from pydantic import BaseModel

from laufruhe import InputError, load
from laufruhe.files.complaints import _tables_in
from laufruhe.files.problem_file import file_model
from laufruhe.files.trade_words import meanings, trade_words

SINGLE = """
title = "A single"
[engine]
layout = "inline"
cycle = "four-stroke"
cylinders = 1
stroke = "80 mm"
rod_length = "140 mm"
reciprocating_mass = "0.45 kg"
{engine}
[[operating_points]]
speed = "1500 rpm"
{point}
"""


def said(engine: str = "", point: str = "", text: str = SINGLE) -> str:
    with pytest.raises(InputError) as refused:
        load(text.format(engine=engine, point=point))
    (line,) = str(refused.value).splitlines()
    return line


@pytest.mark.parametrize(
    ("word", "remedy"),
    [
        (
            "piston_mass",
            "did you mean 'reciprocating_mass', the mass of piston, rings and pin, with the small end's share",
        ),
        ("crank_radius", "did you mean 'stroke', twice the crank radius?"),
        ("throw_radius", "did you mean 'stroke', twice the crank radius?"),
        ("conrod_length", "did you mean 'rod_length'?"),
        ("Pleuellänge", "did you mean 'rod_length'?"),
        ("Pleuellaenge", "did you mean 'rod_length'?"),
        ("Hub", "did you mean 'stroke'?"),
        ("Bohrung", "did you mean 'bore'?"),
        ("Kolben", "did you mean 'reciprocating_mass'"),
        ("Pleuel", "did you mean 'rod', a table of mass, centre_of_gravity and inertia?"),
        (
            "rod_mass",
            "did you mean 'rod', a table of mass, centre_of_gravity and inertia; or add the small end's share to",
        ),
        ("Zündfolge", "did you mean 'firing_order'?"),
        ("journal", "did you mean the table [[main_bearings]]?"),
        ("wrist pin", "did you mean 'piston_pin' of [running_gear]?"),
        ("Drehzahl", "did you mean 'speed' of [[operating_points]]?"),
        ("strok", "did you mean 'stroke'?"),
    ],
)
def test_a_word_of_the_trade_leads_to_its_key(word: str, remedy: str) -> None:
    line = said(engine=f'"{word}" = "40 mm"')
    assert f"is not a key here; {remedy}" in line


def test_the_key_that_a_word_means_is_not_missed_too() -> None:
    assert said(text=SINGLE.replace("stroke =", "Hub =")) == (
        """problem: engine.Hub = "80 mm": is not a key here; did you mean 'stroke'?"""
    )


def test_words_of_another_table() -> None:
    assert "did you mean 'brake_torque'?" in said(point='torque = "100 N m"')
    assert "did you mean 'imep'?" in said(point='Mitteldruck = "9 bar"')


def _keys(model: type[BaseModel], known: set[type[BaseModel]]) -> set[str]:
    inner = {table for field in model.model_fields.values() for table in _tables_in(field.annotation)} - known
    known |= inner
    return {*model.model_fields, *(key for table in inner for key in _keys(table, known))}


def test_every_word_means_a_key_that_there_is() -> None:
    keys = _keys(file_model(), set())
    for word, key, _ in trade_words():
        assert key in keys
        assert key in [meant for meant, _ in meanings(word.upper().replace(" ", "_"))]


@pytest.mark.parametrize("speed", ["1500 1/min", "1500 U/min", "1500 RPM", "25 Hz", "1500/min"])
def test_speeds_of_the_trade(speed: str) -> None:
    plain, other = (
        load(SINGLE.format(engine="", point="")),
        load(SINGLE.replace("1500 rpm", speed).format(engine="", point="")),
    )
    assert other.points[0].speed == pytest.approx(plain.points[0].speed, rel=1e-14)
