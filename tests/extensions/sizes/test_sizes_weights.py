"""Sizes with unbalances, compared with random designs, cone programs at given sizes, and less freedom."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import laufruhe
import ready
from extensions.sizes.test_sizes import TEXT
from laufruhe.errors import ModelError
from laufruhe.extensions.sizes.boxes import SizeBoxes
from laufruhe.extensions.sizes.model import SizeModel
from laufruhe.extensions.sizes.solver import solve_cone_program
from laufruhe.problem.decision import domains_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Status
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.result import Result
from problem_files import PROBLEMS, changed
from searched import searched

WEIGHT = """
[[counterweights]]
name = "w"
x = "10 mm"
radius = "60 mm"
unbalance = { between = ["0 kg m", "0.03 kg m"] }
angle = { between = [0, 360] }
[[balancer_shafts]]
name = "shaft"
ratio = -1
position = ["80 mm", "20 mm"]
unbalances = [{ x = "0 mm", unbalance = { between = ["0 kg m", "0.01 kg m"] }, angle = 180 }]
"""
FEWER = changed(
    changed(TEXT, '{ between = ["20 mm", "40 mm"], start = "35 mm" }', '"36 mm"'), "samples = 360", "samples = 90"
)
TOGETHER = changed(FEWER, "[objective]", f"{WEIGHT}[objective]")
FIXED_ROD = changed(
    TOGETHER, '{ diameter = { between = ["8 mm", "25 mm"], start = "20 mm" } }', '{ diameter = "16 mm" }'
)
TOLERANCE = 5e-3


@pytest.fixture(scope="module")
def problem() -> Problem:
    return laufruhe.load(TOGETHER).changed(tolerance=TOLERANCE)


@pytest.fixture(scope="module")
def solved(problem: Problem) -> Result:
    return laufruhe.solve(problem)


def with_sizes(problem: Problem, sizes: np.ndarray) -> Problem:
    """Return the problem with these sizes and open unbalances."""
    named = tuple(d for d in problem.decisions if d not in problem.unbalances)
    engine = problem.design(sizes.tolist(), named)
    return replace(problem, engine=engine, decisions=problem.unbalances)


def test_the_best_sizes_with_the_best_weights_are_proven(solved: Result) -> None:
    assert solved.status is Status.OPTIMAL
    assert solved.certificate.kind is Proof.GLOBAL
    assert solved.certificate.kkt_residual < 1e-4
    assert "boxes of sizes" in solved.certificate.method


def test_at_its_sizes_the_cone_program_finds_the_same(solved: Result, problem: Problem) -> None:
    found = {entry.name: entry.value for entry in solved.decisions}
    sizes = np.array([found[d.name] for d in problem.decisions if d not in problem.unbalances])
    solution = solve_unbalances(with_sizes(problem, sizes))
    assert solution.objective.value == pytest.approx(solved.objective.value, rel=1e-6)
    # and no box around them alone has a bound beyond it
    model = SizeModel(problem)
    boxes = SizeBoxes(model, solve_cone_program)
    point = boxes.cut(sizes, sizes, np.inf)
    assert point.bound <= solved.objective.value * (1.0 + 1e-9)
    # less by what means lose that are averaged about their angles
    assert point.bound == pytest.approx(solved.objective.value, rel=1e-5)


def test_weights_and_sizes_together_are_never_worse(solved: Result, problem: Problem) -> None:
    sizes = laufruhe.solve(laufruhe.load(FEWER).changed(tolerance=TOLERANCE))
    weights = solve_unbalances(with_sizes(problem, np.array([entry.value for entry in sizes.decisions])))
    for less in (weights, sizes):
        assert solved.certificate.lower_bound <= less.objective.value
        assert solved.objective.value <= less.objective.value * (1.0 + TOLERANCE)
    assert solved.objective.value < 0.5 * sizes.objective.value


def test_boxes_bound_what_is_in_them_with_any_weights(problem: Problem) -> None:
    """Check random boxes, designs and dual rows: no allowed design is below a bound or excluded."""
    model = SizeModel(problem)
    boxes, rng, feasible = SizeBoxes(model, solve_cone_program), np.random.default_rng(1), 0
    domains = domains_of(problem.unbalances)
    measure = problem.objective[0].measure
    known: tuple = ()
    for _ in range(6):
        low, high = np.sort(model.lower + rng.random((2, 3)) * (model.upper - model.lower), axis=0)
        # dual rows of the previous box bound this one too
        bound, cut = boxes.objective(low, high, known), boxes.cut(low, high, np.inf)
        for _ in range(20):
            x = low + rng.random(3) * (high - low)
            wild = np.concatenate([d.scale * rng.uniform(-1.0, 1.0, d.width) for d in domains]) * rng.random()
            u = np.concatenate([domain.project(wild) for domain in domains])
            values = iter([domain.complex_value(u) for domain in domains])
            sizes = iter(x.tolist())
            design = [next(values) if d in problem.unbalances else next(sizes) for d in problem.decisions]
            evaluation = evaluate(problem, problem.design(design))
            assert model.value(measure, x, u) == pytest.approx(evaluation.value(measure), rel=1e-9)
            if evaluation.violation(problem.limits) <= 0.0:
                feasible += 1
                assert evaluation.value(measure) >= bound * (1.0 - 1e-9)
                assert cut is not None
                assert evaluation.value(measure) >= cut.bound * (1.0 - 1e-9)
                assert np.all(cut.lower <= x)
                assert np.all(x <= cut.upper)
        known = cut.multipliers if cut is not None else known
    assert feasible > 5


def test_stresses_that_no_sizes_and_weights_meet_are_named() -> None:
    text = changed(FIXED_ROD, 'max = "50 N/mm^2"', 'max = "0.5 N/mm^2"')
    # the result states what the limit can reach
    result = laufruhe.solve(laufruhe.load(text).changed(tolerance=1e-2))
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("maximum web stress",)


def test_masses_of_weights_are_limited_beside_sizes(solved: Result) -> None:
    limited = changed(
        FIXED_ROD, "[fidelity]", '[[constraints]]\nlimit = "added mass"\nof = ["w"]\nmax = "0.2 kg"\n[fidelity]'
    )
    result = laufruhe.solve(laufruhe.load(limited).changed(tolerance=30 * TOLERANCE))
    assert result.certificate.kind is Proof.GLOBAL
    assert result.limits[-1].value <= 0.2 * (1.0 + 1e-5)
    assert result.objective.value >= solved.certificate.lower_bound
    assert result.limits[-1].active


def test_bearings_beside_an_uneven_speed_are_refused_in_a_line() -> None:
    with pytest.raises(ModelError, match="constant crank speed") as refused:
        laufruhe.solve(changed(TOGETHER, "samples = 90", 'samples = 90\ncrank_inertia = "1 kg m^2"'))
    assert "\n" not in str(refused.value)


@pytest.mark.slow
def test_pistons_beside_sizes_are_searched() -> None:
    searched(laufruhe.load(changed(TOGETHER, '"0.5 kg"', '{ between = ["0.1 kg", "1 kg"], start = "0.5 kg" }')), 10.0)


STARS = """
title = "Four in line: star, sizes and a weight"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "90 mm"
bore = "80 mm"
rod_length = "150 mm"
reciprocating_mass = "0.6 kg"
cylinders = 4
cylinder_spacing = "120 mm"
throws = "open"
firing_order = "open"
[engine.big_end]
diameter = { between = ["35 mm", "70 mm"], start = "60 mm" }
width = "28 mm"
[[operating_points]]
speed = "4000 rpm"
[running_gear]
density = "7850 kg/m^3"
rod = { diameter = { between = ["10 mm", "30 mm"], start = "25 mm" } }
[[counterweights]]
name = "w"
opposite_throw = 1
unbalance = { between = ["0 kg m", "0.05 kg m"] }
[objective]
terms = [{ quantity = "mean rocking couple", weight = 5.0 }, { quantity = "mean shaking force" }]
[[constraints]]
limit = "maximum crank-pin pressure"
max = "7 N/mm^2"
[[constraints]]
limit = "maximum rod stress"
max = "60 N/mm^2"
[fidelity]
samples = 120
"""


def test_the_best_star_is_the_best_of_all_stars_each_with_its_sizes() -> None:
    """Compare with each star by itself, and with one weight less."""
    result = laufruhe.solve(laufruhe.load(STARS).changed(tolerance=TOLERANCE))
    assert result.certificate.kind is Proof.GLOBAL
    values = []
    for throws in ([0, 180, 180, 0], [0, 180, 0, 180], [0, 0, 180, 180]):
        text = changed(changed(STARS, 'throws = "open"', f"throws = {throws}"), "cylinders = 4\n", "")
        solution = laufruhe.solve(changed(text, 'firing_order = "open"\n', ""))
        assert solution.certificate.kind is Proof.GLOBAL
        values.append(solution.objective.value)
    assert result.objective.value == pytest.approx(min(values), rel=2e-4, abs=1e-6)
    assert max(values) > 1.1 * min(values) > 0.0
    assert "of 3 stars" in result.certificate.method


def test_a_weight_beside_the_length_of_the_rod_is_proven() -> None:
    text = (PROBLEMS / "single-rod-length.toml").read_text(encoding="utf-8")
    weight = '[[counterweights]]\nname = "w"\nopposite_throw = 1\nunbalance = { between = ["0 kg m", "0.025 kg m"] }\n'
    weighted = laufruhe.load(changed(text, "[objective]", f"{weight}[objective]")).changed(tolerance=TOLERANCE)
    result, without = laufruhe.solve(weighted), ready.solved("single-rod-length")
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value < 0.9 * without.objective.value
    problem = result.problem
    solution = solve_unbalances(with_sizes(problem, np.array([entry.value for entry in result.decisions[1:]])))
    assert solution.objective.value == pytest.approx(result.objective.value, rel=1e-6)


def test_a_stress_itself_may_be_minimised() -> None:
    text = changed(FEWER, "mean shaking force", "maximum crank-pin bending stress")
    result = laufruhe.solve(laufruhe.load(text).changed(tolerance=TOLERANCE))
    assert result.certificate.kind is Proof.GLOBAL
    pin = next(entry for entry in result.decisions if entry.name == "engine.big_end.diameter")
    assert pin.at_bound


def test_an_infeasible_limit_on_a_mean_is_named() -> None:
    """Check a limit on a mean that boxes at few angles do not exclude."""
    limit = '[[constraints]]\nname = "smooth"\nlimit = "mean shaking force"\nmax = "600 N"\n[fidelity]'
    text = changed(
        changed(FIXED_ROD, 'minimise = "mean shaking force"', 'minimise = "running-gear mass"'), "[fidelity]", limit
    )
    result = laufruhe.solve(laufruhe.load(changed(text, "samples = 90", "samples = 360")).changed(tolerance=1e-2))
    assert result.status is Status.INFEASIBLE
    assert "smooth" in result.conflict
