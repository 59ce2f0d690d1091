"""Extensions that a change reaches: `make test-fast` leaves out the tests of all others.

A change is what differs from the last commit that is shared with `main`. It reaches an extension whose folder or tests
it touches, or that imports a changed module directly, itself or its tests. A change of what all tests share reaches
every extension, as does a folder without git.
"""

from __future__ import annotations

import ast
import subprocess
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE, TESTS = "src/laufruhe/extensions", "tests/extensions"
SHARED = ("pyproject.toml", "constraints.txt", "tests/conftest.py", "problems/")


def add_options(parser: pytest.Parser) -> None:
    parser.addoption("--changed", action="store_true", help="leave out tests of extensions that no change reaches")


def _git(*words: str) -> list[str]:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.splitlines()


def changed_files() -> list[str] | None:
    """Return the paths that differ from the last commit shared with main; None without git or main."""
    try:
        (base,) = _git("merge-base", "HEAD", "main")
        return [*_git("diff", "--name-only", base), *_git("ls-files", "--others", "--exclude-standard")]
    except (OSError, subprocess.CalledProcessError):
        return None


def imports_of(file: Path) -> Iterator[str]:
    """Yield the paths, without ending, of the modules of the package and the tests that a file imports."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        names: Iterable[str] = ()
        if isinstance(node, ast.Import):
            names = (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
        for name in names:
            yield f"{'src' if name.startswith('laufruhe') else 'tests'}/{name.replace('.', '/')}"


def reached(names: Iterable[str], changed: Iterable[str]) -> set[str]:
    """Return the extensions that changes of these files reach."""
    changed = list(changed)
    if any(path.startswith(SHARED) for path in changed):
        return set(names)
    modules = {path.removesuffix(".py").removesuffix("/__init__") for path in changed if path.endswith(".py")}
    found = set()
    for name in names:
        folders = f"{SOURCE}/{name}/", f"{TESTS}/{name}/"
        files = (file for folder in folders for file in (ROOT / folder).rglob("*.py"))
        if any(path.startswith(folders) for path in changed) or any(
            module in modules for file in files for module in imports_of(file)
        ):
            found.add(name)
    return found


@cache
def left_out() -> frozenset[Path]:
    """Return the folders of tests of extensions that no change reaches."""
    folders = {path.name: path for path in (ROOT / TESTS).iterdir() if path.is_dir() and path.name != "__pycache__"}
    changed = changed_files()
    selected = set(folders) if changed is None else reached(folders, changed)
    return frozenset(path for name, path in folders.items() if name not in selected)


def ignores(path: Path, config: pytest.Config) -> bool:
    """Return whether nothing of a folder is collected."""
    return bool(config.getoption("--changed")) and path in left_out()
