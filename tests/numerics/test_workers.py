"""Pieces of work in parallel: each is answered once, and the death of a worker costs only its piece."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, closing
from pathlib import Path
from queue import SimpleQueue

import pytest

from laufruhe.errors import InputError
from laufruhe.files.reader import tables_of
from laufruhe.numerics.budget import limit_time, seconds_left
from laufruhe.numerics.cluster import cluster
from laufruhe.numerics.processes import Processes, WorkerDied
from laufruhe.numerics.progress import progress_listener
from laufruhe.numerics.workers import (
    SERIAL,
    SerialExecutor,
    TimeIsOver,
    WorkersGone,
    current_executor,
    executor_for,
    ordered_map,
    unordered_map,
    worker_count,
    working_on,
)

# functions that workers find by name: those of Python and of the package
POWERS = [(k, 3) for k in range(40)]


def power(pair: tuple[int, int]) -> int:
    return int(pair[0] ** pair[1])


@pytest.mark.parametrize("executor", [SERIAL, ThreadPoolExecutor(3)], ids=["here", "threads"])
def test_every_piece_is_answered_once_by_any_executor(executor: Executor) -> None:
    result = list(unordered_map(power, POWERS, executor))
    assert sorted(result) == [(k, k**3) for k in range(40)]


@pytest.mark.slow
def test_processes_answer_and_pass_errors_on() -> None:
    with Processes(2) as pool:
        assert sorted(unordered_map(abs, range(-20, 0), pool)) == [(k, 20 - k) for k in range(20)]
        assert pool.submit(os.getpid).result() in pool.pids
        with pytest.raises(ZeroDivisionError):
            pool.submit(divmod, 1, 0).result()
        # an error with a constructor of its own, from another interpreter
        with pytest.raises(InputError, match="does not exist") as caught:
            pool.submit(tables_of, Path("no-such.toml")).result()
        assert caught.value.complaints
        pids = pool.pids
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    with pytest.raises(RuntimeError, match="after shutdown"):
        pool.submit(abs, -1)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes with names")
def test_calls_are_worked_on_side_by_side(tmp_path: Path) -> None:
    """Check that calls end independently, and that running processes can be listed while they start."""
    pipes = [tmp_path / str(k) for k in range(3)]
    with Processes(len(pipes)) as pool, ExitStack() as ends:
        for pipe in pipes:
            os.mkfifo(pipe)
        begun = [pool.submit(Path.read_bytes, pipe) for pipe in pipes]
        # opened once who reads has opened it too
        for number, pipe in enumerate(pipes):
            ends.enter_context(pipe.open("wb")).write(b"%d" % number)
        assert len(set(pool.pids)) == len(pipes)
        assert not any(future.done() for future in begun)
        ends.close()
        assert [future.result() for future in begun] == [b"0", b"1", b"2"]


def test_a_pool_accepts_work_while_workers_start(monkeypatch: pytest.MonkeyPatch) -> None:
    class Begun:
        """Stand-in for a process."""

        pid, stdin, stdout = 0, None, None

        def __init__(self, *_: object, **__: object) -> None: ...
        def kill(self) -> None: ...
        def wait(self) -> None: ...

    monkeypatch.setattr("laufruhe.numerics.processes.subprocess.Popen", Begun)
    monkeypatch.setattr("laufruhe.numerics.processes._exchange", lambda *_: (True, None))
    before, count = sys.getswitchinterval(), 200
    sys.setswitchinterval(1e-6)
    try:
        with Processes(count) as pool, ThreadPoolExecutor(1) as other:
            answer = other.submit(lambda: [pool.submit(abs, -1) for _ in range(count)])
            while not answer.done():
                assert len(pool.pids) <= count
            assert [future.result() for future in answer.result()] == [None] * count
    finally:
        sys.setswitchinterval(before)


@pytest.mark.slow
def test_a_worker_that_is_killed_costs_no_answer() -> None:
    with Processes(2) as pool, closing(unordered_map(time.sleep, [0.05] * 30, pool)) as found:
        done = [next(found)[0]]
        for pid in pool.pids:
            os.kill(pid, signal.SIGKILL)
        done += [number for number, _ in found]
        assert sorted(done) == list(range(30))
        assert pool.submit(abs, -1).result() == 1


@pytest.mark.slow
def test_a_call_that_kills_its_workers_is_given_up() -> None:
    with Processes(1) as pool:
        with pytest.raises(WorkerDied):
            pool.submit(os._exit, 3).result()
        with pytest.raises(WorkersGone, match="repeatedly"):
            list(unordered_map(os._exit, [3], pool))


@pytest.mark.slow
def test_no_process_outlives_an_error() -> None:
    began, pool = time.monotonic(), Processes(2)

    def fails() -> None:
        with pool:
            pool.submit(time.sleep, 600)
            while not pool.pids:
                time.sleep(0.01)
            pids.extend(pool.pids)
            raise ZeroDivisionError

    pids: list[int] = []
    with pytest.raises(ZeroDivisionError):
        fails()
    assert time.monotonic() - began < 300.0
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_a_call_that_a_worker_takes_while_all_end_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Between the question whether calls are left and the answer a worker may have taken the last one."""

    class Emptied(SimpleQueue[object]):
        """Seems to hold a call that it does not hold."""

        def empty(self) -> bool:
            return False

    monkeypatch.setattr("laufruhe.numerics.processes.SimpleQueue", Emptied)
    ending = threading.Thread(target=Processes(1).shutdown, kwargs={"cancel_futures": True}, daemon=True)
    ending.start()
    ending.join(60.0)
    assert not ending.is_alive()


def test_time_that_is_left_goes_with_a_piece() -> None:
    with limit_time(100.0):
        ((_, seconds),) = unordered_map(lambda _: seconds_left(), [0], SERIAL)
    assert 90.0 < seconds <= 100.0


def test_at_the_time_limit_patience_waits_for_what_was_begun() -> None:
    pieces = [0.2] * 50
    with ThreadPoolExecutor(2) as pool, limit_time(0.1):
        with pytest.raises(TimeIsOver):
            list(unordered_map(time.sleep, pieces, pool))
        begun = list(unordered_map(time.sleep, pieces, pool, patient=True))
    assert 1 <= len(begun) < 50


def test_a_worker_starts_no_workers() -> None:
    with ThreadPoolExecutor(1) as pool:
        assert list(unordered_map(lambda _: current_executor(), [0], pool)) == [(0, SERIAL)]
    assert current_executor() is None
    with working_on(SERIAL), executor_for(4) as executor:
        assert isinstance(executor, SerialExecutor)
        assert worker_count() == 1
    assert worker_count() >= 1


def test_pieces_are_taken_as_workers_get_free() -> None:
    taken = []

    def pieces() -> object:
        for k in range(1000):
            taken.append(k)
            yield (k, 1)

    with ThreadPoolExecutor(2) as pool, closing(unordered_map(power, pieces(), pool)) as found:  # type: ignore[arg-type]
        next(found)
        assert len(taken) <= 12


def test_in_turn_keeps_the_order_whoever_works() -> None:
    steps: list[int] = []
    with ThreadPoolExecutor(3) as pool, working_on(pool), progress_listener(lambda step: steps.append(step.done)):
        assert ordered_map(abs, [-3, -1, -2], "numbers") == [3, 1, 2]
    assert steps == [0, 1, 2]


def test_without_dask_the_option_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"needs Dask, which is not installed; pip install 'laufruhe\[cluster\]'"):
        cluster("tcp://127.0.0.1:1").__enter__()
