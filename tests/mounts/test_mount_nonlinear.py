"""Mounts and unbalances decided together: the program against the exact model, and its optima."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import check_grad

from cli.scenes import SECOND_ORDER_SHAFTS
from lanes import first_fast
from laufruhe.files.reader import load
from laufruhe.numerics.budget import limit_time
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from laufruhe.solvers.conclusion import evaluate_design
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.mounts.nonlinear import (
    _method,
    _rebalanced,
    bound_search,
    mounts_bound,
    solve_joint,
    solve_mounts,
)
from laufruhe.solvers.mounts.search import MountSearch, SearchResult
from laufruhe.solvers.mounts.starts import start_points
from laufruhe.solvers.result import Status
from laufruhe.solvers.smooth.local_optimum import Ending, LocalOptimum
from laufruhe.solvers.smooth.program import SmoothProgram
from mounts.files import BLOCK, ENGINE, MOUNTS, SAG, problem_of
from problem_files import PROBLEMS

SHAFTS = SECOND_ORDER_SHAFTS.replace("60 mm", "100 mm")
FORCE = '[objective]\nminimise = "{measure} mount force"\n'
LIMITS = """
[[constraints]]
limit = "natural frequencies"
outside = ["16 Hz", "30 Hz"]
[[constraints]]
limit = "transmissibility"
orders = [2]
max = "0.6"
[[constraints]]
limit = "static sag"
max = "3 mm"
[[constraints]]
limit = "kinetic-energy decoupling"
motions = ["bounce"]
min = "0.7"
[[constraints]]
limit = "balancer mass"
max = "0.5 kg"
[[constraints]]
limit = "maximum mount travel"
max = "4 mm"
"""
TURNED = MOUNTS.replace(
    '"0 mm"]\nstiffness', '"0 mm"]\nturned = [{ between = [0, 50], start = 10 }, 0, 0]\nstiffness', 1
)
SEARCH = "[search]\nstarts = 2\n"


def joint_problem(tmp_path, measure: str = "mean", limits: str = LIMITS, search: str = SEARCH + "boxes = 0\n"):
    return problem_of(tmp_path, ENGINE, BLOCK, TURNED, SHAFTS, FORCE.format(measure=measure), limits, search)


def at(joint: SmoothProgram, point, softness: float = 1e-9):
    program = joint.program
    function = ca.Function("f", [program.x, program.parameters], [program.objective, program.constraints])
    value, constraints = function(point, softness)
    return float(value), np.asarray(constraints, dtype=float).ravel()


@pytest.mark.parametrize("measure", ["mean", "maximum", "rms"])
def test_the_program_says_what_the_exact_model_says(measure, tmp_path):
    plain = joint_problem(tmp_path, measure)
    # weights of points are relative
    slow = replace(plain.points[0], name="slow", speed=0.8 * plain.points[0].speed, weight=3.0)
    problem = replace(plain, points=(*plain.points, slow))
    joint = SmoothProgram(problem, objective_value(problem, evaluate(problem)))
    generator = np.random.default_rng(2)
    for _ in range(3):
        mounts = [generator.uniform(d.lower, d.upper) for d in problem.mount_decisions]
        columns = generator.uniform(-0.01, 0.01, joint.columns)
        start = joint.start(mounts, columns)
        given, unbalances = joint.decision_values(start)
        assert given == pytest.approx(mounts)
        exact = evaluate(problem, problem.design([*unbalances, *given]))
        value, constraints = at(joint, start)
        names = np.array(joint.program.constraint_names)
        if problem.objective[0].measure.norm is NORMS["maximum"]:
            # the variable starts five percent over the largest sample
            value /= 1.05
        assert value == pytest.approx(objective_value(problem, exact), rel=5e-3)
        _, ratio, sag, _ = (limit.measure for limit in problem.mount_limits)
        assert constraints[names == "static sag"][0] * 3e-3 == pytest.approx(exact.value(sag), rel=1e-9)
        found = constraints[names == "transmissibility of order 2"]
        assert found.max() == pytest.approx(exact.value(ratio), rel=1e-9)
        assert np.abs(constraints[names == "modes"]).max() < 1e-9
        shares = mounting_in(exact.engine).modes.energy[2]
        assert constraints[names == "kinetic-energy decoupling of bounce"][0] == pytest.approx(shares.max(), rel=1e-9)
        mass = exact.value(problem.load_limits[0].measure)
        assert constraints[names == "balancer mass"][0] * 0.5 == pytest.approx(mass, rel=1e-6)


def test_unbalances_have_no_more_room_than_their_sets(tmp_path):
    """Check that the program's rows hold a disc, a sector and a given direction."""
    shaft = """
[[balancer_shafts]]
name = "s{k}"
ratio = 2
position = ["100 mm", "-100 mm"]
[[balancer_shafts.unbalances]]
radius = "20 mm"
unbalance = {{ between = ["0 kg m", "0.0{k} kg m"] }}
angle = {angle}
"""
    angles = "{ between = [0, 360] }", "{ between = [-20, 70] }", "30"
    shafts = [shaft.format(k=k + 1, angle=angle) for k, angle in enumerate(angles)]
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, *shafts, FORCE.format(measure="rms"))
    joint = SmoothProgram(problem, 1.0)
    program, names = joint.program, np.array(joint.program.constraint_names)
    held = {d.name: names == d.name for d in problem.unbalances}
    assert [int(rows.sum()) for rows in held.values()] == [1, 3, 0]
    generator, inside = np.random.default_rng(3), []
    mounts = [d.start for d in problem.mount_decisions]
    constraints = ca.Function("g", [program.x, program.parameters], [program.constraints])
    for _ in range(60):
        size, angle = generator.uniform(0.0, 1.5, 2) * (0.01, 0.02), generator.uniform(-180.0, 180.0, 2)
        u = size * np.exp(1j * np.radians(angle))
        start = joint.start(mounts, np.array([u[0].real, u[0].imag, u[1].real, u[1].imag, 0.0]))
        rows = np.asarray(constraints(start, 1e-3), dtype=float).ravel()
        satisfied = (program.constraint_lower <= rows) & (rows <= program.constraint_upper)
        disc, sector = (bool(satisfied[each].all()) for each in list(held.values())[:2])
        assert disc == (size[0] <= 0.01)
        assert sector == (size[1] <= 0.02 and -20.0 <= angle[1] <= 70.0)
        inside.append((disc, sector))
    assert {pair[1] for pair in inside} == {pair[0] for pair in inside} == {True, False}
    # the size along a given direction is a variable between its own bounds
    first = len(mounts) + 4
    assert (program.lower[first], program.upper[first]) == pytest.approx((0.0, 0.03), abs=1e-15)


def test_derivatives_agree_with_finite_differences(tmp_path):
    joint = SmoothProgram(joint_problem(tmp_path), 50.0)
    program = joint.program
    weights = np.random.default_rng(0).normal(size=len(program.constraint_names))
    scale = program.variable_scales
    y = ca.MX.sym("y", program.x.numel())
    both = program.objective / program.objective_scale + ca.dot(ca.DM(weights), program.constraints)
    shifted = ca.substitute(both, program.x, y * ca.DM(scale))
    value = ca.Function("v", [y, program.parameters], [shifted])
    slope = ca.Function("g", [y, program.parameters], [ca.gradient(shifted, y)])
    curve = ca.Function("h", [y, program.parameters], [ca.hessian(shifted, y)[0]])
    mounts = [d.start for d in joint.problem.mount_decisions]
    point = joint.start(mounts, np.array([0.004, -0.002, 0.003, 0.001])) / scale

    def gradient(v):
        return np.asarray(slope(v, 1e-3)).ravel()

    error = check_grad(lambda v: float(value(v, 1e-3)), gradient, point, epsilon=1e-7)
    assert error <= 1e-5 * np.linalg.norm(gradient(point))
    direction, step = np.random.default_rng(1).normal(size=len(point)), 1e-6
    change = (gradient(point + step * direction) - gradient(point - step * direction)) / (2 * step)
    assert np.asarray(curve(point, 1e-3)) @ direction == pytest.approx(
        change, rel=1e-4, abs=1e-4 * np.abs(change).max()
    )


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    problem = joint_problem(tmp_path_factory.mktemp("joint"))
    return problem, solve(problem)


class ScriptedSearch:
    """Search that finds the designs that boxes name, and nothing else."""

    moves = None

    def __init__(self, problem, stiffness):
        self.problem = problem
        self.best = self.best_or_initial = SearchResult(evaluate_design(problem, stiffness), None)

    def search_from(self, places):
        result = SearchResult(evaluate_design(self.problem, places[0][0]), None)
        is_better = result.rank < self.best.rank
        if is_better:
            self.best = self.best_or_initial = result
        return is_better


@pytest.mark.parametrize(
    ("stiffness", "count"), [([1e5, 1e5], 2), ([2e5 * (1.0 - 1e-8)] * 2, 1), ([3e5, 3e5], 1)],
    ids=["better", "as good", "worse"],
)  # fmt: skip
def test_boxes_bound_the_best_design_of_the_search(stiffness, count, tmp_path, monkeypatch):
    """Check that boxes that lead to a better design are divided again for its value."""
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, FORCE.format(measure="rms"), "[fidelity]\nsamples = 72\n")
    values = []

    def by_provers(question):
        value = question.value
        values.append(value)
        assert question.witness.place == pytest.approx([number.real for number in question.good_values])
        return BoxResult(0.9 * value, 3, (np.array(stiffness),) if len(values) == 1 else ())

    monkeypatch.setattr("laufruhe.solvers.mounts.nonlinear.run_provers", by_provers)
    search = ScriptedSearch(problem, [2e5, 2e5])
    given = search.best.design.value
    result = bound_search(problem, search, False)
    assert values[0] == pytest.approx(given, rel=1e-6)
    assert len(values) == count
    assert values[-1] == pytest.approx(search.best.design.value, rel=1e-6)
    assert (result.bound, result.boxes) == (0.9 * values[-1], 3)


def test_convex_terms_of_a_sum_are_bounded_by_their_optimum(tmp_path):
    """Check that the bound of a sum has the least sag, while the force alone has no such bound."""
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, FORCE.format(measure="rms"), "[fidelity]\nsamples = 72\n")
    sag = Term(Measure(channels.SAG), 200.0)
    stiffest = problem.design([d.upper for d in problem.decisions])
    minimum = 200.0 * evaluate(problem, stiffest).value(sag.measure)
    bound = mounts_bound(replace(problem, objective=(*problem.objective, sag)))
    assert minimum * (1.0 - 1e-4) <= bound <= minimum * (1.0 + 1e-12)
    assert mounts_bound(problem) == 0.0


@pytest.mark.slow
def test_joint_design_keeps_its_limits_and_beats_each_part_alone(solved):
    problem, result = solved
    assert result.status is Status.FEASIBLE
    assert result.certificate.kind is Proof.LOCAL
    assert result.certificate.kkt_residual < 1e-7
    assert result.certificate.lower_bound <= result.objective.value
    assert all(result.final.check_limit(limit).violation <= 1e-5 for limit in problem.mount_limits)
    assert result.final.value(problem.load_limits[0].measure) <= 0.5 * (1 + 1e-5)
    balance = solve_unbalances(problem.balance)
    assert result.objective.value < balance.objective.value < result.objective.initial


@pytest.mark.slow
def test_no_neighbour_within_the_limits_is_better(solved):
    problem, result = solved
    values = {d.name: d.value for d in result.decisions}
    mounts = [values[d.name] for d in problem.mount_decisions]
    sizes = [values[d.name] * np.exp(1j * values[d.name.rsplit(".", 1)[0] + ".angle"]) for d in problem.unbalances]
    generator, better, allowed = np.random.default_rng(0), 0, 0
    for _ in range(300):
        size = 10.0 ** generator.uniform(-4, -1.5)
        moved = [
            float(np.clip(v + size * generator.normal() * (d.upper - d.lower), d.lower, d.upper))
            for v, d in zip(mounts, problem.mount_decisions, strict=True)
        ]
        shaken = [u + size * 0.05 * complex(*generator.normal(size=2)) for u in sizes]
        near = evaluate(problem, problem.design([*shaken, *moved]))
        feasible = all(near.check_limit(limit).violation <= 1e-9 for limit in problem.mount_limits)
        feasible = feasible and all(near.value(limit.measure) <= limit.maximum for limit in problem.load_limits)
        allowed += feasible
        better += feasible and objective_value(problem, near) < result.objective.value * (1 - 1e-5)
    assert allowed > 10
    assert better == 0


def test_unbalances_on_fixed_elastic_mounts_are_proven_globally(tmp_path):
    fixed = MOUNTS.replace('{ between = ["20 N/mm", "4000 N/mm"], start = "400 N/mm" }', '"300 N/mm"')
    problem = problem_of(tmp_path, ENGINE, BLOCK, fixed, SHAFTS, FORCE.format(measure="mean"))
    assert not problem.uses_mounts
    result = solve(problem)
    assert result.status is Status.OPTIMAL
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value < 0.2 * result.objective.initial


@pytest.mark.slow
def test_the_search_with_fixed_mounts_ends_at_the_proven_balance(tmp_path):
    """The nonlinear route, given a limit that never binds, must reproduce the cone program's optimum."""
    fixed = MOUNTS.replace('{ between = ["20 N/mm", "4000 N/mm"], start = "400 N/mm" }', '"300 N/mm"')
    parts = (ENGINE, BLOCK, fixed, SHAFTS, FORCE.format(measure="mean"))
    proven = solve(problem_of(tmp_path, *parts))
    loose = '[[constraints]]\nlimit = "transmissibility"\nmax = "50"\n'
    searched = solve_joint(problem_of(tmp_path, *parts, loose, SEARCH + "boxes = 0\n"))
    assert searched.objective.value == pytest.approx(proven.objective.value, rel=2e-3)
    assert searched.objective.value >= proven.certificate.lower_bound * (1 - 1e-9)


@pytest.mark.slow
def test_a_convex_problem_searched_all_the_same_is_recognised_as_global(tmp_path):
    band = SAG + '[[constraints]]\nlimit = "natural frequencies"\noutside = ["14 Hz", "30 Hz"]\nname = "band"\n'
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, band, SEARCH)
    result = solve_mounts(problem)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value == pytest.approx(1.3973e-3, rel=1e-4)


@pytest.mark.slow
def test_limits_out_of_reach_are_not_met_and_said_so(tmp_path):
    hopeless = '[[constraints]]\nlimit = "static sag"\nmax = "2 mm"\n'
    hopeless += '[[constraints]]\nlimit = "natural frequencies"\nmax = "9 Hz"\n'
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, FORCE.format(measure="mean"), hopeless, SEARCH)
    result = solve_mounts(problem)
    assert result.status is Status.INFEASIBLE
    assert set(result.conflict) == {"static sag", "natural frequencies"}
    moved = problem_of(tmp_path, ENGINE, BLOCK, TURNED, FORCE.format(measure="mean"), hopeless, SEARCH)
    actual = solve_mounts(moved)
    # not stiffness alone: nothing is proven, and nothing proven is claimed
    assert actual.status is Status.FAILED
    assert "no design was found" in actual.message


@pytest.mark.slow
def test_a_natural_frequency_is_kept_out_of_a_band(tmp_path):
    objective = (
        FORCE.format(measure="rms") + '[[constraints]]\nlimit = "natural frequencies"\noutside = ["8 Hz", "12 Hz"]\n'
    )
    result = solve_mounts(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, objective, SEARCH))
    frequencies = mounting_in(result.final.engine).modes.frequencies
    # two open stiffnesses: the bounds are divided until nothing better is left
    assert result.status is Status.OPTIMAL
    assert not np.any((frequencies > 8.0 * (1 + 1e-6)) & (frequencies < 12.0 * (1 - 1e-6)))
    given = mounting_in(result.initial.engine).modes.frequencies
    assert np.any((given > 8.0) & (given < 12.0))


@pytest.mark.slow
@pytest.mark.parametrize("start", ["400 N/mm", "1e-2 N/mm"])
def test_bounds_a_thousand_million_apart_are_searched_by_ratio(start, tmp_path):
    """The least stiffness isolates best; no start may be pushed to the middle of bounds and end above itself."""
    wide = MOUNTS.replace('"20 N/mm", "4000 N/mm"], start = "400 N/mm"', f'"1e-3 N/mm", "1e6 N/mm"], start = "{start}"')
    result = solve(problem_of(tmp_path, ENGINE, BLOCK, wide, FORCE.format(measure="rms"), SEARCH + "boxes = 4\n"))
    assert result.objective.value <= result.objective.initial
    # below this only the horizontal stiffness, which is not open, is left
    assert result.objective.value == pytest.approx(0.91240, rel=1e-3)
    assert result.certificate.lower_bound <= result.objective.value


@pytest.mark.validation
@pytest.mark.parametrize("seed", first_fast(range(10), 0, 1))
def test_ten_seeds_find_the_best_known_optimum_of_the_tractor(seed):
    problem = load(PROBLEMS / "tractor-four-elastic.toml")
    problem = replace(problem, search=replace(problem.search, starts=2, seed=seed, boxes=0))
    assert solve_joint(problem).objective.value == pytest.approx(4.0870, rel=1e-3)


@pytest.mark.validation
@pytest.mark.parametrize("seed", first_fast(range(4), 0, 1))
def test_few_starts_find_the_best_known_optimum_of_the_powertrain(seed):
    """Its six modes stand on either side of a band in many ways: of ten pairs of starts six find the best."""
    problem = load(PROBLEMS / "powertrain-least-force.toml")
    problem = replace(problem, search=replace(problem.search, starts=6, seed=seed, boxes=0))
    assert solve_joint(problem).objective.value == pytest.approx(13.106325, rel=1e-5)


def test_an_active_limit_on_a_load_has_a_price(tmp_path):
    def solved_under(maximum: float):
        limits = f'[[constraints]]\nlimit = "rms mount force"\nmax = "{maximum} N"\n'
        return solve(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SAG.split("[[")[0], limits, SEARCH))

    loose, wide = solved_under(3.0), solved_under(1e6)
    assert loose.limits[0].active
    assert loose.limits[0].value == pytest.approx(3.0, rel=1e-5)
    assert loose.limits[0].shadow_price > 0.0
    assert wide.objective.value < 0.9 * loose.objective.value
    assert wide.limits[0].shadow_price == 0.0


@pytest.mark.parametrize("starts", [1, 3])
def test_a_search_has_the_chosen_number_of_starts(starts, tmp_path):
    """Check that the initial design is first, the others within bounds, and that no time returns it."""
    objective = '[objective]\nminimise = "static sag"\n'
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, objective, f"[search]\nstarts = {starts}\n")
    points, size = start_points(problem)
    given = [d.start for d in problem.mount_decisions]
    assert len(points) == starts
    assert points[0][0] == given
    drawn = np.array([mounts for mounts, _ in points])
    assert len(np.unique(drawn, axis=0)) == starts
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    assert np.all((low <= drawn) & (drawn <= high))
    values = [objective_value(problem, evaluate(problem, problem.design(mounts))) for mounts, _ in points]
    assert 0.0 < size <= min(values) * (1.0 + 1e-9)
    search = MountSearch(problem, evaluate(problem))
    with limit_time(0.0):
        search.run()
    assert list(search.best.design.values) == given
    assert search.best.design.value == pytest.approx(values[0], rel=1e-12)


@pytest.mark.parametrize(
    ("ends", "chosen"), [([(2.0, 0.0), (1.0, 1e-8)], 1), ([(2.0, 0.3), (1.0, 0.5)], 0)], ids=["ends", "none"]
)
def test_a_search_is_refined_from_its_best_end(ends, chosen, tmp_path, monkeypatch):
    """Refine the end that misses the limits least if no start ended within them."""
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SAG.split("[[")[0], SEARCH)
    search, begun = MountSearch(problem, evaluate(problem)), []
    places = np.array([[2e5, 3e5], [4e5, 5e5]])
    search.optima = tuple(
        LocalOptimum(search.joint.start(place, np.zeros(0)), value, none, none, 0.0, over, 1, 0.0, Ending.CONVERGED, 0)
        for place, (value, over) in zip(places, ends, strict=True)
        for none in [np.zeros(0)]
    )

    def ended(starts):
        begun.extend(starts)
        return ()

    monkeypatch.setattr(search, "_solve", ended)
    search.refine()
    assert [search.joint.decision_values(start)[0] for start in begun] == [pytest.approx(places[chosen])]


def test_constant_terms_are_numbers_of_the_program(tmp_path):
    """Check that the roll moment of the block with open mounts adds no rows to the program."""
    problem = joint_problem(tmp_path, "rms", '[[constraints]]\nlimit = "static sag"\nmax = "3 mm"\n')
    alone = replace(problem, decisions=problem.mount_decisions)
    roll = Term(Measure(channels.ROLL_MOMENT, NORMS["peak to peak"]), 2.0)
    plain, mixed = (SmoothProgram(replace(alone, objective=terms), 1.0) for terms in
                    (alone.objective, (*alone.objective, roll)))  # fmt: skip
    assert mixed.program.x.numel() == plain.program.x.numel()
    start = plain.start([d.start for d in alone.decisions], np.zeros(0))
    own = 2.0 * evaluate(alone).value(roll.measure)
    assert own > 0.0
    assert at(mixed, start)[0] == pytest.approx(at(plain, start)[0] + own, rel=1e-9)


def test_unbalances_become_the_best_for_the_mounts_of_a_design(tmp_path):
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, SHAFTS, FORCE.format(measure="rms"))
    poor = evaluate_design(problem, problem.start)
    found, gap = _rebalanced(SearchResult(poor, MountSearch(problem, evaluate(problem)).joint))
    held = replace(problem, engine=problem.design([d.start for d in problem.mount_decisions], problem.mount_decisions))
    best = solve_unbalances(replace(held, decisions=problem.unbalances)).objective.value
    assert gap <= problem.tolerance
    assert found.design.value == pytest.approx(best, rel=1e-6)
    assert found.design.value < 0.9 * poor.value


@pytest.mark.parametrize("unit", [1e-6, 1.0])
def test_the_spread_of_optima_is_reported_in_every_unit(unit):
    none = np.zeros(0)
    ends = [
        LocalOptimum(np.array([value]), unit * value, none, none, 0.0, 0.0, 1, 0.0, Ending.CONVERGED, k)
        for k, value in enumerate((1.0, 4.0))
    ]
    assert "up to 4 times the best" in _method(ends, unit, None, BoxResult(0.0, 0))
