"""Single parts of study files: run, shown and refused."""

from __future__ import annotations

from pathlib import Path

import pytest
import xarray as xr
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.errors import InputError
from laufruhe.report.document import Document
from laufruhe.report.study_report import blocks_of
from laufruhe.studies.kinds import KINDS
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from problem_files import written


def part_of(folder: Path, text: str) -> xr.Dataset:
    """Return the dataset of the first part of a study."""
    datasets, _ = run(load_study(written(folder, text, "study")), folder, folder / "kept")
    return next(iter(datasets.values()))


def text_of_study(kind: str, data: xr.Dataset) -> str:
    """Return the tables of a part as Markdown."""
    blocks = tuple(block for text in KINDS[kind].table(data) for block in blocks_of(text))
    return Document("part", blocks).as_markdown(".png")


def refused(folder: Path, text: str, said: str) -> None:
    """Check that a study is refused: one line, exit status 2, no results."""
    path = written(folder, text, "study")
    with pytest.raises(InputError) as caught:
        run(load_study(path), folder, folder / "kept")
    line = str(caught.value)
    assert said in line
    assert "\n" not in line
    answer = CliRunner().invoke(app, ["study", str(path), "--out", str(folder / "out")])
    assert answer.exit_code == 2
    assert not (folder / "out").exists()
