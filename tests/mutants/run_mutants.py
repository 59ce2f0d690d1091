"""Run the tests that reach a changed line, for a random sample of one-line mutants, and tell which survive.

    python tests/mutants/run_mutants.py map                     # which test calls which function; an hour
    python tests/mutants/run_mutants.py map --tests extensions/mount_relaxation/test_dual.py  # of new tests alone
    python tests/mutants/run_mutants.py run --page              # the sample; writes results/mutants/README.md

`make mutants` does both. A mutant is killed if one of the tests that call its function fails, stops or takes far too
long. Tests run in the order of their cost until `--seconds` of a core are used. What survives shows a test that is
missing, unless it returns the same: `equivalent.csv` lists such mutants with the reason, and they are not run.

A log keeps what became of each mutant. While the code of its file stays as it is, what is killed is not run again, and
a survivor meets only tests that it has not met yet. Every test that kills has to pass without any change.
"""

from __future__ import annotations

import argparse
import compileall
import contextlib
import csv
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
from importlib import import_module
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from mutants.single_lines import ROOMS, SOURCE, Mutant, code_of, drawn  # noqa: E402

PAGE = ROOT / "results" / "mutants" / "README.md"
EQUIVALENT = Path(__file__).with_name("equivalent.csv")
"""Mutants that return the same as the source: the change, and why."""
MAP = ROOT / ".pytest_cache" / "functions-of-tests.json"
TESTS = (*ROOMS, "numerics", "problem", "mounts", "phasing", "fidelity", "literature", "claims", "validation", "attack")
OPTIONS = ("-q", "-p", "no:xdist", "-p", "no:cacheprovider", "--import-mode=importlib")
LOG = MAP.with_name("mutants.jsonl")
"""Outcome of each mutant, one a line; a run goes on where the last one ended."""
FEW = 10
Key = tuple[str, str]
Found = tuple[Mutant, str, int]
"""Mutant, its fate, and the number of tests that it passed."""
KILLED, SAME, SURVIVED, UNREACHED = "killed", "equivalent", "survived", "met no test"


class Calls:
    """Note which functions of the package each test calls, and what the test takes."""

    def __init__(self) -> None:
        self.functions: dict[str, set[str]] = defaultdict(set)
        self.seconds: dict[str, float] = {}
        self.collected: set[str] = set()
        self.codes: set[Any] = set()
        self.file = ""

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        self.collected.update(item.nodeid for item in items)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        self.codes.clear()
        if (file := item.nodeid.partition("::")[0]) != self.file:
            # shared results are computed anew for each file, so that its own tests call the code
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
                    name = f"{os.path.relpath(code.co_filename, SOURCE)}:{code.co_qualname}"
                    self.functions[name].add(item.nodeid)


class Failures:
    """Write the tests that fail to a file."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            with self.file.open("a", encoding="utf-8") as file:
                file.write(f"{report.nodeid}\n")


def write_map(arguments: argparse.Namespace) -> None:
    """Run tests once and note in the map which functions each of them calls."""
    calls = Calls()
    chosen = [str(ROOT / "tests" / name) for name in arguments.tests if (ROOT / "tests" / name).exists()]
    pytest.main([*OPTIONS, *chosen], plugins=[calls])
    seconds: dict[str, float] = {}
    functions: dict[str, set[str]] = defaultdict(set)
    if MAP.exists():
        table = json.loads(MAP.read_text(encoding="utf-8"))
        files = {name.partition("::")[0] for name in calls.collected}
        known_names = [
            name
            if name not in calls.seconds
            and (name in calls.collected if (file := name.partition("::")[0]) in files else (ROOT / file).exists())
            else None
            for name, _ in table["tests"]
        ]
        seconds.update((name, own) for name, (_, own) in zip(known_names, table["tests"], strict=True) if name)
        for key, own in table["functions"].items():
            functions[key].update(name for k in own if (name := known_names[k]))
    seconds.update(calls.seconds)
    for key, names in calls.functions.items():
        functions[key] |= names
    # a test is known by its number: names are long
    number = {name: k for k, name in enumerate(seconds)}
    written = {
        "tests": [[name, round(own, 3)] for name, own in seconds.items()],
        "functions": {key: sorted(number[n] for n in own) for key, own in functions.items() if own},
    }
    MAP.parent.mkdir(exist_ok=True)
    MAP.write_text(json.dumps(written), encoding="utf-8")


def equivalents() -> dict[str, str]:
    """Return the reason of each mutant that returns the same as the source, by its change."""
    with EQUIVALENT.open(encoding="utf-8", newline="") as file:
        return {row["change"]: row["reason"] for row in csv.DictReader(file)}


def tests_of(mutant: Mutant, table: dict[str, Any], seconds: float, passed: Iterable[str]) -> list[str]:
    """Return the tests that call the function of a mutant, the cheapest first, up to a sum of core-seconds."""
    known = table["functions"].get(f"{mutant.file}:{mutant.function}", [])
    pairs = [table["tests"][k] for k in known]
    chosen, total = [], 0.0
    for name, taken in sorted((pair for pair in pairs if pair[0] not in passed), key=lambda pair: pair[1]):
        total += taken
        if total > seconds:
            break
        chosen.append(name)
    return chosen


def outcome(mutant: Mutant, tests: list[str], source: Path, seconds: float) -> tuple[str, list[str]]:
    """Run tests on a copy of the source that holds one mutant; return what became of it and the tests that fail."""
    file = source / mutant.file
    before = file.read_text(encoding="utf-8")
    lines = before.splitlines(keepends=True)
    lines[mutant.line - 1] = mutant.after + "\n"
    file.write_text("".join(lines), encoding="utf-8")
    try:
        # most fall to the first few
        for part in (tests[:FEW], tests[FEW:]):
            passed, failed = _forked(["-x", *part], source, seconds) if part else (True, [])
            if not passed:
                # an end before any test names all tests
                return KILLED, failed or part
        return SURVIVED, []
    finally:
        file.write_text(before, encoding="utf-8")


def _forked(tests: list[str], source: Path, seconds: float) -> tuple[bool, list[str]]:
    """Run tests in a copy of this process, which has the libraries imported already; return what fails."""
    log = source / "failed"
    log.write_text("", encoding="utf-8")
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
            quiet_options = ["-W", "ignore::pytest.PytestAssertRewriteWarning", *OPTIONS]
            targets = [name if name.startswith("-") else str(ROOT / name) for name in tests]
            code = int(pytest.main([*quiet_options, *targets], plugins=[Failures(log)]))
        os._exit(code)
    until = time.monotonic() + 120.0 + 6.0 * seconds
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return status == 0, log.read_text(encoding="utf-8").splitlines()
        time.sleep(0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False, []


def run(arguments: argparse.Namespace) -> None:
    """Run what the log has not killed, print survivors as they come, and write the page."""
    table = json.loads(MAP.read_text(encoding="utf-8"))
    sample = drawn(arguments.number, arguments.seed)
    if arguments.files:
        sample = [mutant for mutant in sample if any(part in mutant.file for part in arguments.files)]
    same, killers = equivalents(), dict[Key, list[str]]()
    passed: dict[Key, set[str]] = defaultdict(set)
    for line in LOG.read_text(encoding="utf-8").splitlines() if LOG.exists() else ():
        entry = json.loads(line)
        key = entry["change"], entry["code"]
        if entry["outcome"] == KILLED:
            killers[key] = entry["failed"]
        passed[key].update(entry["passed"])
    for library in ("casadi", "clarabel", "cvxpy", "matplotlib", "pint", "pydantic", "scipy.optimize", "typer"):
        import_module(library)
    found: list[Found] = []
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder, LOG.open("a", encoding="utf-8") as log:
        copies: SimpleQueue[Path] = SimpleQueue()
        for k in range(arguments.workers):
            copies.put(Path(shutil.copytree(SOURCE, Path(folder) / str(k))))
            compileall.compile_dir(Path(folder) / str(k), quiet=2)

        def tried(mutant: Mutant) -> tuple[str, list[str]]:
            if mutant.change in same:
                return SAME, []
            key = mutant.change, code_of(mutant.file)
            if (failed := killers.get(key)) is not None:
                return KILLED, failed
            tests = tests_of(mutant, table, arguments.seconds, passed[key])
            if not tests:
                return SURVIVED if passed[key] else UNREACHED, []
            source = copies.get()
            try:
                said, failed = outcome(mutant, tests, source, arguments.seconds)
            finally:
                copies.put(source)
            passed[key].update(tests if said == SURVIVED else [])
            entry = {"change": key[0], "code": key[1], "outcome": said, "failed": failed,
                     "passed": tests if said == SURVIVED else []}  # fmt: skip
            log.write(f"{json.dumps(entry)}\n")
            log.flush()
            return said, failed

        unproven: set[str] = set()
        with ThreadPoolExecutor(arguments.workers) as pool:
            for mutant, (said, failed) in zip(sample, pool.map(tried, sample), strict=True):
                found.append((mutant, said, len(passed[mutant.change, code_of(mutant.file)])))
                unproven.update(failed)
                if said in (SURVIVED, UNREACHED):
                    print(f"{said}: {mutant}", flush=True)
        fine, failed = _forked(sorted(unproven), copies.get(), 600.0)
    if unproven and not fine:
        sys.exit(f"these fail without any change: {failed or 'the run itself'}; nothing is written")
    killed = sum(said == KILLED for _, said, _ in found)
    print(f"{killed} of {len(found)} mutants killed")
    if arguments.page:
        PAGE.parent.mkdir(exist_ok=True)
        PAGE.write_text(page(found, same, len(table["tests"]), arguments), encoding="utf-8")


def page(found: Iterable[Found], same: dict[str, str], tests: int, arguments: argparse.Namespace) -> str:
    """Return the page that says what was killed in each room, and which mutants are equivalent or open."""
    found = list(found)
    lines = [
        "# One-line mutants",
        "",
        f"Made by `make mutants`: {len(found)} mutants drawn with seed {arguments.seed} from all single-line changes",
        f"of operators, numbers, signs and extremes in the rooms below. Each meets those of the {tests} tests of the",
        "map that call its function, the cheapest first, until one fails or the time of a run is over. A run goes on",
        "where earlier ones ended: what is killed is not run again while the code of its file stays, and a survivor",
        "meets only tests that it has not met yet. All tests that kill pass without a change. An equivalent mutant",
        "returns the same as the source, or chooses another way to what is then proven; its reason stands in",
        "`tests/mutants/equivalent.csv`. An open one shows a test that is missing.",
        "",
        "| room | mutants | killed | equivalent | open | killed of the others |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    for room in (*ROOMS, "all"):
        own = [said for mutant, said, _ in found if room == "all" or mutant.file.startswith(f"laufruhe/{room}/")]
        killed, alike = own.count(KILLED), own.count(SAME)
        share = killed / max(len(own) - alike, 1)
        lines.append(f"| {room} | {len(own)} | {killed} | {alike} | {len(own) - killed - alike} | {share:.0%} |")
    lines += ["", "## Open", "", "With the number of tests that each passed.", ""]
    lines += [f"- {n}: `{mutant}`" for mutant, said, n in found if said in (SURVIVED, UNREACHED)] or ["None."]
    lines += ["", "## Equivalent", ""]
    lines += [f"- `{mutant}`: {same[mutant.change]}" for mutant, said, _ in found if said == SAME] or ["None."]
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    mapping = commands.add_parser("map")
    mapping.set_defaults(call=write_map)
    mapping.add_argument("--tests", nargs="*", default=TESTS, help="files or folders below tests")
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
