"""`report.md`: a result that explains itself."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from laufruhe.present.pictures import CAPTIONS
from laufruhe.report.grid import Grid
from laufruhe.report.grids import grids_of
from laufruhe.report.versions import versions
from laufruhe.report.wording import explained, headline
from laufruhe.solvers.result import Result


def as_markdown(result: Result, pictures: Sequence[str], command: str) -> str:
    """The report as Markdown.

    Parameters
    ----------
    pictures
        File names beside the report.
    command
        What makes the same result again.
    """
    sections = [
        f"# {escaped(result.problem.title)}",
        _facts(result),
        "## Result",
        escaped(headline(result)),
        *(f"![{CAPTIONS[name]}]({name})\n\n*{CAPTIONS[name]}*" for name in pictures),
        *(_table(grid) for grid in grids_of(result)),
        "## Proof",
        escaped(explained(result)),
        "## Fidelity",
        _fidelity(result),
        "## Reproduce",
        _fenced(command),
        "Made with " + ", ".join(f"{name} {version}" for name, version in versions().items()) + ".",
    ]
    return "\n\n".join(section for section in sections if section) + "\n"


def escaped(text: str) -> str:
    """The user's text, in which Markdown means nothing."""
    return re.sub(r"([\\`*_\[\]<>|#$])", r"\\\1", " ".join(text.split()))


def _facts(result: Result) -> str:
    problem = result.problem
    lines = [f"Source: {escaped(problem.source)}."] if problem.source else []
    if problem.assumptions:
        lines.append("Assumptions:\n\n" + "\n".join(f"- {escaped(text)}" for text in problem.assumptions))
    return "\n\n".join(lines)


def _table(grid: Grid) -> str:
    marks = ["---" if k < grid.left else "---:" for k in range(len(grid.head))]
    lines = [_row(map(escaped, grid.head)), _row(marks), *(_row(map(escaped, row)) for row in grid.rows)]
    note = f"\n\n{escaped(grid.note)}" if grid.note else ""
    return f"## {escaped(grid.title)}\n\n" + "\n".join(lines) + note


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _fidelity(result: Result) -> str:
    f = result.problem.fidelity
    text = f"{f.summary.capitalize()}, {result.final.samples} steps over the working cycle."
    if result.objective is None:
        return text
    error = f"{100.0 * result.error_estimate:.1g} %"
    if f.tolerance is not None:
        return f"{text} Chosen for an error of {f.tolerance:g}; the objective is wrong by at most {error}."
    return f"{text} Estimated error of the objective: {error}, the change when every second step is left out."


def _fenced(command: str) -> str:
    return f"```sh\n{' '.join(command.split())}\n```"
