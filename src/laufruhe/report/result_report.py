"""Content and order of the report of a result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from laufruhe.present.pictures import PICTURES
from laufruhe.report.document import Block, Bullets, Code, Document, Heading, Illustration, Paragraph, sources
from laufruhe.report.inputs import input_tables
from laufruhe.report.sections import tables_of
from laufruhe.report.strict_json import made_with
from laufruhe.report.wording import details, explained, fidelity_of, headline
from laufruhe.solvers.result import Result


def result_document(result: Result, pictures: Sequence[str], command: str) -> Document:
    """Return the report of a result, with the pictures that were drawn and the command that reproduces it."""
    return Document(result.problem.title, tuple(_blocks(result, pictures, command)))


def _blocks(result: Result, pictures: Sequence[str], command: str) -> Iterator[Block]:
    problem = result.problem
    yield from sources(problem.source, problem.assumptions)
    if problem.plausibility_warnings:
        yield Bullets("Numbers to check:", [str(warning) for warning in problem.plausibility_warnings])
    yield Heading("Result")
    yield Paragraph(headline(result))
    yield from map(Paragraph, details(result))
    yield from (Illustration(name, PICTURES[name].caption) for name in pictures)
    yield from tables_of(result)
    yield Heading("Proof")
    yield Paragraph(explained(result))
    yield Heading("Fidelity")
    yield Paragraph(fidelity_of(result))
    yield Heading("Inputs")
    yield from input_tables(problem, result.final.engine)
    yield Heading("Reproduce")
    yield Code(" ".join(command.split()))
    if problem.origin is not None:
        yield Paragraph("The problem file:")
        yield Code(problem.to_toml().rstrip(), "toml")
    yield Paragraph(made_with(), marked=True)
