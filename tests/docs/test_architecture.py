"""The page of the architecture, and the guide of contributors, say of methods, rooms and files what is so."""

from __future__ import annotations

import ast
import inspect
import re
import tomllib
from functools import partial
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from pkgutil import resolve_name

import pytest

from laufruhe.solvers import METHODS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
GUIDE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
SOURCE = ROOT / "src" / "laufruhe"


def first_cells(head: str) -> list[str]:
    """Return the first cells of the rows under a heading of the page."""
    rows = PAGE[PAGE.index(head) :].split("\n\n")[0].splitlines()[2:]
    return [row.split("|")[1].strip() for row in rows]


def layers() -> list[set[str]]:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    rooms = next(each["layers"] for each in contracts if each.get("containers") == ["laufruhe"])
    return [set(re.findall(r"\w+", layer)) for layer in rooms]


def test_methods_say_what_they_prove() -> None:
    assert all(method.proves for method in METHODS)
    assert len({method.name for method in METHODS}) == len(METHODS)


@pytest.mark.slow
def test_every_method_imports_a_function_that_exists() -> None:
    for method in METHODS:
        if isinstance(method.solver, partial):
            assert callable(resolve_name(*method.solver.args))
            continue
        for node in ast.walk(ast.parse(inspect.getsource(method.solver))):
            if isinstance(node, ast.ImportFrom):
                assert all(callable(getattr(import_module(node.module), alias.name)) for alias in node.names)


def test_rooms_stand_in_the_order_of_their_imports() -> None:
    assert [set(re.findall(r"\w+", cell)) for cell in first_cells("| room | what is in it |")] == layers()
    (chain,) = re.findall(r"^ +(extensions -> .*)$", GUIDE, re.MULTILINE)
    assert [set(re.findall(r"\w+", part)) for part in chain.split(" -> ")] == layers()


def test_the_picture_shows_every_room_and_extension() -> None:
    path = ROOT / "docs" / "extensions" / "rooms.py"
    spec = spec_from_file_location("rooms", path)
    rooms = module_from_spec(spec)
    spec.loader.exec_module(rooms)
    assert rooms.PICTURE.read_text(encoding="utf-8") == rooms.drawing(), "run `python docs/extensions/rooms.py`"


def test_files_that_are_named_are_there() -> None:
    for page in (PAGE, GUIDE):
        for path in re.findall(r"`((?:[a-z_]+/)+[a-z_]+\.py)`", page):
            assert (SOURCE / path).is_file() or (ROOT / path).is_file(), path
