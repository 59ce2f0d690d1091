"""Balance under tolerances: the worst case, the share of engines, and prices."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from laufruhe.errors import ModelError
from laufruhe.extensions.robust.built_engines import BuiltEngines, WorstCaseAdversary, WorstEngines, objective_values
from laufruhe.extensions.robust.result import RobustResult
from laufruhe.extensions.robust.solver import MAX_MARGIN, RobustDesign, _keep_limits, _Program
from laufruhe.extensions.robust.tolerance import (
    Population,
    Robust,
    Tolerances,
    tolerances_of,
    with_errors,
    with_tolerances,
)
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.conclusion import FEASIBILITY_TOL, unbalance_values
from laufruhe.solvers.result import Result
from problem_files import FOUR, MOUNTS, PROBLEMS, changed, shaft

ENGINE = (
    changed(FOUR, "1.25 kg", "2 kg ± 2 %")
    + """[[operating_points]]
speed = "2500 rpm"
[objective]
minimise = "rms mount force"
[fidelity]
samples = 48
"""
)
OPEN = 'unbalance = { between = ["0 kg m", "0.05 kg m"], tolerance = "± 10 %" }\nradius = "20 mm"\n'
TEXT = (
    ENGINE
    + MOUNTS
    + shaft("left", 2, "60 mm", OPEN + "angle = 180")
    + shaft("right", -2, "-60 mm", OPEN + "angle = 180")
)
RESIDUAL = '[tolerances]\nresidual_unbalance = "60 g cm"\n'
ROBUST = "[robust]\n"


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Problem]:
    folder = tmp_path_factory.mktemp("robust")

    def of(text: str) -> Problem:
        path = Path(folder / "engine.toml")
        path.write_text(text, encoding="utf-8")
        return load(path)

    return of


@pytest.fixture(scope="module")
def problem(read: Callable[[str], Problem]) -> Problem:
    """Return a problem with tolerances of pistons, shafts and residual unbalance."""
    return read(TEXT + RESIDUAL + ROBUST)


@pytest.fixture(scope="module")
def result(problem: Problem) -> Result:
    return solve(problem)


def turned(sizes: Sequence[float]) -> list[complex]:
    """Return decisions of these sizes, with the unbalances of the shafts down."""
    return [complex(-size) for size in sizes]


def worst(found: Result) -> float:
    assert found.objective is not None
    return found.objective.value


def test_worst_case_is_proven(result: Result) -> None:
    assert result.certificate is not None
    assert isinstance(result.details, RobustResult)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.kkt_residual < 1e-2
    assert result.details.exact
    assert result.details.robust.worst == worst(result)
    assert result.details.robust.worst < result.details.nominal.worst
    # the best drawing is the nominal design
    assert result.details.nominal.drawing <= result.details.robust.drawing


def test_no_built_engine_exceeds_the_worst_case(problem: Problem, result: Result) -> None:
    """Check 10,064 built engines by rows, and some by the exact model, against the worst case."""
    values = turned([d.value for d in result.decisions])
    engines = BuiltEngines(problem, values, problem.fidelity.samples)
    errors = tolerances_of(problem).draw(np.random.default_rng(99), 10_000)
    corners = np.array([[*ends, 1.0, 0.0, 0.0, 1.0] for ends in itertools.product((-1.0, 1.0), repeat=6)])
    many = np.concatenate([errors, corners])
    actual = objective_values(engines.terms, many)
    assert actual.max() <= worst(result) * (1.0 + 1e-12)
    assert actual.max() > 0.97 * worst(result)
    for k in (*range(0, 10_000, 2_000), int(np.argmax(actual))):
        built_problem = with_errors(problem, many[k])
        assert objective_value(built_problem, evaluate(built_problem, built_problem.design(values))) == pytest.approx(
            actual[k], rel=1e-10
        )


def test_no_other_design_is_better(read: Callable[[str], Problem]) -> None:
    """Compare with a search by the exact model over every corner of the intervals."""
    problem = read(TEXT + ROBUST)
    result = solve(problem)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=6)))

    def largest(x: np.ndarray) -> float:
        built = BuiltEngines(problem, turned(x), problem.fidelity.samples)
        return float(objective_values(built.terms, corners).max())

    start = [d.value for d in result.decisions]
    assert largest(np.array(start)) == pytest.approx(worst(result), rel=1.1e-4)
    searched = minimize(largest, [0.9 * v for v in start], method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-4})
    assert searched.fun >= worst(result) * (1.0 - 1.1e-4)
    assert searched.fun == pytest.approx(worst(result), rel=1e-3)


def test_no_tolerance_is_the_drawing(read: Callable[[str], Problem], problem: Problem) -> None:
    none = with_tolerances(problem, scaled(tolerances_of(problem), 0.0))
    drawing = solve(problem.drawing)
    assert worst(solve(none)) == pytest.approx(worst(drawing), rel=1e-9)
    written = read(TEXT.replace("± 2 %", "± 0 %").replace("± 10 %", "± 0 %") + ROBUST)
    assert worst(solve(written)) == pytest.approx(worst(drawing), rel=1e-9)


def scaled(tolerances: Tolerances, factor: float) -> Tolerances:
    return replace(tolerances, tolerances=tuple(replace(t, scale=factor * t.scale) for t in tolerances.tolerances))


def test_more_tolerance_is_never_better(problem: Problem, result: Result) -> None:
    half = worst(solve(with_tolerances(problem, scaled(tolerances_of(problem), 0.5))))
    drawing = worst(solve(problem.drawing))
    assert drawing < half * (1.0 + 1e-4)
    assert half < worst(result) * (1.0 + 1e-4)


@pytest.mark.slow
def test_prices_are_slopes(problem: Problem, result: Result) -> None:
    """Compare prices of tolerances with optima for each a little wider and a little narrower."""
    assert isinstance(result.details, RobustResult)
    fine = replace(problem, tolerance=3e-6)
    for tolerance in result.details.tolerances[1:2]:
        wide, narrow = (
            worst(solve(with_tolerances(fine, tolerances_of(problem).scaled(tolerance.name, 1.0 + step))))
            for step in (0.02, -0.02)
        )
        assert tolerance.saving == pytest.approx((wide - narrow) / 0.04, rel=5e-3)
        assert tolerance.price * tolerance.size == pytest.approx(tolerance.saving)


def test_share_of_engines(problem: Problem, result: Result) -> None:
    shared = solve(replace(problem, extras=(Robust(tolerances_of(problem), Population(0.95, 400, 3)),)))
    assert shared.certificate is not None
    assert isinstance(shared.details, RobustResult)
    assert shared.certificate.kind in (Proof.LOCAL, Proof.GLOBAL)
    assert shared.certificate.lower_bound <= worst(shared) < worst(result)
    details = shared.details
    # another sample agrees with the one that decided
    assert details.robust.low <= details.robust.share <= details.robust.high
    assert details.robust.share == pytest.approx(worst(shared), rel=0.02)
    assert details.exceeding_at_most < 0.08
    # and no neighbour is better in the sample that decided
    errors = tolerances_of(problem).draw_mirrored(np.random.default_rng(3), 400)
    values = [d.value for d in shared.decisions]

    def level(x: list[float]) -> float:
        engines = BuiltEngines(problem, turned(x), problem.fidelity.samples)
        return float(np.sort(objective_values(engines.terms, errors))[379])

    assert level(values) == pytest.approx(worst(shared), rel=1e-9)
    # the initial design is judged by the same share of the same engines
    engines = BuiltEngines(problem, problem.start, problem.fidelity.samples)
    initial = np.sort(objective_values(engines.terms, errors))[379]
    assert shared.objective is not None
    assert shared.objective.initial == pytest.approx(initial, rel=1e-9)
    for k, step in itertools.product(range(2), (-2e-3, 2e-3)):
        moved = [v * (1.0 + step * (j == k)) for j, v in enumerate(values)]
        assert level(moved) >= worst(shared) * (1.0 - 3e-4)


def limited(read: Callable[[str], Problem], maximum: float) -> tuple[Problem, _Program]:
    """Return a problem with a limit of the shaking force, and the program of drawn engines."""
    limit = f'[[constraints]]\nlimit = "maximum shaking force"\nmax = "{maximum} N"\n'
    problem = read(TEXT + ROBUST + limit)
    program = _Program(problem)
    program.add([np.zeros(tolerances_of(problem).count)])
    return problem, program


def test_limits_that_are_lowered_too_far_show_no_conflict(read: Callable[[str], Problem]) -> None:
    """Check that a program without a design names no conflict if margins, not limits, exclude all designs."""
    _, program = limited(read, 1900.0)
    assert program.solved(program.angles) is not None
    program.lower(0.91)
    assert program.solved(program.angles) is None
    assert program.conflict == ()
    _, program = limited(read, 100.0)
    assert program.solved(program.angles) is None
    assert program.conflict == ("maximum shaking force",)


def test_a_design_keeps_limits_by_what_is_proven(read: Callable[[str], Problem]) -> None:
    """Check that a design is sought again with lowered limits if the proven worst engine breaks one."""
    problem, program = limited(read, 1000.0)
    angles = program.angles

    class Stricter(WorstCaseAdversary):
        """Adversary that proves a slightly larger violation than that of the drawn engine."""

        def at(self, values: Sequence[complex], proven: bool) -> WorstEngines:
            drawn = evaluate(problem, problem.design(values))
            return replace(super().at(values, proven), violation=drawn.violation(problem.limits) + 1e-3)

    adversary = Stricter(problem, 2 * problem.fidelity.samples, 0.5 * problem.tolerance)
    solved = program.solved(angles)
    assert solved is not None
    first = RobustDesign(
        solved[0], adversary.at(solved[0], proven=True), 0.0, program.active, 1, angles, adversary.samples
    )
    assert FEASIBILITY_TOL < first.worst.violation < MAX_MARGIN
    tightened = _keep_limits(program, adversary, first)
    assert tightened.worst.violation <= FEASIBILITY_TOL
    assert tightened.worst.value > first.worst.value


def test_limits_are_kept_by_every_engine(read: Callable[[str], Problem]) -> None:
    limit = '[[constraints]]\nlimit = "maximum shaking force"\nmax = "{}"\noperating_points = ["2500 rpm"]\n'
    tight = read((TEXT + ROBUST + limit.format("1900 N")).replace('operating_points = ["2500 rpm"]\n', ""))
    result = solve(tight)
    assert result.limits[0].value <= 1900.0 * (1.0 + 1e-5)
    wide, narrow = (
        worst(solve(replace(tight, limits=(replace(tight.limits[0], maximum=maximum),))))
        for maximum in (1930.0, 1870.0)
    )
    assert result.limits[0].shadow_price == pytest.approx((narrow - wide) / 60.0, rel=0.05, abs=1e-6)
    for z in itertools.product((-1.0, 1.0), repeat=6):
        built_problem = with_errors(tight, np.array(z))
        design = built_problem.design(turned([d.value for d in result.decisions]))
        assert evaluate(built_problem, design).value(tight.limits[0].measure) <= 1900.0 * (1.0 + 1e-5)
    none = solve(read((TEXT + ROBUST + limit.format("200 N")).replace('operating_points = ["2500 rpm"]\n', "")))
    assert "no design exists" in none.message


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (
            TEXT.replace(
                "firing_order = [1, 3, 4, 2]",
                'cylinders = 4\nthrows = "open"\n[phasing]\nintervals = { largest_deviation = "20 deg" }',
            ),
            "fire evenly",
        ),
        (
            TEXT.replace("cylinder_spacing = ", 'offset = { between = ["0 mm", "5 mm"] }\ncylinder_spacing = '),
            "engine.offset is open too",
        ),
        (TEXT.replace('["60 mm", "-100 mm"]', '[{ between = ["0 mm", "60 mm"] }, "-100 mm"]'), "left.y"),
    ],
)
def test_unsupported_robust_problems_are_refused(read: Callable[[str], Problem], text: str, word: str) -> None:
    with pytest.raises(ModelError, match=word):
        solve(read(text + ROBUST))


VEE = """
title = "Vee-two"
[engine]
layout = "vee"
bank_angle = 90
cycle = "four-stroke"
stroke = "80 mm"
rod_ratio = 0.27
reciprocating_mass = "0.5 kg ± 3 % normal"
cylinder_spacing = "100 mm"
cylinders = 2
throws = [45]
[[operating_points]]
speed = "3000 rpm"
"""
WEIGHT = """
[[counterweights]]
name = "w"
opposite_throw = 1
unbalance = { between = ["0 kg m", "0.1 kg m"], tolerance = "3 %" }
"""
TWO_POINTS = '[[operating_points]]\nspeed = "1500 rpm"\nweight = 2\n[[operating_points]]\nspeed = "2500 rpm"\n'
GAS = '[gas]\nmodel = "seiliger"\npeak_pressure = "80 bar"\nimep = "6 bar"\n'
ELASTIC = """
[block]
mass = "300 kg"
inertia = ["12 kg m^2", "25 kg m^2", "25 kg m^2"]
[mounts]
kind = "elastic"
stiffness = ["400 N/mm", "300 N/mm", "500 N/mm"]
loss_factor = 0.1
"""


def minimise(quantity: str, samples: int = 48) -> str:
    return f'[objective]\nminimise = "{quantity}"\n[fidelity]\nsamples = {samples}\n'


@pytest.mark.parametrize(
    "text",
    [
        VEE + WEIGHT + minimise("rms shaking force"),
        VEE + WEIGHT + minimise("maximum shaking force"),
        TEXT.replace(MOUNTS, ELASTIC + MOUNTS.replace("[mounts]", "")),
        TEXT.replace('[[operating_points]]\nspeed = "2500 rpm"\n', TWO_POINTS),
        TEXT.replace('stroke = "120 mm"', 'stroke = "120 mm"\nbore = "100 mm"').replace("= 48", "= 240") + GAS,
    ],
    ids=["vee", "vee, a peak", "elastic mounts", "two points", "gas"],
)
def test_crossed(read: Callable[[str], Problem], text: str) -> None:
    """Check that none of a few hundred drawn engines exceeds the proven value."""
    problem = read(text + ROBUST)
    result = solve(replace(problem, tolerance=1e-3))
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    values = unbalance_values(problem, result)
    for z in tolerances_of(problem).draw(np.random.default_rng(4), 200):
        built_problem = with_errors(problem, z)
        value = objective_value(
            built_problem, evaluate(built_problem, built_problem.design(values), result.final.samples)
        )
        assert value <= worst(result) * (1.0 + 1e-9)


def test_nonlinear_tolerances_are_drawn_at_random(read: Callable[[str], Problem]) -> None:
    """Check that tolerances of rod ratio and spacing give the worst of the drawn engines, and say so."""
    text = TEXT.replace("rod_ratio = 0.26", 'rod_ratio = "0.26 ± 5 %"').replace('"125 mm"', '"125 mm ± 1 mm"')
    problem = read(text + ROBUST + "engines = 30\n")
    result = solve(problem)
    assert result.objective is not None
    assert isinstance(result.details, RobustResult)
    assert result.certificate is not None
    assert "worst of 30 drawn engines" in result.objective.name
    assert "not of all" in result.certificate.method
    assert not result.details.exact
    values = unbalance_values(problem, result)
    engines = (with_errors(problem, z) for z in tolerances_of(problem).draw(np.random.default_rng(1), 30))
    maximum = max(objective_value(own, evaluate(own, own.design(values), result.final.samples)) for own in engines)
    assert maximum == pytest.approx(worst(result), rel=1e-9)


@pytest.mark.slow
def test_ready_problem() -> None:
    """Check a proof within a thousandth."""
    problem = load(PROBLEMS / "tractor-four-robust.toml")
    result = solve(replace(problem, tolerance=1e-3, fidelity=replace(problem.fidelity, samples=72)))
    assert worst(result) == pytest.approx(462.02, rel=1e-3)
    assert isinstance(result.details, RobustResult)
    assert result.details.nominal.worst == pytest.approx(469.99, rel=1e-3)
    assert result.details.exceeding == 0
