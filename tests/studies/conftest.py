"""Replications, each part computed once for all tests."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from laufruhe.studies.kinds.replication import Replication
from laufruhe.studies.reader import load_study
from laufruhe.studies.replication.expressions import value_of
from laufruhe.studies.scenes import Scenes

PROBLEMS = Path(__file__).parents[2] / "problems"


@cache
def parts_of(file: str) -> dict[str, Replication]:
    return {part.name: part for part in load_study(PROBLEMS / f"{file}.toml").study.parts}  # type: ignore[misc]


@cache
def computed(file: str, name: str) -> xr.Dataset:
    part, scenes = parts_of(file)[name], Scenes(PROBLEMS)
    points = part.points(scenes)
    # what is kept on disk between two runs is JSON
    records = [json.loads(json.dumps(part.answer(point, scenes))) for point in points]
    return part.dataset(points, records)


@pytest.fixture(scope="session")
def figure() -> Callable[[str], xr.Dataset]:
    """Dataset of a figure of the tractor study."""
    return lambda name: computed("tractor-study", name)


@pytest.fixture(scope="session")
def worth() -> Callable[..., Any]:
    """What an expression is worth in a part of a replication, in the first reading unless told."""

    def found(name: str, text: str, file: str = "tractor-study", reading: str | None = None) -> Any:
        names = parts_of(file)[name].names(computed(file, name))
        return value_of(text, names[reading or next(iter(names))])

    return found
