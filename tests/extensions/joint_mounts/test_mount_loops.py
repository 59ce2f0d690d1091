"""Open numbers of mounts as one loop, polynomials of their boxes, and limits at rest over them (E68, E70)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from attack.families import problem as random_problem
from lanes import first_fast
from laufruhe.extensions.joint_mounts.mount_loops import is_looped, mount_loop
from laufruhe.extensions.joint_mounts.rest_limits import RestLimits, coefficients, corners_of, mixed
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import TURNED
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
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
    polynomials = generator.normal(size=(2**count, 1 + count + count**2))
    whole = np.einsum("vkp,kp->v", mixed(count), polynomials)

    def powers(s: np.ndarray) -> np.ndarray:
        return np.concatenate([[1.0], s, np.outer(s, s).ravel()])

    for s in generator.uniform(-1.0, 1.0, (50, count)):
        shares = np.prod(0.5 * (1.0 + ends * s), axis=1)
        assert shares.sum() == pytest.approx(1.0)
        assert whole.min() - 1e-12 <= shares @ polynomials @ powers(s) <= whole.max() + 1e-12
        alone = coefficients(count) @ polynomials[0]
        assert alone.min() - 1e-12 <= polynomials[0] @ powers(s) <= alone.max() + 1e-12
    at_ends = whole.reshape((4,) * count)[tuple(np.ix_(*[[0, 3]] * count))].ravel()
    assert at_ends == pytest.approx([row @ powers(end) for row, end in zip(polynomials, ends, strict=True)])


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
            forces = np.concatenate([k @ g @ motion for g, k in zip(mounting.motions, each, strict=True)])
            forces += mounting.dynamic.forces(np.array([omega]), np.eye(6))[0] @ motion
            gone = np.concatenate([g @ motion for g in mounting.motions])
            turned = np.diag(share[loop.numbers])
            back = turned @ np.linalg.solve(np.eye(len(turned)) + loop.gain[w] @ turned, loop.inputs[w] @ load)
            for maps, true in ((loop.forces, forces), (loop.travels, gone)):
                found = maps[0][w] @ load + maps[1][w] @ back
                assert np.abs(found - true).max() <= 1e-9 * np.abs(true).max()


@pytest.mark.parametrize("seed", first_fast((780000, 780002, 780021, 780054), 2, 3))
def test_limits_at_rest_are_over_zero_only_where_they_break(seed: int) -> None:
    problem, generator = joint(seed), np.random.default_rng(seed)
    rest, near = RestLimits(problem), 0
    for lower, upper in boxes_of(problem, generator, 300, 0.02):
        over = max(float(each.min()) for each in rest.over(lower, upper))
        design = evaluate_start(problem.changed(engine=problem.design(upper.tolist(), problem.mount_decisions)))
        violation = max(design.check_limit(limit).violation for limit in problem.mount_limits)
        # none is over zero where a design keeps all, and small boxes tell of what breaks one
        assert over <= 0.0 or violation > 0.0
        assert violation < 0.1 or over > 0.0
        near += abs(violation) < 0.03
    assert near
