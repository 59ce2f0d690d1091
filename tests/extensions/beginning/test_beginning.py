"""Beginning without the repository: init, examples and engines from an empty folder."""

from __future__ import annotations

import errno
import re
import shlex
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from laufruhe import units
from laufruhe.cli import app
from laufruhe.files.reader import load, load_tables
from laufruhe.files.ready import SCHEMAS, ready
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.report import files
from laufruhe.studies.reader import load_study
from problem_files import PROBLEMS

run = CliRunner()


def test_every_ready_problem_has_a_use() -> None:
    assert sorted(ready()) == sorted(path.stem for path in PROBLEMS.glob("*.toml"))
    listed = run.invoke(app, ["examples"]).output
    assert all(f"  {name} " in listed for name in ready())


def test_the_wheel_carries_them() -> None:
    project = tomllib.loads((PROBLEMS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"] == {"problems": "laufruhe/problems"}


@pytest.mark.parametrize("name", ["bmw-b48", "tractor-single"])
def test_init_writes_a_problem_that_loads(here: Path, name: str) -> None:
    assert run.invoke(app, ["init", "mine.toml", "--from", name]).exit_code == 0
    text = (here / "mine.toml").read_text(encoding="utf-8")
    assert text.startswith("#:schema ./laufruhe.schema.json\n")
    assert {path.name for path in here.iterdir()} == {"mine.toml", "laufruhe.schema.json"}
    assert load(here / "mine.toml").objective


def test_init_leaves_what_is_there(here: Path) -> None:
    (here / "problem.toml").write_text("mine", encoding="utf-8")
    outcome = run.invoke(app, ["init", "--from", "bmw-b48"])
    assert outcome.exit_code == 2
    assert "problem.toml: exists with other contents" in outcome.output
    assert [path.name for path in here.iterdir()] == ["problem.toml"]


@pytest.mark.parametrize("typed", ["", "\nMine\n"])
def test_init_without_all_answers_says_what_to_do(here: Path, typed: str) -> None:
    outcome = run.invoke(app, ["init"], input=typed)
    assert (outcome.exit_code, list(here.iterdir())) == (2, [])
    assert "but the input ended at" in outcome.stderr


def answered(*answers: str) -> str:
    """Return what is typed: no source, a title, then these answers and the default ones."""
    return "\n".join(["", "Mine", *answers, *[""] * 30])


@pytest.mark.parametrize(
    ("answers", "keys"),
    [
        ([], {"layout": "inline", "cylinders": 4, "firing_order": [1, 3, 4, 2]}),
        (["single", "2"], {"cycle": "two-stroke", "cylinders": 1}),
        (["270 twin"], {"firing_intervals": [270, 450], "firing_order": [1, 2]}),
        (["twin", "", "", "180"], {"firing_intervals": [180, 540]}),
        (["twin", "", "", "even"], {"firing_intervals": None, "firing_order": [1, 2]}),
        (["60° V2"], {"layout": "vee", "bank_angle": 60, "cylinders": 2}),
        (["V2 75 Grad"], {"layout": "vee", "bank_angle": 75, "cylinders": 2}),
        (["75-degree vee twin"], {"layout": "vee", "bank_angle": 75, "cylinders": 2}),
        (["L-Twin"], {"layout": "vee", "bank_angle": 90, "cylinders": 2}),
        (["Reihensechser", "", "", "", "1-5-3-6-2-4"], {"layout": "inline", "cylinders": 6}),
        (["Reihensechszylinder", "", "", "gleichmäßig", "1-5-3-6-2-4"], {"layout": "inline", "cylinders": 6}),
        (["flat four", "", "", "", "", "1-3-2-4"], {"layout": "boxer", "firing_order": [1, 3, 2, 4]}),
        (["V6", "", "", "60", "60", "by bank", "links", "", "163524"],
         {"split_pin_angle": 60, "first_bank": "left", "firing_order": [1, 6, 3, 5, 2, 4]}),
        (["V10", "", "", "", "", "", "left", "", "-", "0, 144, 216, 288, 72", "-"],
         {"cylinders": 10, "throws": [0, 144, 216, 288, 72], "firing_order": None}),
    ],
)  # fmt: skip
def test_init_puts_answers_into_the_file(here: Path, answers: list[str], keys: dict[str, object]) -> None:
    outcome = run.invoke(app, ["init"], input=answered(*answers))
    assert outcome.exit_code == 0, outcome.output
    assert load(here / "problem.toml").objective
    engine = tomllib.loads((here / "problem.toml").read_text(encoding="utf-8"))["engine"]
    assert {key: engine.get(key) for key in keys} == keys


FOUR = ["", "", "", "", "", "1-3-4-2"]
"""Answers about an inline four, before its sizes."""


@pytest.mark.parametrize(
    ("answers", "said", "key", "value"),
    [
        # an odd number of cylinders in two banks, then an even one
        (["boxer", "", "5", "4"], "is no multiple of the 2 banks", "cylinders", 4),
        # no even firing of ten cylinders at 90 degrees, nothing in its place, then throws and an order that they allow
        (["V10", *[""] * 5, "left", "", "1-10-5-7-2-8-3-9-4-6", "", "45,117,333,189,261", "1-2-3-4-5-6-7-8-9-10"],
         "cannot be even: cylinders 1 and 6", "throws", [45, 117, 333, 189, 261]),
        (["w", ""], "is no layout; use inline, vee or boxer, or a name such as V8", "layout", "inline"),
        (["", "6", "four"], "is none of these; use one of", "cycle", "four-stroke"),
        (["", "", "five", "3", "", "", "1-2", "1-2-3"], "must be a whole number", "cylinders", 3),
        (["twin", "", "", "270-270", "270"], "does not divide the 720 deg of a cycle into 2 intervals; write even, or",
         "firing_intervals", [270, 450]),
        (["89,6", ""], "has an angle, as only a vee, a boxer or a twin has", "layout", "inline"),
        ([*FOUR[:-1], "112 mm", "1-3-4-2"], "is no order of the cylinders 1 to 4", "firing_order", [1, 3, 4, 2]),
        ([*FOUR[:-1], "-", "", "0, 180, 180, 0", "-"], "is empty; write an angle for each throw", "throws",
         [0, 180, 180, 0]),
        (["V6", "", "", "60°", "sixty", "60°", "by bank", "links", "", "163524"], 'write for example "90 deg"',
         "split_pin_angle", 60),
        (["400 twin", "two-stroke", "four-stroke"], "engine.firing_intervals: does not divide the 360 deg", "cycle",
         "four-stroke"),
        ([*FOUR, "0 mm", "80 mm"], "must be more than 0 mm", "bore", "80 mm"),
        ([*FOUR, '"80 mm"'], "Stroke [80 mm]", "bore", "80 mm"),
        ([*FOUR, "80", "81 mm"], 'write for example "120 mm"', "bore", "81 mm"),
        ([*FOUR, "1,5 mm", "82 mm"], 'write "1.5 mm"', "bore", "82 mm"),
        ([*FOUR, "", "", "", "1.2", "1:4"], "is no usual ratio", "rod_ratio", 0.25),
        ([*FOUR, "", "", "", "30 mm", "140 mm"], "blocks the crank", "rod_length", "140 mm"),
        ([*FOUR, "", "", "", "", "0.4 kg", "0.6 kg", "0.7 kg", "25 %"], "is not between zero and the 0.6 kg of the rod",
         "reciprocating_mass", "0.55 kg"),
        ([*FOUR, "", "", "", "", "", "", "", "", "", "", "10 bar", "60 bar"], "for example 60 bar", "bore", "80 mm"),
    ],
)  # fmt: skip
def test_a_bad_answer_is_explained_and_asked_again(
    here: Path, answers: list[str], said: str, key: str, value: object
) -> None:
    outcome = run.invoke(app, ["init"], input=answered(*answers))
    assert outcome.exit_code == 0, outcome.output
    assert said in outcome.output
    assert "draft" not in outcome.output
    assert tomllib.loads((here / "problem.toml").read_text(encoding="utf-8"))["engine"][key] == value


@pytest.mark.parametrize("answers", [["V2 90°"], ["V6", "", "", "60", "60"], ["boxer", "", "2"], ["single"]])
def test_a_throw_carries_the_big_ends_of_all_its_rods(here: Path, answers: list[str]) -> None:
    """The first order is that of rods as rigid bodies."""
    shown = run.invoke(app, ["init"], input=answered(*answers)).output
    piston, rod = (float(mass) for mass in re.findall(r"Mass of .* \[(.*) kg\]", shown))
    tables = tomllib.loads((here / "problem.toml").read_text(encoding="utf-8"))
    engine = tables["engine"]
    length = 0.5 * units.parse(engine["stroke"], "m") / engine["rod_ratio"]
    # a third of the rod is its small end, by default
    inertia = rod * length**2 * 2.0 / 9.0
    body = {"mass": f"{rod} kg", "centre_of_gravity": f"{length / 3.0} m", "inertia": f"{inertia} kg m^2"}
    bodies = {**engine, "reciprocating_mass": f"{piston} kg", "rotating_mass": "0 kg", "rod": body}
    first, second = (
        shaking_loads(problem.engine, problem.points[0]).at(1)
        for problem in (load_tables({**tables, "engine": table}, here / "problem.toml") for table in (engine, bodies))
    )
    assert np.abs(first).max() > 1.0
    np.testing.assert_allclose(first, second, atol=1e-5 * np.abs(first).max())


def test_an_unknown_source_is_asked_again(here: Path) -> None:
    outcome = run.invoke(app, ["init"], input="bmw-b49\n" + answered())
    assert (outcome.exit_code, "did you mean 'bmw-b48'?" in outcome.output) == (0, True)


@pytest.mark.parametrize(("name", "cylinders"), [("V8", 8), ("inline six", 6), ("270 twin", 2)])
def test_a_layout_is_a_source(here: Path, name: str, cylinders: int) -> None:
    outcome = run.invoke(app, ["init"], input="\n".join(["V7", name, "Mine", *[""] * 5, *[""] * 30]))
    assert (outcome.exit_code, "is no multiple of the 2 banks" in outcome.output) == (0, True)
    tables = tomllib.loads((here / "problem.toml").read_text(encoding="utf-8"))
    assert tables["engine"]["cylinders"] == cylinders
    assert "Layout, or a name" not in outcome.output
    is_vee = tables["engine"]["layout"] == "vee"
    assert any("bank_stagger" in note for note in tables["assumptions"]) == is_vee


def test_an_answer_can_be_changed(here: Path) -> None:
    # the first question has none before it; a layout sets the number of cylinders, which is asked once it is gone
    answers = ["<", "V6", "<", "inline", "", "<", "two-stroke", "3", "", "", "1-2-3", "<", "1-3-2"]
    outcome = run.invoke(app, ["init"], input=answered(*answers))
    assert outcome.exit_code == 0, outcome.output
    engine = tomllib.loads((here / "problem.toml").read_text(encoding="utf-8"))["engine"]
    keys = ("layout", "cycle", "cylinders", "firing_order")
    assert [engine[key] for key in keys] == ["inline", "two-stroke", 3, [1, 3, 2]]


def test_petrol_and_diesel_have_pressures_of_their_own(here: Path) -> None:
    peaks, masses = [], []
    for fuel in ("benzin", "diesel"):
        assert run.invoke(app, ["init", f"{fuel}.toml"], input=answered("", "", "", fuel)).exit_code == 0
        tables = tomllib.loads((here / f"{fuel}.toml").read_text(encoding="utf-8"))
        peaks.append(tables["gas"]["peak_pressure"])
        masses.append(float(tables["engine"]["reciprocating_mass"].removesuffix(" kg")))
        assert "compression ratio" in tables["assumptions"][0]
    assert peaks == ["60 bar", "140 bar"]
    assert masses[0] < masses[1]


@pytest.mark.parametrize(
    ("answers", "ratios"),
    # a force or couple of first order that turns against the crank needs a shaft that does so, others counterweights
    [(["single"], [-1]), (["twin", "", "", "even"], [-1]), (["270 twin"], [-1]), (["V2"], [2, -2]), ([], [2, -2])],
)
def test_balancer_shafts_turn_as_the_free_loads(here: Path, answers: list[str], ratios: list[int]) -> None:
    assert run.invoke(app, ["init"], input=answered(*answers)).exit_code == 0
    tables = tomllib.loads((here / "problem.toml").read_text(encoding="utf-8"))
    assert [shaft["ratio"] for shaft in tables.get("balancer_shafts", [])] == ratios


def test_an_existing_file_is_refused_before_questions(here: Path) -> None:
    (here / "problem.toml").write_text("mine", encoding="utf-8")
    outcome = run.invoke(app, ["init"])
    assert (outcome.exit_code, outcome.output.count("\n")) == (2, 1)


def test_ctrl_c_at_a_question_ends_as_everywhere(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # an end of what is typed at a terminal is told in the same way
    monkeypatch.setattr(
        "laufruhe.extensions.beginning.questions.sys", SimpleNamespace(stdin=SimpleNamespace(isatty=lambda: True))
    )
    outcome = run.invoke(app, ["init"], input="\n")
    assert outcome.exit_code == 130
    assert outcome.stderr == "\nlaufruhe: interrupted, nothing was written\n"
    assert list(here.iterdir()) == []


def test_a_new_folder_is_made_and_the_next_command_can_be_pasted(here: Path) -> None:
    outcome = run.invoke(app, ["init", "new folder/it's mine.toml", "--from", "bmw-b48"])
    assert outcome.exit_code == 0
    *_, verb, named = shlex.split(outcome.output.partition("; then: ")[2])
    assert (verb, (here / named).is_file()) == ("solve", True)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["init", ".", "--from", "bmw-b48"], "file = .: is a folder; name a file in it"),
        (["init", "file/x.toml", "--from", "bmw-b48"], "'file' is not a folder); name another place"),
        (["examples", "tractor-single", "--to", "file"], "'file' is not a folder); name another place"),
    ],
)
def test_an_unwritable_path_is_refused_before_questions(here: Path, words: list[str], said: str) -> None:
    (here / "file").write_text("mine", encoding="utf-8")
    outcome = run.invoke(app, words)
    assert (outcome.exit_code, outcome.output.count("\n")) == (2, 1)
    assert said in outcome.output
    assert [path.name for path in here.iterdir()] == ["file"]


@pytest.mark.parametrize("words", [["init", "a/b/mine.toml", "--from", "bmw-b48"], ["examples", "tractor-sweeps"]])
def test_a_full_disk_leaves_no_partial_files(here: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]) -> None:
    write = files.write

    def full(path: Path, text: str) -> None:
        write(path, text[:10])
        if len([*here.rglob(".unfinished-*")]) == 2:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files, "write", full)
    outcome = run.invoke(app, words)
    assert (outcome.exit_code, outcome.output.count("\n")) == (1, 1)
    assert re.search(r"'[^']*(schema\.json|\.toml)' cannot be written \(No space left", outcome.output)
    assert outcome.output.endswith("; free disk space, or name another folder\n")
    assert list(here.iterdir()) == []


def test_a_copied_study_names_the_study_command(here: Path) -> None:
    assert "laufruhe study mine.toml" in run.invoke(app, ["init", "mine.toml", "--from", "tractor-sweeps"]).output


def test_copies_bring_what_they_refer_to(here: Path) -> None:
    assert run.invoke(app, ["examples", "tractor-sweeps", "tractor-two", "--to", "mine"]).exit_code == 0
    made = {path.name for path in (here / "mine").iterdir()}
    assert {"tractor-sweeps.toml", "tractor-single.toml", "tractor-two.toml", *SCHEMAS} <= made
    load_study(here / "mine" / "tractor-sweeps.toml")
    # once more: the same files are no loss
    assert run.invoke(app, ["examples", "tractor-two", "--to", "mine"]).exit_code == 0


def test_engines_are_listed_and_shown() -> None:
    assert "bmw-s85" in run.invoke(app, ["engines"]).output
    shown = run.invoke(app, ["engines", "buick-3800"]).output
    assert "Source: Wikipedia" in shown
    assert 'reciprocating_mass = "0.81 kg"   # assumed' in shown


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["examples", "tractor-fourr"], "is no ready problem"),
        (["engines", "s85"], "did you mean 'bmw-s85'?"),
        (["engines", "laverd"], "did you mean 'laverda-1000'?"),
        (["engines", "bmw-b"], "use one of: bmw-b38, bmw-b48, bmw-b58"),
        (["engines", "bmw-b49"], "did you mean 'bmw-b48'?"),
        (["init", "--from", "bmw-b49"], "did you mean 'bmw-b48'?"),
    ],
)
def test_an_unknown_engine_or_problem_is_refused(here: Path, words: list[str], line: str) -> None:
    outcome = run.invoke(app, words)
    assert outcome.exit_code == 2
    assert line in outcome.output
