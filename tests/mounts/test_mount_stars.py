"""Stars and throws decided together with elastic mounts: against every star by its own solve (E35, E36)."""

from __future__ import annotations

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.solvers import solve
from laufruhe.solvers.conclusion import evaluate_only
from laufruhe.solvers.mounts.stars import _method, _stars, _with_bounds
from laufruhe.solvers.result import Status
from laufruhe.solvers.smooth.program import SmoothProgram
from laufruhe.solvers.stars.star_results import StarDesign
from mounts.files import BLOCK, MOUNTS, OPEN, SAG, changed, problem_of

ENGINE = """
title = "four"
[engine]
layout = "inline"
cycle = "four-stroke"
cylinders = 4
stroke = "90 mm"
rod_ratio = 0.28
reciprocating_mass = "0.6 kg"
rotating_mass = "0.4 kg"
cylinder_spacing = "90 mm"
throws = "open"
[[operating_points]]
speed = "1500 rpm"
[[counterweights]]
name = "web"
balance_factor = { between = [0, 1] }
"""
HEAVY_END = ('["0 mm", "0 mm", "120 mm"]', '["60 mm", "0 mm", "120 mm"]')
FORCE = '[objective]\nminimise = "mean mount force"\n[[constraints]]\nlimit = "static sag"\nmax = "4 mm"\n'
SEARCH = "[search]\nstarts = 1\nboxes = 1\n"
# where no bound is looked at
UNBOUNDED = changed(SEARCH, ("boxes = 1", "boxes = 0"))
UNEVEN = '[phasing]\nintervals = { largest_deviation = "8 deg" }\nbest = 2\n'
STARS = ([0, 180, 180, 0], [0, 180, 0, 180], [0, 0, 180, 180])


def parts(throws: str = '"open"', objective: str = FORCE, search: str = SEARCH) -> tuple[str, ...]:
    return changed(ENGINE, ('"open"', throws)), changed(BLOCK, HEAVY_END), MOUNTS, objective, search


@pytest.fixture(scope="module")
def decided(tmp_path_factory):
    return solve(problem_of(tmp_path_factory.mktemp("open"), *parts()))


@pytest.mark.slow
def test_the_best_star_is_the_best_of_all_solved_one_by_one(decided, tmp_path):
    one_by_one = {}
    for star in STARS:
        result = solve(problem_of(tmp_path, *parts(str(star), search=UNBOUNDED)))
        one_by_one[tuple(star)] = result.objective.value
    ranked = {tuple(round(math.degrees(a)) for a in entry.throws): entry.value for entry in decided.phasing.ranking}
    assert set(ranked) == set(one_by_one)
    for star, value in one_by_one.items():
        assert ranked[star] == pytest.approx(value, rel=1e-4)
    assert decided.objective.value == pytest.approx(min(one_by_one.values()), rel=1e-4)
    assert decided.phasing.ranking[0].value == min(entry.value for entry in decided.phasing.ranking)


@pytest.mark.slow
def test_a_search_of_all_stars_is_bounded_by_the_least_of_their_bounds(decided):
    certificate = decided.certificate
    assert certificate.kind is not Proof.NONE
    assert 0.0 <= certificate.lower_bound <= decided.objective.value
    assert "each of 3 stars" in certificate.method
    assert certificate.lower_bound == min(entry.lower_bound for entry in decided.phasing.ranking)
    assert [d.name for d in decided.decisions][:4] == [f"throw {k}" for k in (1, 2, 3, 4)]


@pytest.mark.slow
def test_stars_left_out_leave_no_bound(tmp_path):
    result = solve(problem_of(tmp_path, *parts(), "[phasing]\nbest = 1\n"))
    assert result.certificate.lower_bound == 0.0
    assert "the best of 3 on the initial mounts" in result.certificate.method


@pytest.mark.parametrize("best", [1, 2, 50])
def test_stars_are_counted_and_the_best_are_ranked(best, tmp_path):
    """Check the three stars of four throws at 0 and 180 degrees, and that the best ones come first."""
    problem = problem_of(tmp_path, *parts(), f"[phasing]\nbest = {best}\n")
    ranked, designs = _stars(problem, problem.phasing)
    assert designs == math.comb(3, 1) == len(STARS)
    throws = [tuple(round(math.degrees(angle)) for angle in star.throws) for star, _ in ranked]
    assert len(throws) == len(set(throws)) == min(best, designs)
    assert set(throws) <= {tuple(star) for star in STARS}
    # on the initial mounts the star of the four-cylinder engine leaves no couple
    assert throws[0] == (0, 180, 180, 0)


def test_the_method_counts_stars_by_how_they_were_decided(tmp_path):
    """Check counts of stars that stay, of omitted ones, and of starts whose throws moved."""
    still = StarDesign(Candidate((0.0, math.pi)), evaluate_only(problem_of(tmp_path, *parts(str(STARS[0])))))
    moved = replace(still, has_moved_throws=True)
    each = "mounts and balance optimised for each of"
    assert _method([still], 1) == f"{each} 1 star"
    assert _method([still] * 2, 7) == f"{each} 2 stars, the best of 7 on the initial mounts"
    assert _method([still, moved, still, moved, moved], 2) == f"{each} 2 stars; throws moved from 3 starts"
    assert _method([moved], 1) == "mounts, balance and throws optimised; throws moved from 1 start"


def test_every_star_keeps_its_own_design_when_it_is_bounded(tmp_path, monkeypatch):
    """Check that the first star is bounded fully, the others up to it, and none if one was omitted."""
    calls = []

    def bounded(result, value, cutoff=math.inf, in_batch=False):
        calls.append((value, cutoff, in_batch))
        bound = 0.9 * result.objective.value
        return replace(result, certificate=Certificate(Proof.GLOBAL, bound, 0.1, 0.0, "a bound"))

    monkeypatch.setattr("laufruhe.solvers.mounts.stars.with_mount_bounds", bounded)
    phasing = problem_of(tmp_path, *parts()).phasing
    found = [
        StarDesign(Candidate(tuple(map(math.radians, star))), evaluate_only(problem_of(tmp_path, *parts(str(star)))))
        for star in STARS
    ]
    found.sort(key=lambda star: star.value)
    out = _with_bounds(found, phasing, len(found))
    assert [star.candidate for star in out] == [star.candidate for star in found]
    assert [star.bound for star in out] == pytest.approx([0.9 * star.value for star in found])
    minimum = found[0].value
    assert calls == [(minimum, math.inf, True), *[(minimum, 0.9 * minimum, True)] * 2]
    assert _with_bounds(found, phasing, len(found) + 1) is found


@pytest.mark.slow
def test_the_proof_of_mounts_holds_for_all_stars(tmp_path):
    """Sag and natural frequencies know no throws: every star has the same proven optimum."""
    engine = changed(ENGINE, ('"open"', '"open"'), ('[[counterweights]]\nname = "web"\n', ""),
                     ("balance_factor = { between = [0, 1] }\n", ""))  # fmt: skip
    result = solve(problem_of(tmp_path, engine, BLOCK, MOUNTS, SAG))
    assert result.status is Status.OPTIMAL
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value == pytest.approx(1.3973e-3, rel=1e-4)
    assert len(result.phasing.ranking) == 3


@pytest.mark.slow
def test_limits_that_contradict_on_every_star_are_named(tmp_path):
    hopeless = changed(FORCE, ("4 mm", "2 mm")) + '[[constraints]]\nlimit = "natural frequencies"\nmax = "9 Hz"\n'
    result = solve(problem_of(tmp_path, *parts(objective=hopeless)))
    assert result.status is Status.INFEASIBLE
    assert set(result.conflict) == {"static sag", "natural frequencies"}


@pytest.mark.slow
def test_throws_that_fire_unevenly_get_the_firing_order_that_gas_likes_best(tmp_path):
    """Compare the decided firing order with each order solved by itself on its own mounts."""
    gas = '[gas]\nmodel = "seiliger"\npeak_pressure = "60 bar"\nimep = "8 bar"\n'
    wide = '[phasing]\nintervals = { min = "20 deg", max = "700 deg" }\n'
    engine = changed(ENGINE, ("[[operating_points]]", 'bore = "80 mm"\nfiring_order = "open"\n[[operating_points]]'),
                     ('"open"', "[0, 100, 190, 300]"), ("cylinders = 4\n", ""))  # fmt: skip
    engine = engine.partition("[[counterweights]]")[0]

    def solved_in_order(order, search=UNBOUNDED):
        text = changed(engine, ('firing_order = "open"', f"firing_order = {order}"))
        force = '[objective]\nminimise = "rms mount force"\norders = [0.5, 1.5]\n'
        return solve(problem_of(tmp_path, text, BLOCK, MOUNTS, gas, force, search, wide))

    best = solved_in_order('"open"', SEARCH)
    values = {}
    for order in ([1, 4, 2, 3], [1, 3, 2, 4], [1, 3, 4, 2], [1, 2, 4, 3], [1, 4, 3, 2]):
        values[tuple(order)] = solved_in_order(order).objective.value
    assert max(values.values()) > 1.02 * min(values.values())
    assert best.objective.value == pytest.approx(min(values.values()), rel=1e-4)
    assert best.certificate.lower_bound <= min(values.values())
    assert values[best.phasing.ranking[0].firing_orders[0].order] == min(values.values())


@pytest.fixture(scope="module")
def uneven(tmp_path_factory):
    return solve(problem_of(tmp_path_factory.mktemp("uneven"), *parts(), UNEVEN))


@pytest.mark.slow
def test_throws_that_may_move_are_never_worse_and_keep_their_intervals(decided, uneven):
    assert uneven.objective.value < decided.objective.value * (1 - 1e-4)
    assert uneven.problem.phasing.intervals.holds(uneven.final.engine.firing_intervals, 1e-7)
    assert max(uneven.final.engine.firing_intervals) - math.pi > math.radians(1.0)
    assert uneven.certificate.kind is Proof.LOCAL
    assert uneven.certificate.lower_bound == 0.0
    assert uneven.certificate.kkt_residual < 1e-6
    throws = [d.value for d in uneven.decisions[:4]]
    assert [part.throw for part in uneven.final.engine.slider_cranks] == pytest.approx(throws)


@pytest.mark.slow
def test_a_limit_that_only_throws_move_has_the_price_of_a_looser_one(tmp_path):
    """Check the price of a limit on crank torque, which no mount changes."""
    engine = ENGINE.partition("[[counterweights]]")[0]

    def found(maximum):
        force = f'{FORCE}[[constraints]]\nlimit = "rms crank torque"\nmax = "{maximum} N m"\n'
        force = changed(force, ("mean mount force", "rms mount force"))
        return solve(problem_of(tmp_path, engine, changed(BLOCK, HEAVY_END), MOUNTS, force, UNBOUNDED, UNEVEN))

    low, middle, high = (found(maximum) for maximum in (41.83, 41.84, 41.85))
    (limit,) = (one for one in middle.limits if one.name == "rms crank torque")
    slope = (low.objective.value - high.objective.value) / 0.02
    assert slope > 0.05
    assert limit.active
    assert limit.price.relaxed == pytest.approx(slope, rel=0.02)
    assert limit.price.is_equal


@pytest.mark.slow
def test_no_star_near_an_uneven_one_is_better(uneven):
    phasing = uneven.problem.phasing
    candidate = _candidate(uneven)
    values = {d.name: d.value for d in uneven.decisions}
    generator, tried = np.random.default_rng(1), 0
    for _ in range(400):
        size = 10.0 ** generator.uniform(-4, -1.5)
        throws = tuple(t + (size * generator.normal() if k else 0.0) for k, t in enumerate(candidate.throws))
        star_problem = replace(phasing.problem_of(replace(candidate, throws=throws)), phasing=None)
        mounts = [
            float(np.clip(values[d.name] * (1 + size * generator.normal()), d.lower, d.upper))
            for d in star_problem.mount_decisions
        ]
        fraction = float(np.clip(values["web.balance_factor"] + size * generator.normal(), 0.0, 1.0))
        near = evaluate(star_problem, star_problem.design([fraction, *mounts]), 96)
        if not phasing.intervals.holds(near.engine.firing_intervals, 1e-9):
            continue
        if max(near.check_limit(limit).violation for limit in star_problem.mount_limits) > 0.0:
            continue
        tried += 1
        assert objective_value(star_problem, near) > uneven.objective.value * (1 - 1e-5)
    assert tried > 20


def _candidate(result):
    """Return the star of a result."""
    best = result.phasing.ranking[0]
    return Candidate(best.throws, best.firing_orders[0].order)


@pytest.mark.parametrize("quantity", ["mean mount force", "rms mount force", "rms rocking couple"])
def test_the_program_of_moved_throws_says_what_the_exact_model_says(quantity, tmp_path):
    objective = changed(FORCE, ("mean mount force", quantity))
    problem = problem_of(tmp_path, *parts(objective=objective), UNEVEN)
    phasing = problem.phasing
    star = Candidate((0.0, math.pi, math.pi, 0.0), (1, 3, 4, 2))
    star_problem = replace(phasing.problem_of(star), phasing=None)
    moves = ThrowMoves(phasing, phasing.layout(None, None), star, phasing.intervals)
    joint = SmoothProgram(star_problem, 100.0, moves=moves)
    value = ca.Function("f", [joint.program.x, joint.program.parameters], [joint.program.objective])
    generator = np.random.default_rng(5)
    for _ in range(3):
        turns = generator.uniform(-0.07, 0.07, moves.size)
        mounts = [generator.uniform(d.lower, d.upper) for d in star_problem.mount_decisions]
        x = joint.start(mounts, generator.uniform(0.0, 1.0, 1), turns)
        moved = joint.problem_at(x)
        given, unbalances = joint.decision_values(x)
        # at as many angles as the program has: 32 a turn
        exact = evaluate(moved, moved.design([*unbalances, *given]), 64)
        assert float(value(x, 1e-9)) == pytest.approx(objective_value(moved, exact), rel=1e-3)
        rows, _ = moves.firing_intervals(turns)
        assert sorted(rows) == pytest.approx(sorted(exact.engine.firing_intervals), abs=1e-9)


@pytest.mark.parametrize("quantity", ["mean mount force", "rms mount force", "rms roll moment"])
def test_the_program_of_moved_throws_has_the_gas_of_the_exact_model(quantity, tmp_path):
    gas = '[gas]\nmodel = "seiliger"\npeak_pressure = "60 bar"\nimep = "8 bar"\n'
    objective = changed(FORCE, ("mean mount force", quantity))
    engine, *rest = parts(objective=objective)
    engine = changed(engine, ("[[operating_points]]", 'bore = "85 mm"\n[[operating_points]]'))
    phasing = problem_of(tmp_path, engine, *rest, gas, UNEVEN).phasing
    star = Candidate((0.0, math.pi, math.pi, 0.0), (1, 3, 4, 2))
    star_problem = replace(phasing.problem_of(star), phasing=None)
    moves = ThrowMoves(phasing, phasing.layout(None, None), star, phasing.intervals)
    joint = SmoothProgram(star_problem, 100.0, moves=moves)
    value = ca.Function("f", [joint.program.x, joint.program.parameters], [joint.program.objective])
    generator = np.random.default_rng(6)
    for _ in range(2):
        turns = generator.uniform(-0.07, 0.07, moves.size)
        mounts = [generator.uniform(d.lower, d.upper) for d in star_problem.mount_decisions]
        x = joint.start(mounts, np.array([0.5]), turns)
        moved = joint.problem_at(x)
        given, unbalances = joint.decision_values(x)
        exact = evaluate(moved, moved.design([*unbalances, *given]))
        assert max(abs(loads.wrench.at(0.5)[3]) for loads in exact.loads) > 0.5
        assert float(value(x, 1e-9)) == pytest.approx(objective_value(moved, exact), rel=2e-3)


@pytest.mark.slow
def test_throws_between_bounds_of_their_own_are_decided_with_the_mounts(tmp_path):
    throws = "[0, { between = [160, 200] }, { between = [160, 200] }, { between = [-15, 15] }]"
    phasing = '[phasing]\nintervals = { largest_deviation = "25 deg" }\n'
    result = solve(problem_of(tmp_path, *parts(throws), phasing))
    assert result.status is Status.FEASIBLE
    assert result.problem.phasing.intervals.holds(result.final.engine.firing_intervals, 1e-7)
    assert result.objective.value < result.objective.initial
    for decision in result.decisions[1:4]:
        low, high = decision.lower, decision.upper
        turned = low + (decision.value - low + 1e-9) % math.tau
        assert turned <= high + 1e-7


# one number is open, the stiffness of both mounts behind
ONE_OPEN = MOUNTS.replace(OPEN, '"400 N/mm"', 1)
RADIAL = """
title = "five in one row"
[engine]
layout = "radial"
cycle = "four-stroke"
cylinders = 5
bore = "80 mm"
stroke = "84 mm"
rod_ratio = 0.27
knuckle_radius = "42 mm"
reciprocating_mass = "0.7 kg"
[gas]
model = "seiliger"
peak_pressure = "60 bar"
imep = "7 bar"
[fidelity]
samples = 120
[[operating_points]]
speed = "1500 rpm"
[[balancer_shafts]]
name = "s"
ratio = 1
position = ["80 mm", "-60 mm"]
unbalances = [{ radius = "40 mm", unbalance = { between = ["0 kg m", "0.01 kg m"] } }]
[phasing]
intervals = { largest_deviation = "350 deg" }
"""


@pytest.mark.slow
def test_transmissibility_depends_on_the_firing_order(tmp_path):
    """Check that gas makes the even one of twelve firing orders of one throw the best."""
    objective = '[objective]\nminimise = "transmissibility"\n'
    problem = problem_of(tmp_path, RADIAL, BLOCK, ONE_OPEN, objective, UNBOUNDED)
    assert problem.depends_on_gas
    result = solve(problem)
    assert result.objective.value <= result.objective.initial * (1.0 + 1e-9)
    assert len({entry.firing_orders[0].order for entry in result.phasing.ranking}) == 12
    assert result.phasing.ranking[0].firing_orders[0].order == (1, 3, 5, 2, 4)
