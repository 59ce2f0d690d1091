"""Many designs in one call have the values that each has alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import laufruhe
from laufruhe.errors import InputError, ModelError
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS

MIXED = ("single-stroke-offset", "worked-diesel-counterweight", "tractor-four-elastic", "two-machines-angle")
SHARED = ("car-four-willans", "tractor-four-lanchester", "geared-inertia", "tractor-three-bearings", "shaper")
COUNT = 9


def ready(name: str) -> Problem:
    return laufruhe.load(PROBLEMS / f"{name}.toml")


def drawn(problem: Problem, count: int) -> dict[str, np.ndarray]:
    """Return the random values of every open number and open angle."""
    random, designs = np.random.default_rng(7), dict[str, np.ndarray]()
    for decision in problem.decisions:
        designs[decision.name] = random.uniform(decision.lower, decision.upper, count)
        if decision.set.width > 1:
            designs[f"{decision.name.rpartition('.')[0]}.angle"] = random.uniform(*decision.set.angles, count)
    return designs


def written(designs: dict[str, np.ndarray], table: pd.DataFrame, row: int) -> dict[str, Any]:
    """Return the numbers of one design, as a file writes them."""
    units = table.attrs["units"]
    return {name: f"{float(column[row])!r} {units[name]}".strip() for name, column in designs.items()}


@pytest.mark.parametrize("name", [*SHARED, *MIXED])
def test_a_design_has_the_values_that_it_has_alone(name: str) -> None:
    problem = ready(name)
    designs = drawn(problem, COUNT)
    table = laufruhe.evaluate_many(problem, designs)
    assert list(table.message) == [""] * COUNT
    for row in (0, COUNT - 1):
        alone = laufruhe.evaluate(problem.with_values(written(designs, table, row)))
        assert alone.objective is not None
        assert table.objective[row] == pytest.approx(alone.objective.value, rel=1e-9)
        for limit in alone.limits:
            assert table[limit.name][row] == pytest.approx(limit.value, rel=1e-9)
        assert bool(table.feasible[row]) == (alone.final.violation(problem.limits) <= 1e-5)


def test_designs_of_every_form_are_equal() -> None:
    problem = ready("tractor-four-lanchester")
    designs = {"left.unbalance": [0.01, 0.02, 0.03], "front web.mass": ["1 kg", "1200 g", "2 kg"]}
    table = laufruhe.evaluate_many(problem, designs)
    rows = [dict(zip(designs, row, strict=True)) for row in zip(*designs.values(), strict=True)]
    frame = pd.DataFrame(designs, index=["a", "b", "c"])
    assert table.equals(laufruhe.evaluate_many(problem, rows))
    named = laufruhe.evaluate_many(problem, frame)
    assert list(named.index) == ["a", "b", "c"]
    assert table.equals(named.reset_index(drop=True))
    assert list(table["front web.mass"]) == [1.0, 1.2, 2.0]


def test_a_dataset_returns_its_dimensions() -> None:
    problem = ready("tractor-four-lanchester")
    sizes = xr.Dataset({"left.unbalance": ("left", [0.0, 0.01]), "right.unbalance": ("right", [0.0, 0.01, 0.02])})
    data = laufruhe.evaluate_many(problem, sizes.assign_coords(left=["small", "large"]), jobs=2)
    assert data.objective.dims == ("left", "right")
    assert data.objective.units == "N"
    table = laufruhe.evaluate_many(problem, {"left.unbalance": [0.01], "right.unbalance": [0.02]})
    assert float(data.objective.sel(left="large").isel(right=2)) == pytest.approx(table.objective[0], rel=1e-12)
    with pytest.raises(InputError, match="has no dimension"):
        laufruhe.evaluate_many(problem, xr.Dataset({"left.unbalance": 0.01}))


def test_missing_numbers_have_their_start() -> None:
    problem = ready("tractor-four-lanchester")
    table = laufruhe.evaluate_many(problem, [{"left.unbalance": 0.01}, {"right.unbalance": 0.01}])
    assert list(table["left.unbalance"]) == [0.01, 0.0]
    assert list(table["right.unbalance"]) == [0.0, 0.01]


def test_a_design_outside_its_bounds_is_evaluated_and_not_feasible() -> None:
    problem = ready("tractor-four-lanchester")
    table = laufruhe.evaluate_many(problem, {"left.unbalance": [0.049, 0.051]})
    assert list(table.feasible) == [True, False]
    assert np.isfinite(table.objective).all()


def test_a_design_that_cannot_be_built_says_why_and_the_others_stay() -> None:
    problem = ready("tractor-single").open("engine.rod_ratio", 0.2, 0.3)
    table = laufruhe.evaluate_many(problem, {"engine.rod_ratio": [0.25, 1.5, 0.26]})
    assert np.isfinite(table.objective[[0, 2]]).all()
    assert np.isnan(table.objective[1])
    assert "engine.rod_ratio" in table.message[1]
    assert not table.feasible[1]


@pytest.mark.slow
def test_processes_change_nothing() -> None:
    problem = ready("single-stroke-offset")
    designs = drawn(problem, 110)
    assert laufruhe.evaluate_many(problem, designs).equals(laufruhe.evaluate_many(problem, designs, jobs=2))


@pytest.mark.parametrize(
    ("designs", "words"),
    [
        ({"left.unbalances": [0.0]}, "is no open number"),
        ({"left.unbalance": ["1 kg"]}, "unbalance"),
        ({"left.unbalance": [None, "x"]}, "of design 1"),
        ({"left.unbalance": [np.inf]}, "is not finite"),
        ({"left.unbalance": [0.0, 1.0], "right.unbalance": [0.0, 0.0, 0.0]}, "one length"),
        (3, "is of type int"),
    ],
)
def test_wrong_designs_are_refused(designs: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        laufruhe.evaluate_many(ready("tractor-four-lanchester"), designs)


def test_open_throws_are_refused() -> None:
    with pytest.raises(ModelError, match="fix "):
        laufruhe.evaluate_many(ready("vee-six-open"), {})
