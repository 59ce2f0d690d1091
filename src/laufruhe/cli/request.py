"""What is asked of solve and evaluate, and how long each part of an answer takes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from laufruhe.cli.drawing import Ask
from laufruhe.cli.screen import typed


@dataclass(frozen=True)
class Request:
    """What was typed."""

    verb: str
    problem: Path
    json: str | None
    out: Path | None
    kinds: tuple[str, ...]
    ask: Ask
    animated: bool = False
    tolerance: float | None = None
    series: bool = False

    @property
    def command(self) -> str:
        """The line that makes the same result again."""
        words = ["laufruhe", self.verb, str(self.problem), *(("--series",) if self.series else ())]
        return typed(*words, *([] if self.tolerance is None else ["--tolerance", f"{self.tolerance:g}"]))


@contextmanager
def timed(seconds: dict[str, float], what: str) -> Iterator[None]:
    """Adds the seconds that a part takes."""
    started = time.perf_counter()
    yield
    seconds[what] = seconds.get(what, 0.0) + time.perf_counter() - started
