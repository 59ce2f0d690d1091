"""`report.md`: a result that explains itself."""

from __future__ import annotations

from collections.abc import Sequence

from laufruhe.present.pictures import CAPTIONS
from laufruhe.report.grid import escaped
from laufruhe.report.sections import tables_of
from laufruhe.report.versions import versions
from laufruhe.report.wording import accuracy, explained, fired_together, headline
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
    problem = result.problem
    sections = [
        f"# {escaped(problem.title)}",
        f"Source: {escaped(problem.source)}." if problem.source else "",
        "Assumptions:\n\n" + _listed(problem.assumptions) if problem.assumptions else "",
        "## Result",
        escaped(headline(result)),
        escaped(fired_together(result)),
        *(f"![{CAPTIONS[name]}]({name})\n\n*{CAPTIONS[name]}*" for name in pictures),
        *(grid.as_markdown() for grid in tables_of(result)),
        "## Proof",
        escaped(explained(result)),
        "## Fidelity",
        _fidelity(result),
        "## Reproduce",
        f"```sh\n{' '.join(command.split())}\n```",
        "Made with " + ", ".join(f"{name} {version}" for name, version in versions().items()) + ".",
    ]
    return "\n\n".join(section for section in sections if section) + "\n"


def _listed(texts: Sequence[str]) -> str:
    return "\n".join(f"- {escaped(text)}" for text in texts)


def _fidelity(result: Result) -> str:
    f = result.problem.fidelity
    text = f"{f.summary.capitalize()}, {result.final.samples} steps over the working cycle."
    if result.objective is None:
        return text
    error = accuracy(result)
    if f.tolerance is not None:
        return f"{text} Chosen for an error of {f.tolerance:g}; {error}."
    return f"{text} {error[:1].upper()}{error[1:]}, of the physics that is kept."
