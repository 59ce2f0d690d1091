"""What every test takes of one core, and which of them are in the wrong lane.

    python -m pytest -n 2 --core-seconds seconds.txt      # the costliest first: seconds, marks, name
    python tests/core_seconds.py seconds.txt              # marks `slow` what that file shows to be

Nothing fails by a time: a run names what it saw over half a second without the mark.
"""

from __future__ import annotations

import re
import resource
import sys
from collections import defaultdict
from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time

import pytest

MOST = 0.5
"""Core-seconds that a test of the fast lane may take."""

_NAMED = 12
_PROPERTY = "core-seconds"
_LINE = re.compile(r"(?P<seconds>[\d.]+) (?P<lane>slow|fast) (?P<name>.+)")


def _spent() -> float:
    """Of this process, and of those that it started and that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return process_time() + children.ru_utime + children.ru_stime


@dataclass(eq=False)
class CoreSeconds:
    """Counts in the process that runs a test; collects in the one that reports."""

    config: pytest.Config
    since: float = 0.0
    spent: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    slow: set[str] = field(default_factory=set)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self) -> Generator[None, object, object]:
        self.since = _spent()
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        report = yield
        before, self.since = self.since, _spent()
        report.user_properties.append((_PROPERTY, self.since - before))
        return report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.spent[report.nodeid] += sum(value for name, value in report.user_properties if name == _PROPERTY)
        if {"slow", "long"} & set(report.keywords):
            self.slow.add(report.nodeid)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        costly_first = sorted(self.spent.items(), key=lambda pair: -pair[1])
        if target := self.config.getoption("--core-seconds"):
            lines = (f"{taken:.3f} {'slow' if name in self.slow else 'fast'} {name}\n" for name, taken in costly_first)
            Path(target).write_text("".join(lines))
        in_wrong_lane = [(name, taken) for name, taken in costly_first if taken > MOST and name not in self.slow]
        if in_wrong_lane:
            terminalreporter.section("more than half a second of one core, without the mark `slow`")
            for name, taken in in_wrong_lane[:_NAMED]:
                terminalreporter.write_line(f"{taken:.1f} s {name}")
            if further := in_wrong_lane[_NAMED:]:
                terminalreporter.write_line(f"and {len(further)} further")


def add_options(parser: pytest.Parser) -> None:
    parser.addoption("--core-seconds", metavar="FILE", help="write what every test takes of one core to FILE")


def _functions_to_mark(lines: Iterable[str]) -> dict[Path, set[str]]:
    """Those of which every case, or one that has no parameters, is over the half second and unmarked."""
    found: dict[tuple[Path, str], list[bool]] = defaultdict(list)
    for line in lines:
        if told := _LINE.match(line):
            file, *_, function = told["name"].split("[")[0].split("::")
            found[Path(file), function].append(told["lane"] == "fast" and float(told["seconds"]) > MOST)
    wanted: dict[Path, set[str]] = defaultdict(set)
    for (path, function), over in found.items():
        if any(over):
            if all(over):
                wanted[path].add(function)
            else:
                print(f"{path}::{function}: {sum(over)} of {len(over)} cases; mark them by hand")
    return wanted


def _mark(path: Path, functions: set[str]) -> None:
    source = path.read_text()
    for function in sorted(functions):
        head = re.compile(rf"^( *)((?:@.*\n(?:(?!\1(?:def|@)).*\n)*\1)*)(def {function}\()", re.MULTILINE)
        source = head.sub(r"\1@pytest.mark.slow\n\1\2\3", source, count=1)
    path.write_text(source)


if __name__ == "__main__":
    for changed, names in _functions_to_mark(Path(sys.argv[1]).read_text().splitlines()).items():
        _mark(changed, names)
        print(f"{changed}: {', '.join(sorted(names))}")
