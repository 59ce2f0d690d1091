"""Engines of the catalogue: consistent in themselves, and taken as defaults of a problem."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import pytest

from laufruhe import units
from laufruhe.errors import InputError
from laufruhe.extensions.beginning.drafts import draft_of_engine
from laufruhe.files.catalogue import engines
from laufruhe.files.reader import load
from laufruhe.machine.layouts import LAYOUTS
from laufruhe.problem.problem import Problem
from problem_files import loaded

PRINTED = tomllib.loads(Path(__file__).with_name("makers_engines.toml").read_text(encoding="utf-8"))
POINT = '[[operating_points]]\nspeed = "3000 rpm"\n'


def _problem(folder: Path, key: str, own: str = "") -> Problem:
    return loaded(folder, f'title = "One"\n[engine]\ncatalogue = "{key}"\n{own}\n{POINT}')


def test_there_are_at_least_thirty() -> None:
    assert len(engines()) >= 30


@pytest.mark.parametrize("key", engines())
def test_bore_and_stroke_make_the_published_displacement(key: str, tmp_path: Path) -> None:
    """Compare bore, stroke and cylinders with the displacement, which the source states too."""
    result = engines()[key]
    parts = _problem(tmp_path, key).engine.slider_cranks
    volume = sum(0.25 * math.pi * (part.bore or 0.0) ** 2 * part.stroke for part in parts)
    assert volume == pytest.approx(1e-6 * float(result.displacement.split()[0]), rel=0.004)
    assert result.source
    assert result.engine["layout"] in LAYOUTS
    assert set(result.assumed) <= set(result.engine)
    assert "reciprocating_mass" in result.assumed


@pytest.mark.parametrize(
    ("key", "intervals"),
    [
        ("yamaha-trx850", [270, 450]),
        ("harley-evolution-1200", [315, 405]),
        ("buick-231-odd-fire", [90, 90, 90, 150, 150, 150]),
        ("buick-3800", [120] * 6),
        ("bmw-s85", [54] * 5 + [90] * 5),
        ("ferrari-f136", [90] * 8),
    ],
)
def test_cranks_fire_as_their_makers_say(key: str, intervals: list[float], tmp_path: Path) -> None:
    result = sorted(math.degrees(angle) for angle in _problem(tmp_path, key).engine.firing_intervals)
    assert result == pytest.approx(intervals)


def test_cross_plane_engines_of_three_makers_have_one_crank(tmp_path: Path) -> None:
    """Their firing orders differ, and were published in three ways of numbering."""
    stars = []
    for key in ("chevrolet-350", "chevrolet-ls1", "ford-302", "ford-modular-4-6", "mercedes-m113-5-0"):
        parts = sorted(_problem(tmp_path, key).engine.cylinders, key=lambda part: (-part.x, part.bank))
        stars.append([math.degrees(part.throw - parts[0].throw) % 360.0 for part in parts])
    assert all(star == pytest.approx(stars[0]) for star in stars)


@pytest.mark.parametrize(
    ("key", "printed"),
    [
        ("chevrolet-350", "gm_chevysbg1_v8_350_l31"),
        ("chevrolet-ls1", "gm_chevysbg3_v8_ls1"),
        ("ford-modular-4-6", "ford_modularv8_2v46_mustangpi"),
        ("buick-231-odd-fire", "gm_buickv6f1_225"),
        ("buick-3800", "gm_buickv6s2_l36_fbody"),
        ("porsche-911-2-0", "porsche_h6_m64_21"),
        ("ferrari-f136", "ferrari_v8_f136_e"),
        ("rolls-royce-merlin", "hand-merlin"),
        ("yamaha-trx850", "hand-yamaha-trx"),
        ("bmw-m52-2-8", "bmw_m54b30"),
        ("cummins-6bt", "cummins_isb"),
        ("mercedes-om605", "gm_atlas5_llr"),
    ],
)
def test_numbers_banks_and_firings_are_those_that_makers_print(key: str, printed: str, tmp_path: Path) -> None:
    """Compare banks and firing angles of all cylinders with the makers' data (makers_engines.toml)."""
    engine = PRINTED[printed]
    parts, order = _problem(tmp_path, key).engine.cylinders, engine["order"]
    intervals = engine.get("intervals", [720.0 / len(order)] * len(order))
    for place, number in enumerate(order):
        part = parts[number - 1]
        fires = math.degrees(part.firing_angle - parts[order[0] - 1].firing_angle)
        assert math.remainder(fires - sum(intervals[:place]), 720.0) == pytest.approx(0.0, abs=1e-6)
        assert part.bank == 0.0 or math.copysign(1.0, part.bank) == math.copysign(1.0, engine["banks"][number - 1])


@pytest.mark.parametrize("key", ["subaru-ej20", "subaru-ee20", "lycoming-o-320"])
def test_flat_fours_fire_1_3_2_4_with_opposed_pistons_in_step(key: str, tmp_path: Path) -> None:
    """Odd numbers stand on one side; 1 and 2, 3 and 4 are opposed and have dead centres at once."""
    parts = _problem(tmp_path, key).engine.cylinders
    fires = [math.degrees(part.firing_angle) for part in parts]
    assert [round(angle - fires[0]) % 720 for angle in fires] == [0, 360, 180, 540]
    assert parts[0].bank == parts[2].bank == -parts[1].bank == -parts[3].bank
    assert abs(parts[0].x - parts[1].x) < abs(parts[0].x - parts[3].x)
    # the propeller is at the flywheel end
    front = key != "lycoming-o-320"
    assert (parts[0].x > parts[2].x) == front


def test_no_engine_of_the_catalogue_warns_about_its_order(tmp_path: Path) -> None:
    for key in engines():
        warnings = _problem(tmp_path, key).plausibility_warnings
        assert not [warning for warning in warnings if warning.where == "engine.firing_order"], key


def test_keys_of_the_problem_override_the_catalogue(tmp_path: Path) -> None:
    given = _problem(tmp_path, "chevrolet-350")
    own = _problem(tmp_path, "chevrolet-350", 'rod_ratio = 0.29\nreciprocating_mass = "1 kg"')
    assert own.engine.cylinders[0].rod_ratio == pytest.approx(0.29)
    assert own.engine.cylinders[0].crank_radius == given.engine.cylinders[0].crank_radius
    assert "reciprocating mass 0.94 kg" in given.assumptions[-1]
    assert "reciprocating mass" not in own.assumptions[-1]
    assert "Hot Rod" in own.source


def test_a_name_alone_is_an_engine(tmp_path: Path) -> None:
    problem = loaded(tmp_path, f'title = "One"\nengine = "bmw-b48"\nsource = "mine"\n{POINT}')
    assert len(problem.engine.cylinders) == 4
    assert problem.source.startswith("mine; engine: ")


def test_throws_left_open_take_those_of_the_catalogue_away(tmp_path: Path) -> None:
    problem = _problem(tmp_path, "mercedes-om605", 'throws = "open"\n[objective]\nminimise = "rms shaking force"')
    assert problem.phasing is not None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('engine = "bmw-b49"', "did you mean 'bmw-b48'?"),
        ('engine = "warp"', "laufruhe engines lists them"),
        ("[engine]\ncatalogue = 5", "engine.catalogue = 5: is not a key of an engine of the catalogue"),
    ],
)
def test_an_engine_that_is_not_there_is_refused_in_a_line(text: str, line: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        loaded(tmp_path, f'title = "One"\n{text}\n{POINT if "[" in text else ""}')
    assert line in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("key", ["yamaha-sr500", "subaru-ej20", "bmw-b58", "buick-3800", "junkers-jumo-205"])
def test_a_draft_is_a_problem_with_something_open(key: str, tmp_path: Path) -> None:
    path = tmp_path / "draft.toml"
    path.write_text(draft_of_engine(key), encoding="utf-8")
    problem = load(path)
    assert problem.decisions
    assert problem.assumptions
    assert units.quantity_text(problem.points[0].speed, "rad/s") == "3000 rpm"
