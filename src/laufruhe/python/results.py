"""Results of Python calls: numbers by name, pictures, report and files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from laufruhe.numerics.budget import stoppable
from laufruhe.present.pictures import PICTURES
from laufruhe.problem.problem import Problem
from laufruhe.python.watch import Callback, Progress, Watch
from laufruhe.report import files
from laufruhe.report.json_result import as_json
from laufruhe.solvers import result as solved

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure


# matplotlib is imported for the first picture
class Pictures:
    """Pictures of a result: `result.plot.polar()`, or `result.plot("polar")`.

    A picture of one panel can be drawn on axes of matplotlib (`ax=`), each one on a figure or subfigure (`figure=`).
    """

    def __init__(self, result: solved.Result) -> None:
        self._result = result

    def __call__(self, name: str, *, ax: Axes | None = None, figure: Figure | SubFigure | None = None) -> Figure:
        """Return a picture by name, as a figure of matplotlib; see `laufruhe.plots.figure`."""
        from laufruhe import plots

        return plots.figure(self._result, name, ax=ax, figure=figure)

    def __getattr__(self, name: str) -> Callable[..., Figure]:
        if name.replace("_", "-") not in PICTURES and name not in PICTURES:
            raise AttributeError(f"a result has no picture '{name}'; it has {', '.join(self)}")
        return partial(self, name if name in PICTURES else name.replace("_", "-"))

    def __iter__(self) -> Iterator[str]:
        from laufruhe import plots

        return iter(plots.names(self._result))

    def __dir__(self) -> list[str]:
        return [*(name.replace("-", "_") for name in self), *super().__dir__()]

    def __repr__(self) -> str:
        return f"<Pictures {', '.join(self)}>"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Result(solved.Result):
    """Result of `laufruhe.solve` or `laufruhe.evaluate`.

    Attributes
    ----------
    history
        Progress of the solve: time, value, bound and design.
    """

    history: tuple[Progress, ...] = ()

    def _repr_html_(self) -> str:
        from laufruhe.report.notebook import result_html

        return result_html(self)

    @property
    def plot(self) -> Pictures:
        """Pictures of the result."""
        return Pictures(self)

    def save(self, path: str | Path, series: bool = False) -> None:
        """Write the `result.json` of the commands, with the loads over the cycle if `series`; see `read_result`."""
        files.write(Path(path), as_json(self, series))

    def report(self, path: str | Path) -> None:
        """Write the report with its pictures: a page if the path ends in .html, or Markdown with pictures beside it."""
        from laufruhe.python.report_file import write_report

        write_report(self, Path(path))


def python_result(result: solved.Result, history: tuple[Progress, ...] = ()) -> Result:
    """Return a result with what Python calls add."""
    content: dict[str, Any] = {field.name: getattr(result, field.name) for field in fields(solved.Result)}
    return Result(**content, history=history)


def watched(problem: Problem, callback: Callback | None, solve: Callable[[Watch], solved.Result]) -> Result:
    """Return the result of a function that solves a problem and reports to a listener."""
    with stoppable() as stop:
        watch = Watch(problem.objective_unit or "", callback, stop)
        result = solve(watch)
    return python_result(result, tuple(watch.history))
