"""Of requests that wait only the newest is worked on, and what hangs is ended."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor

import pytest

from laufruhe.server.desk import Desk, Late, Superseded

pytestmark = pytest.mark.slow


@pytest.fixture
def desk() -> Iterator[Desk]:
    made = Desk(patience=0.5)
    yield made
    made.close()


def test_the_newest_wins(desk: Desk) -> None:
    assert desk.ask(30.0, abs, -1) == 1
    with ThreadPoolExecutor(3) as askers:
        first = askers.submit(desk.ask, 30.0, time.sleep, 0.3)
        time.sleep(0.1)
        second = askers.submit(desk.ask, 30.0, abs, -2)
        time.sleep(0.05)
        third = askers.submit(desk.ask, 30.0, abs, -3)
        assert first.result() is None
        assert third.result() == 3
        with pytest.raises(Superseded):
            second.result()


def test_what_is_at_work_too_long_makes_way(desk: Desk) -> None:
    with ThreadPoolExecutor(1) as asker:
        first = asker.submit(desk.ask, 60.0, time.sleep, 50.0)
        time.sleep(0.2)
        began = time.monotonic()
        assert desk.ask(30.0, abs, -4) == 4
        assert time.monotonic() - began < 20.0
        with pytest.raises(Superseded):
            first.result()


def test_time_is_limited_and_the_next_request_is_answered(desk: Desk) -> None:
    with pytest.raises(Late, match="1 s"):
        desk.ask(1.0, time.sleep, 50.0)
    assert desk.ask(30.0, abs, -5) == 5


def test_a_process_that_dies_is_replaced(desk: Desk) -> None:
    with pytest.raises(BrokenExecutor):
        desk.ask(30.0, os._exit, 3)
    assert desk.ask(30.0, abs, -6) == 6


def test_a_closed_desk_lets_go_of_who_waits(desk: Desk) -> None:
    with ThreadPoolExecutor(1) as asker:
        waiting = asker.submit(desk.ask, 60.0, time.sleep, 50.0)
        time.sleep(0.2)
        desk.close()
        with pytest.raises(Superseded):
            waiting.result(10.0)
    with pytest.raises(Superseded):
        desk.ask(1.0, abs, -7)
    assert threading.active_count() < 20
