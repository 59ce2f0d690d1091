"""Run of all benchmark scripts one after the other, each with a limit of time: `make benchmarks`.

`python tests/benchmarks/every.py growth torsion` runs these alone, `--without trade` all but some. A script that needs
what this machine lacks, as a browser, ends with a reason and leaves its page as it was; one that fails or takes too
long is named at the end, with the last of its output.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pages import ROOT, SKIPPED

FOLDER = Path(__file__).parent
SCRIPTS = {path.stem.removeprefix("bench_"): path for path in sorted(FOLDER.glob("bench_*.py"))}
LIMIT = 900.0
"""Limit of time of one script [s]."""
LINES = 15


def run(path: Path, limit: float) -> tuple[int | None, str]:
    """Return the exit status of a script, none where it took too long, and the last of what it said."""
    with tempfile.TemporaryFile("w+") as log:
        process = subprocess.Popen(
            [sys.executable, str(path)], cwd=ROOT, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )
        try:
            status: int | None = process.wait(limit)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            _ended(process)
        log.seek(0)
        return status, "".join(log.readlines()[-LINES:])


def _ended(process: subprocess.Popen[bytes]) -> None:
    """End a script and every process that it started in its session."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        return
    process.wait()


def verdict_text(status: int | None, said: str, seconds: float, limit: float) -> str:
    """Return a line on the outcome of a script."""
    if status is None:
        return f"FAILED: took longer than {limit:.0f} s"
    if status == SKIPPED:
        return said.strip().splitlines()[-1]
    return f"{seconds:.0f} s" if status == 0 else f"FAILED with exit status {status} after {seconds:.0f} s"


def main() -> int:
    """Run, and count what failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("only", nargs="*", metavar="name", help=", ".join(SCRIPTS))
    parser.add_argument("--without", nargs="+", choices=SCRIPTS, default=[], metavar="name")
    parser.add_argument("--limit", type=float, default=LIMIT, help=f"seconds for each script, {LIMIT:.0f} by itself")
    arguments = parser.parse_args()
    if unknown := set(arguments.only) - SCRIPTS.keys():
        parser.error(f"there is no {', '.join(sorted(unknown))}; there are {', '.join(SCRIPTS)}")
    names = [name for name in arguments.only or SCRIPTS if name not in arguments.without]
    began, failed = time.perf_counter(), 0
    for k, name in enumerate(names, 1):
        print(f"[{k}/{len(names)}] {name} ... ", end="", flush=True)
        started = time.perf_counter()
        status, said = run(SCRIPTS[name], arguments.limit)
        print(verdict_text(status, said, time.perf_counter() - started, arguments.limit), flush=True)
        if status not in (0, SKIPPED):
            failed += 1
            print(said, flush=True)
    print(f"{len(names)} scripts in {time.perf_counter() - began:.0f} s; {failed} failed")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
