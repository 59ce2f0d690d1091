"""Engines typed as their makers print them: numbers, orders and intervals of fifty real engines (makers_engines.toml).

Right values come from the angles of banks and pins alone: a dead centre is at bank - pin, modulo a turn.
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Any

import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.problem.problem import Problem

Printed = dict[str, Any]
TABLE = Path(__file__).with_name("makers_engines.toml")
ENGINES: dict[str, Printed] = tomllib.loads(TABLE.read_text(encoding="utf-8"))
RIGHT = [key for key, engine in ENGINES.items() if "out" not in engine]
WRONG = [key for key, engine in ENGINES.items() if "out" in engine]
SIZES = {
    "cycle": "four-stroke", "stroke": "80 mm", "rod_length": "140 mm", "reciprocating_mass": "0.5 kg",
}  # fmt: skip
POINT = [{"speed": "3000 rpm"}]


def typed(key: str, **changes: Any) -> Problem:
    """Return the engine of the table; a key changed to None is left out."""
    engine = {**SIZES, "firing_order": ENGINES[key]["order"], **ENGINES[key]["typed"], **changes}
    if engine["layout"] == "parts":
        places = zip(ENGINES[key]["banks"], ENGINES[key]["pins"], strict=True)
        engine["slider_cranks"] = [
            {"x": f"{50 - pin / 1.8} mm", "bank_angle": bank, "throw": pin} for bank, pin in places
        ]
    elif engine["layout"] != "radial":
        engine["cylinder_spacing"] = "110 mm"
    if engine["layout"] == "boxer":
        engine["bank_stagger"] = "40 mm"
    engine = {name: value for name, value in engine.items() if value is not None}
    return laufruhe.load({"title": "As printed", "engine": engine, "operating_points": POINT})


def intervals_of(engine: Printed) -> list[float]:
    count, cycle = len(engine["order"]), 360.0 if engine["typed"].get("cycle") == "two-stroke" else 720.0
    return list(engine.get("intervals", [cycle / count] * count))


def fires_at(engine: Printed) -> dict[int, float]:
    """Return the crank angles after the first firing, by printed number."""
    intervals = intervals_of(engine)
    return {number: sum(intervals[:place]) for place, number in enumerate(engine["order"])}


def off_centre(engine: Printed) -> dict[int, float]:
    """Return the angles between each firing and the nearest dead centre of its cylinder."""
    centres = [bank - pin for bank, pin in zip(engine["banks"], engine["pins"], strict=True)]
    first = centres[engine["order"][0] - 1]
    return {n: abs(math.remainder(centres[n - 1] - first - at, 360.0)) for n, at in fires_at(engine).items()}


@pytest.mark.parametrize("key", RIGHT)
def test_an_order_as_printed_fires_as_printed(key: str) -> None:
    engine = ENGINES[key]
    assert max(off_centre(engine).values()) < 0.01
    problem = typed(key)
    cycle = math.degrees(problem.engine.cycle.angle)
    assert sum(intervals_of(engine)) == pytest.approx(cycle)
    assert not problem.plausibility_warnings
    fires = [math.degrees(part.firing_angle) for part in problem.engine.cylinders]
    first = fires[engine["order"][0] - 1]
    for number, at in fires_at(engine).items():
        assert math.remainder(fires[number - 1] - first - at, cycle) == pytest.approx(0.0, abs=0.01)
    assert [math.degrees(a) for a in problem.engine.firing_intervals] == pytest.approx(intervals_of(engine), abs=0.01)


@pytest.mark.parametrize("key", [key for key in RIGHT if ENGINES[key]["typed"]["layout"] in ("vee", "boxer")])
def test_cylinders_stand_where_their_numbers_say(key: str) -> None:
    """Number, bank and pin of each cylinder agree with the table, and neighbours on one pin stand side by side."""
    engine, parts = ENGINES[key], typed(key).engine.cylinders
    pins = engine["pins"]
    for k, part in enumerate(parts):
        assert part.name == f"cylinder {k + 1}"
        assert math.degrees(part.bank) == pytest.approx(engine["banks"][k], abs=0.05)
        turned = math.degrees(part.throw - parts[0].throw) - (pins[k] - pins[0])
        assert math.remainder(turned, 360.0) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    "key", [key for key in RIGHT if "intervals" not in ENGINES[key] and "throws" in ENGINES[key]["typed"]]
)
def test_even_firing_makes_the_printed_crank(key: str) -> None:
    """Numbers and order alone give the crank up to its angle at the start."""
    given, made = typed(key).engine.cylinders, typed(key, throws=None).engine.cylinders
    turned = [math.degrees(b.throw - a.throw) for a, b in zip(given, made, strict=True)]
    assert [math.remainder(turn - turned[0], 360.0) for turn in turned] == pytest.approx([0.0] * len(turned), abs=0.01)


@pytest.mark.parametrize("key", WRONG)
def test_an_order_that_does_not_fit_its_crank_names_the_cylinders_out_of_place(key: str) -> None:
    engine = ENGINES[key]
    out = {number for number, angle in off_centre(engine).items() if angle > 1.0}
    assert out == set(engine["out"])
    with pytest.raises(InputError) as refused:
        typed(key)
    line = str(refused.value)
    assert "\n" not in line
    named = line.partition("cylinders ")[2].partition(" are out of place")[0]
    assert {int(word.split()[0]) for word in named.split(", ")} == out


@pytest.mark.parametrize(
    ("key", "line"),
    [
        ("bad-northstar", "cannot be even: cylinders 1 and 2 (270, not 90 deg), 7 and 8 (270, not 90 deg) are out of"),
        ("bad-o540", "moves opposed pistons in one direction, not against each other: cylinders 1 and 2, 5 and 6"),
        ("bad-m104", "cylinders 1 and 6, 2 and 5 are not in step; check the order; with 5 and 6 exchanged it fits"),
    ],
)
def test_a_wrong_order_without_throws_is_reported(key: str, line: str) -> None:
    try:
        text = str(typed(key, throws=None).plausibility_warnings[0])
    except InputError as refused:
        text = str(refused)
    assert line in text
