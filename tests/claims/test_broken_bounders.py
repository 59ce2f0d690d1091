"""Bounders broken on purpose, one of each family, which contradict a known design."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import laufruhe
from laufruhe.errors import BoundError
from laufruhe.extensions.flywheel.monotone import MonotoneProblem
from laufruhe.extensions.open_positions.solver import PlaceSearch
from laufruhe.load_models.affine import AffineNorm
from laufruhe.numerics.processes import Processes
from laufruhe.numerics.witness import STRICT, check_bound, collected
from laufruhe.numerics.workers import unordered_map
from laufruhe.prove import certificate
from laufruhe.prove.certificate import Proof
from laufruhe.prove.mounts.subdivision import StiffnessBoxes
from laufruhe.prove.throws.star_cuts import Cut
from laufruhe.solvers.conclusion import evaluate_design, witness_of
from laufruhe.solvers.mounts.convex import ConvexProgram
from laufruhe.solvers.mounts.nonlinear import mount_numbers
from laufruhe.solvers.result import Status
from laufruhe.solvers.stars import even_search
from laufruhe.solvers.throws import uneven_throws
from laufruhe.solvers.throws.throw_boxes import ThrowPrograms
from problem_files import PROBLEMS
from prove.test_subdivision import divided_bound

INPUTS = Path(__file__).parent / "inputs"
Break = Callable[[pytest.MonkeyPatch], None]


def scaled(owner: Any, name: str, change: Callable[[Any], Any]) -> Break:
    """Change whatever a function returns."""
    whole = getattr(owner, name)

    def broken(*given: Any, **named: Any) -> Any:
        return change(whole(*given, **named))

    return lambda patch: patch.setattr(owner, name, broken)


def times(factor: float) -> Callable[[Any], Any]:
    return lambda found: found * factor


def first_times(factor: float) -> Callable[[Any], Any]:
    return lambda found: (found[0] * factor, *found[1:])


def value_times(factor: float) -> Callable[[Any], Any]:
    return lambda found: replace(found, value=found.value * factor)


def least_times(factor: float) -> Callable[[Any], Any]:
    return lambda found: replace(found, lower_bound=found.lower_bound * factor)


def bound_times(factor: float) -> Callable[[Any], Any]:
    return lambda found: replace(found, bound=found.bound * factor)


BROKEN = {
    "dual rows": ("flat-four", scaled(certificate, "lower_bound", value_times(1.001))),
    "half a price": ("locomotive-balanced-share", scaled(AffineNorm, "dual_norm", times(0.5))),
    "cuts of stars": ("two-stroke-four-open", scaled(Cut, "_sums", times(1.02))),
    "stars one by one": ("vee-twenty-open", scaled(even_search, "enumerate_stars", least_times(1.02))),
    "windows of throws": ("inline-nine-uneven", scaled(uneven_throws, "uneven_bound", lambda found: found + 1e3)),
    "throws": ("steam-two-crank", scaled(ThrowPrograms, "_bound", first_times(1.02))),
    "the flywheel": ("scotch-yoke-steam-pump", scaled(MonotoneProblem, "minimum_over", times(1.02))),
    "places": ("tractor-four-shaft-heights", scaled(PlaceSearch, "box", bound_times(1.01))),
    "matrix inequalities": ("powertrain-torque-roll", scaled(ConvexProgram, "bound", first_times(1.001))),
}
"""Ready problem of a family, and the change that breaks its bounder."""


@pytest.mark.slow
@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_bounder_is_an_error(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    problem, broken = BROKEN[name]
    broken(monkeypatch)
    with pytest.raises(BoundError, match="contradicts a known design"):
        laufruhe.solve(PROBLEMS / f"{problem}.toml")


def test_a_broken_bounder_by_expansions(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = laufruhe.load(INPUTS / "zero-width.toml")
    problem = replace(problem, search=replace(problem.search, boxes=None))
    design = evaluate_design(problem, [250e3])
    known = witness_of(design, mount_numbers(design))
    result = divided_bound(problem, design.value, 1e-4 * design.value, known)
    assert 0.999 * design.value <= result.bound <= design.value * (1.0 + 1e-9)
    scaled(StiffnessBoxes, "bounds", first_times(1.001))(monkeypatch)
    with pytest.raises(BoundError, match="boxes of stiffness"):
        divided_bound(problem, design.value, 1e-4 * design.value, known)


def test_a_proof_that_contradicts_a_design_is_withheld(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(STRICT)
    scaled(certificate, "lower_bound", value_times(1.001))(monkeypatch)
    result = laufruhe.solve(PROBLEMS / "flat-four.toml")
    assert result.status is Status.FEASIBLE
    assert result.certificate is not None
    assert result.objective is not None
    assert (result.certificate.kind, result.certificate.lower_bound) == (Proof.NONE, 0.0)
    assert "its proof is withheld" in result.message
    assert "please report it" in result.message
    (bound, value) = map(float, re.findall(r"bound of (\S+) contradicts a known design of (\S+)", result.message)[0])
    assert bound > value > 0.0


@pytest.mark.slow
def test_workers_report_what_they_met(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that reports of worker processes come with their answers."""
    monkeypatch.delenv(STRICT)
    with Processes(1) as executor, collected() as reports:
        assert [answer for _, answer in unordered_map(contradicted, [2.0], executor)] == [2.0]
    assert [(error.bound, error.value) for error in reports] == [(2.0, 1.0)]


def contradicted(bound: float) -> float:
    check_bound("a piece of work", bound, 1.0)
    return bound


def test_bounds_and_values_are_compared_to_a_rounding() -> None:
    assert check_bound("", 1.0 + 5e-10, 1.0)
    assert check_bound("", 1.0 + 5e-4, 1.0, zero_level=1e-3)
    for bound, value in ((1.0 + 2e-9, 1.0), (math.nan, 1.0), (math.inf, 1.0), (1.0, math.nan)):
        with pytest.raises(BoundError):
            check_bound("a bound", bound, value)
    assert check_bound("", math.inf, math.inf)
