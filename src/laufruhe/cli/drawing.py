"""Pictures of a result, drawn by processes that get ready while the problem is read and solved.

What draws takes as long to import as what solves; neither waits for the other.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from laufruhe.numerics.cores import processors
from laufruhe.numerics.processes import Processes
from laufruhe.present.pictures import PICTURES

if TYPE_CHECKING:
    from laufruhe.solvers.result import Result

MOST = 2
"""Processes that draw: more of them import for longer than they draw."""
SELDOM = 50_000
"""New objects after which a process looks for garbage: marks of pictures are many, and none of them is."""

Pictures: TypeAlias = dict[str, str]
"""SVG by the names of the pictures."""
Draws: TypeAlias = "Callable[[Result, Path], Callable[[], Pictures]]"
"""Begins to draw a result into a folder, and gives what waits for the pictures."""


@contextmanager
def artists(kinds: Sequence[str]) -> Iterator[Draws]:
    """Processes that draw pictures as files of these kinds."""
    count = min(MOST, processors() - 1) if kinds else 0
    with Processes(max(count, 1)) as workers:
        for _ in range(count):
            workers.submit(_ready)
        yield partial(_begun, workers, count, tuple(kinds))


def _begun(
    workers: Processes, count: int, kinds: tuple[str, ...], result: Result, folder: Path
) -> Callable[[], Pictures]:
    try:
        asked = [workers.submit(_drawn, _bare(result), folder, kinds, k, count) for k in range(count)]
    except (AttributeError, TypeError, ValueError):
        # an engine of somebody's own making that cannot be told to another process
        asked = []
    return partial(_collected, asked, result, folder, kinds)


def _collected(asked: Sequence[Future[Pictures]], result: Result, folder: Path, kinds: Sequence[str]) -> Pictures:
    try:
        found = {name: svg for answer in asked for name, svg in answer.result().items()}
    except BrokenExecutor:
        asked = ()
    if not asked and kinds:
        found = _drawn(result, folder, kinds, 0, 1)
    return {name: found[name] for name in PICTURES if name in found} if kinds else {}


def _bare(result: Result) -> Result:
    """Without what only reading and solving need of the problem."""
    problem = replace(result.problem, origin=None)
    if problem.phasing is not None:
        problem = replace(problem, phasing=replace(problem.phasing, layout=_untold, realise=_untold))
    return replace(result, problem=problem)


def _untold(*_: Any) -> NoReturn:
    raise NotImplementedError("a problem that is drawn makes no other designs")


def _ready() -> None:
    """Import all that draws."""
    gc.set_threshold(SELDOM)
    for name in PICTURES:
        import_module(f"laufruhe.plots.results.{name}")


def _drawn(result: Result, folder: Path, kinds: Sequence[str], first: int, step: int) -> Pictures:
    """Pictures of one of so many who draw, as files of these kinds, and as they stand in a page."""
    from laufruhe import plots

    # there and back again: who has a large one has the next small one
    turn = 2 * step
    own = [name for k, name in enumerate(plots.names(result)) if min(k % turn, turn - 1 - k % turn) == first]
    return plots.draw_and_show(result, folder, kinds, own)
