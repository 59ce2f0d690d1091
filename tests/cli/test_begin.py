"""Beginning without the repository: init, examples and engines from an empty folder."""

from __future__ import annotations

import errno
import re
import shlex
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.files.reader import load
from laufruhe.files.ready import SCHEMAS, ready
from laufruhe.report import files
from laufruhe.studies.reader import load_study
from problem_files import PROBLEMS

run = CliRunner()


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_ready_problem_has_a_use() -> None:
    assert sorted(ready()) == sorted(path.stem for path in PROBLEMS.glob("*.toml"))
    listed = run.invoke(app, ["examples"]).output
    assert all(f"  {name} " in listed for name in ready())


def test_the_wheel_carries_them() -> None:
    told = tomllib.loads((PROBLEMS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    assert told["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"] == {"problems": "laufruhe/problems"}


@pytest.mark.parametrize("name", ["bmw-b48", "tractor-single"])
def test_init_writes_a_problem_that_loads(here: Path, name: str) -> None:
    assert run.invoke(app, ["init", "mine.toml", "--from", name]).exit_code == 0
    text = (here / "mine.toml").read_text(encoding="utf-8")
    assert text.startswith("#:schema ./laufruhe.schema.json\n")
    assert {path.name for path in here.iterdir()} == {"mine.toml", "laufruhe.schema.json"}
    assert load(here / "mine.toml").objective


def test_init_leaves_what_is_there(here: Path) -> None:
    (here / "problem.toml").write_text("mine", encoding="utf-8")
    found = run.invoke(app, ["init", "--from", "bmw-b48"])
    assert found.exit_code == 2
    assert "problem.toml: exists with other contents" in found.output
    assert [path.name for path in here.iterdir()] == ["problem.toml"]


def test_init_with_nobody_to_ask_says_what_to_do(here: Path) -> None:
    found = run.invoke(app, ["init"])
    assert (found.exit_code, list(here.iterdir())) == (2, [])
    assert "add --from" in found.output


@pytest.mark.parametrize(
    ("typed", "cylinders"),
    [
        ("\nMy four\n\n\n\n\n\n\n\n\n\n", 4),
        ("\nMy twin\nvee\n\n2\n60\n\n\n\n\n\n\n0.4 kg\n", 2),
        ("\nMy six\nvee\n\n6\n60\n60\none bank after the other\nleft\n1-6-3-5-2-4\n\n\n\n\n\n", 6),
        ("\nMy single\n\n\n1\n\n\n\n\n", 1),
        # two cylinders on one throw have no neighbours
        ("\nMy two\nboxer\n\n2\n\n\n\n1-2\n\n\n0.3\n0.4 kg\n", 2),
        ("\nMy ten\nvee\n\n10\n\n\n\nleft\n-\n0, 144, 216, 288, 72\n-\n\n\n\n\n\n", 10),
    ],
)
def test_init_asks(here: Path, monkeypatch: pytest.MonkeyPatch, typed: str, cylinders: int) -> None:
    monkeypatch.setattr("laufruhe.cli.begin._someone_answers", lambda: True)
    found = run.invoke(app, ["init"], input=typed)
    assert found.exit_code == 0, found.output
    assert len(load(here / "problem.toml").engine.cylinders) == cylinders


@pytest.mark.parametrize(
    ("typed", "said", "count"),
    [
        # an odd number of cylinders in two banks, then an even one
        ("\n\nboxer\n\n5\n4\n\n\n\n\n\n\n\n\n\n", "is no multiple of the 2 banks", 4),
        # no even firing of ten cylinders at 90 degrees, nothing in its place, then throws and an order that they allow
        ("\n\nvee\n\n10\n\n\n\nleft\n1-10-5-7-2-8-3-9-4-6\n\n\n45,117,333,189,261\n1-2-3-4-5-6-7-8-9-10\n\n\n\n\n\n\n",
         "cannot be even: cylinders 1 and 6", 10),
        ("\n\nw\n\n\n\n\n\n\n\n\n\n", "is none of these; use one of", 4),
        ("bmw-b49\n\n\n\n\n\n\n\n\n\n\n\n", "did you mean 'bmw-b48'?", 4),
        ("\n\n\n\nfive\n3\n1-2\n\n\n\n\n\n\n", "must be a whole number", 3),
        ("\n\n\n\n\n\n\n\n1,5 mm\n\n1.2\n\n\n", 'write "1.5 mm"', 4),
        ("\n\n\n\n\n\n\n\n\n1.2\n\n\n", "blocks the crank", 4),
    ],
)  # fmt: skip
def test_a_mistake_is_told_and_asked_again(
    here: Path, monkeypatch: pytest.MonkeyPatch, typed: str, said: str, count: int
) -> None:
    monkeypatch.setattr("laufruhe.cli.begin._someone_answers", lambda: True)
    found = run.invoke(app, ["init"], input=typed)
    assert found.exit_code == 0, found.output
    assert said in found.output
    assert "draft" not in found.output
    assert len(load(here / "problem.toml").engine.cylinders) == count


def test_nothing_is_asked_for_a_file_that_is_there(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("laufruhe.cli.begin._someone_answers", lambda: True)
    (here / "problem.toml").write_text("mine", encoding="utf-8")
    found = run.invoke(app, ["init"])
    assert (found.exit_code, found.output.count("\n")) == (2, 1)


def test_ctrl_c_at_a_question_ends_as_everywhere(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("laufruhe.cli.begin._someone_answers", lambda: True)
    # an end of what is typed is told in the same way
    found = run.invoke(app, ["init"], input="\n")
    assert found.exit_code == 130
    assert found.stderr == "\nlaufruhe: interrupted, nothing was written\n"
    assert list(here.iterdir()) == []


def test_a_new_folder_is_made_and_the_next_command_can_be_pasted(here: Path) -> None:
    found = run.invoke(app, ["init", "new folder/it's mine.toml", "--from", "bmw-b48"])
    assert found.exit_code == 0
    *_, verb, named = shlex.split(found.output.partition("; then: ")[2])
    assert (verb, (here / named).is_file()) == ("solve", True)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["init", ".", "--from", "bmw-b48"], "file = .: is a folder; name a file in it"),
        (["init", "file/x.toml", "--from", "bmw-b48"], "'file' is not a folder); name another place"),
        (["examples", "tractor-single", "--to", "file"], "'file' is not a folder); name another place"),
    ],
)
def test_what_cannot_be_written_is_refused_before(here: Path, words: list[str], said: str) -> None:
    (here / "file").write_text("mine", encoding="utf-8")
    found = run.invoke(app, words)
    assert (found.exit_code, found.output.count("\n")) == (2, 1)
    assert said in found.output
    assert [path.name for path in here.iterdir()] == ["file"]


@pytest.mark.parametrize("words", [["init", "a/b/mine.toml", "--from", "bmw-b48"], ["examples", "tractor-sweeps"]])
def test_a_full_disk_leaves_nothing_half_written(here: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]) -> None:
    write = files.write

    def full(path: Path, text: str) -> None:
        write(path, text[:10])
        if len([*here.rglob(".unfinished-*")]) == 2:
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files, "write", full)
    found = run.invoke(app, words)
    assert (found.exit_code, found.output.count("\n")) == (1, 1)
    assert re.search(r"'[^']*(schema\.json|\.toml)' cannot be written \(No space left", found.output)
    assert found.output.endswith("; free disk space, or name another folder\n")
    assert list(here.iterdir()) == []


def test_what_begins_as_a_study_is_run_as_one(here: Path) -> None:
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
def test_what_is_not_there_is_refused(here: Path, words: list[str], line: str) -> None:
    found = run.invoke(app, words)
    assert found.exit_code == 2
    assert line in found.output
