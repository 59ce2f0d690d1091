"""Cards of bob weights, compared with those that shops print."""

from __future__ import annotations

from pathlib import Path

import pytest

from laufruhe.errors import InputError
from laufruhe.extensions.balancing.bob_weights import SECTION, BobWeights, card
from laufruhe.extensions.balancing.file import load_job
from laufruhe.files.reader import load
from laufruhe.machine import Engine
from laufruhe.solvers import evaluate_only, solve
from problem_files import FOUR

V8 = """
title = "V8"
[engine]
layout = "vee"
cycle = "four-stroke"
cylinders = 8
bank_angle = 90
cylinder_spacing = "120 mm"
throws = [0, 90, 270, 180]
stroke = "100 mm"
rod_ratio = 0.3
reciprocating_mass = "994.2 g"
"""
POINT = '[[operating_points]]\nspeed = "5000 rpm"\n'
END = 'balance_factor = 0.5\nbig_end = "1 kg"\n'


def weights_of(engine: str, table: str) -> tuple[Engine, BobWeights]:
    engine_of_file = load(f"{engine}\n{POINT}[bob_weights]\n{table}").engine
    weights = engine_of_file.extra(BobWeights)
    assert weights is not None
    return engine_of_file, weights


def grams(pair: tuple[Engine, BobWeights]) -> list[float]:
    engine, weights = pair
    return [1e3 * weights.mass(engine, k) for k in range(len(weights.throws))]


def test_ford_400() -> None:
    """Check the printed 1333 g of the rotating part of a throw (fordmuscle.com 2008, rotating assembly, page 2)."""
    weights = weights_of(V8, 'balance_factor = 0\nbig_end = "621.5 g"\nbearing_shells = "45 g"\n')
    assert grams(weights) == pytest.approx([1333.0] * 4)
    # with piston and pin, 639.5 g, and small end, 216 g: the ring set is not printed
    half = weights_of(V8, 'balance_factor = "50 %"\nbig_end = "621.5 g"\nbearing_shells = "45 g"\npiston = "639.5 g"\n'
                          'small_end = "216 g"\n')  # fmt: skip
    assert grams(half) == pytest.approx([1333.0 + 639.5 + 216.0] * 4)


def test_chevrolet_big_block() -> None:
    """Check 459.6 g of two big ends and the sum of 1505.2 g (chevyhiperformance.com 0906)."""
    weights = weights_of(
        V8,
        'balance_factor = 0.5\nrings = "69.5 g"\npiston = "583.9 g"\npin = "173.6 g"\nlocks = "4.8 g"\noil = "4 g"\n'
        'bearing_shells = "23.7 g"\nsmall_end = "162.4 g"\nbig_end = "229.8 g"\n',
    )
    assert 1e3 * weights[1].shares(weights[0], 0)["big_end"][0] == pytest.approx(459.6)
    assert grams(weights) == pytest.approx([1505.2] * 4)


def test_lancia_fulvia() -> None:
    """Check a weighing sheet of four cylinders at 50 % (forum.viva-lancia.com, topic 8845), one rod on a pin."""
    weights = weights_of(
        FOUR,
        'balance_factor = 0.5\nbig_end = ["490.5 g", "494.5 g", "495.5 g", "489.5 g"]\n'
        'small_end = ["206 g", "207.5 g", "207 g", "206.5 g"]\npiston = ["384.5 g", "383.5 g", "383.5 g", "383 g"]\n'
        'pin = ["100.5 g", "118.5 g", "100 g", "119 g"]\nrings = "37.5 g"\n',
    )
    assert grams(weights) == pytest.approx([854.75, 868.0, 859.5, 862.5])


def test_the_reciprocating_mass_of_the_engine_is_the_default() -> None:
    weights = weights_of(V8, 'balance_factor = 0.5\nbig_end = "229.8 g"\nbearing_shells = "23.7 g"\noil = "4 g"\n')
    assert grams(weights) == pytest.approx([1505.2] * 4)


def test_parts_of_a_split_pin_have_bob_weights_of_their_own() -> None:
    engine = V8.replace("cylinders = 8", "cylinders = 6").replace("[0, 90, 270, 180]", "[0, 240, 120]")
    weights = weights_of(f"{engine}split_pin_angle = 30\n", 'balance_factor = 0.5\nbig_end = "500 g"\n')
    assert sorted(weights[1].throws) == [(k,) for k in range(6)]
    assert grams(weights) == pytest.approx([500.0 + 0.5 * 994.2] * 6)


def test_the_card_has_a_column_for_each_pin_that_differs_and_says_what_the_engine_has() -> None:
    table = ('balance_factor = 0.5\nbig_end = "500 g"\nsmall_end = "200 g"\n'
             'piston = ["400 g", "400 g", "410 g", "400 g"]\n')  # fmt: skip
    sheet = card(*weights_of(FOUR, table))
    assert len(sheet.head) == 2 + 4
    assert [row[-2] for row in sheet.rows] == ["500.00", "205.00", "100.00", "805.00", "48300"]
    assert "600.00 g, but [engine] has 1250.0 g" in sheet.note


ROD = '[engine.rod]\nmass = "700 g"\ncentre_of_gravity = "60 mm"\ninertia = "0.005 kg m^2"\n'


@pytest.mark.parametrize(
    ("engine", "listed", "difference"),
    [
        (V8, 'big_end = "0 g"', ""),
        (f'{V8}rotating_mass = "800 g"', 'big_end = "400 g"', ""),
        (f'{V8}rotating_mass = "800 g"', 'big_end = "401 g"',
         "The rotating parts of cylinder 1, cylinder 5 have 802.00 g, but [engine] has 800.00 g"),
        (f'{V8}[[engine.single_cylinders]]\ncylinders = [3]\nrotating_mass = "500 g"',
         'big_end = ["0 g", "0 g", "450 g", "0 g", "0 g", "0 g", "50 g", "0 g"]', ""),
        (f'{V8}[[engine.single_cylinders]]\ncylinders = [3]\nrotating_mass = "500 g"',
         'big_end = ["0 g", "0 g", "500 g", "0 g", "0 g", "0 g", "9 g", "0 g"]',
         "The rotating parts of cylinder 3, cylinder 7 have 509.00 g, but [engine] has 500.00 g"),
        (f"{V8}{ROD}", 'big_end = "400 g"', ""),
        (f"{V8}{ROD}", 'big_end = "300 g"\npiston = "994.2 g"\nsmall_end = "252 g"',
         "The reciprocating parts have the mass of [engine]."),
    ],
)  # fmt: skip
def test_the_card_compares_weighed_parts_with_the_mass_of_the_throw(engine: str, listed: str, difference: str) -> None:
    note = card(*weights_of(engine, f"balance_factor = 0.5\n{listed}\n")).note
    said = note.split("that at the crank radius.")[1].removesuffix(": loads and weights follow [engine].").strip()
    assert said == difference


def test_the_card_has_the_reciprocating_mass_of_the_final_design() -> None:
    engine = V8.replace('"994.2 g"', '{ between = ["600 g", "900 g"], start = "900 g" }')
    result = solve(load(f'{engine}\n{POINT}[bob_weights]\n{END}[objective]\nminimise = "rms shaking force"\n'))
    (sheet,) = SECTION.tables(result)
    assert ["reciprocating mass", "50 %", "600.0"] in [list(row) for row in sheet.rows]


def test_results_have_the_card() -> None:
    result = evaluate_only(load(f"{V8}\n{POINT}[bob_weights]\n{END}"))
    assert SECTION.applies(result)
    assert SECTION.record is not None
    record = SECTION.record(result)
    assert [throw["bob_weight"] for throw in record["throws"]] == pytest.approx([2.0 + 0.9942] * 4)
    assert [table.file for table in SECTION.tables(result)] == ["bob-weights"]
    assert not SECTION.applies(evaluate_only(load(f"{V8}\n{POINT}")))


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (END.replace("0.5", "50"), 'balance_factor = 50: must be at most 1; give a smaller value, or "50 %"'),
        ("balance_factor = 0.5", "bob_weights.big_end: is missing"),
        (END.replace('"1 kg"', '["1 kg", "1 kg"]'), "big_end: has 2 entries for 4 rods"),
        (f'{END}piston = "1 kg"', "bob_weights.small_end: is missing, and piston is given"),
        (END.replace('"1 kg"', '{ between = ["1 kg", "2 kg"] }'), "bob_weights.big_end = "),
        (f"{END}piston = 380", "bob_weights.piston = 380: has no unit"),
        (f'{END}piston = ["1 kg", 380]', "bob_weights.piston[2] = 380: has no unit"),
        (f'{END}crank_pin = "400 g"', "is not a key here; use one of: balance_factor, bearing_shells, big_end"),
    ],
)
def test_wrong_tables_are_refused(table: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        weights_of(FOUR, table)
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(("mass", "bob", "is_said"), [('"1 kg"', 1.5, True), ('["1 kg", "1 kg"]', 3.0, False)])
def test_a_card_without_an_engine_says_that_one_rod_is_on_the_pin(
    tmp_path: Path, mass: str, bob: float, is_said: bool
) -> None:
    file = tmp_path / "twin.toml"
    file.write_text(
        'title = "twin"\n[bob_weights]\nbalance_factor = 0.5\nbig_end = "1 kg"\n'
        f'piston = "0.5 kg"\nsmall_end = {mass.replace("1 kg", "0.5 kg")}\n', encoding="utf-8",
    )  # fmt: skip
    weights = load_job(file).weights
    assert weights is not None
    assert weights.mass(None, 0) == pytest.approx(bob)
    assert ("for two rods write" in card(None, weights).note) is is_said
