"""Measures of a user: linear functions of loads are proven, functions in place of norms only declared."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError, ModelError
from laufruhe.extension import object_at
from laufruhe.problem.problem import Problem, Search
from laufruhe.prove.certificate import Proof
from problem_files import PROBLEMS


def ready(name: str) -> Problem:
    return laufruhe.load(PROBLEMS / f"{name}.toml")


def test_a_missing_extension_is_named() -> None:
    with pytest.raises(ModelError, match="attribute needs the extension 'missing', which is not installed"):
        object_at("laufruhe.extensions.missing.module:attribute")


def test_a_linear_function_of_a_load_is_proven_as_the_load_is() -> None:
    problem = ready("tractor-four-lanchester")
    vertical = laufruhe.own_measure("vertical force", load=lambda forces: forces[..., 2:])
    result = laufruhe.solve(problem.with_objective(vertical))
    same = laufruhe.solve(problem.minimise("mean mount force", direction_weights=[0, 0, 1]))
    assert result.objective is not None
    assert result.certificate is not None
    assert same.objective is not None
    assert result.objective.value == pytest.approx(same.objective.value, rel=1e-9)
    assert result.certificate.kind is Proof.GLOBAL
    limited = laufruhe.solve(problem.with_limit(vertical, 0.999 * result.certificate.lower_bound, "vertical"))
    assert limited.conflict == ("vertical",)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (np.abs, "is not linear"),
        (lambda forces: forces + 1.0, "is not linear"),
        (lambda forces: forces.sum(), "keep all three axes"),
    ],
)
def test_a_function_that_is_not_linear_is_no_load(function: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        ready("tractor-four-lanchester").with_objective(laufruhe.own_measure("own", load=function))


def test_a_function_in_place_of_a_norm_is_only_declared_convex() -> None:
    problem = ready("twin-parallel-360")
    load = problem.objective[0].measure.channel.name
    root = laufruhe.own_measure("root", lambda f: np.sqrt((f**2).sum(axis=-1).mean()), load, curvature="convex")
    # few starts suffice: the function is the norm of the problem
    result = laufruhe.solve(problem.with_objective(root).changed(search=Search(starts=1)))
    same = laufruhe.solve(problem)
    assert result.objective is not None
    assert result.certificate is not None
    assert same.objective is not None
    assert result.objective.value == pytest.approx(same.objective.value, rel=1e-3)
    assert result.certificate.kind in (Proof.LOCAL, Proof.NONE)
    assert result.certificate.lower_bound == 0.0
    assert "convex as declared, not proven" in result.certificate.method


@pytest.mark.parametrize(
    ("function", "curvature", "error", "message"),
    [
        (lambda f: np.median(np.linalg.norm(f, axis=-1)), "convex", InputError, "midway"),
        (lambda f: np.abs(f).max(), "affine", InputError, "midway"),
        (lambda f: -1.0, "convex", ModelError, "zero or more"),
        (lambda f: f, "unknown", ModelError, "return one finite number"),
        (lambda f: math.nan, "unknown", ModelError, "return one finite number"),
    ],
)
def test_a_function_that_breaks_its_declaration_is_refused(
    function: Any, curvature: Any, error: type[Exception], message: str
) -> None:
    measure = laufruhe.own_measure("own", function, curvature=curvature)
    with pytest.raises(error, match=message):
        ready("tractor-four-lanchester").with_objective(measure)
    with pytest.raises(ModelError, match="no cones"):
        ready("tractor-four-lanchester").changed(objective=(laufruhe.problem.measure.Term(measure),)).to_cvxpy()
