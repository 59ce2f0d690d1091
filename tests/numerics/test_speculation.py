"""A search with speculation asks for the same steps, and finds the same, as one process."""

from __future__ import annotations

import heapq
import math
import os
import random
import time
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from functools import partial
from itertools import count

import pytest

from laufruhe.numerics.budget import limit_time, seconds_left
from laufruhe.numerics.processes import Processes
from laufruhe.numerics.progress import progress_listener
from laufruhe.numerics.workers import SERIAL, ordered_map, speculation, working_on


def halves(step: tuple[int, float, float]) -> list[tuple[int, float]]:
    """Children of a node of a random tree, each with its bound; slower than others at random."""
    seed, bound, _ = step
    rng = random.Random(seed)
    time.sleep(rng.random() * 2e-3)
    return [(rng.getrandbits(40), bound + rng.random() ** 2) for _ in range(2)]


def searched(executor: Executor) -> tuple[list[int], int]:
    """Nodes in the order in which the best-first search wants them; how many answers were there before."""
    number, heap, order, best = count(), [(0.0, 0, 17)], [], 5.0
    next(number)
    with working_on(executor), speculation(halves) as ahead:
        while heap and len(order) < 200 and heap[0][0] < best:
            bound, name, seed = heapq.heappop(heap)
            order.append(seed)
            near = heapq.nsmallest(8, heap)
            ahead.prefetch([(name, (seed, bound, best)), *((n, (s, b, best)) for b, n, s in near)])
            for child, below in ahead.result(name, (seed, bound, best)):
                heapq.heappush(heap, (below, next(number), child))
                best = min(best, 4.0 + below)
        found = ahead.hits
    return order, found


def test_order_and_answers_are_those_of_one_process() -> None:
    alone, none = searched(SERIAL)
    with ThreadPoolExecutor(3) as pool:
        shared, foreseen = searched(pool)
    assert shared == alone
    assert none == 0
    assert foreseen > len(alone) // 2


def test_what_cannot_be_told_to_others_is_done_here() -> None:
    """Neither a step that no other process can read, nor work that only this one knows."""
    here = os.getpid()
    with Processes(1) as pool, working_on(pool):
        with speculation(lambda step: 2 * step, worth=math.inf) as ahead:
            ahead.prefetch([(0, 21)])
            assert ahead.result(0, 21) == 42
        with speculation(partial(only_in, here), worth=math.inf) as ahead:
            ahead.prefetch([(0, 21)])
            assert ahead.result(0, 21) == 42
            assert ahead.hits == 0


def only_in(process: int, step: int) -> int:
    if os.getpid() != process:
        raise AttributeError("a class of somebody's own")
    return 2 * step


def test_a_step_that_is_lost_is_done_here() -> None:
    class Losing(ThreadPoolExecutor):
        """Loses every call."""

        def submit(self, fn: Callable[..., object], /, *args: object, **kwargs: object):  # type: ignore[override, no-untyped-def]
            future = super().submit(time.sleep, 0.0)
            future.result()
            lost = type(future)()
            lost.cancel()
            lost.set_running_or_notify_cancel()
            return lost

    alone, _ = searched(SERIAL)
    with Losing(2) as pool:
        assert searched(pool) == (alone, 0)
    # where all who work have ended, a search goes on
    pool.shutdown()
    assert searched(pool) == (alone, 0)


def test_an_error_is_that_of_the_step() -> None:
    with ThreadPoolExecutor(2) as pool, working_on(pool), speculation(lambda x: 1 // x) as ahead:
        ahead.prefetch([(0, 0), (1, 1)])
        with pytest.raises(ZeroDivisionError):
            ahead.result(0, 0)


def test_in_turn_keeps_the_order_whoever_works() -> None:
    told: list[int] = []
    with ThreadPoolExecutor(3) as pool, working_on(pool), progress_listener(lambda step: told.append(step.done)):
        assert ordered_map(abs, [-3, -1, -2], "numbers") == [3, 1, 2]
    assert told == [0, 1, 2]


def until_of(_: int) -> float:
    """Seconds that are left where a step is worked out."""
    return seconds_left()


def test_steps_have_the_time_that_is_left() -> None:
    with ThreadPoolExecutor(2) as pool, working_on(pool), limit_time(60.0), speculation(until_of) as ahead:
        ahead.prefetch([("a", 1)])
        assert 0.0 < ahead.result("a", 1) <= 60.0
        assert ahead.hits == 1


def test_processes_that_start_are_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Callable[..., object]] = []

    class Starting(Executor):
        """Two workers that never get ready."""

        def submit(self, fn: Callable[..., object], /, *_: object, **__: object):  # type: ignore[override, no-untyped-def]
            asked.append(fn)
            return Future()

    monkeypatch.setattr("laufruhe.numerics.workers.Processes", Starting)
    monkeypatch.setattr("laufruhe.numerics.workers.worker_count", lambda _=None: 2)
    with working_on(None), speculation(abs, worth=0.0) as ahead:
        ahead.prefetch([("a", -1)])
        assert len(asked) == 2
        assert ahead.result("a", -1) == 1
        assert ahead.hits == 0
    assert len(asked) == 2
