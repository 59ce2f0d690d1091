"""Pictures, as PNG files; they read results and datasets, and never call a solver."""

from __future__ import annotations

from contextlib import chdir
from importlib import import_module
from pathlib import Path

# a matplotlibrc in the working folder, which may be broken, is none of ours
with chdir(Path(__file__).parent):
    import matplotlib  # noqa: F401

from laufruhe.plots.style import save
from laufruhe.present.pictures import PICTURES
from laufruhe.solvers.result import Result


def draw(result: Result, folder: Path) -> tuple[str, ...]:
    """Every picture that this result fills, in the order of a report.

    Returns
    -------
    File names in `folder`.
    """
    drawn = []
    for name in PICTURES:
        picture = import_module(f"{__name__}.results.{name}")
        if picture.applies(result):
            drawn.append(f"{name}.png")
            save(picture.figure(result), folder / drawn[-1])
    return tuple(drawn)
