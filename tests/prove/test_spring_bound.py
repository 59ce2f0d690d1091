"""What the forces of springs prove of a box of stiffnesses: no design allowed is under it (E42-E45)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lanes import first_fast
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value, remounted
from laufruhe.problem.problem import Problem
from laufruhe.prove import spring_bound as semidefinite
from laufruhe.prove.certificate import Proof
from laufruhe.prove.spring_lines import middle_of, response, springs_of
from laufruhe.prove.spring_search import _SpringBoxes, spring_bound
from laufruhe.prove.subdivision import divided_bound
from laufruhe.solvers import solve
from mounts.files import changed
from prove.test_subdivision import DAMPED, asked_for

OPEN = '{ between = ["60 N/mm", "700 N/mm"], start = "300 N/mm" }'
TURNED = changed(
    DAMPED,
    ('name = "rear left"', 'name = "rear left"\nturned = [25, 0, 10]'),
    (
        'stiffness = ["120 N/mm", "120 N/mm", { between = ["20 N/mm", "4000 N/mm"]',
        f'stiffness = [{OPEN}, {OPEN}, {{ between = ["20 N/mm", "4000 N/mm"]',
    ),
)
NARROW = '\norders = [2, 4]\noperating_points = ["idle"]'
ASKED = {
    "rms": 'minimise = "rms mount force"\norders = [2, 4]',
    "narrowed": 'minimise = "rms mount force"\nmounts = ["front left"]\ndirection_weights = [1, 0.5, 2]' + NARROW,
    "travel": 'minimise = "rms mount travel"' + NARROW,
    "mean": 'minimise = "mean mount force"' + NARROW,
    "maximum": 'minimise = "maximum mount force"' + NARROW,
}
LIMITS = """
[[constraints]]
limit = "natural frequencies"
min = "4 Hz"
max = "30 Hz"
[[constraints]]
limit = "static sag"
max = "10 mm"
"""
POWERTRAIN = Path(__file__).parents[2] / "problems" / "powertrain-least-force.toml"


def designs_of(problem: Problem, low: np.ndarray, high: np.ndarray, count: int, seed: int) -> list[tuple[Any, float]]:
    """Random designs of a box that keep every limit, and what they are worth."""
    generator, given, found = np.random.default_rng(seed), evaluate(problem), []
    for share in generator.random((count, len(low))):
        x = low + share * (high - low)
        each = remounted(given, problem.design(x.tolist()))
        if each.excess(problem.limits) <= 0.0:
            found.append((x, objective_value(problem, each)))
    return found


def test_open_springs_add_up_to_what_the_matrices_change_by(tmp_path: Path) -> None:
    model = _SpringBoxes(asked_for(tmp_path, ASKED["rms"], mounts=TURNED), 1.0, 100.0).model
    springs = springs_of(model)
    for j in range(len(model.lower)):
        own = springs.decisions == j
        total = np.einsum("i,ia,ib->ab", springs.gains[own], springs.arms[own], springs.arms[own])
        assert np.allclose(total, model.stiffness_slopes[j], rtol=1e-9, atol=1e-9 * np.abs(total).max())
        end = np.where(np.arange(len(model.lower)) == j, model.upper, model.lower)
        change = model.matrices(end).stiffness - model.matrices(model.lower).stiffness
        assert np.allclose(total * (model.upper - model.lower)[j], change, rtol=1e-9, atol=1e-9 * np.abs(change).max())


def test_response_is_affine_in_the_forces_of_the_springs(tmp_path: Path) -> None:
    """E42 at a design of the box: solving for the motion anew gives the same motion and forces."""
    problem = asked_for(tmp_path, ASKED["narrowed"], mounts=TURNED)
    boxes = _SpringBoxes(problem, 1.0, 100.0)
    model = boxes.model
    springs, (_, quantity, lines) = springs_of(model), boxes._terms[0]
    low, high = model.lower, model.lower + 0.4 * (model.upper - model.lower)
    at, generator = middle_of(model, low, high), np.random.default_rng(4)
    rows, factors = np.arange(12), np.ones(12)
    for k in range(len(lines.omegas)):
        known = response(model, springs, at, lines, k, quantity.channel, rows, factors)
        s = generator.uniform(-1.0, 1.0, len(low))
        own, omega = model.matrices(0.5 * (low + high) + 0.5 * s * (high - low)), lines.omegas[k]
        impedance = own.stiffness + 1j * (own.loss + omega * own.damping) - omega**2 * np.eye(6)
        motion = np.linalg.solve(impedance, lines.loads[k])
        unit = np.linalg.norm(np.linalg.solve(_middle(model, low, high, omega), lines.loads[k]))
        scales = np.diagonal(known.shares[0][:, 1 : 1 + len(springs.gains)])
        v = s[springs.decisions] * (springs.arms @ motion) / (unit * scales)
        whole = np.concatenate([[1.0], v.real, v.imag])
        assert np.allclose((known.motion[0] + 1j * known.motion[1]) @ whole, motion / unit, rtol=1e-8, atol=1e-10)
        forces = (own.springs + 1j * (own.losses + omega * own.dampers)) @ motion
        assert np.allclose(
            (known.felt[0] + 1j * known.felt[1]) @ whole, forces, rtol=1e-8, atol=1e-8 * abs(forces).max()
        )
        assert float(np.sum(np.abs(v) ** 2)) <= known.reach


def _middle(model: Any, low: np.ndarray, high: np.ndarray, omega: float) -> np.ndarray:
    here = model.matrices(0.5 * (low + high))
    return np.asarray(here.stiffness + 1j * (here.loss + omega * here.damping) - omega**2 * np.eye(6))


@pytest.mark.parametrize("limits", ["", LIMITS], ids=["free", "limited"])
@pytest.mark.parametrize("name", first_fast(ASKED, 1))
def test_no_design_in_a_box_is_under_its_bound(name: str, limits: str, tmp_path: Path) -> None:
    problem = asked_for(tmp_path, ASKED[name], limits, mounts=TURNED)
    boxes = _SpringBoxes(problem, 1e-3, objective_value(problem, evaluate(problem)))
    low, high = boxes.model.lower, boxes.model.upper
    centre, tight = designs_of(problem, low, high, 100, 5)[0][0], 0.0
    for share in (1.0, 0.2, 0.02):
        below = np.clip(centre - 0.5 * share * (high - low), low, high - share * (high - low))
        above = below + share * (high - low)
        least = min(value for _, value in designs_of(problem, below, above, 40, 6))
        bound = boxes._relaxed(below, above)
        assert bound <= least * (1.0 + 1e-9)
        tight = max(tight, bound / least)
    assert tight > (0.0 if name in ("mean", "maximum") else 0.9)


def test_a_bound_holds_whatever_a_solver_proposes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Multipliers at random, and none at all."""
    problem = asked_for(tmp_path, ASKED["rms"], LIMITS, mounts=TURNED)
    boxes = _SpringBoxes(problem, 1e-3, 1.0)
    low = boxes.model.lower
    high = low + 0.2 * (boxes.model.upper - low)
    least = min(value for _, value in designs_of(problem, low, high, 200, 1))
    generator, proposed = np.random.default_rng(3), semidefinite._proposed

    def noise(squares: Any, limits: Any, numbers: int) -> tuple[list[np.ndarray], np.ndarray]:
        found, middle = proposed(squares, limits, numbers)
        spoilt = [m * generator.uniform(0.0, 2.0) + 1e-3 * generator.normal(size=m.shape) for m in found]
        return [0.5 * (m + m.T) for m in spoilt], middle

    for wrong in (noise, noise, lambda squares, limits, numbers: ([np.zeros((k.size, k.size)) for k in limits], low)):
        monkeypatch.setattr(semidefinite, "_proposed", wrong)
        assert boxes._relaxed(low, high) <= least


@pytest.mark.parametrize("norm", ["rms", "mean"])
def test_orders_that_nothing_excites_have_no_bound(norm: str, tmp_path: Path) -> None:
    """Alone they are nothing; beside others they add nothing."""
    silent = f'minimise = "{norm} mount force"\norders = [3]\noperating_points = ["idle"]'
    assert spring_bound(asked_for(tmp_path, silent), 0.0, 0.0).bound == 0.0
    assert spring_bound(asked_for(tmp_path, silent), 1.0, 1e-4).bound == 0.0


def powertrain(orders: str, frequency: str, opened: int) -> dict[str, Any]:
    """The powertrain with so many of its nine stiffnesses open, its lowest natural frequency limited alone."""
    import tomllib

    tables = tomllib.loads(POWERTRAIN.read_text(encoding="utf-8"))
    tables["constraints"] = [{"limit": "natural frequencies", "min": frequency}]
    tables["objective"] = {"minimise": "rms mount force", "orders": [int(h) for h in orders.split()]}
    tables["search"] = {"starts": 6}
    left = opened
    for place in tables["mounts"]["places"]:
        for k, number in enumerate(place["stiffness"]):
            if left:
                left -= 1
            else:
                place["stiffness"][k] = number["start"]
    return tables


@pytest.mark.slow
def test_four_springs_are_proven_in_a_few_boxes() -> None:
    """Expansions leave a tenth and more of this open after thousands of boxes."""
    problem = load(powertrain("2 4", "7 Hz", 4))
    result = solve(problem)
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.kind is Proof.GLOBAL
    value = result.objective.value
    few = spring_bound(problem, value, 1e-4 * value)
    assert 0 < few.boxes < 40
    many = divided_bound(replace(problem, search=replace(problem.search, boxes=400)), value, 1e-4 * value)
    assert many.bound < 0.9 * value < 0.999 * value < few.bound <= value


@pytest.mark.slow
def test_no_local_search_finds_less_than_the_bound_of_six_springs() -> None:
    """Nelder and Mead, from many starts, on the exact model."""
    from scipy.optimize import minimize

    problem = load(powertrain("2 4", "7 Hz", 6))
    result = solve(problem)
    assert result.certificate is not None
    bound, given = result.certificate.lower_bound, evaluate(problem)
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))

    def worth(s: np.ndarray) -> float:
        each = remounted(given, problem.design(np.clip(low * (high / low) ** s, low, high).tolist()))
        return objective_value(problem, each) * (1.0 + 100.0 * max(each.excess(problem.limits), 0.0))

    generator = np.random.default_rng(7)
    ends = [minimize(worth, generator.random(6), method="Nelder-Mead", options={"maxfev": 400}) for _ in range(6)]
    assert min(float(end.fun) for end in ends) >= bound * (1.0 - 1e-6)
    assert result.certificate.kind is Proof.GLOBAL
