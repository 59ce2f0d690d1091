"""Progress of a solve for callbacks, logs and notebooks; the callback may end the search."""

from __future__ import annotations

import logging
import math
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from laufruhe.numerics.progress import SearchState, Step
from laufruhe.present.progress_text import progress_text

logger = logging.getLogger("laufruhe")
PACE = 0.1
"""Seconds between entries of the history and of the log whose value is the same."""


@dataclass(frozen=True)
class Progress:
    """Progress of a solve.

    Attributes
    ----------
    time
        Seconds since the start of the solve.
    value, bound
        Best value and lower bound so far [`unit`]; infinite where not known.
    design
        Values of decisions of the last feasible design that was evaluated, by name [SI]; complex for a weight with an
        open angle. Empty if no design is known.
    text
        Names and numbers of the searches, on one line.
    """

    time: float
    value: float
    bound: float
    unit: str
    design: Mapping[str, complex] = field(default_factory=dict)
    text: str = ""

    @property
    def gap(self) -> float:
        """Relative gap between value and bound; NaN where either is not known."""
        return Step((), "", value=self.value, bound=self.bound).gap


Callback: TypeAlias = Callable[[Progress], Any]
"""Function of the progress; if it returns True, the search ends with its best design and bound."""


class Watch:
    """Listener that keeps the history of a solve, writes the log and calls the callback.

    Attributes
    ----------
    history
        Progress whenever the value changes, and at a pace.
    """

    def __init__(self, unit: str, callback: Callback | None, stop: Callable[[], None]) -> None:
        self.history: list[Progress] = []
        self._unit, self._callback, self._stop = unit, callback, stop
        self._state, self._start = SearchState(), time.perf_counter()

    def __call__(self, step: Step) -> None:
        """Record a step; an interrupt of the callback ends the search too."""
        self._state.add(step)
        valued, design = self._state.valued, self._state.design
        value = min(valued.value, design.value) if design is not None and math.isinf(valued.value) else valued.value
        known = {} if design is None or design.design is None else design.design
        now = time.perf_counter() - self._start
        progress = Progress(now, value, valued.bound, self._unit, known, progress_text(step, valued, self._unit))
        last = self.history[-1] if self.history else None
        if last is None or last.value != value or now - last.time >= PACE:
            self.history.append(progress)
            logger.info(progress.text)
        if self._callback is not None:
            try:
                ends = self._callback(progress) is True
            except KeyboardInterrupt:
                ends = True
            if ends:
                self._stop()


class ProgressLine:
    """Callback that shows the progress of a solve on one line: in the cell of a notebook, or on standard error."""

    def __init__(self) -> None:
        self._next, self._width, self._display = 0.0, 0, _notebook_display()

    def __call__(self, progress: Progress) -> None:
        """Show the progress, unless that of a moment ago is shown."""
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + PACE
        line = f"{progress.time:.1f} s  {progress.text}"
        if self._display is not None:
            self._display.update({"text/plain": line}, raw=True)
        else:
            sys.stderr.write("\r" + line.ljust(self._width))
            sys.stderr.flush()
            self._width = len(line)


def _notebook_display() -> Any:
    # IPython is there if a notebook runs this code
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if shell is None or not hasattr(shell, "kernel"):
        return None
    display = sys.modules["IPython"].display.display
    return display({"text/plain": "starting"}, raw=True, display_id=True)
