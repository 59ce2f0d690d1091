"""Limits of decoupling in the relaxation of spring forces, which exclude no feasible design (E56, E59)."""

from __future__ import annotations

import numpy as np
import pytest

from extensions.mount_relaxation.test_dual import spoilt
from extensions.mount_relaxation.test_spring_bound import powertrain
from laufruhe.extensions.mount_relaxation.cone_program import ConeProgram, Solution
from laufruhe.extensions.mount_relaxation.constraints import ModeConstraints, mode_basis, mode_constraints
from laufruhe.extensions.mount_relaxation.open_mounts import open_mounts
from laufruhe.extensions.mount_relaxation.program import SdpProgram
from laufruhe.extensions.mount_relaxation.prover import narrowed, spring_bound
from laufruhe.extensions.mount_relaxation.search import SdpRelaxation
from laufruhe.files.reader import load
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.dual_cones import column, in_dual_cones
from laufruhe.prove.mounts.provers import Question

DECOUPLED = {"limit": "kinetic-energy decoupling", "motions": ["bounce", "roll"], "min": "0.5"}


def decoupled(opened: int, turned: bool = False) -> Problem:
    """Return the powertrain with so many open springs, bounce and roll each with half of a mode at least."""
    tables = powertrain("2", "4 Hz", opened)
    tables["constraints"].append(dict(DECOUPLED))
    tables["search"] = {"boxes": 8, "starts": 4}
    if turned:
        tables["mounts"]["places"][1]["turned"] = [{"between": [-20, 20], "start": 3}, 0, 0]
    return load(tables)


def sides(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    return low, high


@pytest.mark.parametrize("turned", [False, True])
def test_every_mode_is_in_its_shapes(turned: bool) -> None:
    """Check that moments of modes, and every s times these, meet all conditions of a box around them."""
    problem, generator = decoupled(9, turned), np.random.default_rng(3)
    low, high = sides(problem)
    for _ in range(12):
        width = generator.choice([1.0, 0.2]) * (high - low)
        below = low + generator.random(len(low)) * (high - low - width)
        x = below + generator.random(len(low)) ** 3 * width
        mounts = open_mounts(problem, below, below + width)
        mounting = mounting_in(problem.design(x.tolist(), problem.mount_decisions))
        stiffness = mounts.root @ mounting.stiffness @ mounts.root.T
        squares, modes = np.linalg.eigh(stiffness)
        if not (mounts.lowest <= squares[0] and squares[-1] <= mounts.highest):
            continue
        slopes = mounts.slopes.reshape(mounts.numbers, -1).T
        s = np.linalg.lstsq(slopes, (stiffness - mounts.middle).ravel(), rcond=None)[0]
        for motion in range(6):
            along, momentum = mounts.root[:, motion], np.linalg.inv(mounts.root)[motion]
            shares = (along @ modes) * (momentum @ modes)
            k = int(np.argmax(shares))
            assert shares[k] == pytest.approx(mounting.modes.energy[motion].max())
            basis = mode_basis(mounts.root, motion, 0.999 * float(shares[k]))
            z = np.linalg.solve(basis, modes[:, k] / (momentum @ modes[:, k]))
            assert z[0] == pytest.approx(1.0)
            assert float(z[1:] @ z[1:]) <= 1.0
            shapes = mode_constraints(mounts, basis, z[1:] - 0.1, z[1:] + 0.1)
            moments = np.outer(z, z) * np.concatenate([[1.0], s])[:, None, None]
            for tensor in shapes.matrices:
                assert np.linalg.eigvalsh(np.einsum("mabxy,mxy->ab", tensor, moments))[0] >= -1e-8
            assert np.einsum("nmxy,mxy->n", shapes.sides, moments).min() >= -1e-8
            assert np.abs(np.einsum("nmxy,mxy->n", shapes.equal, moments)).max() <= 1e-8


def designs_about(problem: Problem, near: np.ndarray, count: int) -> list[tuple[np.ndarray, float]]:
    """Return designs that keep all limits, and their values."""
    generator, evaluation, found = np.random.default_rng(5), evaluate(problem), []
    low, high = sides(problem)
    while len(found) < count:
        x = np.clip(near * np.exp(generator.normal(0.0, 0.25, len(near))), low, high)
        each = with_mounts(evaluation, problem.design(x.tolist()))
        if each.violation(problem.limits) <= 0.0:
            found.append((x, objective_value(problem, each)))
    return found


NEAR = np.array([90e3, 40e3, 110e3, 60e3])


def test_sides_hold_for_any_multipliers_of_a_solver() -> None:
    """Check least s and least w of all better designs, with random multipliers too."""
    problem, generator = decoupled(4), np.random.default_rng(11)
    designs = designs_about(problem, NEAR, 12)
    best, minimum = min(designs, key=lambda pair: pair[1])
    boxes = SdpRelaxation(problem, 1.1 * minimum, 1e-3, best.tolist())
    program, mounts = boxes.cut_off(boxes.lower, boxes.upper)
    assert len(program.modes) == 2
    stated = ConeProgram(program)
    half = 0.5 * (boxes.upper - boxes.lower)
    inside = [x for x, value in designs if value <= 1.1 * minimum]
    for number in (0, 2):
        cost = stated.cost(np.eye(program.numbers + 10)[number])
        answer = stated.solve(cost)
        side = mounts.single_decisions[number]
        assert side is not None
        smallest = min((x[side] - 0.5 * (boxes.lower + boxes.upper)[side]) / half[side] for x in inside)
        assert -1.01 <= answer.bound <= smallest
        # by the solver of the aim before, as exactly as it is worth
        proven, spring_mounts = stated.minimum(np.eye(program.numbers + 10)[number])
        assert answer.bound - 0.05 < proven <= min(smallest, spring_mounts[number] + 0.05)
        for by, noise in ((2.0, 0.0), (1.0, 1e-3), (0.0, 1.0), (0.0, 0.0)):
            assert stated.bound(cost, spoilt(stated, answer.z, by, noise, generator)) <= smallest


def of_mode(mode: ModeConstraints, count: int) -> SdpProgram:
    """Return a program of one mode and numbers alone."""
    none = np.zeros(0)
    return SdpProgram((1,), (0.0,), count, 0, none, none, (), (), (), (), (mode,), np.zeros(count))


@pytest.mark.parametrize("size", [1.0, 0.1, 0.0])
def test_the_bound_of_a_mode_is_under_its_lagrangian(size: float) -> None:
    """Check random conditions and multipliers for w in the unit ball and s between -1 and 1."""
    r, count, d = np.random.default_rng(6), 2, 6
    for _ in range(20):
        square = r.normal(size=(3, 3, 1 + count, d, d))
        mode = ModeConstraints(
            (0.5 * (square + square.transpose(1, 0, 2, 3, 4)),), r.normal(size=(4, 1 + count, d, d)),
            r.normal(size=(2, 1 + count, d, d)),
        )  # fmt: skip
        cones = ConeProgram(of_mode(mode, count))
        multipliers, slope = size * r.normal(size=sum(map(len, cones.right))), r.normal(size=count + d - 1)
        cost = cones.cost(slope)
        bound, z = cones.bound(cost, multipliers), in_dual_cones(multipliers, cones.cones)
        values = []
        for w, s in zip(r.normal(size=(200, d - 1)), r.uniform(-1.0, 1.0, (200, count)), strict=True):
            shape = np.append(1.0, w / np.linalg.norm(w))
            moments = np.outer(shape, shape) * np.append(1.0, s)[:, None, None]
            x = np.concatenate([s, [1.0], column(moments).ravel()])
            assert cost @ x == pytest.approx(slope @ np.append(s, shape[1:]))
            values.append(cost @ x + z @ (cones._matrix @ x - np.concatenate(cones.right)))
        assert bound <= min(values) + 1e-9


@pytest.mark.slow
def test_a_narrowed_box_keeps_all_better_designs_and_halves_are_dropped_rightly() -> None:
    """Check narrowed boxes and dropped halves against better designs, and the bound of the whole."""
    problem = decoupled(4)
    designs = designs_about(problem, NEAR, 60)
    best, minimum = min(designs, key=lambda pair: pair[1])
    boxes = SdpRelaxation(problem, 1.02 * minimum, 1e-3, best.tolist())
    found, _ = narrowed(boxes, boxes.lower, boxes.upper, np.ones(len(boxes.lower)))
    assert found is not None
    for x, value in designs:
        if value <= 1.02 * minimum:
            assert np.all((found[0][:4] <= x) & (x <= found[1][:4]))
    assert np.prod((found[1] - found[0])[:4] / (boxes.upper - boxes.lower)[:4]) < 0.5
    assert 0.0 < spring_bound(Question(problem, minimum, 0.1 * minimum, best.tolist())).bound <= minimum


@pytest.mark.parametrize("seed", range(3))
def test_products_that_are_not_those_of_the_means_pull(seed: int) -> None:
    """Check that scores of s and of w add up, and vanish for products of the means."""
    rng, numbers, d = np.random.default_rng(seed), 3, 6
    shapes = ModeConstraints((), rng.normal(size=(4, 1 + numbers, d, d)), rng.normal(size=(2, 1 + numbers, d, d)))
    cones = ConeProgram(of_mode(shapes, numbers))
    prices = rng.normal(size=sum(map(len, cones.right)))
    s, z = rng.uniform(-1.0, 1.0, numbers), np.concatenate([[1.0], rng.normal(size=d - 1)])

    def moments(own: float, crossed: float) -> np.ndarray:
        plain, mixed = rng_of.normal(size=(d, d)), rng_of.normal(size=(numbers, d, d))
        plain[0] = plain[:, 0] = 0.0
        first = np.outer(z, z) + own * (plain + plain.T)
        return np.concatenate([first[None], s[:, None, None] * first + crossed * (mixed + mixed.swapaxes(1, 2))])

    pulled = []
    for own, crossed in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        rng_of = np.random.default_rng(seed + 10)
        (score,) = cones.mode_scores(Solution(0.0, s, (), (moments(own, crossed),), prices))
        pulled.append(score)
    none, plain, mixed, both = pulled
    for k in range(2):
        assert np.all(none[k] < 1e-9)
        np.testing.assert_allclose(both[k], plain[k] + mixed[k], rtol=1e-9, atol=1e-12)
        assert np.all(mixed[k] > 0.0)
    assert np.all(plain[0] < 1e-9)
    assert np.all(plain[1] > 0.0)
