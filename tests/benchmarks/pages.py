"""What benchmark scripts share: the time of one call, where pages go, and how busy the machine was."""

from __future__ import annotations

import os
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# what tests share is shared with benchmarks
sys.path.insert(0, str(ROOT / "tests"))
# The rest of results/ is what the commands write, and not committed.
PAGES = ROOT / "results" / "benchmarks"
_BEFORE = os.getloadavg()[0]


def spent(work: Callable[[], object]) -> float:
    """Processor time of one call [s]: what else the machine does counts for little."""
    started = time.process_time()
    work()
    return time.process_time() - started


def processor_seconds() -> float:
    """Of this process and of those that it has waited for."""
    both = (resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in both)


def _machine() -> str:
    """How busy the machine was."""
    now, idle = os.getloadavg()[0], _BEFORE < 1.0
    told = "nothing else ran" if idle else "it did other work too, which makes times longer"
    load = f"{_BEFORE:.1f} and {now:.1f} on {os.cpu_count()} processors"
    return f"Load of the machine when this was begun and ended: {load}; {told}."


def publish(path: Path, text: str) -> None:
    """A page in its place, and on the screen; it says how busy the machine was."""
    text = f"{text.rstrip()}\n\n{_machine()}\n"
    print(text)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
