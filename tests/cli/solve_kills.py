"""Solves killed at random moments, alone and two at once in one folder."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import laufruhe
from cli import scenes
from problem_files import written
from studies.kills import Log, Whole, stopped


def started(folder: Path) -> subprocess.Popen[str]:
    """Start the command in a new process."""
    source = str(Path(laufruhe.__file__).parents[1])
    return subprocess.Popen(
        [sys.executable, "-m", "laufruhe", "solve", "scene.toml", "--out", "out"],
        cwd=folder, env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": source}, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip


def results(folder: Path) -> dict[str, bytes]:
    """Return every file of the results without its times; empty if there are none."""
    found = {path.name: path.read_bytes() for path in (folder / "out").glob("*")}
    if "result.json" in found:
        record = json.loads(found["result.json"])
        del record["timing"]
        found["result.json"] = json.dumps(record).encode()
    return found


def left_behind(folder: Path) -> list[str]:
    """Return the names of what is neither the problem nor its results."""
    return sorted(path.name for path in folder.iterdir() if path.name not in ("scene.toml", "out"))


def uninterrupted(folder: Path) -> Whole:
    """Return the results of one run in a new folder."""
    folder.mkdir()
    written(folder, scenes.SHAKING_ONLY)
    began = time.monotonic()
    process = started(folder)
    while not list(folder.glob(".unfinished-*")) and process.poll() is None:
        time.sleep(0.01)
    first = time.monotonic() - began
    said = process.communicate()[1]
    assert (process.returncode, said) == (0, "")
    return Whole(results(folder), first, time.monotonic() - began)


def attacked(folder: Path, seed: int, whole: Whole, log: Log) -> None:
    """Solve one problem in a new folder: kill up to three runs, then let one end, and log what is wrong."""
    rng = random.Random(seed)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    written(folder, scenes.SHAKING_ONLY)
    for _ in range(rng.randint(1, 3)):
        count = rng.choice((1, 2))
        log.tried[f"solves, {count} at once"] += 1
        stopped([started(folder) for _ in range(count)], rng, whole, seed, log)
        if results(folder) not in ({}, whole.files):
            log.wrong.append(f"seed {seed}: a killed solve left files of two runs, or not all of one")
    last = started(folder)
    said = last.communicate()[1]
    if left_behind(folder):
        # the artist of a killed solve may outlive it by a picture, and write it while the last one sweeps
        last = started(folder)
        said += last.communicate()[1]
    left = left_behind(folder)
    if left:
        log.wrong.append(f"seed {seed}: {', '.join(left)} left behind")
    if last.returncode or said or results(folder) != whole.files:
        log.wrong.append(f"seed {seed}: the last solve ended with {last.returncode}: {said[-300:]}")
