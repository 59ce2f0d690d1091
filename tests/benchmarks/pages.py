"""Shared parts of benchmark scripts: the time of one call, the folder of pages, and the load of the machine."""

from __future__ import annotations

import os
import platform
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import psutil

ROOT = Path(__file__).resolve().parents[2]
# benchmarks share the modules of tests
sys.path.insert(0, str(ROOT / "tests"))
# The rest of results/ is what the commands write, and not committed.
PAGES = ROOT / "results" / "benchmarks"
SKIPPED = 77
"""Exit status of a script that cannot run here, as test programs have it."""
QUIET = 0.2
"""So many processors busy with other work disturb nothing."""


def spent(work: Callable[[], object]) -> float:
    """Return the processor time of one call [s]: what else the machine does counts for little."""
    started = time.process_time()
    work()
    return time.process_time() - started


def processor_seconds() -> float:
    """Return the processor time of this process and of finished child processes [s]."""
    both = (resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in both)


def _busy_seconds() -> float:
    """Return the busy time of all processors since the start of the machine [s]."""
    times = psutil.cpu_times()._asdict()
    # user time includes the time of guests
    return float(sum(times.values()) - sum(times.get(name, 0.0) for name in ("idle", "iowait", "guest", "guest_nice")))


_BEGAN, _BUSY, _USED = time.perf_counter(), _busy_seconds(), processor_seconds()


def _machine() -> str:
    """Return sentences on the command, the machine, and its load by other programs."""
    elapsed, own_seconds = time.perf_counter() - _BEGAN, processor_seconds() - _USED
    others = max(_busy_seconds() - _BUSY - own_seconds, 0.0) / elapsed
    words = " ".join(["python", f"tests/benchmarks/{Path(sys.argv[0]).name}", *sys.argv[1:]])
    made = f"Made by `{words}` in {elapsed:.0f} s, {own_seconds:.0f} s of a processor, "
    made += f"with Python {platform.python_version()} on {platform.machine()}."
    effect = "too little to disturb" if others < QUIET else "which makes times longer, those by the clock most"
    load = (
        f"Load of the machine meanwhile: other programs had {others:.1f} of its {os.cpu_count()} processors, {effect}."
    )
    return f"{made} {load}"


def publish(path: Path, text: str) -> None:
    """Write a page to its place and to the screen, with its script and the load of the machine."""
    text = f"{text.rstrip()}\n\n{_machine()}\n"
    print(text)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def skip(reason: str) -> NoReturn:
    """End without a page, and say why."""
    print(f"left out: {reason}")
    sys.exit(SKIPPED)
