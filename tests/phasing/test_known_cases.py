"""Known results of the field, found by the search."""

import json
import math

import numpy as np
import pytest

from laufruhe.files.reader import load
from laufruhe.load_models.amplitudes import AmplitudeObjective, AmplitudeTerm
from laufruhe.machine import Cycle
from laufruhe.machine.firing import even_patterns, firing_lattice
from laufruhe.machine.layouts import inline
from laufruhe.physics.crank_stars import StarSpace, star_sums
from laufruhe.prove.certificate import Proof
from laufruhe.report.json_result import as_dict
from laufruhe.report.wording import explained
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status
from laufruhe.solvers.stars.even_search import enumerate_stars
from phasing import engines
from problem_files import PROBLEMS
from ready import solved

SQRT2, SQRT10 = math.sqrt(2.0), math.sqrt(10.0)


def degrees(star):
    first = star.throws[0]
    return [round(math.degrees(angle - first)) % 360 for angle in star.throws]


def with_choice(tmp_path, name, old, new):
    text = (PROBLEMS / f"{name}.toml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / f"{name}.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return load(path)


def test_two_stroke_four_with_a_shaft():
    """Check Hasselgruber, figs. 26 to 28: U s / (m r a / 2) = sqrt 10, no order 1 and 2."""
    problem = load(PROBLEMS / "two-stroke-four-open.toml")
    result = solve(problem)
    assert result.status is Status.OPTIMAL
    assert result.certificate.kind is Proof.GLOBAL
    best = result.phasing.ranking[0]
    assert best.couples[:2] == pytest.approx((SQRT10, 0.0), abs=1e-12)
    assert best.shafts == ("balancer",)
    wrench = result.final.loads[0].wrench
    part = problem.engine.slider_cranks[0]
    unit = part.reciprocating_mass * part.crank_radius * problem.points[0].speed ** 2
    assert np.abs(wrench.at(1)).max() < 1e-5 * unit
    assert np.abs(wrench.at(2)[[1, 2, 4, 5]]).max() < 1e-5 * unit
    # eq. 31: the shaft's unbalances, one at either end of s = 0.5 m
    unbalance = next(d.value for d in result.decisions if d.name == "balancer.front.unbalance")
    expected = 0.5 * part.reciprocating_mass * part.crank_radius * 0.125 * SQRT10 / 0.5
    assert unbalance == pytest.approx(expected, rel=1e-5)


@pytest.mark.slow
def test_two_stroke_four_without_a_shaft(tmp_path):
    """Check Hasselgruber's star with sqrt 2, better without a shaft."""
    text = (PROBLEMS / "two-stroke-four-open.toml").read_text(encoding="utf-8")
    head, shafts = text.split("# ... and this one against it")
    path = tmp_path / "none.toml"
    path.write_text(head.replace("most_shafts = 1\n", "") + shafts[shafts.index("[objective]") :], encoding="utf-8")
    result = solve(load(path))
    assert result.certificate.kind is Proof.GLOBAL
    assert result.phasing.ranking[0].couples[0] == pytest.approx(SQRT2, rel=1e-12)
    none = solve(with_choice(tmp_path, "two-stroke-four-open", "most_shafts = 1", "most_shafts = 0"))
    assert none.objective.value == pytest.approx(result.objective.value, rel=1e-3)


@pytest.mark.parametrize(("cylinders", "star"), [(4, [0, 180, 180, 0]), (6, [0, 120, 240, 240, 120, 0])])
def test_four_stroke_four_and_six(tmp_path, cylinders, star):
    result = solve(engines.problem(tmp_path, cylinders, "four-stroke"))
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value == 0.0
    actual = degrees(result.phasing.ranking[0])
    assert actual in (star, [(360 - angle) % 360 for angle in star])


def test_cross_plane_eight():
    """Check a 90 degree V8 with free counterweights: the cross-plane crank without orders 1 and 2."""
    result = solved("vee-eight-open")
    assert result.status is Status.OPTIMAL
    best = result.phasing.ranking[0]
    assert sorted(degrees(best)) == [0, 90, 180, 270]
    assert best.couples[:2] == pytest.approx((SQRT10, 0.0), abs=1e-12)
    assert best.order_count == 8
    flat = [star for star in result.phasing.ranking if len(set(degrees(star))) == 2]
    assert flat
    # gas torque is the same for both; the second order comes on top of it
    assert min(star.value for star in flat) > 3.0 * best.value


def test_split_pins_of_a_six():
    """Check a 90 degree V6 with 30 degree split pins, the only ones that fire evenly."""
    result = solved("vee-six-open")
    assert result.status is Status.OPTIMAL
    assert next(d.value for d in result.decisions if d.name == "split pin angle") == pytest.approx(math.radians(30.0))
    assert result.final.engine.firing_intervals == pytest.approx([math.radians(120.0)] * 6)


# Least sqrt(C1^2 + (C2/4)^2) of every even star, by looking at all of them (C in forces times spacing)
COUPLES = [
    (cycle, n, marks)
    for cycle in (Cycle.TWO_STROKE, Cycle.FOUR_STROKE)
    for n, marks in (
        (5, ()),
        (7, ()),
        (9, ()),
        (10, ()),
        (11, (pytest.mark.slow,)),
        (12, (pytest.mark.long if cycle is Cycle.TWO_STROKE else pytest.mark.slow,)),
    )
]


@pytest.mark.parametrize(("cycle", "cylinders"), [pytest.param(c, n, marks=m) for c, n, m in COUPLES])
def test_least_couples_of_in_line_engines(cycle, cylinders):
    layout = inline(cylinders, 1.0)
    steps = firing_lattice(cycle, cylinders).steps
    space = StarSpace(steps, even_patterns(cycle, layout), layout.throw_positions)
    objective = AmplitudeObjective((1, 2), (AmplitudeTerm(1.0, (0.0, 0.0), (1.0, 0.25)),))
    result = enumerate_stars(
        StarSpace(steps, space.patterns, space.places, mirror=True, reflect=True), objective, 1
    )  # fmt: skip
    minimum = math.inf
    # every star, images included, scored without the objective's own code
    whole = space if cylinders < 11 else StarSpace(steps, space.patterns, space.places, True, False)
    for block in whole.blocks():
        couples = np.abs(star_sums(block, steps, layout.throw_positions, (1, 2))[..., 1])
        minimum = min(minimum, float(np.sqrt(couples[:, 0] ** 2 + (0.25 * couples[:, 1]) ** 2).min()))
    assert result.complete
    assert result.values[0] == pytest.approx(minimum, rel=1e-9, abs=1e-9)


def test_published_couples():
    """Check textbook example 5 and the free couples of a two-stroke seven."""
    five = solved("inline-five-open").phasing.ranking[0]
    assert five.couples[:2] == pytest.approx((0.4490, 4.9798), abs=1e-4)
    layout = inline(7, 1.0)
    space = StarSpace(7, ((1,) * 7,), layout.throw_positions, True, True)
    objective = AmplitudeObjective((1, 2), (AmplitudeTerm(1.0, (0.0, 0.0), (1.0, 1.0)),))
    sums = star_sums(enumerate_stars(space, objective).stars, 7, layout.throw_positions, (1, 2))
    assert np.abs(sums[0, :, 1]) == pytest.approx((0.2673, 1.0056), abs=1e-4)


@pytest.mark.slow
def test_vee_twenty():
    result = solved("vee-twenty-open")
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.gap < 1e-9
    values = [star.value for star in result.phasing.ranking]
    assert values == sorted(values)
    assert len({star.throws for star in result.phasing.ranking}) == len(values) == result.problem.phasing.best
    assert all(star.even and star.order_count == 512 for star in result.phasing.ranking)


@pytest.mark.parametrize("fixed", ["throws", "order"])
def test_one_of_throws_and_order_may_be_given(tmp_path, fixed):
    if fixed == "throws":
        engine = 'throws = [0, 180, 180, 0]\nfiring_order = "open"'
    else:
        engine = 'throws = "open"\nfiring_order = [1, 3, 4, 2]'
    result = solve(engines.problem(tmp_path, 4, "four-stroke", engine))
    assert result.status is Status.OPTIMAL
    orders = {order.order for order in result.phasing.ranking[0].firing_orders}
    assert (1, 3, 4, 2) in orders
    assert degrees(result.phasing.ranking[0]) == [0, 180, 180, 0]


@pytest.mark.parametrize("criterion", ["neighbours", "longest gap", "roll moment"])
def test_orders_are_ranked_by_what_the_user_names(tmp_path, criterion):
    engine = 'bank_angle = 90\nthrows = [0, 90, 270, 180]\nfiring_order = "open"'
    problem = engines.problem(tmp_path, 8, "four-stroke", engine, f'rank_orders_by = ["{criterion}"]', layout="vee")
    orders = solve(problem).phasing.ranking[0].firing_orders
    attribute = {"neighbours": "neighbours", "longest gap": "longest_gap", "roll moment": "roll_content"}[criterion]
    values = [round(getattr(order, attribute), 9) for order in orders]
    assert values == sorted(values)


def test_reports_say_where_a_bound_is_from(tmp_path):
    assert "computed from the exact model" in explained(solve(engines.problem(tmp_path, 5, phasing="best = 1")))
    none = solve(engines.problem(tmp_path, 5, phasing='intervals = { max = "60 deg" }'))
    assert "cone solver" not in explained(none)


@pytest.mark.slow
def test_json_holds_ranking_and_trade():
    record = as_dict(solved("inline-seven-uneven"))
    assert [star["rank"] for star in record["ranking"]] == list(range(1, len(record["ranking"]) + 1))
    assert record["objective"]["value"] == record["ranking"][0]["objective"]
    assert len(record["phasing"]["trade"]) > 2
    assert record["certificate"]["kind"] == "global"
    json.dumps(record["ranking"], allow_nan=False)
