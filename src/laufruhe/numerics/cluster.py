"""Dask cluster as an executor, by the address of its scheduler."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager, suppress
from typing import Any, ParamSpec, TypeVar

from laufruhe.errors import Complaint, InputError, SolverError

P = ParamSpec("P")
T = TypeVar("T")

ANSWERS, PATIENCE = 10.0, 60.0
"""Time limits [s]: for the first answer of a scheduler; for the first worker, and for a lost scheduler to return."""


class Cluster(Executor):
    """Executor on the workers of a `distributed.Client`."""

    def __init__(self, client: Any) -> None:
        from distributed.scheduler import KilledWorker

        self._client = client
        self.losses = (KilledWorker,)

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Schedule a call; it waits while the scheduler does not answer."""
        if self._client.status in ("closing", "closed"):
            raise RuntimeError("the connection is closed")
        call, answer = self._client.submit(fn, *args, pure=False, **kwargs), Future[T]()

        def copy_result(call: Any) -> None:
            if not answer.set_running_or_notify_cancel():
                return
            try:
                answer.set_result(call.result(PATIENCE))
            except Exception as error:
                is_its_own = call.status == "error"
                answer.set_exception(error if is_its_own else CancelledError(str(error)))

        # cancelling the future cancels the call
        answer.add_done_callback(lambda done: call.cancel() if done.cancelled() else None)
        call.add_done_callback(copy_result)
        return answer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Do nothing: the client belongs to its creator."""

    @property
    def count(self) -> int:
        """Number of threads of all workers."""
        workers = self._client.scheduler_info(n_workers=-1)["workers"].values()
        return max(sum(int(worker["nthreads"]) for worker in workers), 1)

    @property
    def gone(self) -> str:
        """Message for the loss of all workers."""
        return f"the cluster at {self._client.scheduler.address if self._client.scheduler else 'its address'} is gone"


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """Connect to the scheduler at an address such as tcp://10.0.0.1:8786, and yield an executor on its workers.

    Raises
    ------
    InputError
        If Dask is not installed, or no scheduler answers.
    SolverError
        If no worker connects in time.
    """
    try:
        from distributed import Client
    except ImportError:
        rule, remedy = "needs Dask, which is not installed", "pip install 'laufruhe[cluster]'"
        raise InputError("laufruhe", (Complaint("--scheduler", address, rule, remedy),)) from None
    # the caller reports losses itself
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        Client(address, set_as_default=False, timeout=ANSWERS).close()
        client = Client(address, set_as_default=False, timeout=PATIENCE)
    except (OSError, ValueError, TypeError) as error:
        reason = str(error).partition(":")[0] or type(error).__name__
        complaint = Complaint(
            "--scheduler",
            address,
            f"does not answer ({reason})",
            "name the address that a running dask scheduler prints",
        )
        raise InputError("laufruhe", (complaint,)) from None
    try:
        with suppress(TimeoutError):
            client.wait_for_workers(1, PATIENCE)
        if not client.scheduler_info()["workers"]:
            raise SolverError(f"no worker came to {address} in {PATIENCE:.0f} s; start one: dask worker {address}")
        yield Cluster(client)
    finally:
        client.close(timeout=2)
