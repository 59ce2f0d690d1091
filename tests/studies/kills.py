"""Studies killed at random moments, alone and two at once, with stored points damaged in between."""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import laufruhe
from laufruhe.studies.stores import FINISHED_POINTS

PROBLEM = Path(__file__).parents[2] / "problems" / "tractor-single.toml"
STUDY = """
title = "t"
[[study.parts]]
name = "fraction"
kind = "counterweight fraction"
title = "t"
sweep = [
    { quantity = "operating_points.1.mean_piston_speed", from = "6 m/s", to = "12 m/s", points = 4 },
    { quantity = "counterweights.web.balance_factor", from = 0, to = 1, points = 6 },
]
cases = [{ name = "single", problem = "single.toml" }]
[[study.parts]]
name = "layouts"
kind = "layout comparison"
title = "t"
sweep = [{ quantity = "engine.rod_ratio", from = 0.2, to = 0.3, points = 6 }]
cases = [
    { name = "a", problem = "single.toml" },
    { name = "b", problem = "single.toml", set = { "gas.imep" = "9 bar" } },
]
[[study.parts]]
name = "map"
kind = "speed map"
title = "t"
speeds = { from = "1000 rpm", to = "2000 rpm", points = 5 }
cases = [{ name = "single", problem = "single.toml" }]
"""
AT_ONCE = "from laufruhe.studies import runner; runner.POOL_PAYS = 0.0; from laufruhe.cli import main; main()"
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
TIMED = "## Where the time went"


def prepared(folder: Path) -> Path:
    """Return the study and its problem, at so few samples that a point takes milliseconds."""
    folder.mkdir(parents=True, exist_ok=True)
    text = PROBLEM.read_text(encoding="utf-8") + "\n[fidelity]\nsamples = 144\n"
    (folder / "single.toml").write_text(text, encoding="utf-8")
    (folder / "s.toml").write_text(STUDY, encoding="utf-8")
    return folder


def started(folder: Path, jobs: int = 1) -> subprocess.Popen[str]:
    """Start the command in a new process; several jobs start workers at once."""
    source = str(Path(laufruhe.__file__).parents[1])
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    # a test run in the background has its interrupts ignored, and hands that on
    return subprocess.Popen(
        [sys.executable, "-c", AT_ONCE, "study", "s.toml", "--out", "out", "--jobs", str(jobs)],
        cwd=folder, env={**os.environ, **threads, "PYTHONPATH": source}, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip


def results(folder: Path) -> dict[str, bytes]:
    """Return every file of the results without its times."""
    found = {path.name: path.read_bytes() for path in (folder / "out").iterdir() if path.is_file()}
    # the page has it in its list of sections first
    found["report.html"] = found.get("report.html", b"").rpartition(TIMED.lstrip("# ").encode())[0]
    return {name: data.partition(TIMED.encode())[0] for name, data in found.items()}


def damage(path: Path, rng: random.Random) -> str:
    """Damage the kept points, and return what was done."""
    if not path.is_file() or not path.stat().st_size:
        return "nothing was kept"
    data = path.read_bytes()
    lines = [line for line in data.splitlines() if line]
    line, place = rng.randrange(len(lines)), rng.randrange(len(data))
    ways = {
        "as it was": data,
        "figure changed": data[:place] + bytes([rng.choice(b"0123456789")]) + data[place + 1 :],
        "bit changed": data[:place] + bytes([data[place] ^ (1 << rng.randrange(8))]) + data[place + 1 :],
        "cut": data[:place],
        "line cut": b"\n".join([*lines[:line], lines[line][: rng.randrange(len(lines[line]))], *lines[line + 1 :]]),
        "line doubled": b"\n".join([*lines, lines[line], b""]),
        "lines in disorder": b"\n".join([*rng.sample(lines, len(lines)), b""]),
        "two lines joined": b"".join(lines[:2]) + b"\n" + b"\n".join([*lines[2:], b""]),
        # a checksum and a fingerprint have 32 letters each
        "records exchanged": b"\n".join(
            one[:67] + other[67:] for one, other in zip(lines, rng.sample(lines, len(lines)), strict=True)
        ),
        "noise added": data + rng.randbytes(200),
        "emptied": b"",
    }  # fmt: skip
    way = rng.choice(list(ways))
    path.write_bytes(ways[way])
    return way


@dataclass(frozen=True)
class Whole:
    """A run that nothing stopped: its files, and when its first point was kept and all was done [s]."""

    files: dict[str, bytes]
    first: float
    seconds: float


def uninterrupted(folder: Path) -> Whole:
    """Return the results of one run in a new folder."""
    began = time.monotonic()
    process = started(prepared(folder))
    while not (folder / "out" / FINISHED_POINTS).exists() and process.poll() is None:
        time.sleep(0.01)
    first = time.monotonic() - began
    said = process.communicate()[1]
    assert (process.returncode, said) == (0, "")
    return Whole(results(folder), first, time.monotonic() - began)


@dataclass
class Log:
    """Counts of what was tried, and lines about what went wrong."""

    tried: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)


def attacked(folder: Path, seed: int, whole: Whole, log: Log) -> None:
    """Run one study in a new folder: kill it up to four times, damage its points, then let it end."""
    rng = random.Random(seed)
    shutil.rmtree(folder, ignore_errors=True)
    prepared(folder)
    for _ in range(rng.randint(1, 4)):
        count, jobs = rng.choice((1, 2)), rng.choice((1, 1, 1, 2))
        running = [started(folder, jobs) for _ in range(count)]
        log.tried[f"runs of {count} at once, {jobs} core{'s' if jobs > 1 else ''} each"] += 1
        stopped(running, rng, whole, seed, log)
        log.tried[f"kept points: {damage(folder / 'out' / FINISHED_POINTS, rng)}"] += 1
    last = started(folder)
    said = last.communicate()[1]
    left = sorted(path.name for path in folder.glob(".unfinished-*"))
    if left:
        log.wrong.append(f"seed {seed}: {', '.join(left)} left behind")
    if last.returncode or said:
        log.wrong.append(f"seed {seed}: the last run ended with {last.returncode}: {said[-300:]}")
    elif results(folder) != whole.files:
        names = {name for name, data in results(folder).items() ^ whole.files.items()}
        log.wrong.append(f"seed {seed}: {', '.join(sorted(names))} differ")


def stopped(running: Sequence[subprocess.Popen[str]], rng: random.Random, whole: Whole, seed: int, log: Log) -> None:
    """Stop each process by a random signal at a random moment, mostly while it writes."""
    began, slower = time.monotonic(), len(running) ** 0.3
    moments = []
    for process in running:
        earliest = whole.first if rng.random() < 0.8 else 0.0
        moments.append((slower * rng.uniform(earliest, 1.05 * whole.seconds), rng.choice(SIGNALS), process))
    moments.sort(key=lambda one: one[0])
    for moment, stop, process in moments:
        time.sleep(max(0.0, began + moment - time.monotonic()))
        log.tried[f"{stop.name} {'sent' if process.poll() is None else 'too late'}"] += 1
        process.send_signal(stop)
    for _, stop, process in moments:
        said = process.communicate()[1]
        # errors of a library whose import was interrupted do not count
        # and an interrupt that falls into a callback of Python's own is lost
        importing = stop is not signal.SIGKILL and ("import" in said or "Exception ignored" in said)
        allowed = {0, -stop, *(() if stop is signal.SIGKILL else (130,))}
        if not importing and (process.returncode not in allowed or "Traceback" in said):
            log.wrong.append(f"seed {seed}: {stop.name} ended with {process.returncode}: {said[-300:]}")
