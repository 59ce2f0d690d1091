"""Linear algebra of library calls takes one thread, and the threads of before afterwards."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from laufruhe.numerics.cores import ONE_THREAD, one_thread


def threads() -> set[int]:
    np.zeros((2, 2)) @ np.zeros((2, 2))
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def _two_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ONE_THREAD:
        monkeypatch.delenv(name, raising=False)


def test_a_block_has_one_thread_and_restores_the_number() -> None:
    with threadpool_limits(2, "blas"):
        before = threads()
        with one_thread():
            assert threads() == {1}
            with one_thread():
                assert threads() == {1}
            assert threads() == {1}
        assert threads() == before
        with pytest.raises(ValueError, match="fails"), one_thread():
            raise ValueError("fails")
        assert threads() == before


def test_blocks_that_overlap_restore_the_number() -> None:
    with threadpool_limits(2, "blas"):
        before, first, second = threads(), ExitStack(), ExitStack()
        first.enter_context(one_thread())
        second.enter_context(one_thread())
        first.close()
        assert threads() == {1}
        second.close()
        assert threads() == before


def test_the_environment_decides(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    with threadpool_limits(2, "blas"):
        before = threads()
        with one_thread():
            assert threads() == before
