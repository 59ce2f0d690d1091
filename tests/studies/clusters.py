"""A Dask cluster started from the shell, whose scheduler, workers and clients are killed; a study on it."""

from __future__ import annotations

import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

import laufruhe
from laufruhe.studies.stores import draws_in

PROBLEM = Path(__file__).parents[2] / "problems" / "tractor-single.toml"
STUDY = """
title = "t"
[study]
[[study.parts]]
name = "designs"
kind = "random designs"
title = "t"
draws = {draws}
chunk = {chunk}
cases = [{{ name = "single", problem = "single.toml" }}]
[[study.parts]]
name = "engines"
kind = "random scenes"
title = "t"
draws = {scenes}
chunk = {few}
vary = [{{ quantity = "operating_points.1.mean_piston_speed", from = "6 m/s", to = "12 m/s" }}]
cases = [{{ name = "single", problem = "single.toml" }}]
[[study.parts]]
name = "sweep"
kind = "layout comparison"
title = "t"
sweep = [{{ quantity = "engine.rod_ratio", from = 0.2, to = 0.3, points = {points} }}]
cases = [{{ name = "single", problem = "single.toml" }}]
"""
# on a slow machine too schedulers and workers come in time
PATIENT_CLIENT = "import laufruhe.numerics.cluster as own; own.ANSWERS = own.PATIENCE = 600.0; "
LAUFRUHE = (sys.executable, "-c", PATIENT_CLIENT + "from laufruhe.cli import main; main()")
QUIET = ("--no-dashboard", "--dashboard-address", "127.0.0.1:0")  # the usual port may be taken, by another test too
EACH = ("--nthreads", "1", *QUIET, "--death-timeout", "600")
_SOURCE = str(Path(laufruhe.__file__).parents[1])
_PATIENT = dict.fromkeys((f"DASK_DISTRIBUTED__COMM__TIMEOUTS__{name}" for name in ("CONNECT", "TCP")), "600s")
_THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
TIMED = "## Where the time went"


def environment() -> dict[str, str]:
    """Return the environment of every process: one thread each, the package under test, long waits."""
    return {**os.environ, **_THREADS, **_PATIENT, "PYTHONPATH": _SOURCE}


def prepared(
    folder: Path, draws: int = 3000, chunk: int = 500, scenes: int = 60, few: int = 5, points: int = 9
) -> Path:
    """Return the study and its problem, at so few samples that a solve takes milliseconds."""
    folder.mkdir(parents=True, exist_ok=True)
    text = PROBLEM.read_text(encoding="utf-8") + "\n[fidelity]\nsamples = 144\n"
    (folder / "single.toml").write_text(text, encoding="utf-8")
    study_text = STUDY.format(draws=draws, chunk=chunk, scenes=scenes, few=few, points=points)
    (folder / "s.toml").write_text(study_text, encoding="utf-8")
    return folder


@dataclass
class Cluster:
    """Its processes. A worker is the process that works: nobody minds it, and none comes in its place unasked."""

    folder: Path
    port: int = 0
    scheduler: subprocess.Popen[bytes] | None = None
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)

    @property
    def address(self) -> str:
        """Return the address of the scheduler."""
        return f"tcp://127.0.0.1:{self.port}"

    def start(self, count: int) -> None:
        """Start a scheduler on its port, and workers."""
        self.port = self.port or _port()
        self.scheduler = self._process("scheduler", "--host", "127.0.0.1", "--port", str(self.port), *QUIET)
        for _ in range(count):
            self.add()

    def add(self) -> None:
        """Start one more worker."""
        self.workers.append(self._process("worker", self.address, "--no-nanny", *EACH))

    def kill_worker(self, which: int) -> None:
        """Kill one worker by SIGKILL."""
        worker = self.workers.pop(which)
        worker.kill()
        worker.wait()

    def processor_time(self) -> float:
        """Return the processor time of all workers so far [s]."""
        import psutil

        return sum(sum(psutil.Process(worker.pid).cpu_times()[:2]) for worker in self.workers)

    def kill(self) -> None:
        """Kill all processes by SIGKILL."""
        for process in (*self.workers, *([self.scheduler] if self.scheduler else [])):
            process.kill()
            process.wait()
        self.workers.clear()

    def _process(self, *words: str) -> subprocess.Popen[bytes]:
        local = self.folder / "dask"
        local.mkdir(parents=True, exist_ok=True)
        more = ("--local-directory", str(local)) if words[0] == "worker" else ()
        with (self.folder / "dask.log").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "dask", *words, *more], cwd=local, env=environment(), stdout=log, stderr=log
            )


def _port() -> int:
    """Return a free port outside those that a system hands out, so that a restart can take it again."""
    rng = random.SystemRandom()
    while True:
        with socket.socket() as one, suppress(OSError):
            one.bind(("127.0.0.1", rng.randrange(10_000, 32_000)))
            return int(one.getsockname()[1])


@contextmanager
def cluster(folder: Path, count: int) -> Iterator[Cluster]:
    """Yield a cluster, and kill it after the test."""
    folder.mkdir(parents=True, exist_ok=True)
    own = Cluster(folder)
    try:
        own.start(count)
        yield own
    finally:
        own.kill()
        shutil.rmtree(folder / "dask", ignore_errors=True)


def started(folder: Path, *words: str) -> subprocess.Popen[str]:
    """Start the command in a new process."""
    return subprocess.Popen(
        [*LAUFRUHE, "study", "s.toml", "--out", "out", *words], cwd=folder, env=environment(),
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip


def finished(folder: Path, *words: str) -> str:
    """Run the command to its end, and return its message, empty without an error."""
    process = started(folder, *words)
    said = process.communicate()[1]
    return said if process.returncode == 0 else f"{process.returncode}: {said}"


def results(folder: Path) -> dict[str, bytes]:
    """Return every file of the results without its times and its command."""
    found = {path.name: path.read_bytes() for path in (folder / "out").iterdir() if path.is_file()}
    for page in ("report.md", "report.html"):
        found[page] = found[page].partition(b"Made by")[0]
    return found


def numbers(folder: Path) -> dict[str, bytes]:
    """Return the arrays of the store, bit by bit."""
    paths = sorted(draws_in(folder / "out").glob("*/*.npz"))
    return {f"{path.parent.name}/{path.name}": np.load(path)["values"].tobytes() for path in paths}


def pieces_done(folder: Path) -> int:
    """Return the pieces of draws that are kept."""
    return len(list(draws_in(folder / "out").glob("*/*.npz")))


def same(one: Path, other: Path) -> Sequence[str]:
    """Return the names of results that differ."""
    first, second = ({**results(each), **numbers(each)} for each in (one, other))
    differing = {name for name, data in first.items() ^ second.items()}
    return sorted(name for name in differing if not name.endswith(".nc") or not _same_data(one, other, name))


def _same_data(one: Path, other: Path, name: str) -> bool:
    with xr.open_dataset(one / "out" / name) as first, xr.open_dataset(other / "out" / name) as second:
        return first.identical(second)


def wait_until(done: object, seconds: float = 600.0) -> None:
    """Wait until a condition holds, for a limited time."""
    until = time.monotonic() + seconds
    while not done() and time.monotonic() < until:  # type: ignore[operator]
        time.sleep(0.02)


def moments(seed: int, count: int, seconds: float) -> list[float]:
    """Return the random moments of a run, in order."""
    rng = random.Random(seed)
    return sorted(rng.uniform(0.0, seconds) for _ in range(count))
