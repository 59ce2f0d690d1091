"""Calls in Python that cannot be meant: each is refused in one line by an error of the package, and none by another."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from cli import scenes
from laufruhe.problem.problem import Problem
from laufruhe.solvers import Result
from problem_files import PROBLEMS

FOUR, STUDY = PROBLEMS / "tractor-four-lanchester.toml", PROBLEMS / "tractor-sweeps.toml"
Call = Callable[[Problem, Result], Any]
CALLS: dict[str, Call] = {
    "problem = None: is of type NoneType": lambda p, r: laufruhe.load(None),  # type: ignore[arg-type]
    "problem = 3: is of type int": lambda p, r: laufruhe.solve(3),  # type: ignore[arg-type]
    "b'title = 1': is of type bytes": lambda p, r: laufruhe.load(b"title = 1"),  # type: ignore[arg-type]
    "is of type Result": lambda p, r: laufruhe.solve(r),  # type: ignore[arg-type]
    "no.toml: file: does not exist": lambda p, r: laufruhe.evaluate("no.toml"),
    "file: is a folder": lambda p, r: laufruhe.load("."),
    "title: is missing": lambda p, r: laufruhe.load({}),
    "line 1, column 8: is no TOML": lambda p, r: laufruhe.load("title =\n"),
    "problem = '': is empty; give a path": lambda p, r: laufruhe.load(""),
    "study: makes this a study file": lambda p, r: laufruhe.solve(STUDY),
    "is an engine without operating points; give its problem": lambda p, r: laufruhe.evaluate(
        laufruhe.engine("bmw-b48")
    ),
    "study: is missing": lambda p, r: laufruhe.study(FOUR),
    "none.toml: file: does not exist": lambda p, r: laufruhe.study(Path("none.toml")),
    "jobs = 0: must be a whole number, 1 or more": lambda p, r: laufruhe.study(STUDY, jobs=0),
    "jobs = '2'": lambda p, r: laufruhe.study(STUDY, jobs="2"),  # type: ignore[arg-type]
    "time_limit = -1": lambda p, r: laufruhe.solve(p, time_limit=-1),
    "time_limit = nan": lambda p, r: laufruhe.solve(p, time_limit=float("nan")),
    "time_limit = '5'": lambda p, r: laufruhe.solve(p, time_limit="5"),  # type: ignore[arg-type]
    "has no operating point": lambda p, r: laufruhe.evaluate(p.engine),
    "points = '3000 rpm': is no operating point": lambda p, r: laufruhe.evaluate(
        p.engine,
        ["3000 rpm"],  # type: ignore[list-item]
    ),
    "stand beside a problem, which has its own": lambda p, r: laufruhe.evaluate(p, p.points),
    "values = None: is no table": lambda p, r: p.with_values(None),  # type: ignore[arg-type]
    "values = 'front web.mass'": lambda p, r: p.with_values("front web.mass"),  # type: ignore[arg-type]
    "name = 3: is no name": lambda p, r: p.with_values({3: 1}),  # type: ignore[dict-item]
    "did you mean 'front web.mass'": lambda p, r: p.open("fron web.mass", "0 kg", "1 kg"),
    "has its bounds reversed": lambda p, r: p.open("front web.mass", "3 kg", "1 kg"),
    "engine.layout": lambda p, r: p.open("engine.layout", 0, 1),
    "'m' is not a unit of a mass": lambda p, r: p.with_values({"front web.mass": "1.2 m"}),
    "decimals follow a point": lambda p, r: p.with_values({"front web.mass": "1,2 kg"}),
    "starts outside its bounds": lambda p, r: p.with_values({"front web.mass": "12 kg"}),
    "is not open": lambda p, r: p.fix("engine.stroke"),
    "name = None": lambda p, r: p.fix(None),  # type: ignore[arg-type]
    "was made or changed in code": lambda p, r: p.changed(title="x").fix("front web.mass"),
    "has no natural modes": lambda p, r: r.modes(),
    "steps = 0: must be a whole number": lambda p, r: r.forces(0),
    "steps = 2.5": lambda p, r: r.forces(2.5),  # type: ignore[arg-type]
    "steps = 10000000000": lambda p, r: r.forces(10**10),
}


@pytest.mark.parametrize("said", CALLS)
def test_refused_by_an_error_of_the_package(said: str) -> None:
    with pytest.raises(laufruhe.LaufruheError) as caught:
        CALLS[said](laufruhe.load(FOUR), scenes.stated(scenes.GIVEN))
    assert said in str(caught.value)


def test_numbers_of_numpy_are_numbers() -> None:
    """Tables that a program makes have arrays, tuples and numbers of NumPy's, which a file has not."""
    engine = {"layout": "inline", "cycle": np.str_("four-stroke"), "stroke": "90 mm", "reciprocating_mass": "1 kg"}
    tables = {"title": "t", "operating_points": ({"speed": "3000 rpm"},)}
    weights = [{"name": "web", "balance_factor": {"between": np.array([0.0, 1.0])}}]
    throws = np.array([0, 180])
    made = {**tables, "counterweights": weights, "objective": {"minimise": "rms shaking force"}}
    made["engine"] = {**engine, "rod_ratio": np.float64(0.3), "throws": throws, "cylinder_spacing": "90 mm"}
    problem = laufruhe.load(made)
    assert [math.degrees(part.throw) for part in problem.engine.cylinders] == pytest.approx([0.0, 180.0])
    (decision,) = problem.open("web.balance_factor", *np.array([0.25, 0.5])).decisions
    assert (decision.lower, decision.upper) == (0.25, 0.5)
    turned = problem.with_values({"engine.throws": np.radians(throws[::-1])}).engine.cylinders
    assert [part.throw for part in turned] == [part.throw for part in problem.engine.cylinders][::-1]
    single = laufruhe.load({**tables, "engine": {**engine, "rod_ratio": 0.3, "cylinders": np.int64(1)}})
    assert len(single.engine.cylinders) == 1
    # the arguments stay unchanged
    assert made["engine"]["throws"] is throws
    endless: dict[str, Any] = {}
    endless["engine"] = endless
    with pytest.raises(laufruhe.InputError, match="is nested more than"):
        laufruhe.load(endless)
