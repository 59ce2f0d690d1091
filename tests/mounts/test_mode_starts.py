"""Start of modes in a smooth program: each in the column of the motion with most of its energy."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from laufruhe.files.reader import load
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Problem
from laufruhe.solvers.smooth.constraint_collector import ConstraintCollector
from laufruhe.solvers.smooth.variables import ModeVariables
from problem_files import PROBLEMS


@pytest.fixture(scope="module")
def problem() -> Problem:
    return load(PROBLEMS / "powertrain-decoupling.toml")


@pytest.mark.parametrize("seed", range(5))
def test_motions_and_modes_are_paired_as_an_assignment_pairs_them(problem: Problem, seed: int) -> None:
    """Compare the pairs of six motions and modes with SciPy's linear assignment."""
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    x = low + (high - low) * np.random.default_rng(seed).random(len(low))
    mounting = mounting_in(problem.design(x.tolist(), problem.mount_decisions))
    modes = ModeVariables(problem, ConstraintCollector())
    modes.hold(np.eye(6), np.eye(6), mounting)
    _, squares = modes.start(mounting)
    _, columns = linear_sum_assignment(-mounting.modes.energy)
    assert squares * modes._unit == pytest.approx(mounting.modes.squares[columns], rel=1e-12)


def test_a_band_has_the_price_of_the_edge_that_each_mode_stands_at(problem: Problem) -> None:
    """Slopes of its rows over either edge, by differences of the band (E23), with rows of other limits around it."""
    low, high = 7.0, 9.0
    measure = Measure(channels.FREQUENCIES)
    band, above = Limit("band", measure, outside=(low, high)), Limit("above", measure, maximum=60.0)
    mounting = mounting_in(problem.engine)
    multipliers, size = np.random.default_rng(4).normal(size=6), (2.0 * np.pi) ** 2

    def rows_of(edges: tuple[float, float]) -> tuple[ModeVariables, ConstraintCollector, ca.Function]:
        held = ConstraintCollector()
        modes = ModeVariables(replace(problem, objective=(Term(measure),)), held)
        modes.hold(np.eye(6), np.eye(6), mounting)
        for limit in (above, replace(band, outside=edges), above):
            assert modes.limit(limit)
        return modes, held, ca.Function("rows", [modes.symbols], [ca.vertcat(*held.expressions)])

    modes, held, _ = rows_of((low, high))
    # modes at, under and over either edge
    frequencies = np.array([low, 0.9 * low, low, high, high, 1.2 * high])
    values = np.concatenate([np.eye(6).ravel(), size * frequencies**2 / modes._unit])
    where = [k for k, name in enumerate(held.names) if name == "band"]
    whole = np.random.default_rng(5).normal(size=len(held.names))
    whole[where] = multipliers

    def row(edges: tuple[float, float]) -> np.ndarray:
        return np.asarray(rows_of(edges)[2](values), dtype=float).ravel()[where]

    step = 1e-6
    slopes = np.stack([(row((low + step, high)) - row((low - step, high))) / (2.0 * step),
                       (row((low, high + step)) - row((low, high - step))) / (2.0 * step)])  # fmt: skip
    # a row that holds a side from below has a multiplier under zero
    at_edge = np.maximum(-multipliers, 0.0) * np.abs(slopes) * np.array([[1, 0, 1, 0, 0, 0], [0, 0, 0, 1, 1, 0]])
    active = whole.copy()
    active[[where[1], where[5]]] = 0.0
    prices = modes.prices(values, active)
    assert prices[band, "at most"] == pytest.approx(at_edge[0].sum(), rel=1e-6)
    assert prices[band, "at least"] == pytest.approx(at_edge[1].sum(), rel=1e-6)
    assert min(prices.values()) > 0.0
