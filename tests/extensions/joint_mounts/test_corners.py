"""Mounts and unbalances together: no design is under the bound of its box, and boxes close on the best (E68-E70)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import laufruhe
from attack.families import objective
from attack.families import problem as random_problem
from claims.test_broken_bounders import first_times, scaled
from extensions.joint_mounts.test_mount_loops import SEEDS, boxes_of, joint
from lanes import first_fast
from laufruhe.errors import BoundError
from laufruhe.extensions.joint_mounts import corner_boxes
from laufruhe.extensions.joint_mounts.corner_boxes import DesignBoxes, best_at, mixes_corners, priced
from laufruhe.extensions.joint_mounts.mount_loops import mount_loop
from laufruhe.extensions.joint_mounts.mounted_loads import MountedLoads
from laufruhe.load_models.affine import AffineModel
from laufruhe.problem.decision import TURNED
from laufruhe.prove.certificate import lower_bound, minorant
from laufruhe.solvers.mounts.starts import design_at_start


@pytest.mark.parametrize("seed", first_fast((780017, 780000, 780004, 780012), 3))
def test_multipliers_of_a_corner_say_the_same_of_other_mounts_as_rows_do(seed: int) -> None:
    problem, generator = joint(seed), np.random.default_rng(seed)
    loads = MountedLoads(problem)
    (_, mounts), (_, other) = boxes_of(problem, generator, 2, 0.5)
    mounted_loads = loads.at(mounts)
    _, multipliers = best_at(mounted_loads)
    # any rows of the limits say something, and have their price
    drawn = tuple(generator.normal(size=norm.constant.shape) for _, norm in mounted_loads.limits)
    multipliers = replace(multipliers, limits=drawn)
    pairing, used = loads.pairing(mounted_loads, multipliers), minorant(mounted_loads, multipliers).multipliers
    # by the rows of the exact model
    held = problem.design(other.tolist(), problem.mount_decisions)
    there = AffineModel(replace(problem, engine=held).balance, keep_all=True).at(loads.samples)
    again = loads.at(other)
    for (_, mine), (_, exact) in zip(again.terms, there.terms, strict=True):
        size = np.abs(exact.constant).max()
        assert np.abs(mine.constant - exact.constant).max() <= 1e-9 * size
        assert np.abs(mine.slope - exact.slope).max() <= 1e-9 * np.abs(exact.slope).max()
    u = generator.normal(size=mounted_loads.size)
    rows = sum(weight * np.vdot(z, norm.rows(u)) for (weight, norm), z in zip(again.terms, used.terms, strict=True))
    for (maximum, norm), z in zip(again.limits, used.limits, strict=True):
        rows += np.vdot(z, norm.rows(u)) - norm.dual_norm(z) * maximum
    loop, orders = mount_loop(problem, loads.orders.omegas, other, other), loads.orders
    total_loads = orders.loads[:, 0] + np.einsum("c,wci->wi", u, orders.loads[:, 1:])
    by_orders = pairing.constant + pairing.slopes @ u
    for duals, maps in ((pairing.forces, loop.forces), (pairing.travels, loop.travels)):
        by_orders += np.einsum("wr,wri,wi->", duals.conj(), maps[0], total_loads).real
    assert by_orders == pytest.approx(rows, rel=1e-9)


@pytest.mark.parametrize("seed", first_fast((780017, 780003), 1))
def test_multipliers_of_a_corner_that_keeps_no_limits_call_it_bad(seed: int) -> None:
    """Check that the bound of an infeasible corner is above the value of its unbalances."""
    problem, generator = joint(seed), np.random.default_rng(1)
    ((_, mounts),) = boxes_of(problem, generator, 1, 0.5)
    mounted_loads = MountedLoads(problem).at(mounts)
    x, multipliers = best_at(mounted_loads)
    assert all(norm.value(x) <= maximum * (1.0 + 1e-6) for maximum, norm in mounted_loads.limits)
    assert lower_bound(mounted_loads, multipliers).value == pytest.approx(mounted_loads.objective(x), rel=1e-3)
    tight = replace(mounted_loads, limits=tuple((0.3 * maximum, norm) for maximum, norm in mounted_loads.limits))
    x, multipliers = best_at(tight)
    assert any(norm.value(x) > maximum * 1.01 for maximum, norm in tight.limits)
    # by once the value of these unbalances
    assert lower_bound(tight, multipliers).value > 1.99 * tight.objective(x) > 0.0


def test_a_corner_is_proven_as_closely_for_any_weights() -> None:
    problem = joint(780017)
    ((_, mounts),) = boxes_of(problem, np.random.default_rng(1), 1, 0.5)
    mounted_loads, gaps = MountedLoads(problem).at(mounts), []
    for times in (1e-6, 1.0, 1e6):
        weighted = replace(mounted_loads, terms=tuple((times * weight, norm) for weight, norm in mounted_loads.terms))
        x, multipliers = best_at(weighted)
        gaps.append(1.0 - lower_bound(weighted, multipliers).value / weighted.objective(x))
    assert gaps == pytest.approx([gaps[1]] * 3, rel=1e-3)
    assert 0.0 <= gaps[1] < 1e-5


@pytest.mark.parametrize("seed", first_fast((780004, 780001, 780000), 2))
def test_multipliers_in_a_box_are_a_polynomial_and_a_remainder(seed: int) -> None:
    problem, generator = joint(seed), np.random.default_rng(seed)
    boxes, near_rest = DesignBoxes(problem, math.inf, lambda *_: math.inf), 0.0
    for lower, upper in boxes_of(problem, generator, 5, 0.25):
        pairing = boxes.corner(lower).pairing
        columns = boxes.corner(lower).columns
        loaded = boxes.loaded(boxes.balanced_loop(lower, upper), columns)
        polynomial, rest = boxes.expanded(pairing, loaded, columns)
        if not np.isfinite(rest).all():
            continue
        for mounts in generator.uniform(lower, upper, (8, len(lower))):
            s = (2.0 * mounts - lower - upper) / (upper - lower)
            for j, decision in enumerate(problem.mount_decisions):
                if TURNED.start <= decision.mount_drives[0].number < TURNED.stop:
                    half = 0.25 * (upper[j] - lower[j])
                    s[j] = math.tan(half * s[j]) / math.tan(half)
            u = columns + generator.normal(size=len(columns))
            loop = mount_loop(problem, boxes.loads.orders.omegas, mounts, mounts)
            loads = boxes.loads.orders.loads[:, 0] + np.einsum("c,wci->wi", u, boxes.loads.orders.loads[:, 1:])
            true = pairing.constant + pairing.slopes @ u
            for duals, maps in ((pairing.forces, loop.forces), (pairing.travels, loop.travels)):
                true += np.einsum("wr,wri,wi->", duals.conj(), maps[0], loads).real
            by = polynomial @ np.concatenate([[1.0], s, np.outer(s, s).ravel()])
            apart = np.append(1.0, u - columns)
            room = float(rest.sum(axis=0) @ np.abs(apart))
            assert abs(true - by @ apart) <= room + 1e-9 * abs(true)
            near_rest = max(near_rest, abs(true - by @ apart) / room)
    # and the rest is no guess that is far too large
    assert near_rest > 1e-3


def test_the_least_over_unbalances_is_that_of_their_sets() -> None:
    problem, generator = joint(780004), np.random.default_rng(1)
    boxes = DesignBoxes(problem, math.inf, lambda *_: math.inf)
    domains = boxes.loads.domains
    for slopes in generator.normal(size=(10, 2)):
        near = generator.normal(size=2)
        inside = [
            np.concatenate([domain.project(u[domain.columns]) for domain in domains])
            for u in 10.0 * generator.normal(size=(2000, 2))
        ]
        minimum = min(float(slopes @ (u - near)) for u in inside)
        assert boxes.minimum(slopes, near) <= minimum + 1e-12
        assert boxes.minimum(slopes, near) == pytest.approx(minimum, rel=0.02, abs=0.02)


@pytest.mark.parametrize("seed", first_fast(SEEDS[:6], 0, 2))
def test_no_design_of_a_box_is_under_its_bound(seed: int) -> None:
    problem, generator = joint(seed), np.random.default_rng(seed)
    boxes, informative = DesignBoxes(problem, math.inf, lambda *_: math.inf), 0
    for lower, upper in boxes_of(problem, generator, 6, 0.08):
        bound = float(boxes.bounds(lower[None], upper[None])[0][0])
        informative += bound > 0.0
        for mounts in generator.uniform(lower, upper, (4, len(lower))):
            at = boxes.loads.at(mounts)
            columns, _ = best_at(at)
            near = [columns, *(columns + 0.05 * generator.normal(size=(4, at.size)) * at.scales)]
            for each in near:
                inside = np.concatenate([domain.project(each[domain.columns]) for domain in at.domains])
                design = design_at_start(problem, (mounts.tolist(), inside))
                if design is not None and design.violation <= 0.0:
                    assert bound <= design.value * (1.0 + 1e-7)
    assert informative >= 2


def test_a_spent_budget_computes_no_more_corners(monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that known corners bound the halves of a box after the budget is spent."""
    problem = joint(780003)
    boxes = DesignBoxes(problem, math.inf, lambda *_: math.inf)
    ((lower, upper),) = boxes_of(problem, np.random.default_rng(2), 1, 0.02)
    whole = float(boxes.bounds(lower[None], upper[None])[0][0])
    known = len(boxes._corners)
    monkeypatch.setattr(DesignBoxes, "max_corners", known)
    middle = np.where(np.arange(len(lower)) == 0, 0.5 * (lower + upper), upper)
    half = float(boxes.bounds(lower[None], middle[None])[0][0])
    assert len(boxes._corners) == known
    assert whole > 0.0
    assert half > 0.0


@pytest.mark.slow
def test_loads_of_too_many_numbers_have_no_boxes(monkeypatch: pytest.MonkeyPatch) -> None:
    boxes = DesignBoxes(joint(780004), math.inf, lambda *_: math.inf)
    count = boxes.loads.rows * 3 * (1 + sum(domain.width for domain in boxes.loads.domains))
    for maximum, few, worth in ((count, 2, True), (count - 1, 2, False), (count, 10**9, False)):
        monkeypatch.setattr(corner_boxes, "MAX_NUMBERS", maximum)
        monkeypatch.setattr(corner_boxes, "MIN_CORNER_SHARE", few)
        assert (boxes.max_boxes > 0) is worth


CROSSED = {
    "loads of the block, and a mass": (
        [("mean mount force", 1.0), ("rms shaking force", 0.2), ("added mass", 3.0)],
        [("added mass", "1.5 kg"), ("maximum mount travel", "8 mm")],
    ),
    "several at two points": (
        [("peak to peak mount travel", 2e4), ("worst mean mount force", 1.0), ("maximum mount force", 0.3)],
        [("maximum rocking couple", "6000 N m"), ("rms mount travel", "6 mm")],
    ),
}


@pytest.mark.parametrize("kind", first_fast(CROSSED, 0))
def test_objectives_and_limits_may_mix_corners(kind: str) -> None:
    table, rng = random_problem("joint", 780004)
    terms, limits = CROSSED[kind]
    table["objective"] = objective([{"quantity": name, "weight": weight} for name, weight in terms])
    table["constraints"] = [{"limit": name, "max": maximum} for name, maximum in limits]
    first = table["operating_points"][0]
    table["operating_points"] = [first, {"name": "faster", "speed": "160 rad/s", "weight": 0.7}]
    problem = laufruhe.load(table)
    assert mixes_corners(problem)
    boxes, informative = DesignBoxes(problem, math.inf, lambda *_: math.inf), 0
    for lower, upper in boxes_of(problem, rng, 1, 0.05):
        bound = float(boxes.bounds(lower[None], upper[None])[0][0])
        for mounts in rng.uniform(lower, upper, (4, len(lower))):
            at = boxes.loads.at(mounts)
            columns, multipliers = best_at(at)
            design = design_at_start(problem, (mounts.tolist(), columns))
            if design is not None and design.violation <= 0.0:
                informative += bound > 0.5 * design.value
                assert bound <= design.value * (1.0 + 1e-7)
            # widened limits have multipliers too, which are so of any unbalances
            u = np.concatenate([d.project(rng.normal(size=d.width) * d.scale) for d in at.domains])
            assert lower_bound(at, multipliers).value <= at.objective(u) or at.violation(u) > 0.0
    assert informative


def test_a_price_lifts_the_least_as_far_as_a_limit_allows() -> None:
    values, over = np.array([1.0, 4.0, 3.0]), np.array([1.0, -1.0, -0.5])
    # the first place breaks the limit: mixed with the second by halves it keeps it
    assert priced(values, [over]).min() == pytest.approx(3.0 - 2.0 / 3.0, rel=1e-6)
    assert np.isinf(priced(values, [np.abs(over)])).all()
    assert priced(values, [-np.abs(over)]).min() == 1.0


@pytest.mark.parametrize("seed", first_fast((780003, 780018, 780014, 780004, 780017), 0, 3))
def test_boxes_close_on_the_best_design(seed: int) -> None:
    problem = joint(seed)
    assert mixes_corners(problem)
    result = laufruhe.solve(problem)
    assert result.certificate is not None
    assert result.certificate.gap <= problem.tolerance


@pytest.mark.slow
def test_a_broken_bounder_of_mounts_with_unbalances(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = laufruhe.load(random_problem("joint", 780003)[0])
    scaled(DesignBoxes, "_bound", first_times(1.05))(monkeypatch)
    with pytest.raises(BoundError, match="boxes of mounts, with unbalances"):
        laufruhe.solve(problem)
