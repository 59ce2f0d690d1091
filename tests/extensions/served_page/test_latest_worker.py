"""Worker that answers only the newest of waiting requests and ends one that hangs."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path

import pytest

from laufruhe.extensions.served_page.latest_worker import Late, LatestWorker, Superseded

# longest wait for an expected event [s]
LONG = 600.0
pytestmark = [pytest.mark.slow, pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")]


@pytest.fixture
def desk() -> Iterator[LatestWorker]:
    made = LatestWorker(patience=0.5)
    yield made
    made.close()


@contextmanager
def at_work(desk: LatestWorker, askers: ThreadPoolExecutor, folder: Path) -> Iterator[Future[bytes]]:
    """Yield a request that works in the desk's process, and ends with it at the latest."""
    pipe = folder / "pipe"
    os.mkfifo(pipe)
    answer = askers.submit(desk.ask, LONG, Path.read_bytes, pipe)
    # opened once the process has opened it too
    with pipe.open("wb"):
        yield answer


def test_the_newest_wins(tmp_path: Path) -> None:
    with closing(LatestWorker(patience=LONG)) as desk, ThreadPoolExecutor(3) as askers:
        with at_work(desk, askers, tmp_path) as first:
            second = askers.submit(desk.ask, LONG, abs, -2)
            while desk._newest < 2:
                time.sleep(0.01)
            third = askers.submit(desk.ask, LONG, abs, -3)
            assert isinstance(second.exception(LONG), Superseded)
            assert not first.done()
        assert first.result(LONG) == b""
        assert third.result(LONG) == 3


def test_a_slow_request_is_superseded(desk: LatestWorker, tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as askers, at_work(desk, askers, tmp_path) as first:
        assert askers.submit(desk.ask, LONG, abs, -4).result(LONG) == 4
        assert isinstance(first.exception(LONG), Superseded)


def test_time_is_limited_and_the_next_request_is_answered(desk: LatestWorker) -> None:
    with pytest.raises(Late, match="1 s"):
        desk.ask(1.0, time.sleep, LONG)
    assert desk.ask(LONG, abs, -5) == 5


def test_a_process_that_dies_is_replaced(desk: LatestWorker) -> None:
    with pytest.raises(BrokenExecutor):
        desk.ask(LONG, os._exit, 3)
    assert desk.ask(LONG, abs, -6) == 6


def test_a_closed_desk_lets_go_of_who_waits(tmp_path: Path) -> None:
    desk = LatestWorker(patience=LONG)
    with ThreadPoolExecutor(2) as askers, at_work(desk, askers, tmp_path) as at:
        waiting = askers.submit(desk.ask, LONG, abs, -7)
        desk.close()
        assert [isinstance(each.exception(LONG), Superseded) for each in (at, waiting)] == [True, True]
    with pytest.raises(Superseded):
        desk.ask(1.0, abs, -7)
