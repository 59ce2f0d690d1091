"""Replications, each part computed once for all tests."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Collection
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import xarray as xr

from laufruhe.extensions.replication.expressions import value_of
from laufruhe.extensions.replication.part import Replication
from laufruhe.studies.reader import StudyFile, load_study
from laufruhe.studies.runner import run
from laufruhe.studies.stores import FINISHED_POINTS
from problem_files import PROBLEMS
from shared import once


@cache
def study_of(file: str) -> StudyFile:
    return load_study(PROBLEMS / f"{file}.toml")


@cache
def parts_of(file: str) -> dict[str, Replication]:
    """Return the parts of a study; the largest sweep, which has as many points as all others, has a third of them."""
    parts: dict[str, Replication] = {part.name: part for part in study_of(file).study.parts}  # type: ignore[misc]
    if part := parts.get("reciprocating-mass"):
        sweeps = [{**case.sweep} for case in part.cases]
        for sweep in sweeps:
            sweep.update({name: sweep[name].model_copy(update={"points": 15}) for name in sweep if name == "phi"})
        cases = [case.model_copy(update={"sweep": sweep}) for case, sweep in zip(part.cases, sweeps, strict=True)]
        parts[part.name] = part.model_copy(update={"cases": cases})
    return parts


def shared_part(file: str, name: str) -> Path:
    """Return the folder of the finished points of one part and its dataset, computed once for all processes."""

    def fill(folder: Path) -> None:
        study = study_of(file)
        alone = study.study.model_copy(update={"parts": [parts_of(file)[name]]})
        data = run(study.model_copy(update={"study": alone}), PROBLEMS, folder / FINISHED_POINTS)[0][name]
        (folder / "data").write_bytes(pickle.dumps(data))

    return once(f"{file}-{name}", fill)


@cache
def computed(file: str, name: str) -> xr.Dataset:
    found: xr.Dataset = pickle.loads((shared_part(file, name) / "data").read_bytes())
    return found


@pytest.fixture(scope="session")
def figure() -> Callable[[str], xr.Dataset]:
    """Return the dataset of a figure of the tractor study."""
    return lambda name: computed("tractor-study", name)


@pytest.fixture(scope="session")
def finished() -> Callable[..., None]:
    """Put the finished points of a replication, or of some parts, into a folder: its command goes on from there."""

    def fill(file: str, folder: Path, names: Collection[str] = ()) -> None:
        folder.mkdir(parents=True)
        for part in names or parts_of(file):
            points = shared_part(file, part) / FINISHED_POINTS
            if points.exists():
                with (folder / FINISHED_POINTS).open("ab") as target:
                    target.write(points.read_bytes())

    return fill


@pytest.fixture(scope="session")
def worth() -> Callable[..., Any]:
    """Return a function that evaluates an expression in a part of a replication, by default in the first reading."""

    def evaluate_text(name: str, text: str, file: str = "tractor-study", reading: str | None = None) -> Any:
        names = parts_of(file)[name].names(computed(file, name))
        return value_of(text, names[reading or next(iter(names))])

    return evaluate_text
