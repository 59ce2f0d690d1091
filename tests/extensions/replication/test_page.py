"""The tractor study by its command."""

from __future__ import annotations

from collections.abc import Callable, Collection
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lanes import first_fast
from laufruhe.cli import app
from laufruhe.extensions.replication.part import Replication
from laufruhe.studies.reader import load_study
from problem_files import PROBLEMS

COUNTS = ("38 of 45 statements are confirmed.", "44 of 45 statements are confirmed.")
FEW = ("fig-08-09", "fig-25", "fig-32")


def study_with(names: Collection[str], folder: Path) -> Path:
    """Write the study with these parts alone, or with all of them."""
    head, *parts = (PROBLEMS / "tractor-study.toml").read_text(encoding="utf-8").split("[[study.parts]]\n")
    chosen = [part for part in parts if not names or part.split('"')[1] in names]
    assert len(chosen) == (len(names) or len(parts))
    (folder / "tractor-study.toml").write_text("[[study.parts]]\n".join([head, *chosen]), encoding="utf-8")
    return folder / "tractor-study.toml"


@pytest.mark.parametrize(("names", "counts"), first_fast([(FEW, ()), ((), COUNTS)], 0, 1), ids=["few", "whole"])
def test_every_figure_and_statement_is_on_the_page(
    names: Collection[str],
    counts: Collection[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    finished: Callable[..., None],
) -> None:
    """Check a picture and a dataset for each figure, and the list of statements."""
    monkeypatch.chdir(tmp_path)
    file = study_with(names, tmp_path)
    finished("tractor-study", tmp_path / "results" / "tractor-study", names)
    answer = CliRunner().invoke(app, ["study", str(file)])
    assert answer.exit_code == 0, answer.output
    folder = tmp_path / "results" / "tractor-study"
    parts = load_study(file).study.parts
    assert {path.name for path in folder.glob("[!.]*")} == {
        "report.md",
        "report.html",
        *(f"{p.name}.{e.replace('png', 'svg')}" for p in parts for e in p.ends),
    }
    page = (folder / "report.md").read_text(encoding="utf-8")
    for part in parts:
        assert isinstance(part, Replication)
        assert f"({part.name}.svg)" in page
        assert part.says in page
        assert all(statement.text in page for statement in part.statements)
    assert "statements are confirmed." in page
    assert all(count in page for count in counts)
