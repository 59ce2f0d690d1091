"""Warnings about numbers that no usual engine has, which stop no command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from laufruhe import InputError, load
from laufruhe.extensions.beginning.drafts import draft_of_engine
from laufruhe.files.catalogue import engines
from laufruhe.units import DECIMAL_COMMA
from problem_files import READY
from recorded_cycle import cycle_pressure

SINGLE = """
title = "Single"
[engine]
layout = "inline"
cycle = "four-stroke"
bore = "90 mm"
stroke = "90 mm"
rod_ratio = 0.28
reciprocating_mass = "0.6 kg"
throws = [0]
[[operating_points]]
speed = "3000 rpm"
[[counterweights]]
name = "web"
opposite_throw = 1
unbalance = "0.03 kg m"
"""


def doubted(old: str = "", new: str = "") -> list[str]:
    assert old in SINGLE
    return [str(doubt) for doubt in load(SINGLE.replace(old, new)).plausibility_warnings]


def test_a_block_is_heavier_than_what_moves_in_it() -> None:
    """Check a mass in grams instead of kilograms, the only unusual number of a block."""
    mounts = "[mounts]\nkind = 'elastic'\nstiffness = ['1 N/mm', '1 N/mm', '1 N/mm']\n" + "".join(
        f"[[mounts.places]]\nname = '{x}{y}'\nposition = ['{x} mm', '{y} mm', '0 mm']\n"
        for x in (-90, 90)
        for y in (-90, 90)
    )
    block = "[block]\nmass = '{}'\ncentre_of_gravity = ['0 mm', '0 mm', '0 mm']\n"
    block += "inertia = ['1 kg m^2', '1 kg m^2', '1 kg m^2']\n"
    (said,) = (str(doubt) for doubt in load(SINGLE + block.format("0.5 kg") + mounts).plausibility_warnings)
    assert said.startswith("mass of the block = 0.5 kg: is not more than the 0.6 kg of its pistons and cranks")
    assert load(SINGLE + block.format("20 kg") + mounts).plausibility_warnings == ()


def test_a_usual_engine_raises_none() -> None:
    assert doubted() == []


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.6 kg", "450 kg", "reciprocating mass = 450 kg: is that of no usual piston"),
        ("0.6 kg", "0 kg", "reciprocating mass = 0 kg: makes no inertia force"),
        ("0.6 kg", "0.6 g", "reciprocating mass = 0.0006 kg"),
        ("3000 rpm", "5e6 rpm", "gives a mean piston speed of 1.5e+04 m/s"),
        ("0.28", "0.6", "rod length = 75 mm: is 1.67 crank radii"),
        ('bore = "90 mm"', 'bore = "900 mm"', "stroke = 90 mm: is 0.1 times the bore"),
        ("0.03 kg m", "30 kg m", "unbalance of web = 30 kg m"),
    ],
)
def test_unusual_numbers_are_reported_with_a_remedy(old: str, new: str, said: str) -> None:
    found = [doubt for doubt in doubted(old, new) if said in doubt]
    assert len(found) == 1
    assert "; check" in found[0]


def test_an_open_mass_may_start_anywhere() -> None:
    text = SINGLE.replace('"0.6 kg"', '{ between = ["0 kg", "1 kg"] }') + '[objective]\nminimise = "mean roll moment"\n'
    assert load(text).plausibility_warnings == ()


@pytest.mark.parametrize("order_line", ["", "firing_order = [1, 10, 5, 7, 2, 8, 3, 9, 4, 6]", "fires_together = true"])
def test_throws_without_a_firing_order_are_reported(order_line: str) -> None:
    """Check a V10 whose cylinders would all fire in one turn of two."""
    vee = 'layout = "vee"\nbank_angle = 90\ncylinder_spacing = "98 mm"'
    engine = SINGLE.replace('layout = "inline"', vee).replace(
        "throws = [0]", f"throws = [45, 117, 333, 189, 261]\n{order_line}"
    )
    found = [str(doubt) for doubt in load(engine).plausibility_warnings]
    assert found == ([] if order_line else [found[0]])
    assert order_line or found[0].startswith(
        "firing: takes place in all 10 cylinders within one of the two turns of the cycle; give a firing order"
    )


def test_twins_that_fire_within_one_turn_are_usual() -> None:
    assert doubted("throws = [0]", 'throws = [0, 180]\ncylinder_spacing = "98 mm"') == []


def test_engines_that_were_built_raise_none() -> None:
    built = [load(draft_of_engine(key)) for key in engines()]
    assert {problem.title: problem.plausibility_warnings for problem in built if problem.plausibility_warnings} == {}


@pytest.mark.parametrize("path", READY[::6], ids=lambda path: path.stem)
def test_ready_problems_raise_none(path: object) -> None:
    assert load(path).plausibility_warnings == ()  # type: ignore[arg-type]


@pytest.mark.parametrize(("text", "is_one"), [("1,25 kg", True), (",5", True), ("1,250,000 N", False), ("1.25", False)])
def test_a_decimal_comma_is_known_from_a_list(text: str, is_one: bool) -> None:
    assert bool(DECIMAL_COMMA.match(text)) is is_one


def test_a_number_without_quotes_has_its_own_remedy() -> None:
    for given, remedy in (("90 mm", 'in quotes, as in "90 mm"'), ('90 mm"', 'in quotes, as in "90 mm"'),
                          ("0,28", "decimals follow a point, as in 0.28"), ("[90,", "add ]")):  # fmt: skip
        with pytest.raises(InputError) as caught:
            load(SINGLE.replace('stroke = "90 mm"', f"stroke = {given}"))
        assert str(caught.value).endswith(remedy)


def test_a_choice_of_two_names_both() -> None:
    with pytest.raises(InputError, match="use one of: two-stroke, four-stroke"):
        load(SINGLE.replace("four-stroke", "diesel"))


TRACE = """
[gas]
model = "trace"
file = "f.csv"
"""


def of_gas(
    folder: Path, factor: float = 1.0, late: float = 0.0, shift: float = 0.0, speed: str = "3000 rpm"
) -> list[str]:
    angles = np.arange(-360.0, 360.0)
    pressures = factor * cycle_pressure(angles - late) + shift
    (folder / "f.csv").write_text("".join(f"{a},{p:.5f}\n" for a, p in zip(angles, pressures, strict=True)))
    (folder / "p.toml").write_text(SINGLE.replace("3000 rpm", speed) + TRACE)
    return [str(doubt) for doubt in load(folder / "p.toml").plausibility_warnings]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, []),
        ({"factor": 9.0}, []),
        (
            {"factor": 10.0},
            ["peak pressure of the gas = 310.4 bar: is more than 300 bar; diesel engines reach 250 bar; check"],
        ),
        ({"late": 35.0}, []),
        (
            {"late": 60.0},
            ["peak of the gas: the peak of 31.04 bar lies 78.79 deg after the firing dead centre; check angle_zero"],
        ),
        (
            {"late": 180.0},
            ["mean torque of the gas: is -20.", "lies 198.8 deg after the firing dead centre; check angle_zero"],
        ),
        ({"late": -30.0}, ["mean torque of the gas: is -"]),
        ({"factor": 4.0, "speed": "4000 rpm"}, []),
        (
            {"shift": 2.5},
            ["pressure at the bottom dead centre = 3.5 bar: is more than usual", "a peak of 33.54 bar; check peg"],
        ),
        ({"shift": -0.95}, ["least pressure of the gas = 0.05 bar: is nearly a vacuum; check gauge and peg"]),
        (
            {"factor": 90.0},
            ["peak pressure of the gas = 2794 bar", "power of the gas = 716.5 kW", "kW for each litre; racing engines"],
        ),
    ],
)
def test_gas_that_no_engine_has(change: dict[str, Any], said: list[str], tmp_path: Path) -> None:
    doubts = of_gas(tmp_path, **change)
    assert bool(doubts) == bool(said)
    assert all(part in " ".join(doubts) for part in said), doubts
