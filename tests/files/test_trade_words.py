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
        ("conrod_length", "did you mean 'rod_length', between the centres of its ends?"),
        ("Pleuellänge", "did you mean 'rod_length', between"),
        ("Pleuellaenge", "did you mean 'rod_length', between"),
        ("Hub", "did you mean 'stroke', such as"),
        ("Bohrung", "did you mean 'bore', such as"),
        ("Kolben", "did you mean 'reciprocating_mass'"),
        ("Pleuel", "did you mean 'rod', a table of mass, centre_of_gravity and inertia; its length is rod_length?"),
        (
            "rod_mass",
            "did you mean 'rod', a table of mass, centre_of_gravity and inertia; or add the small end's share to",
        ),
        ("Zündfolge", "did you mean 'firing_order', such as [1, 3, 4, 2]?"),
        ("journal", "did you mean the table [[main_bearings]]?"),
        (
            "wrist pin",
            "did you mean 'piston_pin' of [running_gear], a table for stresses; the mass of the pin goes into",
        ),
        ("Drehzahl", "did you mean 'speed' of [[operating_points]], such as \"1500 rpm\"?"),
        ("ring_mass", "did you mean 'reciprocating_mass', the mass of piston, rings and pin"),
        ("Kolbenringe", "did you mean 'reciprocating_mass'"),
        ("gudgeon_pin_weight", "did you mean 'reciprocating_mass'"),
        ("conrod_weight", "did you mean 'rod', a table of mass"),
        ("small end", "did you mean 'reciprocating_mass'"),
        ("throw", "did you mean 'throws', the angles of all throws"),
        ("Hubraum", "give bore, stroke and cylinders"),
        ("Zündabstände", "did you mean 'firing_intervals', such as [270, 450]"),
        ("Drehrichtung", "did you mean 'rotation', clockwise or counter-clockwise, seen from the front?"),
        ("Wuchtgüte", "did you mean 'residual_unbalance' of [tolerances], a grade of ISO 21940-11 such as"),
        ("Motorlager", "did you mean the table [mounts]"),
        ("Ausgleichswellen", "did you mean the table [[balancer_shafts]]"),
        ("Leistung", "give imep of [gas] or brake_torque of [[operating_points]]"),
        ("friction", "it is the table [friction]"),
        ("bore_mm", "did you mean 'bore', whose unit stands with its number"),
        ("strok", "did you mean 'stroke'?"),
    ],
)
def test_a_word_of_the_trade_leads_to_its_key(word: str, remedy: str) -> None:
    line = said(engine=f'"{word}" = "40 mm"')
    assert f"is not a key here; {remedy}" in line


def test_the_key_that_a_word_means_is_not_missed_too() -> None:
    assert said(text=SINGLE.replace("stroke =", "Hub =")) == (
        """problem: engine.Hub = "80 mm": is not a key here; did you mean 'stroke', such as "80 mm"?"""
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
    for word, key, note in trade_words():
        assert key in keys or (key == "" and note)
        assert key in [meant for meant, _ in meanings(word.upper().replace(" ", "_"))]


@pytest.mark.parametrize(
    ("key", "word", "remedy"),
    [("cycle", "Viertakt", "did you mean 'four-stroke'?"), ("layout", "Reihe", "did you mean 'inline'?"),
     ("layout", "V8", "did you mean 'vee'?"), ("layout", "flat-4", "did you mean 'boxer'?"),
     ("rotation", "ccw", "did you mean 'counter-clockwise'?"), ("rotation", "left", "use one of: clockwise, counter")],
)  # fmt: skip
def test_a_value_in_words_of_the_trade(key: str, word: str, remedy: str) -> None:
    lines = {"cycle": 'cycle = "four-stroke"', "layout": 'layout = "inline"'}
    text = SINGLE.replace(lines.get(key, "{engine}"), f'{key} = "{word}"')
    assert f'engine.{key} = "{word}": is not allowed; {remedy}' in said(text=text)


def test_a_mass_for_a_table_is_answered_with_the_keys_of_the_table() -> None:
    assert "must be one table, in [ ]; give diameter, width there" in said(engine='big_end = "0.3 kg"')


@pytest.mark.parametrize("speed", ["1500 1/min", "1500 U/min", "1500 RPM", "25 Hz", "1500/min"])
def test_speeds_of_the_trade(speed: str) -> None:
    plain, other = (
        load(SINGLE.format(engine="", point="")),
        load(SINGLE.replace("1500 rpm", speed).format(engine="", point="")),
    )
    assert other.points[0].speed == pytest.approx(plain.points[0].speed, rel=1e-14)
