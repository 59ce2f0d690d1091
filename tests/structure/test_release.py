"""Version and files of a release, which must agree, and the data of its wheel."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import laufruhe

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
RECIPE = (ROOT / "packaging" / "conda" / "recipe.yaml").read_text(encoding="utf-8")
# names of the same libraries on conda-forge
CONDA = {"matplotlib-base": "matplotlib"}


def test_one_version_everywhere() -> None:
    version = PROJECT["version"]
    assert laufruhe.__version__ == version
    assert re.search(r"^version: (.*)$", CITATION, re.MULTILINE)[1] == version  # type: ignore[index]
    assert re.search(r'^  version: "(.*)"$', RECIPE, re.MULTILINE)[1] == version  # type: ignore[index]
    assert f"\n## [{version}] - " in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_recipe_needs_what_the_package_needs() -> None:
    run = RECIPE.partition("  run:\n")[2].partition("\n\n")[0]
    found = {CONDA.get(name, name) + bound for name, bound in re.findall(r"- ([\w-]+) (>=[\d.]+)", run)}
    assert found == {*PROJECT["dependencies"], f"python{PROJECT['requires-python']}"}


def test_the_lowest_versions_are_tested_by_files_that_exist() -> None:
    files = re.findall(r"\btests/\S+\.py", (ROOT / "Makefile").read_text(encoding="utf-8"))
    assert len(files) > 10
    assert [file for file in files if not (ROOT / file).is_file()] == []


def test_the_lowest_versions_are_those_that_are_tested() -> None:
    """Compare with pyproject.toml, and with constraints.txt for all others."""
    lowest = dict(_pins("constraints-lowest.txt"))
    extras = PROJECT["optional-dependencies"]
    assert extras["all"] == [f"laufruhe[{','.join(sorted(set(extras) - {'all'}))}]"]
    needed = [*PROJECT["dependencies"], *(one for name in set(extras) - {"all"} for one in extras[name])]
    for name, version in (one.split(">=") for one in needed):
        assert re.fullmatch(rf"{re.escape(version)}(\.0)*", lowest[_plain(name)]), name
    assert len(lowest) > len(needed)


@pytest.mark.parametrize("file", ["constraints.txt", "constraints-lowest.txt"])
def test_versions_name_no_place(file: str) -> None:
    assert "/" not in (ROOT / file).read_text(encoding="utf-8")
    assert len(dict(_pins(file))) == len(_pins(file))


def _pins(file: str) -> list[tuple[str, str]]:
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    assert all(line.count("==") == 1 for line in lines)
    return [(_plain(line.split("==")[0]), line.split("==")[1]) for line in lines]


def _plain(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.mark.slow
def test_a_wheel_carries_its_data(tmp_path: Path) -> None:
    """Check schemas, engines, the page of reports and ready problems in the wheel, and a run from it."""
    build = f"import hatchling.build as h; print(h.build_wheel({str(tmp_path)!r}))"
    subprocess.run([sys.executable, "-c", build], cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        archive.extractall(tmp_path / "installed")
    own = {"files/engines.toml", "files/laufruhe.schema.json", "files/laufruhe-study.schema.json", "report/page.html",
           "py.typed"}  # fmt: skip
    ready = {f"problems/{path.name}" for path in (ROOT / "problems").iterdir() if path.is_file()}
    assert {f"laufruhe/{name}" for name in own | ready} <= names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    say = "import laufruhe.extensions.beginning.files as b; print(b.__file__); print(b.ready_list())"
    env = {**os.environ, "PYTHONPATH": str(tmp_path / "installed")}
    process = subprocess.run(
        [sys.executable, "-c", say], cwd=tmp_path, env=env, check=True, capture_output=True, text=True
    )
    assert str(tmp_path) in process.stdout
    assert "tractor-four-lanchester" in process.stdout
