"""Arguments and options of commands, with their help."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


def examples(*lines: str) -> str:
    """Return the examples at the end of a command's help."""
    return "\b\n" + "\n".join([f"Example{'s' * (len(lines) > 1)}:", *(f"  {line}" for line in lines)])


def _completed(kinds: str) -> Callable[[str], list[str]]:
    def names(incomplete: str) -> list[str]:
        from laufruhe.files.catalogue import engines
        from laufruhe.files.ready import ready

        names_by_kind = {"engines": engines, "problems": ready}
        return [name for kind in kinds.split() for name in names_by_kind[kind]() if name.startswith(incomplete)]

    return names


FILE = "Problem file (TOML); - reads standard input."
ProblemArgument = Annotated[Path, typer.Argument(metavar="PROBLEM", help=FILE, show_default=False, readable=False)]
EITHER = "Problem or study file (TOML); - reads standard input."
EitherArgument = Annotated[Path, typer.Argument(metavar="FILE", help=EITHER, show_default=False, readable=False)]
JSON = "Write the result as JSON to FILE; - prints it, and the text goes to stderr."
JsonOption = Annotated[str | None, typer.Option("--json", metavar="FILE", help=JSON)]
PARTS = "Write all parts as JSON to FILE; - prints them."
StudyJsonOption = Annotated[str | None, typer.Option("--json", metavar="FILE", help=PARTS)]
OUT = "Folder of the results.  [default: results/<name of the file>{}]"
OutOption = Annotated[Path | None, typer.Option("--out", metavar="DIR", help=OUT.format(""))]
InitialOutOption = Annotated[Path | None, typer.Option("--out", metavar="DIR", help=OUT.format("-initial"))]


class Format(StrEnum):
    """Kinds of picture files."""

    SVG = "svg"
    PNG = "png"
    BOTH = "both"

    @property
    def kinds(self) -> tuple[str, ...]:
        """Endings of the files."""
        return ("svg", "png") if self is Format.BOTH else (str(self),)


FORMAT = "Format of the picture files; the HTML report holds its own."
FormatOption = Annotated[Format, typer.Option("--format", help=FORMAT)]
NO_PLOTS = "Draw no pictures; those of an earlier result are removed."
NoPlotsOption = Annotated[bool, typer.Option("--no-plots", help=NO_PLOTS)]
SERIES = "Add the loads over the cycle to the JSON."
SeriesOption = Annotated[bool, typer.Option("--series", help=SERIES)]
GAP = "Relative gap at which an optimum counts as proven, in place of the file's."
ToleranceOption = Annotated[float | None, typer.Option("--tolerance", metavar="X", help=GAP)]
LIMIT = "End the search after SECONDS with the best design so far and its bound."
LimitOption = Annotated[float | None, typer.Option("--time-limit", metavar="SECONDS", help=LIMIT)]
SOLVER = "Let a solver of cvxpy propose unbalances, such as SCS; the proof stays that of Laufruhe."
SolverOption = Annotated[str | None, typer.Option("--solver", metavar="NAME", help=SOLVER)]
STOP = "End after SECONDS; finished work is kept."
StopOption = Annotated[float | None, typer.Option("--time-limit", metavar="SECONDS", help=STOP)]
JOBS = "Use at most N processes.  [default: one for each core]"
JobsOption = Annotated[int | None, typer.Option("--jobs", metavar="N", help=JOBS)]
SCHEDULER = "Let the Dask workers of the scheduler at ADDRESS do the work."
SchedulerOption = Annotated[str | None, typer.Option("--scheduler", metavar="ADDRESS", help=SCHEDULER)]
STUDY = "Study file (TOML); - reads standard input."
StudyArgument = Annotated[Path, typer.Argument(metavar="STUDY", help=STUDY, show_default=False, readable=False)]
FileArgument = Annotated[Path, typer.Argument(metavar="FILE", help="Problem file to write.")]
FROM = "Engine of the catalogue, or ready problem, to start from."
COPIED = "Ready problems to copy, with all files that they refer to."
ENGINE_ARGUMENT = "Engines to show: published figures, source, and assumptions."
FromOption = Annotated[
    str | None, typer.Option("--from", metavar="NAME", help=FROM, autocompletion=_completed("engines problems"))
]
NamesArgument = Annotated[
    list[str] | None,
    typer.Argument(metavar="[NAME...]", help=COPIED, show_default=False, autocompletion=_completed("problems")),
]
ToOption = Annotated[Path, typer.Option("--to", metavar="DIR", help="Folder of the copies.")]
KeysArgument = Annotated[
    list[str] | None,
    typer.Argument(metavar="[KEY...]", help=ENGINE_ARGUMENT, show_default=False, autocompletion=_completed("engines")),
]
QUIET = "Print errors only."
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help=QUIET)]
VERBOSE = "Print every step on standard error, in a pipe too."
VerboseOption = Annotated[bool, typer.Option("--verbose", "-v", help=VERBOSE)]
