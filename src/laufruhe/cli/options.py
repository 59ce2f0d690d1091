"""Arguments and options of commands, with their help."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


def examples(*lines: str) -> str:
    """Return the examples at the end of a command's help."""
    return "\b\n" + "\n".join([f"Example{'s' * (len(lines) > 1)}:", *(f"  {line}" for line in lines)])


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
QUIET = "Print errors only."
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help=QUIET)]
VERBOSE = "Print every step on standard error, in a pipe too."
VerboseOption = Annotated[bool, typer.Option("--verbose", "-v", help=VERBOSE)]
