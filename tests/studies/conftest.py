"""The study's datasets, each computed once for all tests."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest
import xarray as xr

from laufruhe.studies.tractor import COMPUTE, VERDICTS, Verdict


@cache
def _data(name: str) -> xr.Dataset:
    return COMPUTE[name]()


@pytest.fixture(scope="session")
def figure() -> Callable[[str], xr.Dataset]:
    return _data


@pytest.fixture(scope="session")
def verdicts() -> Callable[[str], tuple[Verdict, ...]]:
    return lambda name: VERDICTS[name](_data(name))
