"""Prices of limits and bounds on either side, compared with problems solved again."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from lanes import first_fast
from laufruhe.prove.certificate import Proof
from laufruhe.report.json_result import as_dict
from laufruhe.solvers.prices import Price, Slopes, prices_of

INPUTS = Path(__file__).parent / "inputs"


def value(table: dict[str, Any] | str) -> float:
    result = laufruhe.solve(table)
    assert result.certificate.kind is Proof.GLOBAL
    return float(result.objective.value)


def prices(result: Any) -> dict[str, Price]:
    return {one.name: one.price for one in (*result.decisions, *result.limits)}


@pytest.mark.slow
def test_a_size_at_the_end_of_its_angles() -> None:
    """Check prices of 41,926 N per kg m up and 41,958 down, and 681 N/rad for the angle."""
    text = (INPUTS / "size-at-the-end-of-its-angles.toml").read_text()
    result = laufruhe.solve(text)
    price_of, here = prices(result), result.objective.value
    size, angle = price_of["c.unbalance"], price_of["c.angle"]
    more, less = (value(text.replace("0.01 kg m", f"{at:.6f} kg m")) for at in (0.01001, 0.00999))
    assert (here - more) / 1e-5 == pytest.approx(41_926, rel=1e-3)
    assert size.relaxed == size.tightened == pytest.approx((less - more) / 2e-5, rel=1e-3)
    wider, tighter = (value(text.replace("[40,120]", f"[{at},120]")) for at in (39.9, 40.1))
    assert angle.relaxed == pytest.approx((tighter - wider) / math.radians(0.2), rel=5e-3)
    assert angle.relaxed == pytest.approx(681.0, rel=5e-3)


@pytest.mark.slow
def test_a_limit_that_no_weight_moves() -> None:
    """Check that a limit on order 2, which weights do not change, is free to relax and impossible to tighten."""
    text = (INPUTS / "limit-that-no-weight-moves.toml").read_text()
    result = laufruhe.solve(text)
    assert result.limits[0].active
    assert result.limits[0].price == Price(0.0, math.inf)
    assert laufruhe.solve(text.replace("max=0.0161301463", "max=0.0162")).objective.value == pytest.approx(
        result.objective.value, rel=1e-6
    )
    record = as_dict(result)["constraints"][0]
    assert record["shadow_price"] == 0.0
    assert not laufruhe.solve(text.replace("max=0.0161301463", "max=0.0161")).status.has_design


@pytest.mark.slow
def test_a_bound_at_a_kink_has_two_prices() -> None:
    """Check a weight of zero, which costs on one side only."""
    text = (INPUTS / "bound-at-a-kink.toml").read_text()
    result = laufruhe.solve(text)
    (bound,) = (one for one in result.decisions if one.name == "s0.u0.unbalance")
    assert bound.shadow_price == 0.0
    more = value(text.replace('["0 kg m","0.03962906 kg m"]', '["0.0005 kg m","0.03962906 kg m"]'))
    assert bound.tightening_price == pytest.approx((more - result.objective.value) / 0.0005, rel=0.03)
    assert bound.tightening_price == pytest.approx(7410.0, rel=0.02)
    record = as_dict(result)["decisions"]["s0.u0.unbalance"]
    assert (record["shadow_price"], record["tightening_price"]) == (0.0, bound.tightening_price)


@pytest.mark.slow
def test_an_envelope_has_a_price_with_places_open() -> None:
    """Compare the price with -2605 N/m from differences of two solves."""
    result = laufruhe.solve(INPUTS / "envelope.toml")
    (price,) = (one.price for one in result.limits if one.name == "envelope radius")
    assert price.relaxed == pytest.approx(2605.0, rel=0.01)
    assert price.tightened == price.relaxed


@pytest.mark.parametrize("count", [100, 3000])
def test_rows_on_a_circle(count: int) -> None:
    """Check that some of many rows of one length give the multiplier, the length of the slope."""
    turns = math.tau * np.arange(count) / count
    circle = Slopes(2.0 * np.stack([np.cos(turns), np.sin(turns)], axis=1), np.zeros((0, 2)))
    multipliers = prices_of([Slopes.smooth(np.array([-3.0, 4.0]))], [circle], np.zeros((0, 2)))
    assert multipliers is not None
    # balanced to a hundredth; no more of a circle than its radius pulls
    assert multipliers[0].relaxed == pytest.approx(2.5, rel=2e-3)
    assert multipliers[0].tightened == math.inf


def random_problem(rng: np.random.Generator) -> dict[str, Any]:
    """Return an engine with weights of every kind near their bounds, and limits that hold it."""
    throws = [0.0, *(float(x) for x in rng.uniform(0.0, 360.0, int(rng.integers(0, 3))))]
    weights = []
    for k in range(int(rng.integers(1, 4))):
        angle: Any = float(rng.uniform(0.0, 360.0))
        if rng.random() < 0.6:
            start = float(rng.uniform(-180.0, 180.0))
            angle = {"between": [start, start + float(rng.choice([40.0, 120.0, 360.0]))]}
        size = {"between": ["0 kg m", f"{rng.uniform(0.002, 0.03):.6f} kg m"]}
        weights.append(
            {"name": f"w{k}", "ratio": int(rng.choice([1, -1])),
             "position": [f"{rng.uniform(-80, 80):.3f} mm", "50 mm"],
             "unbalances": [{"x": f"{rng.uniform(-150, 150):.3f} mm", "radius": "40 mm", "unbalance": size,
                             "angle": angle}]}
        )  # fmt: skip
    engine = {
        "layout": "inline", "cycle": "four-stroke", "stroke": "90 mm", "rod_ratio": 0.28,
        "reciprocating_mass": "0.6 kg", "rotating_mass": "0.4 kg", "cylinder_spacing": "95 mm", "throws": throws,
    }  # fmt: skip
    found: dict[str, Any] = {
        "title": "prices", "tolerance": 1e-5, "engine": engine,
        "operating_points": [{"speed": "2500 rpm"}], "balancer_shafts": weights,
        "mounts": {"positions": [[f"{x} mm", f"{y} mm", "-30 mm"] for x, y in ((250, 180), (250, -180), (-250, 0))]},
        "objective": {"minimise": f"{rng.choice(['mean', 'rms', 'maximum'])} mount force"},
    }  # fmt: skip
    if len(throws) == 1:
        engine.pop("cylinder_spacing")
    if rng.random() < 0.7:
        found["constraints"] = [{"limit": "balancer mass", "max": f"{rng.uniform(0.1, 0.9):.4f} kg"}]
    return found


@pytest.mark.parametrize("seed", first_fast([134, 140, 145, 130, *range(12)], 0, 7))
def test_prices_are_the_slopes_of_problems_solved_again(seed: int) -> None:
    """Compare prices with optima for every active bound and limit moved a little both ways."""
    _moved_both_ways(random_problem(np.random.default_rng(seed)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "quantity"),
    [(0, "worst mean mount force"), (9, "worst mean mount force"), (1, "peak to peak mount force"),
     (10, "peak to peak mount force"), (5, "peak to peak shaking force"), (2, "peak to peak roll moment")],
)  # fmt: skip
def test_prices_of_norms_that_group_rows(seed: int, quantity: str) -> None:
    """Check worst means over points, and peak to peak over the cycle."""
    table = random_problem(np.random.default_rng(seed)) | {"objective": {"minimise": quantity}}
    table["operating_points"] = [{"name": "fast", "speed": "2500 rpm"}, {"name": "slow", "speed": "2400 rpm"}]
    _moved_both_ways(table)


@pytest.mark.slow
def test_a_star_alone_has_no_prices() -> None:
    """Check that an open star, which takes no small step, has no prices."""
    engine = {
        "layout": "inline", "cycle": "four-stroke", "stroke": "90 mm", "rod_ratio": 0.28, "cylinders": 5,
        "reciprocating_mass": "0.6 kg", "rotating_mass": "0.4 kg", "cylinder_spacing": "95 mm", "throws": "open",
        "firing_order": "open",
    }  # fmt: skip
    table = {"title": "star", "engine": engine, "operating_points": [{"speed": "2500 rpm"}]}
    minimum = value(table | {"objective": {"minimise": "maximum rocking couple"}})
    limit = {"limit": "maximum rocking couple", "max": f"{minimum * (1.0 + 2e-6)!r} N m"}
    result = laufruhe.solve(table | {"objective": {"minimise": "mean rocking couple"}, "constraints": [limit]})
    assert result.status == "optimal"
    assert result.limits[0].active
    assert math.isnan(result.limits[0].shadow_price)


def _moved_both_ways(table: dict[str, Any]) -> None:
    result = laufruhe.solve(table)
    here, left = result.objective.value, 2.0 * result.certificate.gap * result.objective.value
    for k, shaft in enumerate(table["balancer_shafts"]):
        weight = shaft["unbalances"][0]
        low = weight["unbalance"]["between"][0]
        (one,) = (d for d in result.decisions if d.name == f"w{k}.unbalance")
        if one.at_bound and one.value > 0.5 * one.upper:
            step = 0.01 * one.upper
            moved = [
                _with(table, k, {"unbalance": {"between": [low, f"{one.upper + sign * step:.9f} kg m"]}})
                for sign in (1.0, -1.0)
            ]
            _agrees(one.price, here, moved, step, left)
        turns = [d for d in result.decisions if d.name == f"w{k}.angle"]
        if turns and turns[0].at_bound:
            first, last = weight["angle"]["between"]
            at_first = turns[0].value - turns[0].lower < turns[0].upper - turns[0].value
            moved = [
                _with(table, k, {"angle": {"between": [first - d, last] if at_first else [first, last + d]}})
                for d in (0.3, -0.3)
            ]
            _agrees(turns[0].price, here, moved, math.radians(0.3), left)
    for limit in result.limits:
        step = 0.01 * limit.limit
        moved = [
            table | {"constraints": [{"limit": "balancer mass", "max": f"{limit.limit + sign * step:.9f} kg"}]}
            for sign in (1.0, -1.0)
        ]
        _agrees(limit.price, here, moved, step, left)


def _with(table: dict[str, Any], k: int, change: dict[str, Any]) -> dict[str, Any]:
    shafts = [dict(shaft) for shaft in table["balancer_shafts"]]
    shafts[k]["unbalances"] = [shafts[k]["unbalances"][0] | change]
    return table | {"balancer_shafts": shafts}


def _agrees(price: Price, here: float, moved: list[dict[str, Any]], step: float, left: float) -> None:
    """Check that slopes of short steps lie on both sides of the price of every edge but an angle."""
    relaxed, tightened = (laufruhe.solve(other).objective.value for other in moved)
    falls, rises = (here - relaxed) / step, (tightened - here) / step
    # error of a short step, and the gap of the proofs
    slack = 0.15 * max(abs(rises), abs(falls)) + 2.0 * left / step + 1e-3 * here * 1e-2 / step
    assert falls - slack <= price.relaxed <= price.tightened + 1e-12 <= rises + slack + 1e-12
    assert price.relaxed <= falls + slack + 0.5 * abs(rises - falls)
    assert price.tightened >= rises - slack - 0.5 * abs(rises - falls)


def test_multipliers_of_edges_that_hang_together() -> None:
    """Check that two edges share a price: |x| + |y| least, x + y at least 1, x at most 1, at (1, 0)."""
    objective = [Slopes(np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]]))]
    result = prices_of(objective, [Slopes.smooth(np.array([-1.0, -1.0]))], np.array([[1.0, 0.0]]))
    assert result is not None
    (limit, edge) = result
    assert (limit.relaxed, limit.tightened) == pytest.approx((1.0, 1.0), abs=1e-5)
    assert edge.tightened == pytest.approx(0.0, abs=1e-5)
    # a peak of two rows: any mixture balances, so each edge may carry all or nothing
    peak = [Slopes(np.array([[1.0, 0.0], [-1.0, 0.0]]), np.zeros((0, 2)))]
    (only,) = prices_of(peak, [], np.array([[1.0, 0.0]])) or ()
    assert (only.relaxed, only.tightened) == pytest.approx((0.0, 1.0), abs=1e-5)
    assert prices_of([Slopes.smooth(np.array([1.0, 0.0]))], [], np.array([[0.0, 1.0]])) is None


def test_two_limits_that_say_the_same_share_their_price() -> None:
    """Check x at most 1, twice, for 2 x: relaxing one gains nothing, tightening one costs all."""
    limit = Slopes.smooth(np.array([1.0, 0.0]))
    result = prices_of([Slopes.smooth(np.array([-2.0, 0.0]))], [limit, limit], np.zeros((0, 2)))
    assert result is not None
    for price in result:
        assert (price.relaxed, price.tightened) == pytest.approx((0.0, 2.0), abs=1e-4)


def test_a_limit_at_its_kink_beside_a_bound() -> None:
    """Check x + y with max(x, y) and x at most 1: relaxing the limit by e gains e, tightening costs 2 e."""
    kinked = Slopes(np.array([[1.0, 0.0], [0.0, 1.0]]), np.zeros((0, 2)))
    result = prices_of([Slopes.smooth(np.array([-1.0, -1.0]))], [kinked], np.array([[1.0, 0.0]]))
    assert result is not None
    limit, bound = result
    assert (limit.relaxed, limit.tightened) == pytest.approx((1.0, 2.0), abs=1e-4)
    assert (bound.relaxed, bound.tightened) == pytest.approx((0.0, 1.0), abs=1e-4)
    assert not limit.is_equal
    assert limit.other == limit.tightened


def test_sides_within_two_percent_are_one_price() -> None:
    assert Price.both(3.0).is_equal
    assert Price(3.0, 3.05).other is None
    assert Price(3.0, 3.1).other == 3.1
    assert (Price(1.0, 2.0) + Price.both(3.0)) == Price(4.0, 5.0)
    assert Price(1e-9, 2.0).floored(1e-6) == Price(0.0, 2.0)
