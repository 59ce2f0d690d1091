"""Run the tests that reach a changed line, for a random sample of one-line mutants, and tell which survive.

    python tests/mutants/run_mutants.py map                     # which test calls which function; minutes
    python tests/mutants/run_mutants.py run --number 300        # the sample; writes results/mutants/README.md

`make mutants` does both. A mutant is killed if one of the tests that call its function fails, stops or takes far too
long. Tests run in the order of their cost until `--seconds` of a core are used. A survivor is either equal to the
source in all that it returns, or shows a test that is missing.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Generator, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from mutants.single_lines import ROOMS, SOURCE, Mutant, drawn  # noqa: E402

PAGE = ROOT / "results" / "mutants" / "README.md"
MAP = ROOT / ".pytest_cache" / "functions-of-tests.json"
TESTS = (*ROOMS, "numerics", "problem", "mounts", "phasing", "fidelity", "literature", "claims", "validation", "attack")
OPTIONS = ("-q", "-p", "no:xdist", "-p", "no:cacheprovider", "--import-mode=importlib")
CONTROLS = 3
"""Mutants that are run without their change first: a run in which these fail tells nothing."""
KILLED, SURVIVED, UNREACHED = "killed", "survived", "not called by any test"


class Calls:
    """Note which functions of the package each test calls, and what the test takes."""

    def __init__(self) -> None:
        self.functions: dict[str, set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = {}
        self.codes: set[Any] = set()
        self.file = ""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        self.codes.clear()
        if (file := item.nodeid.partition("::")[0]) != self.file:
            # what tests share is made anew for each file, so that its own tests are seen to call it
            self.file, folder = file, Path(os.environ["LAUFRUHE_TESTS_SHARED"])
            shutil.rmtree(folder)
            folder.mkdir()
        begun = time.process_time()
        sys.settrace(lambda frame, *_: self.codes.add(frame.f_code))
        try:
            return (yield)
        finally:
            sys.settrace(None)
            self.seconds[item.nodeid] = time.process_time() - begun
            for code in self.codes:
                if code.co_filename.startswith(str(SOURCE)):
                    name = f"{os.path.relpath(code.co_filename, SOURCE)}:{code.co_firstlineno}"
                    self.functions[name].add(item.nodeid)


def write_map(arguments: argparse.Namespace) -> None:
    """Run the tests of the rooms once and keep which functions each of them calls."""
    calls = Calls()
    folders = [str(ROOT / "tests" / name) for name in arguments.tests if (ROOT / "tests" / name).exists()]
    pytest.main(
        ["-q", "-p", "no:xdist", "-p", "no:cacheprovider", "--import-mode=importlib", *folders], plugins=[calls]
    )
    # a test is known by its number: names are long
    names = list(calls.seconds)
    number = {name: k for k, name in enumerate(names)}
    table = {
        "tests": [[name, round(calls.seconds[name], 3)] for name in names],
        "functions": {key: sorted(number[n] for n in own) for key, own in calls.functions.items()},
    }
    MAP.parent.mkdir(exist_ok=True)
    MAP.write_text(json.dumps(table), encoding="utf-8")


def tests_of(mutant: Mutant, table: dict[str, Any], seconds: float) -> list[str]:
    """Return the tests that call the function of a mutant, the cheapest first, up to a sum of core-seconds."""
    known = table["functions"].get(f"{mutant.file}:{mutant.function[1]}", [])
    chosen, total = [], 0.0
    for name, taken in sorted((table["tests"][k] for k in known), key=lambda pair: pair[1]):
        total += taken
        if chosen and total > seconds:
            break
        chosen.append(name)
    return chosen


def outcome(mutant: Mutant, tests: list[str], source: Path, seconds: float) -> str:
    """Run tests on a copy of the source that holds one mutant."""
    if not tests:
        return UNREACHED
    file = source / mutant.file
    before = file.read_text(encoding="utf-8")
    lines = before.splitlines(keepends=True)
    lines[mutant.line - 1] = mutant.after + "\n"
    file.write_text("".join(lines), encoding="utf-8")
    try:
        return KILLED if _forked(tests, source, seconds) else SURVIVED
    finally:
        file.write_text(before, encoding="utf-8")


def _forked(tests: list[str], source: Path, seconds: float) -> bool:
    """Return whether a test fails in a copy of this process, which has the libraries imported already."""
    child = os.fork()
    if not child:
        os.setpgid(0, 0)
        os.environ["PYTHONPATH"] = str(source)
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
        sys.dont_write_bytecode = True
        sys.path.insert(0, str(source))
        quiet = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(quiet, stream)
        code = 1
        with contextlib.suppress(BaseException):
            # libraries that are imported already are not rewritten by pytest
            quiet_options = ["-W", "ignore::pytest.PytestAssertRewriteWarning", "-x", *OPTIONS]
            code = int(pytest.main([*quiet_options, *(str(ROOT / name) for name in tests)]))
        os._exit(code)
    until = time.monotonic() + 120.0 + 6.0 * seconds
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return status != 0
        time.sleep(0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return True


def run(arguments: argparse.Namespace) -> None:
    """Run the sample, print survivors as they come, and write the page."""
    table = json.loads(MAP.read_text(encoding="utf-8"))
    sample = drawn(arguments.number, arguments.seed)
    if arguments.files:
        sample = [mutant for mutant in sample if any(part in mutant.file for part in arguments.files)]
    _import_libraries()
    found: list[tuple[Mutant, str]] = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies: SimpleQueue[Path] = SimpleQueue()
        for k in range(arguments.workers):
            copies.put(Path(shutil.copytree(SOURCE, Path(folder) / str(k))))

        def tried(mutant: Mutant) -> str:
            source = copies.get()
            try:
                return outcome(mutant, tests_of(mutant, table, arguments.seconds), source, arguments.seconds)
            finally:
                copies.put(source)

        for mutant in sample[:CONTROLS]:
            if tried(replace(mutant, after=mutant.before)) == KILLED:
                sys.exit(f"tests of {mutant.file}:{mutant.line} fail without any change")
        with ThreadPoolExecutor(arguments.workers) as pool:
            for mutant, said in zip(sample, pool.map(tried, sample), strict=True):
                found.append((mutant, said))
                if said != KILLED:
                    print(f"{said}: {mutant}", flush=True)
    killed = sum(said == KILLED for _, said in found)
    print(f"{killed} of {len(found)} mutants killed")
    if arguments.page:
        PAGE.parent.mkdir(exist_ok=True)
        PAGE.write_text(page(found, arguments), encoding="utf-8")


def page(found: Iterable[tuple[Mutant, str]], arguments: argparse.Namespace) -> str:
    """Return the page that says what was killed in each room and which mutants survive."""
    found = list(found)
    lines = [
        "# One-line mutants",
        "",
        f"Made by `make mutants`: {len(found)} mutants drawn with seed {arguments.seed} from all single-line changes",
        "of operators, numbers, signs and extremes in the rooms below. Each runs the tests that call its function, for",
        f"{arguments.seconds:g} s of a core at most. A survivor is a change that no test sees.",
        "",
        "| room | mutants | killed | share |",
        "| --- | ---: | ---: | ---: |",
    ]
    for room in (*ROOMS, "all"):
        own = [said for mutant, said in found if room == "all" or mutant.file.startswith(f"laufruhe/{room}/")]
        killed = sum(said == KILLED for said in own)
        lines.append(f"| {room} | {len(own)} | {killed} | {killed / max(len(own), 1):.0%} |")
    lines += ["", "## Survivors", ""]
    lines += [f"- {said}: `{mutant}`" for mutant, said in found if said != KILLED] or ["None."]
    return "\n".join(lines) + "\n"


def _import_libraries() -> None:
    import casadi  # noqa: F401
    import clarabel  # noqa: F401
    import cvxpy  # noqa: F401
    import matplotlib  # noqa: F401
    import pint  # noqa: F401
    import pydantic  # noqa: F401
    import scipy.optimize  # noqa: F401
    import typer  # noqa: F401


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    mapping = commands.add_parser("map")
    mapping.set_defaults(call=write_map)
    mapping.add_argument("--tests", nargs="*", default=TESTS, help="folders below tests")
    running = commands.add_parser("run")
    running.set_defaults(call=run)
    running.add_argument("--number", type=int, default=300, help="mutants in the sample")
    running.add_argument("--seed", type=int, default=1, help="of the sample")
    running.add_argument("--seconds", type=float, default=30.0, help="core-seconds of tests for a mutant")
    running.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)), help="mutants at once")
    running.add_argument("--files", nargs="*", default=(), help="parts of paths; other mutants are left out")
    running.add_argument("--page", action="store_true", help="write results/mutants/README.md")
    arguments = parser.parse_args()
    arguments.call(arguments)


if __name__ == "__main__":
    main()
