"""Pages that the commands and the documentation make, each made once for all tests of a run."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cli import scenes
from laufruhe.cli import app
from laufruhe.present.tables import Table
from laufruhe.report.document import Bullets, Code, Document, Heading, Illustration, Paragraph
from laufruhe.report.web_page import as_html
from problem_files import written
from shared import once

ROOT = Path(__file__).parents[2]
PROBLEMS, DOCS = ROOT / "problems", ROOT / "docs"
STUDY = """
title = "Two cranks"
[study]
[[study.parts]]
name = "two"
kind = "layout comparison"
title = "Mean mount force of two cranks"
[[study.parts.cases]]
name = "four"
problem = "scene.toml"
[[study.parts.cases]]
name = "four, long rods"
problem = "scene.toml"
[study.parts.cases.set]
"engine.rod_ratio" = 0.2
"""
# all that pages are made of: long words, tables as wide as any, pictures wider than paper
SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="1400" height="300"><path d="M0 0h1400v300z"/></svg>'
BLOCKS = (
    Heading("Result"), Paragraph("**falls** to `227 N`", marked=True), Bullets("Assumptions:", ["rod ratio 0.26"]),
    Illustration("bars", "Mean and maximum of each mount's force"),
    Table(("throw", "mass [kg]"), [("front", "1.25")], title="Narrow", note="A note."),
    Table([f"heading {k} [N]" for k in range(10)], [["a case by its name", *["-1234 N"] * 9]], title="Ten columns"),
    Table([f"largest {k} [N]" for k in range(14)], [["a case", *["12345.6"] * 13]] * 12, title="Fourteen columns"),
    Code("laufruhe solve " + "a-problem-with-a-long-name-" * 8 + ".toml"),
)  # fmt: skip
LEFT_OUT = {"_build", "jupyter_execute", "gallery", "notebooks", "examples"}
SITE = ("index", "reference/commands", "theory/kinematics")


def _run(*words: object) -> None:
    answer = CliRunner().invoke(app, [*map(str, words)])
    assert answer.exit_code == 0, answer.output


def _solved(folder: Path) -> Path:
    _run("solve", PROBLEMS / "tractor-four-lanchester.toml", "--out", folder / "out")
    return folder / "out" / "report.html"


def _evaluated(folder: Path) -> Path:
    _run("evaluate", PROBLEMS / "inline-five-elastic.toml", "--no-plots", "--out", folder / "out")
    return folder / "out" / "report.html"


def _traded(folder: Path) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("laufruhe.extensions.fidelity.trade._MAX_REPEATS", 1)
        _run("trade", written(folder, scenes.GIVEN), "--out", folder / "out")
    return folder / "out" / "scene.html"


def _studied(folder: Path) -> Path:
    written(folder, scenes.GIVEN)
    (folder / "study.toml").write_text(STUDY)
    _run("study", folder / "study.toml", "--out", folder / "out")
    return folder / "out" / "report.html"


def _of_everything(folder: Path) -> Path:
    (folder / "page.html").write_text(as_html(Document("Everything", BLOCKS), {"bars": SVG}), encoding="utf-8")
    return folder / "page.html"


MAKERS: dict[str, Callable[[Path], Path]] = {
    "everything": _of_everything, "solve": _solved, "evaluate": _evaluated, "study": _studied, "trade": _traded,
}  # fmt: skip


def made(kind: str) -> Path:
    """Return a page of this kind."""
    folder = once(f"page-{kind}", lambda folder: (folder / "name").write_text(str(MAKERS[kind](folder))))
    return Path((folder / "name").read_text())


def site() -> Path:
    """Return folder of a few pages of the documentation, as the site has them; notebooks and the gallery left out."""

    def build(folder: Path) -> None:
        source = folder / "source"
        shutil.copytree(DOCS, source, ignore=lambda *_: LEFT_OUT)
        for page in source.rglob("*.md"):
            if str(page.relative_to(source).with_suffix("")) not in (*SITE, "README"):
                page.unlink()
        # its first equations have all that the others are set in
        kinematics = source / "theory" / "kinematics.md"
        first, _, _ = kinematics.read_text(encoding="utf-8").partition("## Orders in closed form")
        kinematics.write_text(first, encoding="utf-8")
        extensions = "extensions=labels,mathml,myst_nb,sphinx_copybutton"
        words = [sys.executable, "-m", "sphinx", "-Q", "-b", "html", "-D", extensions, source, folder / "site"]
        subprocess.run(words, check=True)

    return once("site", build) / "site"
