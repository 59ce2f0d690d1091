"""Pages of the site, all in its index, and pictures of the gallery, all of problems that tests solve."""

from __future__ import annotations

import ast
import csv
import re
import runpy
from pathlib import Path

import nbformat
import pytest

from laufruhe.problem.channels import CHANNELS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
MADE = runpy.run_path(str(DOCS / "extensions" / "pages.py"))["PAGES"]
EXAMPLES = sorted((DOCS / "examples").glob("plot_*.py"))


def ready() -> set[str]:
    with (ROOT / "problems" / "uses.csv").open(encoding="utf-8") as rows:
        return {row["problem"] for row in csv.DictReader(rows)}


MADE_BY_SITE = {"_build", "gallery", "jupyter_execute", "measured"}
"""Folders that a build of the site leaves under docs."""


def test_every_page_is_in_the_index() -> None:
    index = (DOCS / "index.rst").read_text(encoding="utf-8")
    listed = set(re.findall(r"^   ([a-z-]+(?:/[a-z-]+)?)$", index, re.MULTILINE))
    paths = [path.relative_to(DOCS) for pattern in ("**/*.md", "notebooks/*.ipynb") for path in DOCS.glob(pattern)]
    found = {str(path.with_suffix("")) for path in paths if not MADE_BY_SITE & set(path.parts)}
    # index.rst includes the one, and the site makes the other
    assert found - {"README"} == listed - {"gallery/index"}


@pytest.mark.parametrize("place", MADE)
def test_pages_made_of_other_files_are_up_to_date(place: str) -> None:
    """`python docs/extensions/pages.py` makes them."""
    assert (DOCS / place).read_text(encoding="utf-8") == MADE[place]()


def test_pages_say_all_without_the_site() -> None:
    """Check that the build of the site fills in only details."""
    filled = {
        "changes.md": "CHANGELOG.md",
        "contributing.md": "CONTRIBUTING.md",
        "reference/api.md": "This page is filled as the site is built",
    }
    for path in DOCS.rglob("*.md"):
        place, text = str(path.relative_to(DOCS)), path.read_text(encoding="utf-8")
        if not MADE_BY_SITE & set(path.parts):
            assert filled.get(place, "") in text
            assert place in filled or not re.search(r"^(```|:::)\{|project:", text, re.MULTILINE), place


PLAIN_TABLES = {"how-to/what-is-proven.md", "reference/glossary.md", "reference/keys.md", "reference/result-json.md"}
"""Pages of tables, in which a reader looks up one row."""
LONGEST = 1500


def test_pages_are_read_in_one_sitting() -> None:
    """Check the length of pages; pages of theory follow their derivations."""
    paths = [path for folder in ("how-to", "tutorials", "reference") for path in (DOCS / folder).glob("*.md")]
    lengths = {str(path.relative_to(DOCS)): len(path.read_text(encoding="utf-8").split()) for path in paths}
    assert not {page for page, words in lengths.items() if words > LONGEST} - PLAIN_TABLES


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_pictures_of_the_gallery_are_of_ready_problems(path: Path) -> None:
    """Check that pictures name ready problems, so that a program runs from its folder."""
    calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
    solved = [ast.literal_eval(call.args[0]) for call in calls if ast.unparse(call.func) == "laufruhe.solve"]
    assert solved
    assert set(solved) <= ready()
    assert "../" not in path.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_program_of_the_gallery_runs_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (path,) = [path for path in EXAMPLES if path.stem == "plot_counterweight"]
    assert runpy.run_path(str(path))["polar"].axes


def test_every_quantity_is_explained() -> None:
    page = (DOCS / "reference" / "quantities.md").read_text(encoding="utf-8")
    assert not [name for name in CHANNELS if name not in page]


def test_notebooks_are_kept_without_output() -> None:
    """They are executed as the site is built."""
    for path in DOCS.glob("notebooks/*.ipynb"):
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        assert all(not cell.get("outputs") for cell in notebook.cells)
