"""Bound of every even star by the loads that all share, with any weights."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from laufruhe.files.reader import load_tables
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.throws.firing_windows_bound import firing_bound
from laufruhe.solvers import solve
from laufruhe.solvers.stars.phasing_solver import even_stars
from problem_files import PROBLEMS


def problem(name: str, quantity: str = "mean mount force", **engine: Any) -> Problem:
    tables = tomllib.loads((PROBLEMS / f"compare-{name}.toml").read_text(encoding="utf-8"))
    tables["engine"] |= engine
    return load_tables({**tables, "objective": {"minimise": quantity}}, Path("star.toml"))


CASES = [
    ("inline", "mean mount force", {"cylinders": 5}),
    ("inline", "maximum mount force", {"cylinders": 6}),
    ("vee", "rms mount force", {"cylinders": 6, "bank_angle": 60, "split_pin_angle": 60}),
    ("inline", "peak to peak roll moment", {"cylinders": 7}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "quantity", "engine"), CASES)
def test_no_even_star_with_any_weights_goes_under_it(name: str, quantity: str, engine: dict[str, Any]) -> None:
    variant = problem(name, quantity, **engine)
    random, found = np.random.default_rng(3), []
    stars = even_stars(variant.phasing)
    for k in random.choice(len(stars), 4):
        realised = replace(variant.phasing.problem_of(stars[int(k)][0]), phasing=None)
        for size in (0.0, 0.02, 0.3):
            values = [complex(*random.normal(0.0, 0.1 * size, 2)) for _ in realised.unbalances]
            design = evaluate(realised, realised.design(values, realised.unbalances))
            bound = firing_bound(variant, design)
            found.append(bound)
            assert objective_value(realised, design) >= bound * (1.0 - 1e-9) > 0.0
    assert found == pytest.approx([found[0]] * len(found), rel=1e-6)


@pytest.mark.slow
def test_a_six_in_line_reaches_it() -> None:
    variant = problem("inline", cylinders=6)
    result = solve(variant)
    assert result.objective.value == pytest.approx(firing_bound(variant, result.final), rel=1e-6)
    assert str(result.certificate.kind) == "global"


def test_shafts_that_turn_with_the_firing_leave_no_common_bound() -> None:
    """Four cylinders fire twice a turn, as the shafts of the second order turn."""
    variant = problem("inline", cylinders=4)
    (candidate, _), *_ = even_stars(variant.phasing)
    realised = replace(variant.phasing.problem_of(candidate), phasing=None)
    assert firing_bound(variant, evaluate(realised)) == 0.0


def test_omitted_shafts_or_unlike_cylinders_leave_no_common_bound() -> None:
    """Another design may have these shafts; and the loads of unlike cylinders are not one load shifted."""
    variant = problem("inline", cylinders=4)
    (candidate, _), *_ = even_stars(variant.phasing)
    realised = replace(variant.phasing.problem_of(candidate), phasing=None)

    def bound(unlike: float, known: Problem) -> float:
        first, *others = realised.engine.slider_cranks
        parts = (replace(first, reciprocating_mass=unlike * first.reciprocating_mass), *others)
        return firing_bound(known, evaluate(realised, replace(realised.engine, rotors=(), slider_cranks=parts)))

    alike = replace(variant, engine=replace(variant.engine, rotors=()))
    assert variant.engine.rotors
    assert bound(1.0, alike) > 0.0
    assert bound(1.0, variant) == 0.0
    assert bound(1.1, alike) == 0.0
