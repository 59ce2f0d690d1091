"""The command that balances: files, printed text, and refused input."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from laufruhe.cli import app
from problem_files import PROBLEMS

JOB = """
title = "Disc"
[correction]
density = "7850 kg/m^3"
drills = ["8 mm", "10 mm"]
depth_step = "1 mm"
max_depth = "12 mm"
wall = "2 mm"
permitted_unbalance = "20 g mm"
zero_mark = 30
machine_counts = "against rotation"
[[correction.planes]]
name = "left"
measured = { unbalance = "400 g mm", angle = 77 }
radius = "60 mm"
places = 12
[[correction.planes]]
name = "right"
measured = { mass = "4 g", radius = "60 mm", angle = 10 }
radius = "60 mm"
angles = [0, 45, 90, 180, 200]
"""


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["balance", *map(str, words)])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "disc.toml").write_text(JOB, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_holes_of_list_json_and_residuals_agree(folder: Path) -> None:
    result = run("disc.toml", "--json", "disc.json")
    assert result.exit_code == 0, result.stderr
    assert "correct both planes: the fewest (proven)." in result.stdout
    made = folder / "results" / "disc-balance"
    assert {entry.name for entry in made.iterdir()} == {
        ".laufruhe.json", "report.md", "report.html", "result.json", "holes.csv", "planes.svg",
    }  # fmt: skip
    data = json.loads((folder / "disc.json").read_text(encoding="utf-8"))
    assert data == json.loads((made / "result.json").read_text(encoding="utf-8"))
    with (made / "holes.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    holes = data["correction"]["holes"]
    assert len(rows) == len(holes) > 0
    # the residual by hand, in the angles of the machine
    for plane, size, reading in zip(data["correction"]["planes"], (400.0, 240.0), (77.0, 10.0), strict=True):
        across = along = 0.0
        for row in (row for row in rows if row["plane"] == plane["name"]):
            diameter, depth, angle = (float(row[key]) for key in (
                "diameter [mm]", "depth [mm]", "angle at the machine [deg]"))  # fmt: skip
            change = -7850e-6 * math.pi / 4.0 * diameter**2 * depth * 60.0
            assert float(row["unbalance [g mm]"]) == pytest.approx(change)
            along += change * math.cos(math.radians(angle))
            across += change * math.sin(math.radians(angle))
            assert (30.0 - angle) % 360.0 == pytest.approx(float(row["angle on the crank [deg]"]) % 360.0)
        along += size * math.cos(math.radians(reading))
        across += size * math.sin(math.radians(reading))
        assert math.hypot(along, across) == pytest.approx(1e6 * plane["after"]["unbalance"])
        assert math.hypot(along, across) <= 20.0
        assert plane["met"]
        assert plane["fewest_proven"]


@pytest.mark.slow
def test_the_ready_problem_has_its_card_and_its_holes(folder: Path) -> None:
    result = run(PROBLEMS / "vee-eight-balance-job.toml", "--format", "png")
    assert result.exit_code == 0, result.stderr
    made = folder / "results" / "vee-eight-balance-job-balance"
    assert "bob weight,,1505.2" in (made / "bob-weights.csv").read_text(encoding="utf-8")
    assert "![The two planes to scale" in (made / "report.md").read_text(encoding="utf-8")
    assert (made / "planes.png").exists()


@pytest.mark.slow
def test_too_few_holes_have_status_one_and_the_best_design(folder: Path) -> None:
    (folder / "disc.toml").write_text(JOB.replace('depth = "12 mm"', 'depth = "2 mm"\nmax_holes = 2'), encoding="utf-8")
    result = run("disc.toml")
    assert result.exit_code == 1
    assert "No design with at most 2 holes in a plane is proven to correct 'left' and 'right'" in result.stdout
    assert (folder / "results" / "disc-balance" / "holes.csv").exists()


@pytest.mark.slow
def test_the_report_has_the_units_of_choice_and_the_list_its_own(folder: Path) -> None:
    text = JOB.replace("[correction]", 'units = { unbalance = "oz in", length = "in", mass = "oz" }\n[correction]', 1)
    (folder / "disc.toml").write_text(text.replace('"8 mm"', '"0.375 in"'), encoding="utf-8")
    result = run("disc.toml")
    assert result.exit_code == 0, result.stderr
    report = (folder / "results" / "disc-balance" / "report.md").read_text(encoding="utf-8")
    assert "diameter \\[in\\]" in report
    # 400 g mm and 20 g mm
    assert "| left | 0.5555 | 77.0 |" in report
    assert "| 0.02777 | yes |" in report
    assert "depth [mm]" in (folder / "results" / "disc-balance" / "holes.csv").read_text(encoding="utf-8")


def test_a_rotor_within_its_grade_needs_no_hole(folder: Path) -> None:
    (folder / "disc.toml").write_text(JOB.replace('"20 g mm"', '"401 g mm"'), encoding="utf-8")
    result = run("disc.toml")
    assert result.exit_code == 0
    assert "No hole is needed: the unbalance of both planes is permitted." in result.stdout


def test_masses_of_one_pin_need_no_engine(folder: Path) -> None:
    """Check two rods on a pin: 2 x 0.3 kg in full, and 0.6 of 0.5 + 0.52 + 2 x 0.2 kg."""
    text = 'title = "Twin"\n[bob_weights]\nbalance_factor = 0.6\npiston = ["500 g", "520 g"]\nbig_end = "300 g"\n'
    (folder / "twin.toml").write_text(text + 'small_end = "200 g"\n', encoding="utf-8")
    result = run("twin.toml")
    assert result.exit_code == 0, result.stderr
    card = (folder / "results" / "twin-balance" / "bob-weights.csv").read_text(encoding="utf-8")
    assert card.splitlines()[-1] == "bob weight,,1452.0"
    (folder / "twin.toml").write_text(text, encoding="utf-8")
    assert "bob_weights.small_end: is missing" in run("twin.toml").stderr
    (folder / "twin.toml").write_text(text.replace("piston", "#"), encoding="utf-8")
    assert "without [engine] there is no reciprocating mass; add piston and small_end" in run("twin.toml").stderr


@pytest.mark.parametrize(
    ("wall", "note"),
    [
        ("", "The file gives no wall: a drill may break through into the next hole"),
        ('wall = "2 mm"', "At least 2 mm of material is left between holes"),
    ],
)
def test_the_list_of_holes_states_the_wall(folder: Path, wall: str, note: str) -> None:
    text = JOB.replace('wall = "2 mm"', wall).replace('"20 g mm"', '"401 g mm"')
    (folder / "disc.toml").write_text(text, encoding="utf-8")
    assert note in " ".join(run("disc.toml").stdout.split())


PLANE = "correction.planes[1]"


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (JOB, 'title = "Disc"', "correction: is missing, and this file has no [bob_weights] either"),
        ('unbalance = "400 g mm"', 'unbalance = "400 g"', f"{PLANE}.measured.unbalance"),
        ('unbalance = "400 g mm"', 'mass = "4 g"', f"{PLANE}.measured.radius: is missing"),
        ('unbalance = "400 g mm", ', "", f"{PLANE}.measured.unbalance: is missing; give unbalance or mass and radius"),
        ("places = 12", "", f"{PLANE}.angles: is missing; give angles or places"),
        ("places = 12", "angles = [10, 370]", "two places are at this angle"),
        ("places = 12", "places = 12\nsolid = [-30, 30]", "must be a list of lists; write for example [[-30, 30]]"),
        ("places = 12", "places = 12\nsolid = [[0, 360]]", f"{PLANE}.allowed: and solid leave no place"),
        ('"right"', '"left"', "two planes have this name"),
        ('"20 g mm"', '"G 6.3"', "correction.rotor_mass: is missing, and a balance grade needs it"),
        ('"20 g mm"', '"fine"', 'permitted_unbalance = "fine": is neither a balance grade nor an unbalance'),
        ('"20 g mm"', '"0 g mm"', "must be more than 0"),
        ('permitted_unbalance = "20 g mm"', "", "is missing, and decides how many holes are enough"),
        ('"20 g mm"', '"20 g mm"\nservice_speed = "900 rpm"', "correction.service_speed: needs a balance grade"),
        ('"20 g mm"', '"G 6.3"\nservice_speed = "900 rpm"\nrotor_mass = "9 kg"\ncentre_of_mass = "0 mm"',
         'centre_of_mass = "0 mm": must be between the places x of the two planes'),
        ('depth_step = "1 mm"', 'depth_step = "20 mm"', "allows no depth that is a multiple of depth_step"),
        ('wall = "2 mm"', 'direction = "radial"\nwall = "2 mm"\npoint_angle = 5', "reaches the axis"),
        ('[[correction.planes]]', '[correction.slugs]\ndensity = "2700 kg/m^3"\ndiameters = ["9 mm"]\n'
         "[[correction.planes]]", "correction.slugs.density"),
        ('depth_step = "1 mm"', 'depth_step = "0.01 mm"', "correction.max_holes = 4: makes too many designs to prove"),
        ('drills = ["8 mm", "10 mm"]', "drills = []", "correction.drills"),
        ('max_depth = "12 mm"', 'max_depth = { between = ["8 mm", "12 mm"] }', "correction.max_depth"),
        ('title = "Disc"', 'title = "Disc"\n[bob_weights]', "bob_weights.big_end: is missing"),
        ('title = "Disc"', 'title = "Disc"\n[study]', "use laufruhe study"),
    ],
)  # fmt: skip
def test_bad_input_is_refused_in_a_line(folder: Path, before: str, after: str, said: str) -> None:
    assert before in JOB
    (folder / "disc.toml").write_text(JOB.replace(before, after, 1), encoding="utf-8")
    result = run("disc.toml")
    assert result.exit_code == 2, result.stdout
    assert said in result.stderr
    assert "disc.toml" in result.stderr
    assert not (folder / "results").exists()
