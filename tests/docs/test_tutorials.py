"""Commands of tutorials, how-to and reference pages, whose answers must be those of the page."""

from __future__ import annotations

import doctest
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.files.ready import copies

DOCS = Path(__file__).parents[2] / "docs"
FILE = re.compile(r"^Save this as `([\w.-]+\.toml)`.*:\n\n```toml\n((?:.*\n)*?)```", re.MULTILINE)
BLOCK = re.compile(r"^```(console|pycon)\n(.*?)^```", re.MULTILINE | re.DOTALL)

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("small_trade")]


def blocks(page: Path, kind: str) -> list[str]:
    return [text for found, text in BLOCK.findall(page.read_text(encoding="utf-8")) if found == kind]


def commands(text: str) -> list[tuple[list[str], list[str]]]:
    """Return the typed words of each command with the lines that the page shows of its answer."""
    found: list[tuple[list[str], list[str]]] = []
    for line in text.splitlines():
        if line.startswith("$ laufruhe "):
            found.append((line.split()[2:], []))
        elif line.strip():
            found[-1][1].append(" ".join(line.split()))
    return found


TUTORIALS = sorted(DOCS.glob("tutorials/*.md"))
REFERENCE = [page for page in sorted(DOCS.glob("reference/*.md")) if page.stem != "python"]
"""Pages of reference but the one of Python, whose calls tests/docs/test_reference.py makes."""
FRONT = DOCS.parent / "README.md"
PAGES = [FRONT, *TUTORIALS, *sorted(DOCS.glob("how-to/*.md")), *REFERENCE]


def pages(kind: str) -> list[Path]:
    """Return the pages with blocks of a kind."""
    return [page for page in PAGES if blocks(page, kind)]


def name_of(page: Path) -> str:
    return page.stem


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of a user who saved the files of the pages and copied a ready problem."""
    for page in (FRONT, *TUTORIALS):
        for name, text in FILE.findall(page.read_text(encoding="utf-8")):
            (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "tractor-single.toml").write_text(copies(["tractor-single"])["tractor-single.toml"], encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    return tmp_path


@pytest.mark.parametrize("page", pages("console"), ids=name_of)
def test_commands_answer_as_the_page_says(page: Path, folder: Path) -> None:
    for text in blocks(page, "console"):
        for words, shown in commands(text):
            more = ["--no-plots"] if words[0] in ("solve", "evaluate") else []
            answer = CliRunner().invoke(app, [*words, *more])
            assert answer.exit_code == 0, answer.output
            said = [" ".join(line.split()) for line in answer.output.splitlines()]
            for line in shown:
                assert line in said, f"{page.stem}: {line}\n{answer.output}"


@pytest.mark.parametrize("page", pages("pycon"), ids=name_of)
def test_python_answers_as_the_page_says(page: Path, folder: Path) -> None:
    text = "\n".join(blocks(page, "pycon"))
    test = doctest.DocTestParser().get_doctest(text, {}, page.stem, page.stem, 0)
    failures: list[str] = []
    assert doctest.DocTestRunner().run(test, out=failures.append).failed == 0, "".join(failures)


def test_every_tutorial_shows_an_answer() -> None:
    assert TUTORIALS
    for page in TUTORIALS:
        text = page.read_text(encoding="utf-8")
        assert len(FILE.findall(text)) == text.count("```toml"), page.stem
        assert blocks(page, "console") or blocks(page, "pycon"), page.stem
