"""Pieces of work side by side: whoever does them, each is answered once, and a death costs only what it was at."""

from __future__ import annotations

import os
import signal
import subprocess
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
from laufruhe.numerics.cores import ONE_THREAD
from laufruhe.numerics.processes import Processes, WorkerDied, fork_map
from laufruhe.numerics.workers import (
    SERIAL,
    SerialExecutor,
    TimeIsOver,
    WorkersGone,
    current_executor,
    executor_for,
    unordered_map,
    worker_count,
    worker_pool,
    working_on,
)

# what workers are asked for has to be found by them by its name: functions of Python's own, and of the package
POWERS = [(k, 3) for k in range(40)]


def power(pair: tuple[int, int]) -> int:
    return int(pair[0] ** pair[1])


@pytest.mark.parametrize("executor", [SERIAL, ThreadPoolExecutor(3)], ids=["here", "threads"])
def test_every_piece_is_answered_once_by_any_executor(executor: Executor) -> None:
    found = list(unordered_map(power, POWERS, executor))
    assert sorted(found) == [(k, k**3) for k in range(40)]


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
    """Each ends when it is told to alone; who asks which processes run may do so while they begin."""
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


def test_who_works_may_be_asked_while_workers_begin(monkeypatch: pytest.MonkeyPatch) -> None:
    class Begun:
        """As a process, without one."""

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
            asked = other.submit(lambda: [pool.submit(abs, -1) for _ in range(count)])
            while not asked.done():
                assert len(pool.pids) <= count
            assert [future.result() for future in asked.result()] == [None] * count
    finally:
        sys.setswitchinterval(before)


COPIED = """
import os, signal, sys, tomllib
from laufruhe.numerics.processes import ForkedWorker, Processes, WorkerDied

tomllib.known = "of this process alone"
signal.signal(signal.SIGINT, lambda *_: None)
with Processes(1, [ForkedWorker()]) as pool:
    (copy,) = pool.pids
    assert pool.submit(os.getpid).result() == copy == pool.submit(os.getsid, 0).result() != os.getpid()
    assert pool.submit(eval, "__import__('tomllib').known").result() == tomllib.known
    assert pool.submit(eval, "__import__('signal').getsignal(2).name").result() == "SIG_DFL"
    assert not ForkedWorker.is_possible()
    try:
        pool.submit(divmod, 1, 0).result()
    except ZeroDivisionError:
        os.kill(copy, signal.SIGKILL)
    try:
        pool.submit(abs, -1).result()
    except WorkerDied:
        assert pool.submit(os.getpid).result() not in (copy, os.getpid())
with Processes(1, [ForkedWorker()]) as pool:
    (copy,) = pool.pids
    pool.submit(abs, -1)
assert ForkedWorker.is_possible()
try:
    os.kill(copy, 0)
except ProcessLookupError:
    print("done")
"""
THREADS = Path("/proc/self/task")
SEVERAL = """
import os, sys
from laufruhe.numerics import workers
from laufruhe.numerics.processes import ForkedWorker
from laufruhe.numerics.progress import progress_listener, report_progress

workers.processors = lambda: 3
sys.known = os.getpid()
with workers.Processes(3, ForkedWorker.several(3)) as unasked:
    assert len(unasked.pids) == 3
with progress_listener(lambda step: print(step, file=sys.stderr)), workers.worker_pool(abs):
    own = workers.current_executor()
    pids = own.pids
    assert len(pids) == 3
    assert own.submit(eval, "__import__('sys').known").result() == os.getpid() != own.submit(os.getpid).result()
    own.submit(report_progress, "nobody hears it").result()
    assert not ForkedWorker.several(2)
try:
    os.wait()
except ChildProcessError:
    print("done")
"""
MEANWHILE = """
import os, signal, time
from laufruhe.numerics import processes

processes.processors = lambda: 2
with processes.run_concurrently(os.getpid, pays=True) as answer:
    assert answer() != os.getpid()
with processes.run_concurrently(os.getpid, pays=False) as answer:
    assert answer() == os.getpid()
here = os.getpid()
with processes.run_concurrently(lambda: os.getpid() == here or os._exit(3), pays=True) as answer:
    assert answer()
began = time.monotonic()
try:
    with processes.run_concurrently(lambda: time.sleep(600), pays=True):
        raise ZeroDivisionError
except ZeroDivisionError:
    assert time.monotonic() - began < 300.0
try:
    os.wait()
except ChildProcessError:
    print("done")
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system copies no process")
@pytest.mark.parametrize(
    "program",
    [COPIED, MEANWHILE, pytest.param(SEVERAL, marks=pytest.mark.skipif(not THREADS.is_dir(), reason="told by Linux"))],
    ids=["served", "once", "several"],
)
def test_copies_of_a_process_have_all_that_it_has_and_end_with_it(program: str) -> None:
    told = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        capture_output=True, text=True, check=False, env={**os.environ, **ONE_THREAD},
    )  # fmt: skip
    assert (told.stdout, told.stderr) == ("done\n", "")


@pytest.mark.slow
def test_twins_of_a_process_share_its_work_and_a_dead_one_costs_no_answer() -> None:
    with Processes(1) as pool:
        known = {"fork_map": fork_map, "pid": os.getpid, "end": os._exit, "own": pool.submit(os.getpid).result()}
        found = pool.submit(eval, "fork_map(lambda k: (k, pid()), 3)", known).result()
        assert [k for k, _ in found] == [0, 1, 2]
        assert len({pid for _, pid in found}) == 3
        assert pool.submit(eval, "fork_map(lambda k: k if pid() == own else end(3), 3)", known).result() == [0, 1, 2]
        with pytest.raises(ZeroDivisionError):
            pool.submit(eval, "fork_map(lambda k: 1 / (2 - k), 3)", known).result()
        assert len(pool.pids) == 1


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
def test_what_ends_its_workers_is_given_up() -> None:
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


@pytest.mark.slow
def test_processes_at_hand_end_with_the_searches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also in the middle of a call, which nobody waits for."""
    for room in ("workers", "processes"):
        monkeypatch.setattr(f"laufruhe.numerics.{room}.processors", lambda: 2)
    with worker_pool(abs):
        own = current_executor()
        assert isinstance(own, Processes)
        begun = own.submit(time.sleep, 600)
        assert own.submit(abs, -1).result() == 1
        pids = own.pids
        assert pids
        with worker_pool(abs):
            assert current_executor() is own
    assert current_executor() is None
    assert isinstance(begun.exception(), WorkerDied)
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    monkeypatch.setattr("laufruhe.numerics.workers.processors", lambda: 1)
    with worker_pool(abs):
        assert current_executor() is None


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


def test_without_dask_the_option_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"needs Dask, which is not installed; pip install 'laufruhe\[cluster\]'"):
        cluster("tcp://127.0.0.1:1").__enter__()
