"""Cone programs by their dual: x and z are feasible and meet, independent of earlier solves."""

from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_array

from laufruhe.extensions.mount_relaxation.cone_program import (
    ConeProgram,
    ConeSolver,
)
from laufruhe.extensions.mount_relaxation.program import RootTerm, SdpProgram
from laufruhe.prove.mounts.dual_cones import LENGTH, SIDES, ZERO, column, matrix_of

SETTINGS = {"verbose": False, "max_threads": 1, "presolve_enable": False, "chordal_decomposition_enable": False}
SIZE, COUNT = 3, 4
ENTRIES = SIZE * (SIZE + 1) // 2


def spoilt(cones: ConeProgram, z: np.ndarray, by: float, noise: float, generator: Any) -> np.ndarray:
    """Return the multipliers of each cone off by a factor, and by their own size."""
    parts = np.split(z, np.cumsum([*map(len, cones.right)])[:-1])
    return np.concatenate([m * generator.uniform(0.0, by) + noise * generator.normal(size=m.shape) for m in parts])


class Program:
    """Program with numbers between -1 and 1, two matrices of trace one in equations, and a bounded length."""

    def __init__(self, seed: int) -> None:
        generator = np.random.default_rng(seed)
        self.matrices = [COUNT + k * ENTRIES + np.arange(ENTRIES) for k in range(2)]
        width = COUNT + 2 * ENTRIES
        traces = np.zeros((2, width))
        for row, own in zip(traces, self.matrices, strict=True):
            row[own] = column(np.eye(SIZE))
        inside = np.append(generator.uniform(-0.5, 0.5, COUNT), np.tile(column(np.eye(SIZE) / SIZE), 2))
        bound = generator.normal(size=(1, width))
        sides = np.zeros((2 * COUNT, width))
        sides[:, :COUNT] = np.concatenate([np.eye(COUNT), -np.eye(COUNT)])
        # sizes that are far apart are what scaling is for
        length = 1e3 * np.concatenate([np.zeros((1, width)), generator.normal(size=(3, width))])
        slack = 1e3 * np.array([3.0, 0.0, 0.0, 0.0])
        self.rows = np.concatenate([traces, bound, sides, length])
        right = [np.ones(2), bound @ inside, np.ones(2 * COUNT), slack + length @ inside]
        self.right = np.concatenate(right)
        self.cones = [
            (ZERO, 3),
            (SIDES, 2 * COUNT),
            (LENGTH, 4),
        ]
        self.costs = generator.normal(size=(3, width))

    def solver(self) -> ConeSolver:
        """Return the solver of the program."""
        return ConeSolver(coo_array(self.rows), self.right, self.cones, self.matrices, SETTINGS)


@pytest.mark.parametrize("seed", range(4))
def test_both_keep_their_conditions_and_meet(seed: int) -> None:
    program = Program(seed)
    for cost in program.costs:
        x, z = program.solver().solve(cost)
        slack = program.right - program.rows @ x
        assert np.abs(slack[:3]).max() < 1e-6
        assert slack[3 : 3 + 2 * COUNT].min() > -1e-6
        assert slack[-4] - np.linalg.norm(slack[-3:]) > -1e-3
        left = cost + program.rows.T @ z
        assert np.abs(left[:COUNT]).max() < 1e-6
        for own in program.matrices:
            assert np.linalg.eigvalsh(matrix_of(x[own], SIZE)).min() > -1e-6
            assert np.linalg.eigvalsh(matrix_of(left[own], SIZE)).min() > -1e-6
        assert z[3 : 3 + 2 * COUNT].min() > -1e-6
        assert z[-4] - np.linalg.norm(z[-3:]) > -1e-6
        assert cost @ x == pytest.approx(-program.right @ z, abs=1e-5)


def test_an_answer_does_not_depend_on_those_before() -> None:
    program = Program(7)
    several = program.solver()
    for cost in (*program.costs, *program.costs[::-1]):
        for solved, alone in zip(several.solve(cost), program.solver().solve(cost), strict=True):
            assert np.array_equal(solved, alone)


def test_a_root_is_proven_above_all_its_lengths() -> None:
    """Check three lengths without an open number."""
    rows = np.random.default_rng(5).normal(size=(3, 2, 1))
    root = RootTerm(1.0, 0.1, 5.0, ((0, rows),))
    program = SdpProgram((1,), (0.0,), 1, 0, np.zeros(1), np.array([25.0]), (), (), (), (root,), (), np.zeros(1))
    cones = ConeProgram(program)
    bound = cones.solve(cones.cost()).bound
    assert bound == pytest.approx(float(np.linalg.norm(rows[..., 0], axis=1).sum()), rel=1e-4)
