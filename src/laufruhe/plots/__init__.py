"""Pictures, as PNG and SVG; they read results and datasets, and never call a solver."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import chdir
from importlib import import_module
from pathlib import Path
from typing import Any

# ignore a matplotlibrc in the working folder
with chdir(Path(__file__).parent):
    import matplotlib  # noqa: F401

from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from laufruhe.errors import refused, wrong_call
from laufruhe.plots.letters import prepare
from laufruhe.plots.style import as_svg as as_svg
from laufruhe.plots.style import drawn_on, save, save_and_show
from laufruhe.present.pictures import PICTURES
from laufruhe.solvers.result import Result


def figures(result: Result) -> Iterator[tuple[str, Figure]]:
    """Yield every picture of a result with its name, in the order of a report."""
    for name in names(result):
        yield name, figure(result, name)


def names(result: Result) -> list[str]:
    """Return the names of a result's pictures, in the order of a report."""
    return [name for name in PICTURES if import_module(PICTURES[name].module).applies(result)]


def figure(
    result: Result, name: str, *, ax: Axes | None = None, figure: Figure | SubFigure | None = None
) -> Figure:  # fmt: skip
    """Return one picture of a result, by its name among `laufruhe.present.pictures.PICTURES`.

    Parameters
    ----------
    result, name
        Result, and name of the picture.
    ax
        Axes to draw on, for a picture of one panel; they get title and legend.
    figure
        Empty figure or subfigure to fill. By default a figure of its own.
    """
    if ax is not None and figure is not None:
        raise wrong_call("figure", figure, "stands beside ax", "give one of both")
    result = result.at_own_points
    picture = import_module(PICTURES[name].module) if name in PICTURES else None
    if picture is None or not picture.applies(result):
        known = ", ".join(names(result))
        raise refused("name", f'"{name}"', "is not the name of a picture of this result", f"one of {known}", "figure")
    prepare(_words(result))
    with drawn_on(figure if ax is None else ax):
        drawn: Figure = picture.figure(result)
    return drawn


def _words(result: Result) -> Iterator[str]:
    problem, engine = result.problem, result.final.engine
    yield from (problem.title, problem.source, problem.objective_name)
    named: list[Any] = [*problem.points, *problem.limits, *problem.decisions]
    named += [*engine.cylinders, *engine.mounts, *engine.rotors]
    yield from (part.name for part in named)
    for extra in engine.extras:
        yield from extra.labels


def draw(result: Result, folder: Path, kinds: Sequence[str] = ("png",)) -> tuple[str, ...]:
    """Write all pictures, as png or svg, into a folder and return the file names."""
    folder.mkdir(parents=True, exist_ok=True)
    files: list[str] = []
    for name in names(result):
        drawn, ends = figure(result, name), [f"{name}.{kind}" for kind in kinds]
        for file in ends:
            save(drawn, folder / file)
        files += ends
    return tuple(files)


def draw_and_show(result: Result, folder: Path, kinds: Sequence[str]) -> dict[str, str]:
    """Write all pictures as files of these kinds, and return them as SVG by name."""
    folder.mkdir(parents=True, exist_ok=True)
    return {name: save_and_show(figure(result, name), folder / name, kinds) for name in names(result)}


def get_ready() -> None:
    """Import all modules that draw."""
    for name in PICTURES:
        import_module(PICTURES[name].module)
