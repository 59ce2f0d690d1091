"""Conventions of a command line: help, quiet and verbose, standard input, completion, progress."""

from __future__ import annotations

import base64
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from cli import scenes
from laufruhe.cli import app
from laufruhe.cli.screen import Watched, spoken
from laufruhe.files import reader
from laufruhe.numerics.progress import Step, progress_listener, report_progress, search_scope
from laufruhe.solvers import solve
from problem_files import PROBLEMS, loaded, written

run = CliRunner()
COMMANDS = ("init", "examples", "engines", "solve", "evaluate", "study", "check", "explain", "trade")
SINGLE = PROBLEMS / "tractor-single.toml"


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command_has_an_example(command: str) -> None:
    short, long = (run.invoke(app, [command, flag]) for flag in ("-h", "--help"))
    assert short.exit_code == 0
    assert short.output == long.output
    assert f"  laufruhe {command}" in short.output.partition("Example")[2]


def test_every_command_is_documented() -> None:
    page = (PROBLEMS.parent / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")
    listed = re.findall(r"^  (\w+) ", run.invoke(app, ["-h"]).output.partition("Commands:")[2], re.MULTILINE)
    assert set(COMMANDS) <= set(listed)
    assert all(f"| `{name} " in page for name in COMMANDS)
    for status in ("0", "1", "2", "130"):
        assert f"| {status} |" in page


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
def test_output_that_cannot_be_written_is_an_error(here: Path) -> None:
    words = [sys.executable, "-m", "laufruhe", "check", str(SINGLE)]
    with Path("/dev/full").open("w") as full:
        process = subprocess.run(words, cwd=here, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert process.returncode == 1
    assert process.stderr.startswith("laufruhe: the output cannot be written (No space left")
    assert process.stderr.count("\n") == 1


def shell(words: str, here: Path) -> subprocess.CompletedProcess[str]:
    """Run a command whose streams a shell closes."""
    line = f"{shlex.quote(sys.executable)} -m laufruhe {words}"
    return subprocess.run(["sh", "-c", line], cwd=here, capture_output=True, text=True, check=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        ("check p.toml <&-", 0, ""),
        ("check p.toml 2>&-", 0, ""),
        ("check none.toml 2>&-", 2, ""),
        ("check none.toml >&- 2>&- <&-", 2, ""),
        ("check p.toml >&-", 1, "laufruhe: the output cannot be written"),
        ("--version >&-", 1, "laufruhe: the output cannot be written"),
        ("check p.toml -q >&- 2>&- <&-", 0, ""),
        ("check - <&-", 2, "stdin: title: is missing"),
        ("init new.toml <&-", 2, "laufruhe: init: asks questions, but the input ended"),
        ("evaluate p.toml --no-plots --out o --json - >&-", 1, "laufruhe: the output cannot be written"),
    ],
)
def test_closed_streams(words: str, status: int, said: str, here: Path) -> None:
    shutil.copy(SINGLE, here / "p.toml")
    result = shell(words, here)
    assert (result.returncode, result.stderr[: len(said)]) == (status, said)
    assert "Traceback" not in result.stderr
    assert said or not result.stderr


@pytest.mark.slow
def test_files_do_not_take_the_numbers_of_closed_streams(here: Path) -> None:
    """Compare files written with open and with closed streams; a pipe gets no colours."""
    shutil.copy(SINGLE, here / "p.toml")
    for out, streams in (("open", ""), ("closed", "-q >&- 2>&- <&-")):
        process = shell(f"evaluate p.toml --no-plots --out {out} {streams}", here)
        assert process.returncode == 0
        assert "\x1b" not in process.stdout + process.stderr
        assert bool(process.stdout) == (out == "open")
    names = sorted(path.name for path in (here / "open").iterdir())
    assert sorted(path.name for path in (here / "closed").iterdir()) == names
    for name in (name for name in names if name.endswith(".csv")):
        assert (here / "open" / name).read_bytes() == (here / "closed" / name).read_bytes()


def test_names_of_files_cannot_command_a_screen(here: Path) -> None:
    path = here / "a\x1b[31m\u202eb.toml"
    shutil.copy(SINGLE, path)
    for words in (["check", path.name], ["evaluate", path.name, "--no-plots"],
                  ["evaluate", path.name, "--no-plots", "--out", "o\x1b[2J\u202e"],
                  ["init", "n\x1b[2J\u202e.toml", "--from", "vw-ea827-2-0"],
                  ["examples", "tractor-single", "--to", "t\x1b[2J\u202e"]):  # fmt: skip
        outcome = run.invoke(app, words)
        assert outcome.exit_code == 0
        assert "\\x1b" in outcome.output
        assert all(line.isprintable() for line in outcome.output.splitlines())
    (folder,) = (here / "results").iterdir()
    for page in (folder / "report.md", folder / "report.html"):
        assert "\x1b" not in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("command", ["check", "solve", "evaluate", "study", "explain", "trade"])
def test_a_file_without_permission_is_refused_in_a_line(
    here: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """Check that the reader refuses a file without permission in its one line."""

    whole = Path.open

    def forbidden(path: Path, *given: Any, **named: Any) -> Any:
        if path.name == "mine.toml":
            raise PermissionError(13, "Permission denied")
        return whole(path, *given, **named)

    (here / "mine.toml").write_text("", encoding="utf-8")
    monkeypatch.setattr(os, "access", lambda *_, **__: False)
    monkeypatch.setattr(Path, "open", forbidden)
    outcome = run.invoke(app, [command, "mine.toml"])
    assert outcome.exit_code == 2
    assert outcome.stderr == "mine.toml: file: cannot be read (Permission denied); check its permissions\n"


def test_quiet_says_nothing_and_writes_all(here: Path) -> None:
    outcome = run.invoke(app, ["evaluate", str(SINGLE), "-q", "--no-plots"])
    assert (outcome.exit_code, outcome.output) == (0, "")
    assert (here / "results" / "tractor-single-initial" / "result.json").is_file()
    assert run.invoke(app, ["check", str(SINGLE), "-q"]).output == ""
    assert "does not exist" in run.invoke(app, ["check", "none.toml", "-q"]).output


def test_verbose_says_every_step_in_a_line(here: Path) -> None:
    outcome = run.invoke(app, ["evaluate", str(SINGLE), "-v", "--no-plots"])
    assert re.search(r"^ +\d+\.\d s  reading the problem$", outcome.stderr, re.MULTILINE)
    assert "reading" not in outcome.stdout


def test_quiet_and_verbose_contradict_each_other(here: Path) -> None:
    outcome = run.invoke(app, ["check", str(SINGLE), "-q", "-v"])
    assert outcome.exit_code == 2
    assert "-q: is given beside -v" in outcome.output


def test_help_describes_every_command_in_one_line() -> None:
    commands = run.invoke(app, ["--help"], env={"COLUMNS": "80"}).output.partition("Commands:")[2]
    assert "trade" in commands
    assert "..." not in commands


def test_loudness_may_stand_before_the_command(here: Path) -> None:
    assert run.invoke(app, ["-q", "check", str(SINGLE)]).output == ""
    assert "reading the problem" in run.invoke(app, ["-v", "evaluate", str(SINGLE), "--no-plots"]).stderr
    # and holds for that command alone
    assert "ok: " in run.invoke(app, ["check", str(SINGLE)]).output


def test_options_before_the_command_are_refused_with_a_remedy(here: Path) -> None:
    outcome = run.invoke(app, ["--json", "found.json", "check", str(SINGLE)])
    assert (outcome.exit_code, list(here.iterdir())) == (2, [])
    assert (
        outcome.output
        == "laufruhe: --json: belongs after the command; write it there, as in: laufruhe check ... --json\n"
    )
    assert "No such option" in run.invoke(app, ["--nothing", "check", str(SINGLE)]).output


@pytest.mark.parametrize("words", [["check"], ["evaluate", "--no-plots"]], ids=["check", "evaluate"])
def test_a_problem_may_come_from_standard_input(here: Path, words: list[str]) -> None:
    reader._standard_input.cache_clear()
    found = run.invoke(app, [*words, "-"], input=SINGLE.read_bytes())
    assert found.exit_code == 0, found.output
    assert (here / "results" / "stdin-initial").is_dir() == (words[0] == "evaluate")
    reader._standard_input.cache_clear()
    found = run.invoke(app, [*words, "-"], input=b"title = 5")
    assert found.exit_code == 2
    assert "stdin: title = 5" in found.output
    reader._standard_input.cache_clear()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_commands_and_engines(shell: str, here: Path) -> None:
    completion_words = {"bash": {"COMP_WORDS": "laufruhe init --from bmw-s8", "COMP_CWORD": "3"}}.get(
        shell, {"_TYPER_COMPLETE_ARGS": "laufruhe init --from bmw-s8", "_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    )
    environment = {**completion_words, "_LAUFRUHE_COMPLETE": f"complete_{shell}"}
    output = run.invoke(app, [], env=environment, prog_name="laufruhe").stdout
    assert "bmw-s85" in output
    assert "buick" not in output
    if shell == "bash":
        # the command itself is asked once
        words = [sys.executable, "-c", "import sys; sys.argv = ['laufruhe']; from laufruhe.cli import main; main()"]
        alone = subprocess.run(words, env={**os.environ, **environment}, capture_output=True, text=True, timeout=300)
        assert alone.stdout.split() == output.split()


def test_progress_shows_value_bound_and_gap_of_the_outermost_search() -> None:
    said: list[str] = []
    with spoken(quiet=False, verbose=False):
        watched = Watched(said.append, "N")
        for step in (
            Step((), "stars", 2, 24, 227.4, 220.0),
            Step(("star 3 of 24",), "starts", 1, 4),
            Step(("star 3 of 24",), "boxes", 7, 0, 300.0, 100.0),
            Step((), "ends", 1, 3),
        ):
            watched._next = 0.0
            watched(step)
    assert said == [
        "stars: 2 of 24, best 227.4 N, bound 220.0 N, gap 3.3 %",
        "star 3 of 24, starts: 1 of 4, best 227.4 N, bound 220.0 N, gap 3.3 %",
        "star 3 of 24, boxes: 7, best 227.4 N, bound 220.0 N, gap 3.3 %",
        "ends: 1 of 3",
    ]


def test_searches_report_progress_to_their_listener_only() -> None:
    steps: list[Step] = []
    with progress_listener(steps.append), search_scope("outer"):
        report_progress("inner", 1, 2, 3.0, 2.0)
    report_progress("nobody listens")
    assert [(step.within, step.what, step.gap) for step in steps] == [(("outer",), "inner", pytest.approx(1 / 3))]
    assert math.isnan(Step((), "x").gap)


OPEN_FOUR = """
title = "Two-stroke four"
[engine]
layout = "inline"
cycle = "two-stroke"
cylinders = 4
stroke = "120 mm"
rod_ratio = 0.26
reciprocating_mass = "1.25 kg"
cylinder_spacing = "125 mm"
throws = "open"
[[operating_points]]
speed = "2000 rpm"
[[counterweights]]
name = "front"
x = "187.5 mm"
unbalance = { between = ["0 kg m", "0.3 kg m"] }
angle = { between = [0, 360] }
[objective]
minimise = "rms mount force"
[mounts]
positions = [["300 mm", "250 mm", "0 mm"], ["300 mm", "-250 mm", "0 mm"], ["-300 mm", "0 mm", "0 mm"]]
"""


def test_progress_of_a_star_search_encloses_the_optimum(tmp_path: Path) -> None:
    steps: list[Step] = []
    result = solve(loaded(tmp_path, OPEN_FOUR), steps.append)
    assert result.objective is not None
    valued = [step for step in steps if math.isfinite(step.value) and math.isfinite(step.bound)]
    assert valued
    for step in valued:
        assert step.bound <= result.objective.value * (1.0 + 1e-4)
        assert step.value >= result.objective.value * (1.0 - 1e-4)


@pytest.mark.parametrize(("kind", "ends"), [("svg", {".svg"}), ("png", {".png"}), ("both", {".svg", ".png"})])
def test_pictures_have_the_chosen_format(here: Path, kind: str, ends: set[str]) -> None:
    assert run.invoke(app, ["evaluate", str(SINGLE), "-q", "--format", kind]).exit_code == 0
    folder = here / "results" / "tractor-single-initial"
    assert {path.suffix for path in folder.glob("bars.*")} == ends
    first = "png" if kind == "png" else "svg"
    assert f"(bars.{first})" in (folder / "report.md").read_text(encoding="utf-8")
    page = (folder / "report.html").read_text(encoding="utf-8")
    shown = [base64.b64decode(text).decode() for text in re.findall(r"data:image/svg\+xml;base64,([^\"]+)", page)]
    assert len(shown) == len(list(folder.glob(f"*.{first}"))) > 0
    assert all(text.count("<svg") == 1 for text in shown)
    if first == "svg":
        assert set(shown) == {path.read_text(encoding="utf-8") for path in folder.glob("*.svg")}


@pytest.mark.slow
@pytest.mark.parametrize(("more", "lines"), [([], 1), (["-q"], 0)])
def test_letters_without_a_font_give_one_warning(more: list[str], lines: int, tmp_path: Path) -> None:
    """Check letters of Linear A in a new process without a backend and with broken settings."""
    (tmp_path / "matplotlibrc").write_bytes(b"font.size: nonsense\n\xff\xfe\n")
    path = written(tmp_path, scenes.SHAKING_ONLY.replace('title = "', 'title = "\U00010600 '))
    words = [sys.executable, "-m", "laufruhe", "evaluate", str(path), "--out", str(tmp_path / "out"), *more]
    env = {**os.environ, "MPLBACKEND": "junk"}
    found = subprocess.run(words, env=env, cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300)
    assert (tmp_path / "out/cycle.svg").is_file()
    warning = "laufruhe: no installed font has '\U00010600', so pictures show boxes in its place"
    assert [line[: len(warning)] for line in found.stderr.splitlines()] == lines * [warning]
