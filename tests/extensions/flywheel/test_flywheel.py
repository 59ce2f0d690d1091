"""Flywheel for a degree of irregularity, proven by boxes, compared with brute force and its properties."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.fidelity.explanation import explained
from laufruhe.extensions.fidelity.trade_report import traded
from laufruhe.extensions.flywheel.machine import Flywheel, Rim
from laufruhe.extensions.flywheel.solver import _Coordinates
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Status
from laufruhe.solvers.methods import refuse
from one_cylinder import irregularity
from problem_files import PROBLEMS, changed, loaded
from ready import solved

SINGLE = """
title = "Single"
[engine]
layout = "inline"
cycle = "four-stroke"
bore = "100 mm"
stroke = "120 mm"
rod_ratio = 0.26
reciprocating_mass = "1.25 kg"
throws = [0]
[[operating_points]]
name = "rated"
speed = "2500 rpm"
[[operating_points]]
name = "idle"
speed = "900 rpm"
imep = "5 bar"
[gas]
model = "seiliger"
peak_pressure = "80 bar"
imep = "9 bar"
[fidelity]
samples = 360
"""
INERTIA = """
[flywheel]
inertia = { between = ["0.05 kg m^2", "40 kg m^2"] }
"""
RIM = """
[flywheel.rim]
mean_diameter = { between = ["220 mm", "420 mm"] }
width = { between = ["20 mm", "150 mm"] }
height = { between = ["15 mm", "60 mm"] }
"""
LEAST = """
[objective]
minimise = "flywheel inertia"
[[constraints]]
limit = "degree of irregularity"
max = "1/100"
operating_points = ["rated"]
"""


@pytest.fixture(scope="module")
def diesel() -> laufruhe.solvers.Result:
    return solved("diesel-70-hp-flywheel")


def proven(problem: Problem) -> laufruhe.solvers.Result:
    result = laufruhe.solve(problem)
    assert result.status is Status.OPTIMAL
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.kkt_residual < 1e-2
    return result


def test_the_least_inertia_has_its_degree_and_is_shown_from_both_sides(tmp_path: Path) -> None:
    problem = loaded(tmp_path, SINGLE + INERTIA + LEAST)
    result = proven(problem)
    assert result.objective is not None
    assert result.certificate is not None
    minimum, bound = result.objective.value, result.certificate.lower_bound
    engine, point = problem.engine, problem.points[0]
    assert bound <= minimum <= bound * (1.0 + 1e-6)
    assert irregularity(engine, point, minimum, problem.fidelity) <= 0.01
    assert irregularity(engine, point, bound * (1.0 - 1e-9), problem.fidelity) > 0.01
    # the price is the slope of the inertia over the degree, told by solving twice more
    ends = [
        proven(loaded(tmp_path, SINGLE + INERTIA + changed(LEAST, "1/100", str(degree)))) for degree in (0.0099, 0.0101)
    ]
    slope = (ends[0].objective.value - ends[1].objective.value) / 0.0002
    assert result.limits[0].shadow_price == pytest.approx(slope, rel=1e-3)


@pytest.mark.slow
def test_inertia_is_inverse_to_the_permitted_degree(tmp_path: Path) -> None:
    """Check the textbook's table (2.7) and eq. 25, E = J w^2 delta, for small delta."""
    page = (PROBLEMS.parent / "docs/how-to/flywheel.md").read_text(encoding="utf-8")
    degrees = re.findall(r"^\| .* \| `(1/\d+)` \|$", page, re.MULTILINE)
    inertia = changed(INERTIA, "40 kg m^2", "400 kg m^2")
    products = {
        degree: proven(loaded(tmp_path, SINGLE + inertia + changed(LEAST, "1/100", degree))).objective.value
        * float(Fraction(degree))
        for degree in degrees
    }
    assert list(products) == ["1/300", "1/200", "1/150", "1/90", "1/45", "1/25"]
    assert list(products.values()) == pytest.approx([products["1/300"]] * 6, rel=5e-3)


@pytest.mark.slow
def test_a_rim_is_the_best_of_a_grid(tmp_path: Path) -> None:
    """Check that none of 60 x 60 sections and diameters, each with the needed width, is lighter."""
    limits = '[[constraints]]\nlimit = "rim stress"\nmax = "18 N/mm^2"\n'
    problem = loaded(tmp_path, SINGLE + RIM + changed(LEAST, "flywheel inertia", "flywheel mass") + limits)
    result = proven(problem)
    assert result.objective is not None
    needed = laufruhe.solve(loaded(tmp_path, SINGLE + INERTIA + LEAST)).objective.value
    fastest = problem.points[0].speed
    best = np.inf
    for diameter in np.linspace(0.22, 0.42, 60):
        for height in np.linspace(0.015, 0.06, 60):
            rim = Rim(diameter, 0.1, height, 7250.0)
            width = 0.1 * needed / rim.inertia
            if 0.02 <= width <= 0.15 and rim.stress(fastest) <= 18e6:
                best = min(best, rim.mass * width / 0.1)
    assert best < np.inf
    assert result.certificate.lower_bound <= best
    assert result.objective.value <= best
    assert best <= 1.02 * result.objective.value


def test_boxes_of_a_rim_are_of_its_mass_in_place_of_its_width(tmp_path: Path) -> None:
    """Check the mass pi rho D w h of a rim, from the point of a box and back."""
    limits = '[[constraints]]\nlimit = "rim stress"\nmax = "18 N/mm^2"\n'
    minimum = changed(LEAST, "flywheel inertia", "flywheel mass")
    problem = loaded(tmp_path, changed(SINGLE, "samples = 360", "samples = 72") + RIM + minimum + limits)
    initial = evaluate(problem)
    boxes, whole = (_Coordinates.from_problem(problem, by_mass) for by_mass in (True, False))
    with_mass, with_width = (each.monotone_problem(initial, problem.limits) for each in (boxes, whole))
    assert problem.engine.extra(Flywheel) is not None
    rho = problem.engine.extra(Flywheel).ring.density
    names = [decision.name.removeprefix("flywheel.") for decision in problem.decisions]
    lower, upper = boxes.bounds
    ends = [np.pi * rho * np.prod(sides) for sides in (lower, upper)]
    assert (with_mass.lower[-1], with_mass.upper[-1]) == pytest.approx(ends)
    # both sides of the width are limits then
    assert len(with_mass.limits) == len(with_width.limits) + 2
    for share in np.random.default_rng(2).random((3, 3)):
        values = lower + share * (upper - lower)
        point = boxes.place(values.tolist())
        assert point[-1] == pytest.approx(np.pi * rho * np.prod(values), rel=1e-12)
        assert point[:-1] == pytest.approx([x for x, name in zip(values, names, strict=True) if name != "width"])
        assert boxes.decisions(point) == pytest.approx(values, rel=1e-12)
        assert with_mass.value(point) == pytest.approx(with_width.value(values), rel=1e-12)
        (width,) = (x for x, name in zip(values, names, strict=True) if name == "width")
        numbers = [number.value(point) for _, number in with_mass.limits]
        assert numbers == pytest.approx([*(number.value(values) for _, number in with_width.limits), width, -width])
    alone = loaded(tmp_path, SINGLE + INERTIA + LEAST)
    assert _Coordinates.from_problem(alone, True).width is None


@pytest.mark.slow
def test_a_sum_of_inertia_and_degree_is_proven(tmp_path: Path) -> None:
    """Check by brute force that no inertia gives less than the bound or a better sum."""
    degree = '{ quantity = "degree of irregularity", weight = 500 }'
    terms = f'[objective]\nterms = [{degree}, {{ quantity = "flywheel inertia" }}]\n'
    problem = loaded(tmp_path, SINGLE + INERTIA + terms)
    result = proven(problem)
    every = [
        500.0 * max(irregularity(problem.engine, point, inertia, problem.fidelity) for point in problem.points)
        + inertia
        for inertia in np.geomspace(0.05, 40.0, 400)
    ]
    assert result.certificate.lower_bound <= min(every)
    assert result.objective.value <= min(every) * (1.0 + 1e-4)


def test_a_degree_is_minimised_at_the_largest_flywheel_allowed(tmp_path: Path) -> None:
    minimum = '[objective]\nminimise = "degree of irregularity"\n[[constraints]]\nlimit = "flywheel inertia"\n'
    result = proven(loaded(tmp_path, SINGLE + INERTIA + minimum + 'max = "2 kg m^2"\n'))
    assert result.decisions[0].value == pytest.approx(2.0, rel=1e-6)
    assert result.limits[0].shadow_price > 0.0


def test_a_flywheel_too_small_for_the_degree_is_infeasible(tmp_path: Path) -> None:
    small = changed(INERTIA, "40 kg", "1 kg")
    result = laufruhe.solve(loaded(tmp_path, SINGLE + small + LEAST))
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("degree of irregularity at rated",)
    assert "\n" not in result.message
    stress = '[[constraints]]\nlimit = "rim stress"\nmax = "8 N/mm^2"\n'
    text = SINGLE + RIM + changed(changed(LEAST, "flywheel inertia", "flywheel mass"), "1/100", "1/200") + stress
    both = laufruhe.solve(loaded(tmp_path, text))
    assert set(both.conflict) == {"degree of irregularity at rated", "rim stress"}


@pytest.mark.slow
def test_the_worked_diesel_gets_its_printed_flywheel(diesel: laufruhe.solvers.Result) -> None:
    """Check a 70 hp diesel, part E: 1:60, rim of 300 by 195 mm, 4850 kg of 6330 kg."""
    assert diesel.certificate is not None
    assert diesel.certificate.kind is Proof.GLOBAL
    wheel = diesel.final.engine.extra(Flywheel)
    assert wheel is not None
    rim = wheel.ring
    assert diesel.objective.value == pytest.approx(6330.0, rel=0.06)
    assert rim.mass == pytest.approx(4850.0, rel=0.06)
    assert (rim.width, rim.height) == (pytest.approx(0.300, rel=0.05), pytest.approx(0.195, rel=0.05))
    assert 2.0 * rim.radii[1] == pytest.approx(3.5, rel=0.01)
    # every limit that holds it has a price, and together they balance
    assert {limit.name for limit in diesel.limits if limit.active} == {"degree of irregularity", "rim stress"}
    assert diesel.certificate.kkt_residual < 1e-6


@pytest.mark.slow
def test_more_room_is_never_worse(diesel: laufruhe.solvers.Result) -> None:
    problem = diesel.problem
    limits = tuple(
        replace(limit, maximum=1.001 * limit.maximum) if limit.name == "rim stress" else limit
        for limit in problem.limits
    )
    relaxed = laufruhe.solve(problem.changed(limits=limits))
    fall = diesel.objective.value - relaxed.objective.value
    price = next(limit.shadow_price for limit in diesel.limits if limit.name == "rim stress")
    assert fall == pytest.approx(price * 0.006e6, rel=0.02)


@pytest.mark.parametrize(
    ("text", "where", "rule"),
    [
        (INERTIA.replace("[flywheel]", '[flywheel]\nrim = { mean_diameter = "1 m", width = "1 mm", height = "1 mm" }'),
         "flywheel.inertia", "given twice"),
        ("[flywheel]\n", "flywheel.inertia", "missing"),
        ('[flywheel]\ninertia = "0 kg m^2"\n', "flywheel.inertia", "more than"),
        (INERTIA + 'crankshaft_inertia = "1 kg m^2"\n', "flywheel.crankshaft_inertia", "needs a rim"),
        (RIM.replace('"60 mm"', '"230 mm"'), "flywheel.rim.height", "leaves no hole"),
        (RIM + 'arms = { count = 4, at_rim = ["9 mm", "9 mm"], at_hub = ["9 mm", "9 mm"], hub_diameter = "200 mm" }\n',
         "hub_diameter", "does not fit"),
        (RIM + 'whole = 0.9\n', "flywheel.rim.whole", "at least"),
    ],
)  # fmt: skip
def test_bad_flywheels_are_refused(text: str, where: str, rule: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        loaded(tmp_path, SINGLE + text + LEAST)
    assert where in str(refused.value)
    assert rule in str(refused.value)
    assert "\n" not in str(refused.value)


def test_quantities_of_a_missing_flywheel_are_refused(tmp_path: Path) -> None:
    for name, text, rule in (
        ("degree of irregularity", "", "needs a flywheel"),
        ("flywheel mass", INERTIA, "needs the rim"),
        ("arm stress", RIM, "needs the arms"),
    ):
        with pytest.raises(InputError, match=rule):
            loaded(tmp_path, SINGLE + text + f'[objective]\nminimise = "{name}"\n')


def test_the_inertia_of_an_uneven_speed_gives_the_degree(tmp_path: Path) -> None:
    """Check that the inertia of an uneven speed gives the degree, and is refused with a flywheel."""
    uneven = changed(SINGLE, "samples = 360", 'samples = 360\ncrank_inertia = "1 kg m^2"')
    degree = '[[constraints]]\nlimit = "degree of irregularity"\nmax = "1/10"\noperating_points = ["rated"]\n'
    problem = loaded(tmp_path, uneven + '[objective]\nminimise = "maximum shaking force"\n' + degree)
    assert problem.engine.extra(Flywheel) == Flywheel(1.0)
    irregularity_value = laufruhe.solve(problem).limits[0].value
    assert irregularity_value == pytest.approx(irregularity(problem.engine, problem.points[0], 1.0, problem.fidelity))
    with pytest.raises(InputError, match="given by"):
        loaded(tmp_path, uneven + INERTIA + LEAST)


def test_a_flywheel_beside_counterweights_is_the_sum_of_both(tmp_path: Path) -> None:
    """Check that value, bound and prices at even speed are those of each alone."""
    size = 'mass = { between = ["0 kg", "2 kg"] }'
    web = f'[[counterweights]]\nname = "web"\nradius = "80 mm"\nopposite_throw = 1\n{size}\n'
    mass = '[[constraints]]\nlimit = "counterweight mass"\nmax = "0.3 kg"\n'
    force = '[objective]\nminimise = "mean shaking force"\n'
    terms = (
        '[objective]\nterms = [{ quantity = "flywheel inertia" }, { quantity = "mean shaking force", weight = 0.01 }]\n'
    )
    both = proven(
        loaded(
            tmp_path,
            SINGLE + INERTIA + changed(LEAST, '[objective]\nminimise = "flywheel inertia"\n', terms) + web + mass,
        )
    )
    alone = [proven(loaded(tmp_path, SINGLE + text)) for text in (INERTIA + LEAST, web + force + mass)]
    assert both.objective.value == pytest.approx(alone[0].objective.value + 0.01 * alone[1].objective.value, rel=1e-6)
    assert both.certificate.lower_bound == pytest.approx(
        alone[0].certificate.lower_bound + 0.01 * alone[1].certificate.lower_bound, rel=1e-4
    )
    prices = {limit.name: limit.shadow_price for limit in both.limits}
    assert prices["counterweight mass"] == pytest.approx(0.01 * alone[1].limits[0].shadow_price, rel=1e-3)
    assert prices["degree of irregularity at rated"] == pytest.approx(alone[0].limits[0].shadow_price, rel=1e-6)
    with pytest.raises(ModelError, match="no objective term depends on this number"):
        laufruhe.solve(
            loaded(tmp_path, SINGLE + INERTIA + web + changed(LEAST, "flywheel inertia", "mean shaking force"))
        )
    with pytest.raises(ModelError, match="no objective or limit depends on it"):
        laufruhe.solve(loaded(tmp_path, SINGLE + INERTIA + web + force))


def test_objectives_in_order_decide_a_flywheel_and_a_counterweight_apart(tmp_path: Path) -> None:
    """Check that both orders give the same optima, and that unneeded numbers are refused."""
    size = 'radius = "80 mm"\nopposite_throw = 1\nmass = { between = ["0 kg", "2 kg"] }'
    web = f'[[counterweights]]\nname = "web"\n{size}\n'
    force = '[[objective]]\nminimise = "maximum shaking force"\n'
    limit = changed(LEAST, '[objective]\nminimise = "flywheel inertia"\n', "")
    inertia = '[[objective]]\nminimise = "flywheel inertia"\n'
    alone = [proven(loaded(tmp_path, SINGLE + text)) for text in (INERTIA + inertia + limit, web + force)]
    orders = [(inertia, force), (force, inertia)]
    for order, expected in zip(orders, (alone, alone[::-1]), strict=True):
        result = proven(loaded(tmp_path, SINGLE + INERTIA + web + "".join(order) + limit))
        for rank, single in zip(result.ranks, expected, strict=True):
            assert (rank.minimum, rank.final) == pytest.approx((single.objective.value,) * 2, rel=1e-5)
            assert single.certificate.lower_bound * (1.0 - 1e-4) <= rank.lower_bound <= single.objective.value
            assert rank.proof is Proof.GLOBAL
        assert result.limits[0].value <= 0.01 * (1.0 + 1e-6)
    with pytest.raises(ModelError, match="flywheel is open, but no objective term depends on this number"):
        refuse(loaded(tmp_path, SINGLE + INERTIA + web + force + limit))


def test_a_flywheel_beside_an_open_crank_is_that_of_each_crank(tmp_path: Path) -> None:
    """Compare with a given even crank, because all turn as evenly."""
    text = changed(SINGLE, "throws = [0]", 'cylinders = 3\ncylinder_spacing = "120 mm"\nthrows = "open"')
    both = laufruhe.solve(loaded(tmp_path, text + INERTIA + LEAST))
    crank = changed(text, 'throws = "open"', "throws = [0, 120, 240]\nfiring_order = [1, 2, 3]")
    assert both.objective.value == pytest.approx(
        laufruhe.solve(loaded(tmp_path, crank + INERTIA + LEAST)).objective.value
    )


def test_needed_physics_of_a_flywheel_and_no_trade() -> None:
    """Check that gas and speed are needed, and that a trade of fidelities is refused."""
    path = PROBLEMS / "diesel-70-hp-flywheel.toml"
    text, _ = explained(path, 1e-3)
    assert "gas: without" in text
    assert "crank speed: without" in text
    with pytest.raises(InputError, match="fidelities are compared for a fixed"):
        traded([path], Path("nowhere"), lambda _: None)


@pytest.mark.slow
def test_two_machines_on_one_shaft_are_best_half_a_turn_apart() -> None:
    """Check that the least flywheel is even in the angle between equal engines, least at half a turn."""
    tables = tables_of(PROBLEMS / "two-machines.toml")

    def minimum(angle: float) -> float:
        first, second = tables["engine"]["slider_cranks"]
        engine = {**tables["engine"], "slider_cranks": [first, {**second, "throw": angle}]}
        return proven(load_tables({**tables, "engine": engine}, Path("two.toml"))).objective.value

    found = {angle: minimum(angle) for angle in (0, 90, 150, 180, 210, 270)}
    assert found[90] == pytest.approx(found[270], rel=1e-6)
    assert found[150] == pytest.approx(found[210], rel=1e-6)
    assert found[180] < found[150] < found[90] < found[0]
    # in step they are one machine of twice the size
    alone = {**tables["engine"], "slider_cranks": tables["engine"]["slider_cranks"][:1]}
    one = proven(load_tables({**tables, "engine": alone}, Path("one.toml"))).objective.value
    assert found[0] == pytest.approx(2.0 * one, rel=1e-6)


def test_every_even_star_of_equal_cylinders_stores_the_same(tmp_path: Path) -> None:
    """Check equal ranked stars, and that the degree beside an open flywheel is refused."""
    text = changed(SINGLE, "throws = [0]", 'cylinders = 4\ncylinder_spacing = "120 mm"\nthrows = "open"')
    result = proven(loaded(tmp_path, text + '[objective]\nminimise = "peak to peak stored work"\n'))
    assert len(result.phasing.ranking) > 2
    assert [star.value for star in result.phasing.ranking] == pytest.approx([result.objective.value] * 3, rel=1e-3)
    fixed = changed(INERTIA, '{ between = ["0.05 kg m^2", "40 kg m^2"] }', '"1 kg m^2"')
    objective = '[objective]\nminimise = "degree of irregularity"\n'
    problem = loaded(tmp_path, text + fixed + objective)
    degrees = [irregularity(problem.engine, point, 1.0, problem.fidelity) for point in problem.points]
    assert proven(problem).objective.value == pytest.approx(max(degrees), rel=1e-9)
    wheel = laufruhe.solve(loaded(tmp_path, text + INERTIA + objective))
    assert wheel.final.engine.extra(Flywheel).inertia == pytest.approx(40.0, rel=1e-6)


@pytest.mark.slow
def test_the_error_estimate_of_the_degree_is_not_exceeded() -> None:
    """Check that error estimates of objective and limit are at least the true error."""
    text = SINGLE + '[flywheel]\ninertia = "2 kg m^2"\n[objective]\nminimise = "degree of irregularity"\n'
    text += '[[constraints]]\nlimit = "degree of irregularity"\nmax = 1.9\n'

    def solved(samples: int) -> laufruhe.solvers.Result:
        return laufruhe.solve(laufruhe.load(text.replace("samples = 360", f"samples = {samples}")))

    true = solved(5760).objective
    assert true is not None
    for samples in (60, 90, 240):
        found = solved(samples)
        assert found.objective is not None
        off = abs(found.objective.value - true.value) / found.objective.value
        assert 0.0 < off <= found.error_estimate
        assert found.limits[0].error_estimate >= off
