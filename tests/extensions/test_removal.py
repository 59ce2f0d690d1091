"""Core without the folder of an extension: imports, equal solutions, and messages that name missing parts."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from pydantic import ValidationError

import laufruhe
from extensions.removed_folder import SOURCE, without
from lanes import first_fast
from laufruhe import extension
from laufruhe.extension import HOMES, Tables
from laufruhe.files import complaints
from laufruhe.files.problem_file import ProblemFile
from laufruhe.prove.mounts.provers import PROVERS, Prover
from laufruhe.solvers import methods
from laufruhe.solvers.method import Method
from problem_files import PROBLEMS
from shared import once

EXTENSIONS = sorted(path.name for path in (SOURCE / "extensions").iterdir() if (path / "__init__.py").exists())
MAIN = "tractor-four-lanchester"
STUDY = 'title = "t"\n[study]\n[[study.parts]]\nkind = "{}"\nname = "n"\ntitle = "t"\ncases = []\n'
# one entry of each table and extension stands for all
NEEDS = list({(table, home): (table, name) for table, homes in HOMES.items() for name, home in homes.items()}.values())
ON = {one.name: one.needs for one in extension.extensions() if one.needs}
ORDERED = [
    ("methods", Method, methods._CORE),
    ("reductions", methods.Reduction, methods.REDUCTIONS),
    ("provers", Prover, PROVERS),
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
        "reductions": ("solve", text.replace("[objective]", '[[objective]]\nminimise = "added mass"\n[[objective]]')),
        "gas_models": ("solve", text.replace('model = "seiliger"', f'model = "{name}"')),
        "norms": ("solve", re.sub(r"minimise = .*", f'minimise = "{name} mount force"', text)),
        "channels": ("solve", re.sub(r"minimise = .*", f'minimise = "{name}"', text)),
        "notes": ("solve", re.sub(r"reciprocating_mass = .*", f"reciprocating_mass = {mass}", text)),
    }[table]
    (folder / "asked.toml").write_text(file, encoding="utf-8")
    return [command, str(folder / "asked.toml")]


def commands_without(names: Sequence[str], folder: Path) -> list[list[str]]:
    """Return the command that solves, then one for each entry of a table that these extensions have."""
    ends = ["--no-plots", "--out", str(folder / "out"), "--json", str(folder / "result.json")]
    needs = [words_of(*need, folder / f"asked-{k}") for k, need in enumerate(lacking(names))]
    return [["solve", str(PROBLEMS / f"{MAIN}.toml"), *ends], *needs]


def lacking(names: Sequence[str]) -> list[tuple[Tables, str]]:
    """Return the entries that these extensions have, or others that build on these."""
    return [(table, entry) for table, entry in NEEDS if missing(table, entry, names)]


def missing(table: Tables, entry: str, names: Sequence[str]) -> str:
    """Return the extension whose absence refuses an entry; empty if it is there."""
    home = HOMES[table][entry]
    return next((name for name in (home, *ON.get(home, ())) if name in names), "")


@pytest.fixture(scope="module")
def answers() -> Iterator[Callable[[Sequence[str]], Path]]:
    """Yield the folder with the answers of commands that see the package without some extensions."""
    script = str(Path(__file__).with_name("forked_commands.py"))
    streams = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen([sys.executable, script], text=True, **streams) as server:

        def fill(names: Sequence[str]) -> Callable[[Path], None]:
            def run(folder: Path) -> None:
                without(names, folder)
                copy = {"folder": str(folder), "commands": commands_without(names, folder)}
                print(json.dumps(copy), file=server.stdin, flush=True)
                assert server.stdout.readline() == "done\n", server.stderr.read()
                shutil.rmtree(folder / "laufruhe")

            return run

        # the name of a file is short, however many folders there are
        yield lambda names: once(f"without-{names[0] if len(names) == 1 else 'all'}", fill(names))
        server.stdin.close()
        server.wait()


def answer_of(folder: Path, k: int) -> Answer:
    assert (folder / f"{k}.status").exists(), (folder / "import.err").read_text(encoding="utf-8")
    error = (folder / f"{k}.err").read_text(encoding="utf-8")
    return Answer(int((folder / f"{k}.status").read_text(encoding="utf-8")), error)


def test_every_home_is_there() -> None:
    assert {home for homes in HOMES.values() for home in homes.values()} <= set(EXTENSIONS)


def test_nothing_imports_an_extension_of_others_as_it_is_imported() -> None:
    """A copy without one extension then imports as the copy without all of them does; `needs` go together."""
    for path in SOURCE.rglob("*.py"):
        room, own, *_ = [*path.relative_to(SOURCE).parts, ""]
        names = re.findall(
            r"^(?:from|import) laufruhe\.extensions\.(\w+)", path.read_text(encoding="utf-8"), re.MULTILINE
        )
        assert set(names) <= ({own, *ON.get(own, ())} if room == "extensions" else set()), path


@pytest.mark.parametrize("name", EXTENSIONS)
def test_other_additions_keep_their_order_without_an_extension(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    others = tuple(other for other in extension.extensions() if other.name != name)
    monkeypatch.setattr(extension, "extensions", lambda: others)
    for table, kind, core in ORDERED:
        assert len(extension.in_order(table, kind, core)) >= len(core)


@pytest.mark.parametrize(("table", "key"), [("gas", "chambers"), ("operating_points", "pressure_file")])
def test_a_key_inside_a_table_names_its_extension(table: str, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(complaints, "is_installed", lambda _: False)
    tables = tomllib.loads((PROBLEMS / "compressor-set.toml").read_text(encoding="utf-8"))
    tables = {name: entry for name, entry in tables.items() if name not in HOMES["keys"]}
    changed = tables[table][0] if isinstance(tables[table], list) else tables[table]
    changed[key] = []
    with pytest.raises(ValidationError) as error:
        # the model of files without the keys of extensions
        ProblemFile.model_validate(tables)
    (complaint,) = complaints.complaints_of(error.value, ProblemFile)
    assert complaint.rule == f"needs the extension '{HOMES['gas_models'][key]}', which is not installed"


REMOVED = [EXTENSIONS, *([name] for name in EXTENSIONS)]


@pytest.mark.parametrize("names", first_fast(REMOVED, 0, 1))
def test_the_core_runs_without_extensions(names: list[str], answers: Callable[[Sequence[str]], Path]) -> None:
    folder = answers(names)
    solved = answer_of(folder, 0)
    assert solved.status == 0, solved.error
    objective = laufruhe.solve(PROBLEMS / f"{MAIN}.toml").objective
    assert objective is not None
    assert json.loads((folder / "result.json").read_text(encoding="utf-8"))["objective"]["value"] == objective.value
    for k, (table, name) in enumerate(lacking(names), start=1):
        refused = answer_of(folder, k)
        assert refused.status == 2, refused.error
        (line,) = refused.error.strip().splitlines()
        assert f"needs the extension '{missing(table, name, names)}'" in line
