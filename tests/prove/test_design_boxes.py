"""Mounts and unbalances together: no design is under the bound of its box, and boxes close on the best (E68-E70)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from attack.families import objective
from attack.families import problem as random_problem
from lanes import first_fast
from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.bernstein import coefficients, corners_of, mixed
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import TURNED
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import lower_bound, minorant
from laufruhe.prove.mounts import design_boxes
from laufruhe.prove.mounts.design_boxes import DesignBoxes, mixes_corners
from laufruhe.prove.mounts.mount_loops import is_looped, mount_loop
from laufruhe.prove.mounts.mounted_loads import MountedLoads
from laufruhe.prove.mounts.rest_limits import RestLimits, priced
from laufruhe.solvers.mounts.corners import best_at
from laufruhe.solvers.mounts.places import started_at
from mounts.files import BLOCK, ENGINE, MOUNTS, changed, problem_of
from mounts.test_hydraulic_mounts import HYDRAULIC, RMS
from mounts.test_springs_of_a_place import PAD

# inclined, moved and stiffer mounts, of rms, mean and largest force and travel, with limits of loads and of modes
SEEDS = (780003, 780004, 780005, 780000, 780014, 780017, 780012, 780002)


def joint(seed: int) -> Problem:
    return laufruhe.load(random_problem("joint", seed)[0])


def boxes_of(
    problem: Problem, generator: np.random.Generator, count: int, widest: float
) -> Iterator[tuple[np.ndarray, ...]]:
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    for _ in range(count):
        middle, half = generator.uniform(low, high), (high - low) * widest * generator.random()
        yield np.maximum(middle - half, low), np.minimum(middle + half, high)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_no_value_of_a_polynomial_is_outside_of_its_coefficients(count: int) -> None:
    generator, ends = np.random.default_rng(count), corners_of(count)
    told = generator.normal(size=(2**count, 1 + count + count**2))
    whole = np.einsum("vkp,kp->v", mixed(count), told)

    def powers(s: np.ndarray) -> np.ndarray:
        return np.concatenate([[1.0], s, np.outer(s, s).ravel()])

    for s in generator.uniform(-1.0, 1.0, (50, count)):
        shares = np.prod(0.5 * (1.0 + ends * s), axis=1)
        assert shares.sum() == pytest.approx(1.0)
        assert whole.min() - 1e-12 <= shares @ told @ powers(s) <= whole.max() + 1e-12
        alone = coefficients(count) @ told[0]
        assert alone.min() - 1e-12 <= told[0] @ powers(s) <= alone.max() + 1e-12
    at_ends = whole.reshape((4,) * count)[tuple(np.ix_(*[[0, 3]] * count))].ravel()
    assert at_ends == pytest.approx([row @ powers(end) for row, end in zip(told, ends, strict=True)])


TURNED_LEFT = """name = "rear left"
turned = [{ between = [-20, 30], start = 5 }, 10, 4]
loss_factor = { between = [0.05, 0.3], start = 0.1 }
"""
DAMPED_LEFT = """name = "front left"
damping = ["9 N s/m", { between = ["0 N s/m", "4000 N s/m"], start = "500 N s/m" }, "0 N s/m"]
"""
ALL_KINDS = (
    ('name = "rear left"\n', TURNED_LEFT),
    ('name = "front left"\n', DAMPED_LEFT),
    ('["-300 mm", "200 mm", "0 mm"]', '["-300 mm", { between = ["150 mm", "280 mm"], start = "200 mm" }, "0 mm"]'),
)
LOOPS = {
    "hydraulic": HYDRAULIC,
    "joined": changed(MOUNTS, ('[[mounts.places]]\nname = "rear left"', PAD + '[[mounts.places]]\nname = "rear left"')),
    "all kinds open": changed(MOUNTS, *ALL_KINDS),
}


@pytest.mark.parametrize("kind", [*SEEDS, *LOOPS])
def test_a_loop_is_the_block_on_any_mounts_of_its_box(kind: int | str, tmp_path: Path) -> None:
    problem = joint(kind) if isinstance(kind, int) else problem_of(tmp_path, ENGINE, BLOCK, LOOPS[kind], RMS)
    generator = np.random.default_rng(3)
    assert is_looped(problem)
    omegas = np.array([0.0, 60.0, 210.0, 900.0])
    for lower, upper in boxes_of(problem, generator, 3, 0.5):
        loop = mount_loop(problem, omegas, lower, upper)
        share, load = generator.uniform(-1.0, 1.0, len(lower)), generator.normal(size=(6, 2)) @ [1.0, 1.0j]
        mounts = 0.5 * (lower + upper) + 0.5 * share * (upper - lower)
        for j, decision in enumerate(problem.mount_decisions):
            if TURNED.start <= decision.mount_drives[0].number < TURNED.stop:
                half = 0.25 * (upper[j] - lower[j])
                share[j] = math.tan(half * share[j]) / math.tan(half)
        mounting = mounting_in(problem.design(mounts.tolist(), problem.mount_decisions))
        for w, omega in enumerate(omegas):
            each = mounting.springs + 1j * (mounting.losses * (omega > 0.0) + omega * mounting.dampers)
            impedance = sum(g.T @ k @ g for g, k in zip(mounting.motions, each, strict=True))
            impedance = impedance + mounting.dynamic.impedance(np.array([omega]), np.eye(6))[0]
            # loads of the loop are in coordinates in which the mass is one
            root = np.linalg.inv(np.linalg.cholesky(mounting.block.mass_matrix))
            motion = np.linalg.solve(impedance - omega**2 * mounting.block.mass_matrix, np.linalg.solve(root, load))
            felt = np.concatenate([k @ g @ motion for g, k in zip(mounting.motions, each, strict=True)])
            felt += mounting.dynamic.forces(np.array([omega]), np.eye(6))[0] @ motion
            gone = np.concatenate([g @ motion for g in mounting.motions])
            turned = np.diag(share[loop.own])
            back = turned @ np.linalg.solve(np.eye(len(turned)) + loop.gain[w] @ turned, loop.met[w] @ load)
            for maps, true in ((loop.forces, felt), (loop.travels, gone)):
                found = maps[0][w] @ load + maps[1][w] @ back
                assert np.abs(found - true).max() <= 1e-9 * np.abs(true).max()


@pytest.mark.parametrize("seed", first_fast((780017, 780000, 780004, 780012), 3))
def test_multipliers_of_a_corner_say_the_same_of_other_mounts_as_rows_do(seed: int) -> None:
    problem, generator = joint(seed), np.random.default_rng(seed)
    loads = MountedLoads(problem)
    (_, mounts), (_, other) = boxes_of(problem, generator, 2, 0.5)
    given = loads.at(mounts)
    _, multipliers = best_at(given)
    # any rows of the limits say something, and have their price
    drawn = tuple(generator.normal(size=norm.constant.shape) for _, norm in given.limits)
    multipliers = replace(multipliers, limits=drawn)
    pairing, used = loads.pairing(given, multipliers), minorant(given, multipliers).multipliers
    # by the rows of the exact model
    held = problem.design(other.tolist(), problem.mount_decisions)
    there = AffineModel(replace(problem, engine=held).balance, keep_all=True).at(loads.samples)
    again = loads.at(other)
    for (_, mine), (_, exact) in zip(again.terms, there.terms, strict=True):
        size = np.abs(exact.constant).max()
        assert np.abs(mine.constant - exact.constant).max() <= 1e-9 * size
        assert np.abs(mine.slope - exact.slope).max() <= 1e-9 * np.abs(exact.slope).max()
    u = generator.normal(size=given.size)
    rows = sum(weight * np.vdot(z, norm.rows(u)) for (weight, norm), z in zip(again.terms, used.terms, strict=True))
    for (most, norm), z in zip(again.limits, used.limits, strict=True):
        rows += np.vdot(z, norm.rows(u)) - norm.dual_norm(z) * most
    loop, orders = mount_loop(problem, loads.orders.omegas, other, other), loads.orders
    felt = orders.loads[:, 0] + np.einsum("c,wci->wi", u, orders.loads[:, 1:])
    by_orders = pairing.constant + pairing.slopes @ u
    for duals, maps in ((pairing.forces, loop.forces), (pairing.travels, loop.travels)):
        by_orders += np.einsum("wr,wri,wi->", duals.conj(), maps[0], felt).real
    assert by_orders == pytest.approx(rows, rel=1e-9)


@pytest.mark.parametrize("seed", first_fast((780017, 780003), 1))
def test_multipliers_of_a_corner_that_keeps_no_limits_call_it_bad(seed: int) -> None:
    """Its bound is over the value of the unbalances told, and those are the best where the limits are kept."""
    problem, generator = joint(seed), np.random.default_rng(1)
    ((_, mounts),) = boxes_of(problem, generator, 1, 0.5)
    given = MountedLoads(problem).at(mounts)
    x, multipliers = best_at(given)
    assert all(norm.value(x) <= most * (1.0 + 1e-6) for most, norm in given.limits)
    assert lower_bound(given, multipliers).value == pytest.approx(given.objective(x), rel=1e-3)
    tight = replace(given, limits=tuple((0.3 * most, norm) for most, norm in given.limits))
    x, multipliers = best_at(tight)
    assert any(norm.value(x) > most * 1.01 for most, norm in tight.limits)
    # by once the value of these unbalances
    assert lower_bound(tight, multipliers).value > 1.99 * tight.objective(x) > 0.0


def test_a_corner_is_proven_as_closely_whatever_the_weights() -> None:
    problem = joint(780017)
    ((_, mounts),) = boxes_of(problem, np.random.default_rng(1), 1, 0.5)
    given, gaps = MountedLoads(problem).at(mounts), []
    for times in (1e-6, 1.0, 1e6):
        weighted = replace(given, terms=tuple((times * weight, norm) for weight, norm in given.terms))
        x, multipliers = best_at(weighted)
        gaps.append(1.0 - lower_bound(weighted, multipliers).value / weighted.objective(x))
    assert gaps == pytest.approx([gaps[1]] * 3, rel=1e-3)
    assert 0.0 <= gaps[1] < 1e-5


@pytest.mark.parametrize("seed", first_fast((780004, 780001, 780000), 2))
def test_what_multipliers_say_in_a_box_is_a_polynomial_and_a_rest(seed: int) -> None:
    problem, generator = joint(seed), np.random.default_rng(seed)
    boxes, near_rest = DesignBoxes(problem, math.inf, best_at, lambda *_: math.inf), 0.0
    for lower, upper in boxes_of(problem, generator, 5, 0.25):
        pairing = boxes.corner(lower).pairing
        columns, told, rest = boxes.said(pairing, lower, upper)
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
            felt = boxes.loads.orders.loads[:, 0] + np.einsum("c,wci->wi", u, boxes.loads.orders.loads[:, 1:])
            true = pairing.constant + pairing.slopes @ u
            for duals, maps in ((pairing.forces, loop.forces), (pairing.travels, loop.travels)):
                true += np.einsum("wr,wri,wi->", duals.conj(), maps[0], felt).real
            by = told @ np.concatenate([[1.0], s, np.outer(s, s).ravel()])
            apart = np.append(1.0, u - columns)
            room = float(rest.sum(axis=0) @ np.abs(apart))
            assert abs(true - by @ apart) <= room + 1e-9 * abs(true)
            near_rest = max(near_rest, abs(true - by @ apart) / room)
    # and the rest is no guess that is far too large
    assert near_rest > 1e-3


def test_the_least_over_unbalances_is_that_of_their_sets() -> None:
    problem, generator = joint(780004), np.random.default_rng(1)
    boxes = DesignBoxes(problem, math.inf, best_at, lambda *_: math.inf)
    domains = boxes.loads.domains
    for slopes in generator.normal(size=(10, 2)):
        near = generator.normal(size=2)
        inside = [
            np.concatenate([domain.project(u[domain.columns]) for domain in domains])
            for u in 10.0 * generator.normal(size=(2000, 2))
        ]
        least = min(float(slopes @ (u - near)) for u in inside)
        assert boxes.least(slopes, near) <= least + 1e-12
        assert boxes.least(slopes, near) == pytest.approx(least, rel=0.02, abs=0.02)


@pytest.mark.parametrize("seed", first_fast(SEEDS[:6], 0, 2))
def test_no_design_of_a_box_is_under_its_bound(seed: int) -> None:
    problem, generator = joint(seed), np.random.default_rng(seed)
    boxes, told = DesignBoxes(problem, math.inf, best_at, lambda *_: math.inf), 0
    for lower, upper in boxes_of(problem, generator, 6, 0.08):
        bound = float(boxes.bounds(lower[None], upper[None])[0][0])
        told += bound > 0.0
        for mounts in generator.uniform(lower, upper, (12, len(lower))):
            at = boxes.loads.at(mounts)
            columns, _ = best_at(at)
            near = [columns, *(columns + 0.05 * generator.normal(size=(4, at.size)) * at.scales)]
            for each in near:
                inside = np.concatenate([domain.project(each[domain.columns]) for domain in at.domains])
                design = started_at(problem, (mounts.tolist(), inside))
                if design is not None and design.excess <= 0.0:
                    assert bound <= design.value * (1.0 + 1e-7)
    assert told >= 2


@pytest.mark.slow
def test_loads_of_too_many_numbers_have_no_boxes(monkeypatch: pytest.MonkeyPatch) -> None:
    boxes = DesignBoxes(joint(780004), math.inf, best_at, lambda *_: math.inf)
    count = boxes.loads.rows * boxes.loads.columns
    for most, few, worth in ((count, 2, True), (count - 1, 2, False), (count, 10**9, False)):
        monkeypatch.setattr(design_boxes, "MOST_NUMBERS", most)
        monkeypatch.setattr(design_boxes, "FEW", few)
        assert (boxes.most_boxes > 0) is worth


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
def test_what_is_asked_may_be_crossed(kind: str) -> None:
    table, rng = random_problem("joint", 780004)
    terms, limits = CROSSED[kind]
    table["objective"] = objective([{"quantity": name, "weight": weight} for name, weight in terms])
    table["constraints"] = [{"limit": name, "max": most} for name, most in limits]
    first = table["operating_points"][0]
    table["operating_points"] = [first, {"name": "faster", "speed": "160 rad/s", "weight": 0.7}]
    problem = laufruhe.load(table)
    assert mixes_corners(problem)
    boxes, told = DesignBoxes(problem, math.inf, best_at, lambda *_: math.inf), 0
    for lower, upper in boxes_of(problem, rng, 1, 0.05):
        bound = float(boxes.bounds(lower[None], upper[None])[0][0])
        for mounts in rng.uniform(lower, upper, (4, len(lower))):
            at = boxes.loads.at(mounts)
            columns, multipliers = best_at(at)
            design = started_at(problem, (mounts.tolist(), columns))
            if design is not None and design.excess <= 0.0:
                told += bound > 0.5 * design.value
                assert bound <= design.value * (1.0 + 1e-7)
            # widened limits have multipliers too, which are so of any unbalances
            u = np.concatenate([d.project(rng.normal(size=d.width) * d.scale) for d in at.domains])
            assert lower_bound(at, multipliers).value <= at.objective(u) or at.excess(u) > 0.0
    assert told


@pytest.mark.parametrize("seed", first_fast((780000, 780002, 780021, 780054), 2, 3))
def test_limits_at_rest_are_over_zero_only_where_they_break(seed: int) -> None:
    problem, generator = joint(seed), np.random.default_rng(seed)
    rest, near = RestLimits(problem), 0
    for lower, upper in boxes_of(problem, generator, 300, 0.02):
        over = max(float(each.min()) for each in rest.over(lower, upper))
        design = evaluate_start(problem.changed(engine=problem.design(upper.tolist(), problem.mount_decisions)))
        excess = max(design.standing(limit).excess for limit in problem.mount_limits)
        # none is over zero where a design keeps all, and small boxes tell of what breaks one
        assert over <= 0.0 or excess > 0.0
        assert excess < 0.1 or over > 0.0
        near += abs(excess) < 0.03
    assert near


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
