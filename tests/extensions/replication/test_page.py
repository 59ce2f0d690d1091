"""The whole tractor study by its command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.extensions.replication.part import Replication
from laufruhe.studies.reader import load_study
from problem_files import PROBLEMS


@pytest.mark.slow
def test_every_figure_and_statement_is_on_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, finished: Callable[[str, Path], None]
) -> None:
    """The whole study by its command: a picture and a dataset a figure, and the list of statements."""
    monkeypatch.chdir(tmp_path)
    finished("tractor-study", tmp_path / "results" / "tractor-study")
    answer = CliRunner().invoke(app, ["study", str(PROBLEMS / "tractor-study.toml")])
    assert answer.exit_code == 0, answer.output
    folder = tmp_path / "results" / "tractor-study"
    parts = load_study(PROBLEMS / "tractor-study.toml").study.parts
    assert {path.name for path in folder.glob("[!.]*")} == {
        "report.md",
        "report.html",
        *(f"{p.name}.{e}" for p in parts for e in p.ends),
    }
    page = (folder / "report.md").read_text(encoding="utf-8")
    for part in parts:
        assert isinstance(part, Replication)
        assert f"({part.name}.png)" in page
        assert part.says in page
        assert all(statement.text in page for statement in part.statements)
    assert "38 of 45 statements are confirmed." in page
    assert "44 of 45 statements are confirmed." in page
