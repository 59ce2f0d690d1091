"""Without the folder of an extension the core imports, solves the same, and names what a file lacks."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import laufruhe
from extensions.removed_folder import SOURCE, without
from laufruhe.extension import HOMES, Tables
from problem_files import PROBLEMS
from shared import once

EXTENSIONS = sorted(path.name for path in (SOURCE / "extensions").iterdir() if (path / "__init__.py").exists())
MAIN = "tractor-four-lanchester"
STUDY = 'title = "t"\n[study]\n[[study.parts]]\nkind = "{}"\nname = "n"\ntitle = "t"\ncases = []\n'
# one channel of each extension stands for all
NEEDS = [
    (t, n)
    for t, homes in HOMES.items()
    for n in (homes if t != "channels" else {h: n for n, h in homes.items()}.values())
]


@dataclass(frozen=True)
class Answer:
    status: int
    error: str


def words_of(table: Tables, name: str, folder: Path) -> list[str]:
    """Return a command that needs an entry of a table, and write its file."""
    folder.mkdir()
    text = (PROBLEMS / f"{MAIN}.toml").read_text(encoding="utf-8")
    layout, drive = (f"{said}\nkey_of_its_own = 1" for said in (f'"{name}"', f'"inline"\ndrive = "{name}"'))
    mass = '{ between = ["1 kg", "2 kg"], tolerance = "1 %" }' if name == "tolerance" else f'"2 kg {name} 1 %"'
    command, file = {
        "layouts": ("solve", text.replace('"inline"', layout)),
        "drives": ("solve", text.replace('"inline"', drive)),
        "study_kinds": ("study", STUDY.format(name)),
        "commands": (name, text),
        "keys": ("solve", f"{text}\n[{name}]\n"),
        "weight_keys": ("solve", f'{text}\n[[counterweights]]\nname = "w"\n{name} = {{}}\n'),
        "channels": ("solve", re.sub(r"minimise = .*", f'minimise = "{name}"', text)),
        "notes": ("solve", re.sub(r"reciprocating_mass = .*", f"reciprocating_mass = {mass}", text)),
    }[table]
    (folder / "asked.toml").write_text(file, encoding="utf-8")
    return [command, str(folder / "asked.toml")]


def commands_without(name: str, folder: Path) -> list[list[str]]:
    """Return the command that solves, then one for each entry of a table that the extension has."""
    ends = ["--no-plots", "--out", str(folder / "out"), "--json", str(folder / "result.json")]
    lacking = [(table, entry) for table, entry in NEEDS if HOMES[table][entry] == name]
    asked = [words_of(table, entry, folder / f"asked-{k}") for k, (table, entry) in enumerate(lacking)]
    return [["solve", str(PROBLEMS / f"{MAIN}.toml"), *ends], *asked]


@pytest.fixture(scope="module")
def answers() -> Iterator[Callable[[str], Path]]:
    """Folder with the answers of commands that see the package without an extension."""
    script = str(Path(__file__).with_name("forked_commands.py"))
    streams = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, script], text=True, **streams) as server:

        def fill(name: str) -> Callable[[Path], None]:
            def run(folder: Path) -> None:
                without(name, folder)
                copy = {"folder": str(folder), "commands": commands_without(name, folder)}
                print(json.dumps(copy), file=server.stdin, flush=True)
                assert server.stdout.readline() == "done\n", server.stderr.read()
                shutil.rmtree(folder / "laufruhe")

            return run

        yield lambda name: once(f"without-{name}", fill(name))
        server.stdin.close()
        server.wait()


def answer_of(folder: Path, k: int) -> Answer:
    assert (folder / f"{k}.status").exists(), (folder / "import.err").read_text(encoding="utf-8")
    error = (folder / f"{k}.err").read_text(encoding="utf-8")
    return Answer(int((folder / f"{k}.status").read_text(encoding="utf-8")), error)


def test_every_home_is_there() -> None:
    assert {home for homes in HOMES.values() for home in homes.values()} <= set(EXTENSIONS)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXTENSIONS)
def test_the_core_runs_without_an_extension(name: str, answers: Callable[[str], Path]) -> None:
    folder = answers(name)
    solved = answer_of(folder, 0)
    assert solved.status == 0, solved.error
    objective = laufruhe.solve(PROBLEMS / f"{MAIN}.toml").objective
    assert objective is not None
    assert json.loads((folder / "result.json").read_text(encoding="utf-8"))["objective"]["value"] == objective.value


@pytest.mark.slow
@pytest.mark.parametrize(("table", "name"), NEEDS)
def test_a_file_or_command_that_needs_it_is_refused_by_its_name(
    table: Tables, name: str, answers: Callable[[str], Path]
) -> None:
    home = HOMES[table][name]
    lacking = [(t, n) for t, n in NEEDS if HOMES[t][n] == home]
    refused = answer_of(answers(home), 1 + lacking.index((table, name)))
    assert refused.status == 2
    (line,) = refused.error.strip().splitlines()
    assert f"needs the extension '{home}'" in line
