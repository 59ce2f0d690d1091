"""What benchmark scripts share: the time of one call, and where pages go."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# what tests share is shared with benchmarks
sys.path.insert(0, str(ROOT / "tests"))
# The rest of results/ is what the commands write, and not committed.
PAGES = ROOT / "results" / "benchmarks"


def spent(work: Callable[[], object]) -> float:
    """Wall time of one call [s]."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def publish(path: Path, text: str) -> None:
    """A page in its place, and on the screen."""
    print(text)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
