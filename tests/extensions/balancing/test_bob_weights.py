"""Cards of bob weights against what shops print."""

from __future__ import annotations

import pytest

from laufruhe.errors import InputError
from laufruhe.extensions.balancing.bob_weights import SECTION, BobWeights, card
from laufruhe.files.reader import load
from laufruhe.solvers import evaluate_only
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


def weights_of(engine: str, table: str) -> BobWeights:
    weights = load(f"{engine}\n{POINT}[bob_weights]\n{table}").engine.extra(BobWeights)
    assert weights is not None
    return weights


def grams(weights: BobWeights) -> list[float]:
    return [1e3 * weights.mass(k) for k in range(len(weights.throws))]


def test_ford_400() -> None:
    """fordmuscle.com 2008, rotating assembly, page 2: the rotating part of a throw is printed as 1333 g."""
    weights = weights_of(V8, 'balance_factor = 0\nbig_end = "621.5 g"\nbearing_shells = "45 g"\n')
    assert grams(weights) == pytest.approx([1333.0] * 4)
    # with piston and pin, 639.5 g, and small end, 216 g: the ring set is not printed
    half = weights_of(V8, 'balance_factor = "50 %"\nbig_end = "621.5 g"\nbearing_shells = "45 g"\npiston = "639.5 g"\n'
                          'small_end = "216 g"\n')  # fmt: skip
    assert grams(half) == pytest.approx([1333.0 + 639.5 + 216.0] * 4)


def test_chevrolet_big_block() -> None:
    """chevyhiperformance.com 0906: two big ends are printed as 459.6 g; the printed parts sum to 1505.2 g."""
    weights = weights_of(
        V8,
        'balance_factor = 0.5\nrings = "69.5 g"\npiston = "583.9 g"\npin = "173.6 g"\nlocks = "4.8 g"\noil = "4 g"\n'
        'bearing_shells = "23.7 g"\nsmall_end = "162.4 g"\nbig_end = "229.8 g"\n',
    )
    assert 1e3 * weights.shares(0)["big_end"][0] == pytest.approx(459.6)
    assert grams(weights) == pytest.approx([1505.2] * 4)


def test_lancia_fulvia() -> None:
    """forum.viva-lancia.com, topic 8845: a weighing sheet of four cylinders, here at 50 % with one rod on a pin."""
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
    assert sorted(weights.throws) == [(k,) for k in range(6)]
    assert grams(weights) == pytest.approx([500.0 + 0.5 * 994.2] * 6)


def test_the_card_has_a_column_for_each_pin_that_differs_and_says_what_the_engine_has() -> None:
    table = ('balance_factor = 0.5\nbig_end = "500 g"\nsmall_end = "200 g"\n'
             'piston = ["400 g", "400 g", "410 g", "400 g"]\n')  # fmt: skip
    problem = load(f"{FOUR}\n{POINT}[bob_weights]\n{table}")
    weights = problem.engine.extra(BobWeights)
    assert weights is not None
    sheet = card(problem.engine, weights)
    assert len(sheet.head) == 2 + 4
    assert [row[-2] for row in sheet.rows] == ["500.00", "205.00", "100.00", "805.00", "48300"]
    assert "600.00 g, but reciprocating_mass of [engine] is 1250.0 g" in sheet.note


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
        (END.replace('"1 kg"', '["1 kg", "1 kg"]'), "big_end: has 2 entries, and the engine has 4"),
        (f'{END}piston = "1 kg"', "bob_weights.small_end: is missing, and piston is given"),
        (END.replace('"1 kg"', '{ between = ["1 kg", "2 kg"] }'), "bob_weights.big_end"),
    ],
)
def test_wrong_tables_are_refused(table: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        weights_of(FOUR, table)
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
