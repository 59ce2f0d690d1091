"""Settings that every test shares."""

import gc
import os
import tempfile
from functools import cache
from pathlib import Path

import pytest
import typer.testing
from hypothesis import settings
from hypothesis.configuration import set_hypothesis_home_dir

import changed
import core_seconds
import lanes
import shared

# Tests run in a process for each core: none of them starts further ones unless it says how many.
if "PYTEST_XDIST_WORKER" in os.environ and hasattr(os, "sched_getaffinity"):
    os.sched_getaffinity = lambda _: {0}

# Set before any test module can import matplotlib: no test has a display.
os.environ["MPLBACKEND"] = "Agg"

# Typer makes all commands anew for every call of one, which takes as long as many a command.
typer.testing._get_command = cache(typer.testing._get_command)

# A bound that contradicts a known design is an error here, also in processes that tests start.
os.environ["LAUFRUHE_STRICT"] = "1"

# Derandomised: a failure repeats on the next machine, and no example database is needed.
settings.register_profile("laufruhe", derandomize=True, deadline=None, database=None, max_examples=20)
# `make test-fast` asks for this one
settings.register_profile("fast", settings.get_profile("laufruhe"), max_examples=10)
settings.load_profile("laufruhe")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="run what is marked long, and only that")
    core_seconds.add_options(parser)
    changed.add_options(parser)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    return True if changed.ignores(collection_path, config) else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    core_seconds.mark_listed(config, items)
    lanes.mark_long(items)
    with_long = bool(config.getoption("--long"))
    sorted_out: dict[bool, list[pytest.Item]] = {True: [], False: []}
    for item in items:
        sorted_out[(item.get_closest_marker("long") is not None) == with_long].append(item)
    items[:] = sorted_out[True]
    config.hook.pytest_deselected(items=sorted_out[False])


def pytest_configure(config: pytest.Config) -> None:
    shared.prepare(config)
    config.pluginmanager.register(core_seconds.CoreSeconds(config))
    # Hypothesis keeps tables of the source beside the tests unless told where: they belong into pytest's own cache
    # (seconds of every process), and where there is none nothing may stay behind.
    if hasattr(config, "cache"):
        set_hypothesis_home_dir(config.cache.mkdir("hypothesis"))
    else:
        home = tempfile.TemporaryDirectory(prefix="hypothesis-")
        set_hypothesis_home_dir(Path(home.name))
        config.add_cleanup(home.cleanup)


@pytest.hookimpl(tryfirst=True)
def pytest_collection() -> None:
    """Stop the garbage collector, because imported and collected objects live to the end of the run."""
    gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(100_000, 50, 100)
    gc.enable()


@pytest.fixture
def small_trade(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a trade call each fidelity once, for few designs and scenes."""
    small = {"_MAX_REPEATS": 1, "DESIGNS": 100, "SCENES": 1, "peak_memory": lambda _: 1}
    for name, value in small.items():
        monkeypatch.setattr(f"laufruhe.extensions.fidelity.trade.{name}", value)
