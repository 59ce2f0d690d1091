"""Damaged files through the commands, in new processes; any forbidden behaviour is a finding."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import random
import re
import resource
import shutil
import signal
import sys
import time
import tomllib
import traceback
import unicodedata
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from typer.testing import CliRunner

from cli import scenes
from faults import damage
from laufruhe.cli import app, check, solve, study  # noqa: F401
from laufruhe.extensions.fidelity import explanation  # noqa: F401

PROBLEMS = Path(__file__).parents[2] / "problems"
LONGEST = 10.0
"""Seconds of processor time that a command may take for one damaged file."""
MOST_LINES, MOST_CHARACTERS = 25, 1200
_MEMORY = 4 << 30
# control, format (which turn the direction of reading), line and paragraph separators
_COMMANDS = ("Cc", "Cf", "Zl", "Zp")
_STATUSES = (0, 1, 2, 130)
TRACED = (
    scenes.GIVEN.replace('stroke = "120 mm"', 'stroke = "120 mm"\nbore = "100 mm"')
    + '\n[gas]\nmodel = "trace"\nfile = "trace.csv"\n'
)
TRACE = "angle,pressure\n" + "".join(f"{a},{1 + 40 * max(0.0, 1 - abs(a) / 180)}\n" for a in range(-360, 360, 10))


@dataclass(frozen=True)
class Found:
    """Outcome of a command with one damaged file."""

    seed: int
    kind: str
    verb: str
    status: int
    seconds: float
    wrong: str = ""
    detail: str = ""


class _Hang(BaseException):
    pass


@cache
def sources() -> dict[str, list[str]]:
    """Return the texts of all ready problems and studies, by kind."""
    found: dict[str, list[str]] = {"problem": [scenes.PARTS, scenes.IMPOSSIBLE], "study": []}
    for path in sorted(PROBLEMS.glob("*.toml")):
        text = path.read_text(encoding="utf-8")
        found["study" if re.search(r"^\[study", text, re.MULTILINE) else "problem"].append(text)
    return found


def damaged(seed: int) -> tuple[str, bytes]:
    """Return the kind of file that a seed damages, and the damaged content."""
    rng = random.Random(seed)
    kind = rng.choices(("problem", "study", "trace"), (70, 20, 10))[0]
    if kind == "trace":
        return kind, damage.damaged_rows(TRACE, rng)
    text = rng.choice(sources()[kind])
    if rng.random() < 0.25:
        return kind, damage.damaged_text(text, rng)
    with _deep_tables():
        content = damage.as_toml(damage.damaged_tables(tomllib.loads(text), rng))
    return kind, content.encode(errors="surrogatepass")


@contextlib.contextmanager
def _deep_tables() -> Iterator[None]:
    """Allow tables nested several times deeper than Python's default."""
    usual = sys.getrecursionlimit()
    sys.setrecursionlimit(20 * usual)
    try:
        yield
    finally:
        sys.setrecursionlimit(usual)


def prepared(folder: Path) -> None:
    """Write the files beside a damaged file: ready problems that studies name, and a problem with a trace."""
    for path in PROBLEMS.glob("*.toml"):
        shutil.copy(path, folder)
    (folder / "traced.toml").write_text(TRACED, encoding="utf-8")


def tried(seed: int, verb: str, folder: Path) -> Found:
    """Run one command with one damaged file, and return its outcome."""
    kind, content = damaged(seed)
    path = folder / ("trace.csv" if kind == "trace" else "damaged.toml")
    path.write_bytes(content)
    before = _other_files(folder)
    problem = folder / "traced.toml" if kind == "trace" else path
    words = [verb, str(problem)] + (["--out", str(folder / "out"), "--no-plots"] if verb == "evaluate" else [])
    started, status, wrong, detail = time.process_time(), -1, "", ""
    try:
        with _alarm(), warnings.catch_warnings():
            warnings.simplefilter("always")
            answer = CliRunner().invoke(app, words)
        status = answer.exit_code
        if answer.exception is not None and not isinstance(answer.exception, SystemExit):
            wrong = "traceback"
            detail = "".join(traceback.format_exception(answer.exception))[-1500:]
        else:
            wrong, detail = _said_wrong(status, answer.stdout, answer.stderr, folder)
    except _Hang as error:
        wrong, detail = "hang", "".join(traceback.format_exception(error))[-1500:]
    seconds = time.process_time() - started
    shutil.rmtree(folder / "out", ignore_errors=True)
    if not wrong and (_other_files(folder) != before or path.read_bytes() != content):
        wrong, detail = "touched", str(sorted(set(_other_files(folder)) ^ set(before))[:5])
    path.unlink(missing_ok=True)
    return Found(seed, kind, verb, status, round(seconds, 3), wrong, detail)


def _other_files(folder: Path) -> list[tuple[str, int, int]]:
    found = [(entry.name, entry.stat()) for entry in os.scandir(folder) if entry.name != "out"]
    return sorted((name, about.st_size, about.st_mtime_ns) for name, about in found)


@contextlib.contextmanager
def _alarm() -> Iterator[None]:
    def ring(*_: object) -> None:
        raise _Hang

    # time of the processor: others on the machine are no fault of the file
    signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _said_wrong(status: int, out: str, err: str, folder: Path) -> tuple[str, str]:
    """Return the kind of fault in the output of a command, and its text; both empty without a fault."""
    lines = err.splitlines()
    if status not in _STATUSES:
        return "status", str(status)
    if strange := [c for c in out + err if unicodedata.category(c) in _COMMANDS and c != "\n"]:
        return "control character", f"{strange[0]!a} in {(out + err)[:300]!a}"
    if len(lines) > MOST_LINES:
        return "many lines", f"{len(lines)}: {err[:300]}"
    for line in lines:
        # damage may name another file, and that is the one at fault
        if not line.startswith((f"{folder}/", f"{folder}: ", "laufruhe: ", "/dev/null: ")):
            return "stray line", err[:600]
        said = line.replace(f"{folder}", "")
        if len(said) > MOST_CHARACTERS:
            return "long line", f"{len(said)}: {said[:300]}"
        if status == 2 and not re.match(r".*?: [^ ].*: .+", said):
            return "names no key", said[:300]
    if (status == 2) != (not out) or (status == 2 and not lines):
        return "says nothing", f"{status}: {out[:100]} {err[:100]}"
    return "", ""


def _serve(seeds: Sequence[int], verb: str, folder: Path, log: Path) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    own = folder / f"worker-{os.getpid()}"
    own.mkdir()
    prepared(own)
    with log.open("a", encoding="utf-8") as stream:
        for seed in seeds:
            stream.write(f'{{"at": {seed}}}\n')
            stream.flush()
            stream.write(json.dumps(asdict(tried(seed, verb, own))) + "\n")
    shutil.rmtree(own)


def run(seeds: Sequence[int], verb: str, folder: Path, jobs: int) -> list[Found]:
    """Run one command with the files of all seeds, and return the outcomes.

    A process that ends or hangs counts as an outcome of its current seed.
    """
    # forked: a worker starts with all that is imported, built and read
    fork = multiprocessing.get_context("fork")
    sources()
    CliRunner().invoke(app, ["check", str(PROBLEMS / "tractor-single.toml")])
    share = max(20, min(500, len(seeds) // jobs))
    waiting = [list(seeds[k : k + share]) for k in range(0, len(seeds), share)]
    running: list[tuple[multiprocessing.process.BaseProcess, Path, list[int]]] = []
    found: list[Found] = []
    while waiting or running:
        while waiting and len(running) < jobs:
            batch = waiting.pop()
            log = folder / f"log-{batch[0]}-{len(batch)}.jsonl"
            worker = fork.Process(target=_serve, args=(batch, verb, folder, log))
            worker.start()
            running.append((worker, log, batch))
        for entry in list(running):
            worker, log, batch = entry
            worker.join(0.05)
            silent = log.exists() and time.time() - log.stat().st_mtime > 12.0 * LONGEST
            if worker.is_alive() and not silent:
                continue
            worker.kill()
            worker.join()
            running.remove(entry)
            done, at = _read(log)
            log.unlink(missing_ok=True)
            found += done
            if len(done) < len(batch):
                dead = batch[0] if at is None else at
                wrong = "hears no alarm" if silent else "process died"
                found.append(Found(dead, damaged(dead)[0], verb, worker.exitcode or 0, 0.0, wrong))
                waiting.append(batch[batch.index(dead) + 1 :])
                waiting = [batch for batch in waiting if batch]
    return sorted(found, key=lambda one: one.seed)


def _read(log: Path) -> tuple[list[Found], int | None]:
    found, at = [], None
    for line in log.read_text(encoding="utf-8").splitlines() if log.exists() else ():
        record = json.loads(line)
        if "at" in record:
            at = record["at"]
        else:
            found.append(Found(**record))
    return found, at
