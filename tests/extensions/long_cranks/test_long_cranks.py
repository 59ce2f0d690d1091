"""Cranks with too many throws for a list of stars or a ranking by order (S46)."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status
from laufruhe.solvers.stars.even_search import MAX_LISTED
from laufruhe.solvers.stars.families import families_of
from phasing import engines
from problem_files import changed
from solvers.test_star_crossings import FOUR

# three mounts, none alike
MOUNTS = (
    '[mounts]\npositions = [["900 mm", "200 mm", "0 mm"], ["800 mm", "-250 mm", "0 mm"], ["-700 mm", "0 mm", "0 mm"]]\n'
)


def long(folder: Path, cylinders: int, cycle: str, norm: str, seconds: float = 30.0):
    phasing = f'time_limit = "{seconds} s"'
    mounts = MOUNTS + engines.MOUNT_FORCE.replace("mean", norm)
    problem = engines.problem(folder, cylinders, cycle, phasing=phasing, rest=mounts)
    (family,) = families_of(problem.phasing)[0]
    assert family.size > MAX_LISTED
    return problem, family


@pytest.mark.slow
@pytest.mark.parametrize(("cylinders", "norm"), [(16, "mean"), (24, "maximum"), (48, "mean"), (32, "peak to peak")])
def test_pairs_of_throws_leave_what_every_even_star_has(cylinders: int, norm: str, tmp_path: Path) -> None:
    """Check a proof without a program for throws alike at front and back; 40 other stars are not below it."""
    problem, family = long(tmp_path, cylinders, "four-stroke", norm)
    result = solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    assert "star without couples" in result.certificate.method
    r = np.random.default_rng(cylinders)
    steps = np.array(family.first)
    values = []
    for _ in range(40):
        star_problem = problem.phasing.problem_of(
            family.candidate(problem.phasing, (0, *r.permutation(steps[1:]).tolist()))
        )
        values.append(objective_value(star_problem, evaluate(star_problem)))
    assert min(values) >= result.certificate.lower_bound
    assert min(values) > 10.0 * result.objective.value


@pytest.mark.slow
def test_a_long_crank_is_good_where_a_program_has_no_time(tmp_path: Path) -> None:
    """Check that the star of a crank with 20 throws is ten times better than 300 random stars."""
    problem, family = long(tmp_path, 20, "two-stroke", "mean", 0.5)
    result = solve(problem)
    assert result.certificate.kind is Proof.WITHIN_GAP
    r = np.random.default_rng(20)
    values = []
    for _ in range(300):
        star_problem = problem.phasing.problem_of(
            family.candidate(problem.phasing, (0, *(1 + r.permutation(19)).tolist()))
        )
        values.append(objective_value(star_problem, evaluate(star_problem)))
    assert result.certificate.lower_bound <= result.objective.value < 0.1 * min(values)


@pytest.mark.slow
def test_twelve_open_throws_with_weights_opposite_each() -> None:
    """Check that exchanges find a crank without a couple, which is proven without a program."""
    text = changed(changed(FOUR, "cylinders = 4", "cylinders = 12"), 'mass = { between = ["0 kg", "1 kg"] }\n', "")
    text = changed(changed(text, "angle = { between = [0, 360] }\n", ""), "opposite_throw = 1\n",
                   "balance_factor = { between = [0, 1] }\n")  # fmt: skip
    result = laufruhe.solve(changed(text, 'rotating_mass = "0.3 kg"\n', ""))
    assert result.objective.value < 1e-2 * result.objective.initial
    assert result.certificate.lower_bound <= result.objective.value
    throws = np.array([entry.value for entry in result.decisions if entry.name.startswith("throw")])
    for order, power in itertools.product((1, 2), (0, 1)):
        along = -0.1 * np.arange(12) if power else np.ones(12)
        assert abs(np.sum(along * np.exp(1j * order * throws))) < 1e-9


@pytest.mark.parametrize("cylinders", [10, 11])
def test_a_search_cut_short_names_its_gap(cylinders: int, tmp_path: Path) -> None:
    """Check that a search without time names its gap, for listed stars (10 throws) and for halves (11)."""
    result = solve(engines.problem(tmp_path, cylinders, "two-stroke", phasing='time_limit = "1e-9 s"'))
    assert result.status is Status.FEASIBLE
    assert str(result.certificate.kind) == "global within gap"
    assert result.certificate.gap > 0.01
    assert not any(star.proven for star in result.phasing.ranking)
