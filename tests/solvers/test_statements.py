"""Problems stated by other libraries (xarray, cvxpy, CasADi, scipy), and proofs of their solutions."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any

import casadi as ca
import cvxpy as cp
import numpy as np
import pytest
import xarray as xr
from scipy.optimize import minimize

import laufruhe
from lanes import first_fast
from laufruhe.errors import InputError, ModelError, SolverError
from laufruhe.problem.decision import Kind
from laufruhe.problem.dependence import is_affine
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.problem import Problem, Search
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.cones.cone_program import TIGHT
from laufruhe.solvers.cones.conic import solve_cones
from problem_files import PROBLEMS, READY

SMOOTH = ("tractor-four-lanchester", "twin-parallel-270", "geared-inertia")
PEAKS = ("worked-diesel", "locomotive-two-cylinder", "tractor-four-seven-metres")
MEAN_FORCE = "mean mount force"


def ready(name: str) -> Problem:
    problem = laufruhe.load(PROBLEMS / f"{name}.toml")
    return problem.changed(ranks=()) if problem.ranks else problem


def decided_by_cones(problem: Problem) -> bool:
    """Return whether the open numbers are unbalances, masses of pistons or shares of geared inertia."""
    kinds = {decision.kind for decision in problem.decisions}
    affine = all(is_affine(measure.channel, kinds, problem) for measure in problem.measures)
    decided = affine and kinds and kinds <= {Kind.UNBALANCE, Kind.SHARE, Kind.PISTON}
    return bool(decided) and problem.phasing is None and not problem.extras


OTHERS = [path.stem for path in READY if path.stem not in (*SMOOTH, *PEAKS)]


@pytest.mark.parametrize("name", first_fast([*SMOOTH, *PEAKS, *OTHERS], 0, 6))
def test_the_statement_in_cvxpy_has_the_optimum_of_the_package(name: str) -> None:
    problem = ready(name)
    if name in OTHERS and not decided_by_cones(laufruhe.load(PROBLEMS / f"{name}.toml")):
        pytest.skip("is no problem of cones")
    peaks = any(measure.is_load and measure.norm.refinement > 1 for measure in problem.measures)
    program = problem.to_cvxpy(5760 if peaks else None)
    with warnings.catch_warnings():
        # limits on peaks of a locomotive nearly contradict each other
        warnings.simplefilter("ignore", UserWarning)
        program.solve(solver="CLARABEL", **TIGHT)
    affine = program._affine
    optimum = solve_cones(affine)
    assert optimum.x is not None
    level = 1e-6 * affine.objective(np.zeros(affine.size))
    # a steep price makes more of the 1e-6 to which solvers keep limits, and designs may violate one by 1e-5 of it
    accuracy = 1e-5 if problem.limits else 1e-6
    assert program.value == pytest.approx(affine.objective(optimum.x), rel=accuracy, abs=level)
    result = laufruhe.solve(problem)
    assert result.objective is not None
    assert result.certificate is not None
    proven = laufruhe.certify(problem, program.values, program.multipliers)
    assert proven.objective is not None
    assert proven.certificate is not None
    assert proven.certificate.kind is not Proof.NONE
    same = objective_value(problem, replace(result.final, samples=proven.final.samples))
    gap = max(result.certificate.gap, proven.certificate.gap)
    assert proven.objective.value == pytest.approx(same, rel=accuracy + gap, abs=level)
    lower = max(result.certificate.lower_bound, proven.certificate.lower_bound)
    assert min(same, proven.objective.value) >= lower * (1.0 - (accuracy if problem.limits else 1e-9)) - level


@pytest.mark.slow
def test_the_program_of_the_theory_page_is_that_of_the_package() -> None:
    page = (PROBLEMS.parent / "docs" / "theory" / "programs.md").read_text(encoding="utf-8")
    code: dict[str, Any] = {}
    exec(page.partition("```python\n")[2].partition("```")[0], code)
    assert code["least"].value == pytest.approx(ready("tractor-four-lanchester").to_cvxpy().solve(), rel=1e-5)


@pytest.mark.slow
def test_rows_as_labelled_arrays_make_the_measure() -> None:
    problem = ready("tractor-four-lanchester")
    data = problem.affine()
    assert list(data) == [MEAN_FORCE, "balancer mass"]
    rows = data[MEAN_FORCE]
    assert rows.constant.dims == ("point", "mount", "angle", "direction")
    assert list(rows.decision.values[-2:]) == ["right.unbalance.real", "right.unbalance.imag"]
    unbalances = {"left.unbalance": 0.01, "right.unbalance": 0.02}
    x = xr.zeros_like(rows.decision, dtype=float)
    for name, size in unbalances.items():
        x.loc[f"{name}.real"] = size
    force = rows.constant + (rows.slope * x).sum("decision")
    mean = float((np.sqrt((force**2).sum("direction")) * rows.weight).sum())
    result = laufruhe.evaluate(problem, values=unbalances)
    assert result.objective is not None
    assert mean == pytest.approx(result.objective.value, rel=1e-9)
    curve = result.forces(720).mount_force.sel(design="initial", mount="rear left").isel(point=0)
    ours = force.sel(mount="rear left").isel(point=0)
    repeats = np.tile(ours.transpose("angle", "direction").values, (2, 1))
    # rows of a mean are samples of the Fourier series, which rounds jumps of slope
    wide = 2e-3 * float(abs(curve).max())
    assert repeats[::2] == pytest.approx(curve.transpose("angle", "direction").values, abs=wide)


@pytest.mark.slow
def test_own_constraints_hold_and_cost() -> None:
    problem = ready("tractor-four-lanchester")
    program = problem.to_cvxpy()
    force = program.terms[MEAN_FORCE].at(mount="front left", direction="z")
    left, right = program.decisions["left.unbalance"], program.decisions["right.unbalance"]
    alone = program.solve()
    cp.Problem(program.objective, [*program.constraints, left == 0.5 * right]).solve()
    assert force.shape == (720,)
    assert program.values["left.unbalance"] == pytest.approx(0.5 * program.values["right.unbalance"], rel=1e-6)
    proven = laufruhe.certify(problem, program.values)
    assert proven.objective is not None
    assert proven.certificate is not None
    assert alone < 0.999 * proven.objective.value
    assert proven.certificate.kind is Proof.WITHIN_GAP
    assert proven.certificate.lower_bound == pytest.approx(alone, rel=1e-4)
    assert proven.certificate.kkt_residual == pytest.approx(proven.certificate.gap)
    evaluated = laufruhe.evaluate(problem, values=program.values).forces(720).mount_force
    peak = float(abs(evaluated.sel(design="initial", mount="front left", direction="z")).max())
    assert float(np.abs(force.value).max()) == pytest.approx(peak, rel=1e-4)


@pytest.mark.parametrize("solver", ["SCS", "clarabel"])
def test_a_named_solver_decides_and_the_proof_stays(solver: str) -> None:
    problem = ready("twin-parallel-270")
    result, named = laufruhe.solve(problem), laufruhe.solve(problem, solver=solver)
    assert result.objective is not None
    assert named.objective is not None
    assert named.certificate is not None
    assert solver.upper() in named.certificate.method
    assert named.certificate.kind is Proof.GLOBAL
    assert named.objective.value == pytest.approx(result.objective.value, rel=1e-6)


def test_a_linear_problem_needs_a_linear_solver_only() -> None:
    vertical = laufruhe.own_measure("vertical force", load=lambda forces: forces[..., 2:])
    problem = ready("geared-twin").with_objective(vertical)
    result, named = laufruhe.solve(problem), laufruhe.solve(problem, solver="HIGHS")
    assert result.objective is not None
    assert named.objective is not None
    assert named.objective.value == pytest.approx(result.objective.value, rel=1e-6)


def test_a_solver_that_does_not_fit_is_refused() -> None:
    problem = ready("tractor-four-lanchester")
    with pytest.raises(InputError, match="no solver that cvxpy finds; install it, or name one of CLARABEL"):
        laufruhe.solve(problem, solver="NONESUCH")
    with pytest.raises(SolverError, match="HIGHS does not solve this problem"):
        laufruhe.solve(problem, solver="HIGHS")
    with pytest.raises(InputError, match="decides unbalances alone"):
        laufruhe.solve(PROBLEMS / "powertrain-least-force.toml", solver="SCS")


LIES: dict[str, Any] = {
    "zero": lambda program: 0.0,
    "far": lambda program: 1e9,
    "no number": lambda program: math.nan,
    "infinite": lambda program: math.inf,
}


@pytest.mark.parametrize("lie", first_fast(LIES, 1))
def test_no_lie_of_a_solver_makes_a_false_proof(lie: str, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = ready("tractor-four-lanchester")
    truth = laufruhe.solve(problem)

    def lying(program: Any, **_: Any) -> None:
        for variable in program.variables():
            variable.save_value(np.full(variable.shape, LIES[lie](program)))
        for constraint in program.constraints:
            for dual in constraint.dual_variables:
                dual.save_value(np.full(dual.shape, 7.0 * LIES[lie](program) - 1.0))
        program._status = cp.OPTIMAL

    monkeypatch.setattr(cp.Problem, "solve", lying)
    result = laufruhe.solve(problem, solver="SCS")
    assert truth.objective is not None
    assert truth.certificate is not None
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.lower_bound <= truth.objective.value * (1.0 + 1e-9)
    if result.status.has_design:
        assert result.objective.value >= truth.certificate.lower_bound
        assert result.certificate.gap >= 1.0 - result.certificate.lower_bound / result.objective.value - 1e-9
    program = problem.to_cvxpy()
    program.solve()
    proven = laufruhe.certify(problem, {}, program.multipliers)
    assert proven.certificate is not None
    assert proven.certificate.lower_bound <= truth.objective.value * (1.0 + 1e-9)


@pytest.mark.slow
def test_a_solver_that_excludes_every_design_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cp.Problem, "solve", lambda program, **_: setattr(program, "_status", cp.INFEASIBLE))
    result = laufruhe.solve(ready("tractor-four-lanchester"), solver="SCS")
    assert str(result.status) == "failed"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"left.unbalance": 0.06}, "left.unbalance = 0.06 at 0 deg: lies outside of 0 to 0.05 kg m"),
        (
            {"left.unbalance": 0.05, "right.unbalance": 0.05},
            "limit 'balancer mass': is 5 kg, and has to be at most 4 kg",
        ),
        ({"middle.unbalance": 0.05}, "is no open number of this problem"),
        ({"left.unbalance": "5 kg"}, "left.unbalance"),
    ],
)
def test_designs_that_break_something_are_refused_by_name(values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        laufruhe.certify(ready("tractor-four-lanchester"), values)


def test_multipliers_of_another_form_are_refused() -> None:
    problem = ready("tractor-four-lanchester")
    for multipliers, message in [
        ({"peak": 1.0}, "the names are mean mount force, balancer mass"),
        ({MEAN_FORCE: "high"}, "is no number and no array"),
        ({MEAN_FORCE: np.zeros((3, 3))}, r"not \(2880, 3\)"),
    ]:
        with pytest.raises(InputError, match=message):
            laufruhe.certify(problem, {}, multipliers)


def test_a_design_that_is_no_optimum_is_never_called_one() -> None:
    problem = ready("tractor-single").open("engine.rod_ratio", 0.2, 0.3).changed(search=Search(starts=1))
    result, proven = laufruhe.solve(problem), laufruhe.certify(problem, {})
    assert result.certificate is not None
    assert result.certificate.kind is Proof.LOCAL
    assert proven.certificate is not None
    assert proven.certificate.kind is Proof.NONE


def test_the_program_in_casadi_has_the_optimum_of_the_cones() -> None:
    problem = ready("tractor-four-lanchester")
    program = problem.to_casadi()
    quiet = {"ipopt.print_level": 0, "print_time": 0, "ipopt.sb": "yes"}
    solution = ca.nlpsol("solver", "ipopt", program["nlp"], quiet)(x0=program["x0"], **program["bounds"])
    assert len(program["names"]) == program["nlp"]["x"].numel()
    assert len(program["constraints"]) == program["nlp"]["g"].numel()
    proven = laufruhe.certify(problem, program["values"](solution["x"]))
    assert proven.certificate is not None
    assert proven.certificate.kind is Proof.GLOBAL
    assert proven.objective is not None
    assert float(solution["f"]) == pytest.approx(proven.objective.value, rel=1e-4)
    with pytest.raises(ModelError, match=r"lacks engine\.rod_ratio"):
        problem.open("engine.rod_ratio", 0.2, 0.3).to_casadi()


def test_the_program_in_casadi_of_mounts_has_the_values_of_the_exact_model() -> None:
    problem = laufruhe.load(PROBLEMS / "powertrain-least-force.toml")
    program = problem.to_casadi()
    objective = ca.Function("objective", [program["nlp"]["x"]], [program["nlp"]["f"]])
    values = program["values"](program["x0"])
    exact = laufruhe.evaluate_many(problem, [values]).objective[0]
    assert float(objective(program["x0"])) == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("name", ["tractor-four-lanchester", "worked-diesel", "car-four-willans", "geared-inertia"])
def test_value_and_gradient_are_those_of_the_exact_model(name: str) -> None:
    problem = ready(name)
    objective = problem.objective_function()
    low, high = np.array(objective.bounds).T
    x = low + (high - low) * np.random.default_rng(3).uniform(0.4, 0.6, len(low))
    value, gradient = objective(x)
    step = 1e-7 * (high - low)
    slopes = [(objective(x + d)[0] - objective(x - d)[0]) / (2.0 * d.sum()) for d in np.diag(step)]
    assert gradient == pytest.approx(slopes, rel=1e-5, abs=1e-6 * float(np.abs(gradient).max()))
    table = laufruhe.evaluate_many(problem, [objective.values(x)])
    assert value == pytest.approx(table.objective[0], rel=1e-6)


def test_scipy_finds_the_optimum_and_the_package_proves_it() -> None:
    problem = ready("tractor-four-lanchester")
    objective = problem.objective_function()
    result = minimize(objective, objective.start, jac=True, bounds=objective.bounds)
    proven = laufruhe.certify(problem, objective.values(result.x))
    assert proven.certificate is not None
    assert proven.certificate.kind is Proof.GLOBAL
    with pytest.raises(InputError, match="no vector of 8 finite numbers"):
        objective([0.0])


def test_numbers_without_affine_loads_are_refused_by_name() -> None:
    problem = ready("tractor-four-lanchester").open("engine.rod_ratio", 0.2, 0.3)
    for state in (problem.affine, problem.to_cvxpy, problem.objective_function):
        with pytest.raises(ModelError, match=r"no affine function of engine.rod_ratio; fix it"):
            state()


@pytest.mark.slow
def test_limits_are_constraints_of_scipy() -> None:
    """SLSQP keeps the limit of mass, and its design is proven optimal; gradients are differences."""
    problem = laufruhe.load("tractor-four-lanchester")
    problem = problem.fix("front web.mass").fix("rear web.mass").limit("balancer mass", max=0.8, name="light")
    function = problem.objective_function()
    constraints = function.constraints
    assert len(constraints) == len(problem.limits) == 2
    x = np.linspace(0.004, 0.007, len(function.names))
    for one in constraints:
        steps = 1e-7 * np.eye(len(x))
        slope = [(one["fun"](x + step) - one["fun"](x - step)) / 2e-7 for step in steps]
        assert one["jac"](x) == pytest.approx(np.array(slope), rel=1e-5, abs=1e-6)
    size = function(x)[0]
    end = minimize(
        lambda x: tuple(part / size for part in function(x)), x, jac=True, bounds=function.bounds,
        constraints=constraints, method="SLSQP", options={"ftol": 1e-12},
    )  # fmt: skip
    best = laufruhe.solve(problem)
    assert size * end.fun == pytest.approx(best["mean mount force"], rel=1e-4)
    assert best["light"] == pytest.approx(0.8, rel=1e-6)
    assert min(one["fun"](end.x) for one in constraints) > -1e-8
    assert len(repr(function)) < 200
