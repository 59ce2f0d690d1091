"""Starts of the search of uneven throws: reversed stars, and throws within bounds of their own."""

import math
from dataclasses import replace

import numpy as np
import pytest

from laufruhe.errors import ModelError
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import SOONEST, Candidate, bounded_stars
from laufruhe.solvers import solve
from laufruhe.solvers.result import Status
from laufruhe.solvers.throws.throw_starts import firing_intervals, reverse_rotation
from phasing import engines

OPEN = 'throws = "open"\nfiring_order = "open"'
SPLIT = "\nbank_angle = { between = [60, 100] }\nsplit_pin_angle = { between = [0, 60] }"
ALLOWED = 'intervals = { largest_deviation = "40 deg" }'
MOUNT_FORCE = engines.MOUNTS + engines.MOUNT_FORCE


@pytest.mark.parametrize("layout", ["inline", "vee"])
def test_a_star_turned_back(tmp_path, layout):
    """Its firings follow each other backwards, inertia shakes as before, and turned twice it is itself."""
    vee = layout == "vee"
    phasing = engines.problem(
        tmp_path, 6, "four-stroke", OPEN + (SPLIT if vee else ""), ALLOWED, MOUNT_FORCE, layout
    ).phasing
    geometry = (math.radians(90.0), math.radians(20.0)) if vee else (None, None)
    places = phasing.layout(*geometry)
    first = places.banks[0] - places.pin_offsets[0]
    angles = (0.0, 4.1, 2.0) if vee else (0.0, 4.1, 2.0, 2.2, 4.3, 0.1)
    order = (1, 6, 3, 5, 2, 4) if vee else (1, 5, 3, 6, 2, 4)
    star = Candidate(tuple((first + angle) % math.tau for angle in angles), order, *geometry)
    back = reverse_rotation(phasing, star)

    intervals, turned = firing_intervals(phasing, star), firing_intervals(phasing, back)
    assert min(intervals) > SOONEST
    assert max(intervals) - min(intervals) > 0.1
    assert any(np.allclose(np.roll(intervals[::-1], k), turned, atol=1e-12) for k in range(6))
    problems = [replace(phasing.problem_of(own), phasing=None) for own in (star, back)]
    values = [objective_value(problem, evaluate(problem)) for problem in problems]
    # the samples stand elsewhere in the cycle
    assert values[0] == pytest.approx(values[1], rel=1e-6)
    twice = reverse_rotation(phasing, back)
    assert twice.firing_order == order
    np.testing.assert_allclose(np.exp(1j * np.array(twice.throws)), np.exp(1j * np.array(star.throws)), atol=1e-12)


@pytest.mark.parametrize("order", ["[1, 3, 4, 2]", '"open"'])
def test_bounded_stars_lie_within(tmp_path, order):
    """The middle cannot fire: three pistons would be at their dead centre at once. An even star within can."""
    engine = f"throws = [0, 180, 180, {{ between = [-20, 380] }}]\nfiring_order = {order}"
    phasing = engines.problem(tmp_path, 4, "four-stroke", engine).phasing
    middle, *even = bounded_stars(phasing, phasing.layout(None, None))
    assert np.degrees(middle) == pytest.approx([0.0, 180.0, 180.0, 180.0])
    for star in even:
        assert all(low <= angle <= high for angle, (low, high) in zip(star, phasing.throw_bounds, strict=True))
    assert np.degrees(even[0]) % 360.0 == pytest.approx([0.0, 180.0, 180.0, 0.0])


def test_one_throw_between_bounds_is_enough(tmp_path):
    """A four whose last throw is open is no worse than the even one, which the search starts from."""
    engine = "throws = [0, 180, 180, { between = [0, 360] }]\nfiring_order = [1, 3, 4, 2]"
    even = "throws = [0, 180, 180, 0]\nfiring_order = [1, 3, 4, 2]"
    open_one, even = (
        engines.problem(tmp_path, 4, "four-stroke", own, "", MOUNT_FORCE, samples=48) for own in (engine, even)
    )
    result = solve(open_one)
    assert result.objective.value <= objective_value(even, evaluate(even)) * (1.0 + 1e-6)
    assert min(result.final.engine.firing_intervals) > SOONEST


def crooked_vee(folder, cylinders, bank, deviation, rest=engines.COUPLE, keys=""):
    engine = f"{OPEN}\nbank_angle = {bank}\n{keys}"
    allowed = f'intervals = {{ largest_deviation = "{deviation} deg" }}'
    return solve(engines.problem(folder, cylinders, "four-stroke", engine, allowed, rest, "vee"))


def test_banks_that_no_even_star_fits_start_from_every_crank_that_fires(tmp_path):
    """A V12 at 65 degrees: the star of an in-line six fires 55 and 65 degrees apart, and is balanced."""
    result = crooked_vee(tmp_path, 12, 65, 5)
    assert result.objective.value == pytest.approx(0.0, abs=1e-6 * result.objective.initial)


def test_more_freedom_is_never_worse(tmp_path):
    """A V10 at 90 degrees fires 54 and 90 degrees apart at best."""
    rest = engines.COUPLE + "[search]\nboxes = 5\n"
    found = [crooked_vee(tmp_path, 10, 90, deviation, rest).objective for deviation in (18, 25)]
    values = [objective.value for objective in found]
    assert values == sorted(values, reverse=True)
    assert values[0] < 0.2 * found[0].initial


def test_infeasible_intervals_name_the_needed_range(tmp_path):
    result = crooked_vee(tmp_path, 10, 90, 17)
    assert result.status is Status.INFEASIBLE
    assert "from 54 to 90 deg" in result.message
    assert "multiple of 72 deg" in result.message


def test_shafts_that_may_not_be_built_are_not(tmp_path):
    rest = engines.shaft("against", -1) + engines.shaft("second", 2) + engines.COUPLE
    text = 'intervals = { largest_deviation = "20 deg" }\nmost_shafts = 1'
    engine = f"{OPEN}\nbank_angle = 65"
    result = solve(
        engines.problem(tmp_path, 4, "four-stroke", engine.replace("65", "100"), text.replace("20", "85"), rest, "vee")
    )
    assert sum(d.value for d in result.decisions if d.name.endswith("built")) <= 1


def test_throws_whose_middles_fire_at_once_start_near_them(tmp_path):
    """Banks and pins 120 degrees apart: throws at 0, 120 and 240 would fire in pairs, and have no order."""
    engine = """throws = [0, { between = [108, 132] }, { between = [228, 252] }]
bank_angle = 90
split_pin_angle = 30"""
    wide = 'intervals = { largest_deviation = "180 deg" }'
    result = solve(engines.problem(tmp_path, 6, "two-stroke", engine, wide, engines.COUPLE, "vee"))
    assert result.objective is not None
    assert min(result.final.engine.firing_intervals) > SOONEST


def test_an_order_that_throws_cannot_fire_in_is_no_design_and_no_complaint(tmp_path):
    engine = "throws = [0, 180, { between = [150, 200] }, 0]\nfiring_order = [1, 3, 4, 2]"
    phasing = engines.problem(tmp_path, 4, "two-stroke", engine.replace("0]", "90]"), "", engines.COUPLE).phasing
    with pytest.raises(ModelError, match="cannot fire in the order"):
        phasing.problem_of(Candidate((0.0, 1.0, 2.0, 3.0), (1, 2, 3, 4)))
