"""Calls of a cluster whose answers are lost and requested again, without a cluster."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from lanes import of_clusters
from laufruhe.numerics.cluster import Cluster
from laufruhe.numerics.workers import unordered_map

pytestmark = of_clusters("distributed")


class Call:
    """Stand-in for `distributed.Future` with a status and a function that fetches its result."""

    def __init__(self, status: str, fetch: Callable[[], Any]) -> None:
        self.status, self._fetch = status, fetch

    def add_done_callback(self, callback: Callable[[Call], None]) -> None:
        callback(self)

    def result(self, _: float) -> Any:
        return self._fetch()

    def cancel(self) -> None:
        self.status = "cancelled"


class Client:
    """Stand-in for a client whose first answers cannot be fetched, because a connection ends."""

    status, scheduler = "running", None

    def __init__(self, unreachable: int) -> None:
        self.unreachable, self.calls = unreachable, 0

    def scheduler_info(self, n_workers: int) -> dict[str, Any]:
        return {"workers": {"one": {"nthreads": abs(n_workers)}}}

    def submit(self, work: Callable[..., Any], *words: Any, pure: bool) -> Call:
        assert not pure
        self.calls += 1

        def fetch() -> Any:
            raise OSError("the connection is lost")

        try:
            answer = work(*words)
        except ValueError as error:
            raised = error

            def failing() -> Any:
                raise raised

            return Call("error", failing)
        return Call("finished", fetch if self.calls <= self.unreachable else lambda: answer)


def half(number: int) -> float:
    """Return half of an even number."""
    if number % 2:
        raise ValueError(f"{number} is odd")
    return 0.5 * number


def test_answers_that_cannot_be_fetched_are_requested_again() -> None:
    client = Client(unreachable=2)
    assert sorted(unordered_map(half, [2, 4, 6], Cluster(client))) == [(0, 1.0), (1, 2.0), (2, 3.0)]
    assert client.calls == 5


def test_an_error_of_a_call_is_raised_after_one_request() -> None:
    client = Client(unreachable=0)
    with pytest.raises(ValueError, match="3 is odd"):
        list(unordered_map(half, [3], Cluster(client)))
    assert client.calls == 1
