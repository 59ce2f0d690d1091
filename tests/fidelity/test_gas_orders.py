"""Gas cut off at an order of its own: inertia stays, and the omitted part is bounded."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from cli import scenes
from fidelity.scenes import random_elastic_problem, random_problem
from lanes import first_fast
from laufruhe.errors import InputError, ModelError
from laufruhe.files.reader import load
from laufruhe.load_models import uneven_model
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.load_models.uneven_model import UnevenModel
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS, written

EVERY = 10_000


def _scene(make, seed: int) -> Problem:
    """Return a random problem with gas: rigid or elastic mounts, even or uneven throws, rows and vees."""
    return make(random.Random(40_000 + seed), gas=True)


@pytest.mark.parametrize("make", [random_problem, random_elastic_problem])
@pytest.mark.parametrize("seed", first_fast(range(8), 3, 4))
@pytest.mark.parametrize("crank_inertia", [math.inf, 50.0])
def test_many_orders_are_every_order(make, seed: int, crank_inertia: float) -> None:
    whole = replace(_scene(make, seed), fidelity=Fidelity(samples=360, crank_inertia=crank_inertia))
    cut = replace(whole, fidelity=replace(whole.fidelity, gas_orders=EVERY))
    assert objective_value(cut, evaluate(cut)) == objective_value(whole, evaluate(whole))


@pytest.mark.parametrize("seed", first_fast(range(8), 3, 4))
@pytest.mark.parametrize("last", [1, 3, 12])
def test_gas_alone_is_cut(seed: int, last: int) -> None:
    problem = _scene(random_problem, seed)
    for point in problem.points:
        cut, none, whole = (
            shaking_loads(problem.engine, point, fidelity).with_finer_base(problem.engine.cycle.base_order)
            for fidelity in (Fidelity(gas_orders=last), Fidelity(gas=False), Fidelity())
        )
        length, scale = len(whole.coefficients), np.abs(whole.coefficients).max()
        first, second = (np.pad(s.coefficients, ((0, length - len(s.coefficients)), (0, 0))) for s in (cut, none))
        above = whole.orders > last
        np.testing.assert_allclose(first[above], second[above], rtol=0.0, atol=1e-13 * scale)
        np.testing.assert_allclose(first[~above], whole.coefficients[~above], rtol=0.0, atol=1e-13 * scale)


def test_uneven_throws_are_loaded_by_the_kept_orders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uneven_model, "LEFT_OUT", 0.0)
    monkeypatch.setattr(uneven_model, "HIGHEST", math.inf)
    fidelities = Fidelity(samples=720, gas_orders=3), Fidelity(samples=720), Fidelity(samples=720, gas=False)
    few, every, none = (_roll_of_star(fidelity) for fidelity in fidelities)
    assert max(order for order in every if abs(every[order]) > 1e-3 * abs(every[0.0])) > 3.0
    for order, value in few.items():
        expected = every[order] if order <= 3.0 else none.get(order, 0.0)
        assert value == pytest.approx(expected, abs=1e-9 * abs(every[0.0]))


def _roll_of_star(fidelity: Fidelity) -> dict[float, complex]:
    """Return the roll moment of a star by order, as a smooth program has it."""
    problem = load(PROBLEMS / "inline-five-uneven-gas.toml").at(fidelity)
    assert problem.phasing is not None
    throws = tuple(math.tau * k / 5.0 for k in (0, 3, 2, 1, 4))
    start = Candidate(throws, (1, 2, 4, 5, 3))
    star = problem.phasing.problem_of(start)
    moves = ThrowMoves(problem.phasing, problem.phasing.layout(None, None), start, problem.phasing.intervals)
    lines = UnevenModel(star, moves, ca.DM.zeros(moves.size), ca.DM(0, 1)).wrench(star.points[0])
    real, imaginary = (np.array(ca.DM(part))[3] for part in (lines.real, lines.imaginary))
    return dict(zip(lines.orders.tolist(), (real + 1j * imaginary).tolist(), strict=True))


def test_from_a_file(tmp_path: Path) -> None:
    text = (PROBLEMS / "tractor-four-lanchester.toml").read_text(encoding="utf-8") + "\n[fidelity]\ngas_orders = 12\n"
    problem = load(written(tmp_path, text))
    assert problem.fidelity == Fidelity(gas_orders=12)
    assert "gas to order 12" in problem.fidelity.summary
    with pytest.raises(InputError, match=r"fidelity\.gas_orders.*needs gas"):
        load(written(tmp_path, text + "gas = false\n"))
    with pytest.raises(InputError, match=r"fidelity\.gas_orders"):
        load(written(tmp_path, text.replace("gas_orders = 12", "gas_orders = 0")))
    with pytest.raises(InputError, match=r"fidelity\.gas_orders.*is chosen automatically if kinematics"):
        load(written(tmp_path, text + 'kinematics = "auto"\n'))
    with pytest.raises(InputError, match=r"fidelity\.gas_orders.*add \[gas\]"):
        load(written(tmp_path, scenes.SHAKING_ONLY + "\n[fidelity]\ngas_orders = 3\n"))
    with pytest.raises(ModelError, match="gas orders"):
        Fidelity(gas_orders=0)
