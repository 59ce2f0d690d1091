"""Newton's method in place of a cone program answers where its dual rows prove the answer, and nowhere else (P10)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from laufruhe import load
from laufruhe.load_models import affine as affine_rows
from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.numerics.norms import NORMS, Grid, Norm
from laufruhe.problem.decision import Decision, Domain
from laufruhe.problem.sets import Interval, Sector
from laufruhe.prove.certificate import lower_bound
from laufruhe.solvers.cones import conic
from laufruhe.solvers.cones.cone_program import ConicSolution
from laufruhe.solvers.cones.conic import solve_cones
from laufruhe.solvers.cones.newton import PROVEN, NewtonProgram, newton_solution
from problem_files import PROBLEMS

ROWS = 120


def domains(rng: np.random.Generator, count: int, upper: float) -> tuple[Domain, ...]:
    """Return the intervals from zero and discs, one after another."""
    built: list[Domain] = []
    for k in range(count):
        size = upper * float(rng.uniform(0.5, 2.0))
        kind = Interval(0.0, size) if k % 2 else Sector(size)
        built.append(Domain(Decision(f"d{k}", "kg m", kind, 0.0, ()), built[-1].columns.stop if built else 0))
    return tuple(built)


def load_norm(rng: np.random.Generator, name: str, rank: int, columns: int, rows: int = ROWS) -> AffineNorm:
    """Return the rows of three orders with two components, whose slopes have a rank."""
    angle = 2.0 * np.pi * np.arange(rows) / rows
    waves = np.stack([wave(order * angle) for order in (1, 2, 3) for wave in (np.cos, np.sin)], axis=1)
    free = np.einsum("ko,odr->kdr", waves, rng.standard_normal((6, 2, rank)))
    constant = np.einsum("ko,od->kd", waves, rng.standard_normal((6, 2)))
    slope = free @ rng.standard_normal((rank, columns)) if rank < columns else free
    return AffineNorm(NORMS[name], constant, slope, Grid(np.full(rows, 1.0 / rows), rows))


def masses(rng: np.random.Generator, columns: int) -> AffineNorm:
    """Return a sum of masses, one row for each column."""
    slope = np.zeros((columns, 1, columns))
    slope[np.arange(columns), 0, np.arange(columns)] = rng.uniform(0.5, 2.0, columns)
    return AffineNorm(NORMS["mean"], np.zeros((columns, 1)), slope, Grid(np.ones(columns), 1))


def scene(seed: int, names: tuple[str, ...] = ("mean",), upper: float = 3.0, count: int = 4) -> AffineProblem:
    rng = np.random.default_rng(seed)
    own = domains(rng, count, upper)
    columns = own[-1].columns.stop
    terms = tuple((float(rng.uniform(0.5, 2.0)), load_norm(rng, name, columns, columns)) for name in names)
    return AffineProblem(terms, (), own, ROWS)


def with_mass(problem: AffineProblem, seed: int, share: float) -> AffineProblem:
    """Return the problem with a limit on masses at a share of those of its optimum."""
    norm = masses(np.random.default_rng(seed), problem.size)
    free = newton_solution(problem)
    assert free is not None
    return replace(problem, limits=((share * norm.value(free[0]), norm),))


def with_load(problem: AffineProblem, seed: int, *names: str) -> AffineProblem:
    """Return the problem with limits on other loads at 97 % of those of its optimum."""
    rng = np.random.default_rng(100 + seed)
    free = newton_solution(problem)
    assert free is not None
    norms = [load_norm(rng, name, problem.size, problem.size) for name in names]
    return replace(problem, limits=tuple((0.97 * norm.value(free[0]), norm) for norm in norms))


def by_cones(problem: AffineProblem, monkeypatch: pytest.MonkeyPatch) -> ConicSolution:
    with monkeypatch.context() as patch:
        patch.setattr(conic, "newton_solution", lambda _: None)
        return solve_cones(problem)


SCENES: dict[str, Callable[[int], AffineProblem]] = {
    "mean": scene,
    "root mean square": lambda seed: scene(seed, ("rms",)),
    "root mean quad": lambda seed: scene(seed, ("rmq",)),
    "sum of three": lambda seed: scene(seed, ("mean", "rms", "rmq")),
    "at its bounds": lambda seed: scene(seed, upper=0.1),
    "mass limited": lambda seed: with_mass(scene(seed), seed, 0.6),
    "mean limited": lambda seed: with_load(scene(seed), seed, "mean"),
    "peak limited": lambda seed: with_load(scene(seed, ("rms",)), seed, "maximum"),
    "mean, root mean square and peak limited": lambda seed: with_load(scene(seed), seed, "mean", "rms", "maximum"),
    "mass counted": lambda seed: replace(
        scene(seed), terms=(*scene(seed).terms, (0.1, masses(np.random.default_rng(seed), scene(seed).size)))
    ),
}


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_the_optimum_is_the_same_in_every_unit_of_the_load(unit: float) -> None:
    problem = scene(4)
    terms = tuple(
        (weight, replace(norm, constant=unit * norm.constant, slope=unit * norm.slope))
        for weight, norm in problem.terms
    )
    solution, other = newton_solution(problem), newton_solution(replace(problem, terms=terms))
    assert solution is not None
    assert other is not None
    assert other[0] == pytest.approx(solution[0], rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", SCENES)
def test_it_proves_the_optimum_of_the_cones(kind: str, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = SCENES[kind](seed)
    solution, other = newton_solution(problem), by_cones(problem, monkeypatch)
    assert solution is not None
    assert other.x is not None
    x, multipliers = solution
    value, bound = problem.objective(x), lower_bound(problem, multipliers).value
    assert value * (1.0 - PROVEN) <= bound <= value * (1.0 + 1e-12)
    assert value == pytest.approx(problem.objective(other.x), rel=1e-8)
    assert x == pytest.approx(other.x, abs=1e-4 * np.abs(x).max())
    assert problem.violation(x) <= 1e-9
    for domain in problem.domains:
        assert domain.project(x) == pytest.approx(x[domain.columns], rel=1e-12)
    prices = [m.shadow_prices(problem) for m in (multipliers, other.multipliers)]
    assert prices[0] == pytest.approx(prices[1], rel=1e-4, abs=1e-5 * max(*prices[1], 1e-9) if prices[1] else 0.0)
    assert not problem.limits or max(prices[0]) > 0.0
    # no design near or far is below the bound
    rng = np.random.default_rng(seed)
    for size in 10.0 ** rng.uniform(-6.0, 0.0, 50):
        y = x + size * problem.scales * rng.standard_normal(len(x))
        for domain in problem.domains:
            y[domain.columns] = domain.project(y)
        if problem.violation(y) <= 0.0:
            assert problem.objective(y) >= bound * (1.0 - 1e-12)


def wrong_gradient(program: NewtonProgram, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(len(x)), np.eye(len(x))


def wrong_end(program: NewtonProgram, x: np.ndarray, directions: Any = None) -> Any:
    # a design near the optimum, said to be the optimum
    return x * 1.001, program.multipliers(x * 1.001, program.no_cones)


@pytest.mark.parametrize("kind", ["mean", "sum of three", "at its bounds", "mean limited", "peak limited"])
@pytest.mark.parametrize(
    "broken", [("derivatives", wrong_gradient), ("steps", wrong_end), ("minimise", lambda *_: None)], ids=lambda b: b[0]
)
def test_newton_returns_nothing_without_a_proof(
    kind: str, broken: tuple[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = SCENES[kind](0)
    honest = solve_cones(problem)
    monkeypatch.setattr(NewtonProgram, *broken)
    assert newton_solution(problem) is None
    solution = solve_cones(problem)
    assert honest.by_newton
    assert not solution.by_newton
    assert honest.x is not None
    assert solution.x is not None
    assert problem.objective(solution.x) == pytest.approx(problem.objective(honest.x), rel=1e-8)


@pytest.mark.parametrize("kind", [kind for kind in SCENES if "limited" in kind])
def test_an_optimum_that_breaks_its_limits_is_not_claimed(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, minimise = SCENES[kind](0), NewtonProgram.minimise

    def without_limits(program: NewtonProgram, gradient: Any, curvature: Any, x: Any) -> Any:
        free = NewtonProgram.of(replace(program.problem, limits=()))
        assert free is not None
        step = minimise(free, gradient, curvature, x)
        return step and (step[0], program.no_cones)

    monkeypatch.setattr(NewtonProgram, "minimise", without_limits)
    assert newton_solution(problem) is None


def test_loads_that_are_not_unique_are_left_to_the_cones() -> None:
    """Check two places with parallel forces, of which one gains what the other loses."""
    angle = 2.0 * np.pi * np.arange(ROWS) / ROWS
    along = np.stack([2.0 + np.cos(angle), np.sin(angle)], axis=1)
    constant = np.concatenate([along, along])
    slope = np.concatenate([along, -along])[:, :, None] * 0.5
    norm = AffineNorm(NORMS["mean"], constant, slope, Grid(np.full(2 * ROWS, 0.5 / ROWS), ROWS))
    domain = Domain(Decision("d", "kg m", Interval(-1.0, 1.0), 0.0, ()), 0)
    problem = AffineProblem(((1.0, norm),), (), (domain,), ROWS)
    assert problem.objective(np.zeros(1)) == pytest.approx(problem.objective(np.ones(1)))
    assert newton_solution(problem) is None


@pytest.mark.parametrize("name", ["mean", "rms", "rmq"])
def test_loads_that_cancel(name: str) -> None:
    problem = scene(1, (name,), upper=100.0)
    weight, norm = problem.terms[0]
    balanced = replace(norm, constant=-norm.rows(np.full(problem.size, 0.5)) + norm.constant)
    problem = replace(problem, terms=((weight, balanced),))
    solution = solve_cones(problem)
    assert solution.by_newton
    assert solution.x is not None
    assert problem.objective(solution.x) <= 1e-12 * problem.objective(np.zeros(problem.size))


def test_a_mass_in_the_objective_beside_loads_that_no_weight_reduces() -> None:
    """Check a mass in the objective beside forces of order 3, which no weight reduces."""
    angle = 2.0 * np.pi * np.arange(ROWS) / ROWS
    constant = np.stack([np.cos(3.0 * angle), np.sin(3.0 * angle)], axis=1)
    turn = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    slope = np.stack([turn, turn @ np.array([[0.0, 1.0], [-1.0, 0.0]])], axis=2)
    norm = AffineNorm(NORMS["mean"], constant, slope, Grid(np.full(ROWS, 1.0 / ROWS), ROWS))
    weights = AffineNorm(NORMS["mean"], np.zeros((1, 2)), np.eye(2)[None], Grid(np.ones(1), 1))
    domain = Domain(Decision("d", "kg m", Sector(100.0), 0.0, ()), 0)
    problem = AffineProblem(((1.0, norm), (0.1, weights)), (), (domain,), ROWS)
    result = newton_solution(problem)
    assert result is not None
    assert np.abs(result[0]).max() <= 1e-9
    assert lower_bound(problem, result[1]).value == pytest.approx(1.0, rel=1e-8)


@pytest.mark.parametrize("kind", [kind for kind in NORMS.values() if kind.is_smooth], ids=str)
def test_derivatives_are_those_of_differences(kind: Norm) -> None:
    problem = AffineModel(load(PROBLEMS / "tractor-four-lanchester.toml")).at(360)
    terms = tuple((weight, replace(norm, norm=kind)) for weight, norm in problem.terms)
    program = NewtonProgram.of(replace(problem, terms=terms))
    assert program is not None
    rng = np.random.default_rng(1)
    x = 0.1 * problem.scales * rng.uniform(-1.0, 1.0, problem.size)
    gradient, curvature = program.derivatives(x)
    for k, size in enumerate(problem.scales):
        step = np.zeros(problem.size)
        step[k] = 1e-5 * size
        values = [program.problem.objective(x + sign * step) for sign in (1.0, -1.0)]
        assert (values[0] - values[1]) / (2.0 * step[k]) == pytest.approx(gradient[k], rel=1e-5, abs=1e-3)
        ahead, behind = (program.derivatives(x + sign * step)[0] for sign in (1.0, -1.0))
        assert (ahead - behind) / (2.0 * step[k]) == pytest.approx(curvature[:, k], rel=1e-3, abs=1e-2 / size)


@pytest.mark.parametrize("name", ["mean", "maximum", "peak to peak"])
def test_many_columns_have_the_optimum_and_bound_of_all(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    own = domains(rng, 16, 0.3)
    columns = own[-1].columns.stop
    norm = load_norm(rng, name, 4, columns)
    peak = load_norm(rng, "maximum", 3, columns)
    problem = AffineProblem(((1.0, norm),), ((0.9 * peak.value(np.zeros(columns)), peak),), own, ROWS)
    slope, basis = norm.free_slope
    assert len(basis) == 4
    assert slope @ basis == pytest.approx(norm.slope, abs=1e-12 * np.abs(norm.slope).max())
    few = by_cones(problem, monkeypatch)
    monkeypatch.setattr(affine_rows, "MANY_COLUMNS", columns + 1)
    problem = replace(problem, terms=((1.0, replace(norm)),), limits=tuple((m, replace(n)) for m, n in problem.limits))
    assert len(problem.terms[0][1].free_slope[1]) == columns
    whole = by_cones(problem, monkeypatch)
    assert few.x is not None
    assert whole.x is not None
    assert problem.objective(few.x) == pytest.approx(problem.objective(whole.x), rel=1e-8)
    bounds = [lower_bound(problem, solution.multipliers).value for solution in (few, whole)]
    assert bounds[0] == pytest.approx(bounds[1], rel=1e-6)
    assert bounds[0] <= problem.objective(few.x) * (1.0 + 1e-12)


def test_a_single_row_in_a_direction_of_its_own_is_not_left_out() -> None:
    rng = np.random.default_rng(5)
    norm = load_norm(rng, "maximum", 3, 20, rows=4000)
    norm.slope[1234, 0, 7] += 1e-6
    slope, basis = norm.free_slope
    assert (slope @ basis == norm.slope).all()
