"""Damaged files: every command reads them or refuses them line by line."""

from __future__ import annotations

import re
import time
import tomllib
from collections import Counter
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cli import scenes
from faults import harness
from lanes import first_fast
from laufruhe.cli import app
from laufruhe.cli.screen import BAD_INPUT
from problem_files import written

STUDY = """
title = "A sweep"
[study]
[[study.parts]]
kind = "layout comparison"
name = "one"
title = "One"
cases = [{ name = "a", problem = "scene.toml" }, { name = "b", problem = "scene.toml" }]
sweep = [{ quantity = "engine.rod_ratio", values = [0.2, 0.3] }]
"""


def refused(path: Path, *words: str, verb: str = "check") -> str:
    """Check exit status 2 and one printable line with these words, and return it."""
    answer = CliRunner().invoke(app, [verb, str(path)])
    assert answer.exception is None or isinstance(answer.exception, SystemExit), answer.exception
    assert answer.exit_code == BAD_INPUT
    assert answer.stdout == ""
    (line,) = answer.stderr.splitlines()
    assert line.startswith(f"{path}: ")
    assert line.isprintable()
    assert len(line) < len(str(path)) + 1000
    for word in words:
        assert word in line
    return line


def spoilt(folder: Path, old: str, new: str) -> Path:
    assert old in scenes.GIVEN
    return written(folder, scenes.GIVEN.replace(old, new))


DAMAGED = [("check", 526, 60), ("evaluate", 3000, 15), ("explain", 4100, 15), ("check", 0, 800)]


@pytest.mark.parametrize(("verb", "first", "count"), first_fast(DAMAGED, 0, 3))
def test_damaged_files(verb: str, first: int, count: int, tmp_path: Path) -> None:
    result = harness.run(range(first, first + count), verb, tmp_path, jobs=2)
    assert [one for one in result if one.wrong] == []
    assert [one.seed for one in result] == list(range(first, first + count))
    # damage that is always found, or never, tests nothing
    statuses = Counter((one.kind, one.status) for one in result)
    for kind in ("problem", "study", "trace") if verb == "check" else ("problem",):
        whole = sum(n for (of, _), n in statuses.items() if of == kind)
        assert 0.01 * whole < statuses[kind, 0] < 0.7 * whole
    assert list(tmp_path.iterdir()) == []


def test_the_same_seed_does_the_same_damage() -> None:
    assert harness.damaged(7) == harness.damaged(7) != harness.damaged(8)


def test_undamaged_files_are_read(tmp_path: Path) -> None:
    harness.prepared(tmp_path)
    (tmp_path / "trace.csv").write_text(harness.TRACE, encoding="utf-8")
    for name in ("traced.toml", "tractor-sweeps.toml"):
        assert CliRunner().invoke(app, ["check", str(tmp_path / name)]).exit_code == 0


@pytest.mark.parametrize("deep", [17, 90, 400, 3000])
@pytest.mark.parametrize("open_close", ["[]", "{a=\0}"])
def test_deep_nesting(deep: int, open_close: str, tmp_path: Path) -> None:
    first, last = open_close.split("\0") if "\0" in open_close else open_close
    value = first * deep + ("1" if open_close != "[]" else "") + last * deep
    refused(spoilt(tmp_path, 'stroke = "120 mm"', f"stroke = {value}"), "nested")
    refused(spoilt(tmp_path, 'stroke = "120 mm"', "stroke" + ".a" * deep + " = 1"), "nested")


@pytest.mark.parametrize(
    "text",
    ["a" + ".a" * 20_000 + " = 1", "[" + ".".join("a" * 17) + "]", "a" + ' . "b" ' * 17 + "= 1", "a = " + "[" * 17,
     "x = 1\na = " + "{a = " * 17, "a.'b'.c = { " + "d." * 17 + "e = 1 }"],
)  # fmt: skip
def test_deep_texts_are_not_parsed(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check a text whose parser would take 1.6 GB for 40 kB."""
    monkeypatch.setattr(tomllib, "loads", None)
    refused(written(tmp_path, text), f"line {1 + text.count(chr(10))}", "nested more than 16 levels deep")


@pytest.mark.parametrize(
    "value",
    ['"' + "a." * 50 + '"', "'" + "[" * 50 + "'", '"""\n' + "{a.b.\n[" * 50 + '"""', "'''" + "[" * 50 + "'''",
     '"x" # ' + "[a." * 50, r'"\\" # ' + "[" * 50, '"' + "'" + '"  # ' + "[" * 40, r'"\"' + "[" * 40 + '"'],
)  # fmt: skip
def test_texts_and_notes_have_no_depth(value: str, tmp_path: Path) -> None:
    text = f"source = {value}\n{scenes.GIVEN}"
    answer = CliRunner().invoke(app, ["check", str(written(tmp_path, text))])
    assert "nested" not in answer.stderr
    assert tomllib.loads(text)["source"]


@pytest.mark.parametrize("character", ["\\u001b", "\\u202e", "\\u2028", "\\u009b", "\\u0000"])
@pytest.mark.parametrize(
    ("old", "new"), [('title = "', 'title = "{}'), ('stroke = "', 'stroke = "{}'), ("stroke =", '"{}" =')]
)
def test_characters_that_command_a_screen(character: str, old: str, new: str, tmp_path: Path) -> None:
    refused(spoilt(tmp_path, old, new.format(character)), "U+" + character[2:].upper(), "not a printable character")


def test_a_file_name_cannot_command_a_screen(tmp_path: Path) -> None:
    answer = CliRunner().invoke(app, ["check", str(tmp_path / "a\x1b[2J\u202eb.toml")])
    assert answer.exit_code == BAD_INPUT
    assert "a\\x1b[2J\\u202eb.toml" in answer.stderr


def test_long_texts_are_cut(tmp_path: Path) -> None:
    refused(spoilt(tmp_path, 'stroke = "120 mm"', f'stroke = "1 {"m" * 5000}"'), "engine.stroke", "...")
    refused(spoilt(tmp_path, "stroke =", f"{'x' * 5000} = 1\nstroke ="), "engine.xxx", "...")
    names = ", ".join(f'"point {k}"' for k in range(900))
    refused(spoilt(tmp_path, "[mounts]", f'[mounts]\nnames = [{names}, "\\u0007"]'), "mounts.names[901]")


def test_many_faults_are_counted(tmp_path: Path) -> None:
    path = written(tmp_path, scenes.GIVEN + "assumptions = [" + "1," * 900 + "]")
    path.write_text("assumptions = [" + "1," * 900 + "]\n" + scenes.GIVEN, encoding="utf-8")
    lines = CliRunner().invoke(app, ["check", str(path)]).stderr.splitlines()
    assert len(lines) == 21
    assert "880 more" in lines[-1]


def test_more_than_any_engine_has(tmp_path: Path) -> None:
    path = written(tmp_path, "assumptions = [" + '"",' * 1001 + "]\n" + scenes.GIVEN)
    refused(path, "assumptions", "1001 entries", "1000")
    path.write_bytes(b"#" * 1_000_001)
    refused(path, "file", "1 MB")


@pytest.mark.parametrize(
    "content",
    [b"", b"\x00", b"\xff\xfe", b"[" * 3000, b"a = " + b"[" * 3000, b"title = 'x'\n" * 2, b"\xef\xbb\xbf", b"=" * 99,
     b"a = " + b"9" * 9999],
)  # fmt: skip
def test_files_that_are_no_problem_are_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "spoilt.toml"
    path.write_bytes(content)
    answer = CliRunner().invoke(app, ["check", str(path)])
    assert answer.exit_code == BAD_INPUT
    assert all(line.startswith(f"{path}: ") and line.isprintable() for line in answer.stderr.splitlines())


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "marked.toml"
    path.write_bytes(b"\xef\xbb\xbf" + scenes.GIVEN.encode().replace(b"\n", b"\r\n"))
    assert CliRunner().invoke(app, ["check", str(path)]).exit_code == 0


@pytest.mark.parametrize("cell", ["x" * 200_000, '"', "1\x00", "\u202e1", "nan"])
def test_cells_of_a_trace(cell: str, tmp_path: Path) -> None:
    path = written(tmp_path, harness.TRACED)
    (tmp_path / "trace.csv").write_text(harness.TRACE + f"360,{cell}\n", encoding="utf-8")
    refused(path, "gas")


def test_a_trace_that_never_ends(tmp_path: Path) -> None:
    path = written(tmp_path, harness.TRACED.replace("trace.csv", "/dev/zero"))
    refused(path, "gas.file", "is no file")
    (tmp_path / "trace.csv").write_text("1,2\n" * 100_002, encoding="utf-8")
    refused(written(tmp_path, harness.TRACED), "gas.file", "has 1 angle, too few for a cycle")


def test_a_trace_larger_than_any(tmp_path: Path) -> None:
    """Check a trace of 1 GB, which once took 2.1 GB of memory."""
    path = written(tmp_path, harness.TRACED)
    with (tmp_path / "trace.csv").open("wb") as stream:
        stream.truncate(30_000_001)
    refused(path, "gas.file", "larger than 30 MB")
    lines = harness.TRACE.splitlines()
    (tmp_path / "trace.csv").write_text("\n".join([lines[0] + "," * 1_000_000, *lines[1:]]), encoding="utf-8")
    assert CliRunner().invoke(app, ["check", str(path)]).exit_code == 0


@pytest.mark.parametrize(
    "values",
    ["[1e400, 1]", f"[{10**400}, 1]", "[[0.2], 0.3]", "[{}, 1]", "[nan, 0.1]", '["0.2", 0.3]', "[1e308, -1e308]", "[]",
     "[true, 1]", '["1e999 mm", "2 mm"]'],
)  # fmt: skip
@pytest.mark.parametrize(
    "quantity", ["engine.rod_ratio", "engine.stroke", "engine.throws.1", "operating_points.1.speed"]
)
def test_swept_values(values: str, quantity: str, tmp_path: Path) -> None:
    written(tmp_path, scenes.GIVEN)
    study = written(tmp_path, STUDY.replace("[0.2, 0.3]", values).replace("engine.rod_ratio", quantity), "study")
    answer = CliRunner().invoke(app, ["check", str(study)])
    assert isinstance(answer.exception, SystemExit), answer.exception
    assert answer.exit_code == BAD_INPUT
    assert len(answer.stderr.splitlines()) == 1


def test_check_of_a_study_counts_its_points(tmp_path: Path) -> None:
    written(tmp_path, scenes.GIVEN)
    study = written(tmp_path, STUDY, "study")
    answer = CliRunner().invoke(app, ["check", str(study)])
    assert (answer.exit_code, answer.stdout) == (0, "ok: A sweep, 4 points\n")


def test_a_tab_in_the_title_of_a_study_is_shown_as_one(tmp_path: Path) -> None:
    written(tmp_path, scenes.GIVEN)
    study = written(tmp_path, STUDY.replace("A sweep", "A\\tsweep"), "study")
    assert CliRunner().invoke(app, ["check", str(study)]).stdout == "ok: A\\tsweep, 4 points\n"


@pytest.mark.parametrize("name", ["inline-five-open", "vee-six-open", "two-stroke-four-open", "inline-five-uneven-gas"])
@pytest.mark.parametrize("cylinders", [24, 47, 48])
def test_many_open_cylinders_are_checked_at_once(name: str, cylinders: int, tmp_path: Path) -> None:
    text = (harness.PROBLEMS / f"{name}.toml").read_text(encoding="utf-8")
    path = written(tmp_path, re.sub(r"cylinders *= *\d+", f"cylinders = {cylinders}", text))
    assert f"cylinders = {cylinders}" in path.read_text(encoding="utf-8")
    started = time.process_time()
    assert CliRunner().invoke(app, ["check", str(path)]).exit_code in (0, 2)
    assert time.process_time() - started < 10.0


def test_too_much_at_once_is_refused_in_a_line(tmp_path: Path) -> None:
    steps = 'speed = "2500 rpm"\nup_to = "3500 rpm"\nsteps = '
    assert "operating_points" in scenes.GIVEN
    refused(spoilt(tmp_path, 'speed = "2500 rpm"', f"{steps}201"), "operating_points", "201", "200")
    path = spoilt(tmp_path, 'speed = "2500 rpm"', f"{steps}200")
    assert CliRunner().invoke(app, ["check", str(path)]).exit_code == 0
    weight = '[[counterweights]]\nname = "{}"\nopposite_throw = 1\nunbalance = {{ between = ["0 kg m", "1 kg m"] }}\n'
    many = scenes.GIVEN + "".join(weight.format(k) for k in range(201))
    refused(written(tmp_path, many, "many"), "200.unbalance", "at most 200 numbers can be open")
    fine = "".join(weight.format(k) for k in range(40)) + "[fidelity]\nsamples = 7200\n"
    path = written(tmp_path, path.read_text(encoding="utf-8") + fine)
    refused(path, "million numbers", verb="solve")


@pytest.mark.parametrize("key", ["orders", "mounts", "operating_points"])
def test_a_measure_of_zero(key: str, tmp_path: Path) -> None:
    limit = f'[[constraints]]\nlimit = "mean mount force"\nmax = "1 N"\n{key} = []\n'
    refused(written(tmp_path, scenes.GIVEN + limit), f"constraints[1].{key}", "is empty")


def test_a_name_stands_on_one_line(tmp_path: Path) -> None:
    for name, word in (("tab\\there", "tab"), ("two\\nlines", "lines")):
        weight = f'[[counterweights]]\nname = "{name}"\nopposite_throw = 1\nunbalance = "1 kg m"\n'
        refused(written(tmp_path, scenes.GIVEN + weight), "counterweights", "on one line", word)
