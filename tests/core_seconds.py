"""Core seconds of every test, and the lane in which it runs.

`slow.txt` lists tests without a mark `slow` of their own that took more than a fifth of a second; `make lanes` writes
it anew. No test fails because of its time: a run lists the slow tests that it saw in the fast lane.
"""

from __future__ import annotations

import resource
from collections import defaultdict
from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from time import process_time

import pytest

MOST = 0.2
"""Core-seconds that a test of the fast lane may take."""

LISTED = Path(__file__).with_name("slow.txt")
_HEAD = "# What takes over a fifth of a second of one core; written by `make lanes`.\n"
_NAMED = 12
_PROPERTY = "core-seconds"


def add_options(parser: pytest.Parser) -> None:
    parser.addoption("--core-seconds", metavar="FILE", help="write what every test takes of one core to FILE")
    parser.addoption("--relist", choices=("anew", "more"), help=f"write {LISTED.name}: for all that run, or add to it")


def mark_listed(config: pytest.Config, items: Iterable[pytest.Item]) -> None:
    listed = set() if config.getoption("--relist") == "anew" else set(listed_now())
    for item in items:
        if item.nodeid in listed:
            item.add_marker("slow")


def listed_now() -> list[str]:
    return [line for line in LISTED.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]


def _spent() -> float:
    """Return the time of this process and of its finished children [s]."""
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
    def pytest_runtest_makereport(self) -> Generator[None, pytest.TestReport, pytest.TestReport]:
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
            Path(target).write_text("".join(lines), encoding="utf-8")
        over = [(name, taken) for name, taken in costly_first if taken > MOST and name not in self.slow]
        if self.config.getoption("--relist"):
            self._relist({name for name, _ in over})
        elif over:
            terminalreporter.section(f"over {MOST} s of one core in the fast lane; `make lanes` lists them")
            for name, taken in over[:_NAMED]:
                terminalreporter.write_line(f"{taken:.1f} s {name}")
            if further := over[_NAMED:]:
                terminalreporter.write_line(f"and {len(further)} further")

    def _relist(self, over: set[str]) -> None:
        names = {name for name in listed_now() if name not in self.spent and is_there(name)}
        LISTED.write_text(_HEAD + "".join(f"{name}\n" for name in sorted(names | over)), encoding="utf-8")


def is_there(name: str) -> bool:
    file, _, rest = name.partition("::")
    path = LISTED.parents[1] / file
    function = rest.partition("[")[0].rpartition("::")[2]
    return path.exists() and f"def {function}(" in path.read_text(encoding="utf-8")
