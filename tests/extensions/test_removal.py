"""Without the folder of an extension the core imports, solves the same, and names what a file lacks."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import laufruhe
from laufruhe.extension import HOMES, Tables
from problem_files import PROBLEMS

SOURCE = Path(laufruhe.__file__).parent
EXTENSIONS = sorted(path.name for path in (SOURCE / "extensions").iterdir() if (path / "__init__.py").exists())
MAIN = "tractor-four-lanchester"
EVERY_MODULE = """
import importlib, pkgutil, laufruhe
for module in pkgutil.walk_packages(laufruhe.__path__, "laufruhe."):
    if module.name != "laufruhe.__main__":
        importlib.import_module(module.name)
laufruhe.cli.main()
"""
STUDY = 'title = "t"\n[study]\n[[study.parts]]\nkind = "{}"\nname = "n"\ntitle = "t"\ncases = []\n'


def without(name: str, folder: Path) -> dict[str, str]:
    """Copy the package without an extension, and return the environment of processes that see the copy."""
    # compiled modules come along, for compiling all of them takes seconds
    shutil.copytree(SOURCE, folder / "laufruhe")
    shutil.rmtree(folder / "laufruhe" / "extensions" / name)
    return {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}


def run(environment: dict[str, str], *words: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_every_home_is_there() -> None:
    assert {home for homes in HOMES.values() for home in homes.values()} <= set(EXTENSIONS)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXTENSIONS)
def test_the_core_runs_without_an_extension(name: str, tmp_path: Path) -> None:
    environment = without(name, tmp_path / "site")
    file = tmp_path / "result.json"
    solve = "solve", PROBLEMS / f"{MAIN}.toml", "--no-plots", "--out", tmp_path / "out", "--json", file
    solved = run(environment, "-c", EVERY_MODULE, *solve)
    assert solved.returncode == 0, solved.stderr
    objective = laufruhe.solve(PROBLEMS / f"{MAIN}.toml").objective
    assert objective is not None
    assert json.loads(file.read_text(encoding="utf-8"))["objective"]["value"] == objective.value


@pytest.mark.slow
@pytest.mark.parametrize(
    ("table", "name"),
    # one channel of each extension stands for all
    [
        (t, n)
        for t, homes in HOMES.items()
        for n in (homes if t != "channels" else {h: n for n, h in homes.items()}.values())
    ],
)
def test_a_file_or_command_that_needs_it_is_refused_by_its_name(table: Tables, name: str, tmp_path: Path) -> None:
    home = HOMES[table][name]
    environment = without(home, tmp_path / "site")
    (tmp_path / "study.toml").write_text(STUDY.format(name), encoding="utf-8")
    problem = PROBLEMS / f"{MAIN}.toml"
    (tmp_path / "problem.toml").write_text(f"{problem.read_text(encoding='utf-8')}\n[{name}]\n", encoding="utf-8")
    mass = '{ between = ["1 kg", "2 kg"], tolerance = "1 %" }' if name == "tolerance" else f'"2 kg {name} 1 %"'
    noted = re.sub(r"reciprocating_mass = .*", f"reciprocating_mass = {mass}", problem.read_text(encoding="utf-8"))
    (tmp_path / "note.toml").write_text(noted, encoding="utf-8")
    text = problem.read_text(encoding="utf-8")
    layout, drive = (f"{said}\nkey_of_its_own = 1" for said in (f'"{name}"', f'"inline"\ndrive = "{name}"'))
    (tmp_path / "layout.toml").write_text(text.replace('"inline"', layout), encoding="utf-8")
    (tmp_path / "drive.toml").write_text(text.replace('"inline"', drive), encoding="utf-8")
    asked = re.sub(r"minimise = .*", f'minimise = "{name}"', text)
    (tmp_path / "channel.toml").write_text(asked, encoding="utf-8")
    words = {
        "layouts": ("solve", tmp_path / "layout.toml"),
        "drives": ("solve", tmp_path / "drive.toml"),
        "study_kinds": ("study", tmp_path / "study.toml"),
        "commands": (name, problem),
        "keys": ("solve", tmp_path / "problem.toml"),
        "channels": ("solve", tmp_path / "channel.toml"),
        "notes": ("solve", tmp_path / "note.toml"),
    }
    refused = run(environment, "-m", "laufruhe", *words[table])
    assert refused.returncode == 2
    (line,) = refused.stderr.strip().splitlines()
    assert f"needs the extension '{home}'" in line
