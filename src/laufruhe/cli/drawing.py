"""Pictures, drawn by a process that gets ready while the problem is read and solved.

What draws takes as long to import as what solves; neither waits for the other.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from laufruhe.cli.screen import loudness, speak
from laufruhe.numerics.cores import processors
from laufruhe.numerics.processes import Copy, Processes, called

if TYPE_CHECKING:
    from laufruhe.solvers.result import Result

MOST = 3
"""Processes that draw the pictures of a result: what one has imported, its twins need not."""
SELDOM = 200_000
"""New objects after which a process looks for garbage: marks of pictures are many, and none of them is."""

Ask: TypeAlias = Callable[..., Callable[[], Any]]
"""Asks for a call by the name of what is called; gives what waits for its answer."""


@contextmanager
def artist(kinds: Sequence[str]) -> Iterator[Ask]:
    """Who draws pictures as files of these kinds: another process, or this one where that can have no other."""
    is_other = bool(kinds) and processors() > 1
    with Processes(1, _copy() if is_other else ()) as workers:
        if is_other:
            workers.submit(gc.set_threshold, SELDOM)
            workers.submit(speak, loudness())
            workers.submit(called, "laufruhe.plots:get_ready")
        yield partial(_asked, workers if is_other else None)


def _copy() -> tuple[Copy, ...]:
    """A process that has imported what deciding and drawing both need; none where this one cannot be copied."""
    if not Copy.can_be():
        return ()
    import_module("laufruhe.solvers.conclusion")
    return (Copy(),)


def _asked(workers: Processes | None, name: str, *args: Any) -> Callable[[], Any]:
    here = partial(called, name, *args)
    # an engine of somebody's own making may not be told to another process
    with suppress(AttributeError, TypeError, ValueError):
        return here if workers is None else partial(_answered, workers.submit(called, name, *args), here)
    return here


def _answered(there: Future[Any], here: Callable[[], Any]) -> Any:
    with suppress(BrokenExecutor):
        return there.result()
    return here()


def drawing(ask: Ask, result: Result, folder: Path, kinds: Sequence[str]) -> Callable[[], dict[str, str]]:
    """Have a result drawn into a folder; gives what waits for the pictures, SVG by their names."""
    if not kinds:
        return dict
    return ask("laufruhe.plots:draw_in_shares", _bare(result), folder, kinds, min(MOST, processors() - 1))


def _bare(result: Result) -> Result:
    """Without what only reading and solving need of the problem."""
    problem = replace(result.problem, origin=None)
    if problem.phasing is not None:
        problem = replace(problem, phasing=replace(problem.phasing, layout=_untold, realise=_untold))
    return replace(result, problem=problem, error=float)


def _untold(*_: Any) -> NoReturn:
    raise NotImplementedError("a problem that is drawn makes no other designs")
