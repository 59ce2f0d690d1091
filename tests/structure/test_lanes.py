"""List of slow tests, written from the times of a run, for the tests of that run alone."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import core_seconds
from changed import reached
from core_seconds import CoreSeconds, is_there, listed_now, mark_listed
from lanes import left_out, long_and_shorter

HERE = "tests/structure/test_lanes.py"
OWN = f"{HERE}::test_a_run_lists_what_took_longer"


@pytest.fixture
def timer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a timer with a list of its own, after a run with some times."""
    path = tmp_path / "a/slow.txt"
    path.parent.mkdir()
    path.write_text(f"# kept\n{OWN}[not run]\n{OWN}[now quick]\n{HERE}::test_that_went\ntests/gone.py::test_a\n")
    (tmp_path / HERE).parent.mkdir(parents=True)
    (tmp_path / HERE).write_text("def test_a_run_lists_what_took_longer():\n")
    monkeypatch.setattr(core_seconds, "LISTED", path)
    config: Any = SimpleNamespace(getoption=lambda name: "anew" if name == "--relist" else None)
    run = CoreSeconds(config)
    for name, seconds, marks in (("now quick", 0.01, ()), ("now slow", 0.9, ()), ("marked", 0.9, ("slow",))):
        for share in (0.25, 0.75):
            report: Any = SimpleNamespace(
                nodeid=f"{OWN}[{name}]", user_properties=[("core-seconds", share * seconds)], keywords=marks
            )
            run.pytest_runtest_logreport(report)
    return run


def test_a_run_lists_what_took_longer(timer: CoreSeconds) -> None:
    timer.pytest_terminal_summary(SimpleNamespace())
    assert listed_now() == [f"{OWN}[not run]", f"{OWN}[now slow]"]


def test_listed_tests_are_slow_unless_they_are_measured(timer: CoreSeconds) -> None:
    for relist in (None, "more", "anew"):
        marked: list[str] = []
        items: Any = [
            SimpleNamespace(nodeid=f"{OWN}[{name}]", add_marker=marked.append) for name in ("not run", "other")
        ]
        config: Any = SimpleNamespace(getoption=lambda name, relist=relist: relist)
        mark_listed(config, items)
        assert marked == ([] if relist == "anew" else ["slow"])


def test_a_listed_long_test_has_a_cheaper_one_that_make_test_runs() -> None:
    listed = long_and_shorter()
    for costly, shorter in listed.items():
        assert is_there(costly), costly
        if shorter.isdecimal():
            assert "[" not in costly, costly
            assert int(shorter) > 0, costly
        else:
            assert is_there(shorter), shorter
            names = {shorter, shorter.partition("[")[0]} & set(listed)
            assert all(listed[name].isdecimal() and name == shorter for name in names), shorter


def test_cases_of_a_family_stay_at_equal_steps() -> None:
    assert left_out(range(10), 3) == [1, 2, 4, 5, 7, 8, 9]
    assert left_out(range(2), 3) == []


@pytest.mark.parametrize(
    ("path", "names"),
    [
        ("src/laufruhe/extensions/sizes/model.py", {"sizes"}),
        ("tests/extensions/torsion/inputs/pendulum.toml", {"torsion"}),
        ("src/laufruhe/prove/certificate.py", {"sizes", "torsion"}),
        ("src/laufruhe/machine/layouts/opposed_piston.py", set()),
        ("docs/index.rst", set()),
        ("tests/conftest.py", {"rotary", "sizes", "torsion"}),
        ("problems/tractor-four.toml", {"rotary", "sizes", "torsion"}),
    ],
)
def test_a_change_reaches_its_extension_and_those_that_import_it(path: str, names: set[str]) -> None:
    assert reached(["rotary", "sizes", "torsion"], [path]) == names
