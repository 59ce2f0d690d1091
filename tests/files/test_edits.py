"""Numbers of a problem changed by name are those of a file that has them so."""

from __future__ import annotations

import math
import pickle
import tomllib
from pathlib import Path

import pytest

import laufruhe
from laufruhe.errors import InputError, LaufruheError, ModelError
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import decision_values
from problem_files import PROBLEMS

LANCHESTER = PROBLEMS / "tractor-four-lanchester.toml"
ELASTIC = PROBLEMS / "tractor-four-elastic.toml"


@pytest.fixture(scope="module")
def problem() -> Problem:
    return laufruhe.load(LANCHESTER)


def test_path_text_and_tables_are_one_problem(problem: Problem) -> None:
    text = LANCHESTER.read_text(encoding="utf-8")
    for source in (str(LANCHESTER), text, tomllib.loads(text)):
        found = laufruhe.load(source)
        assert found.engine == problem.engine
        assert found.decisions == problem.decisions


def test_tables_that_were_given_stay_as_they_are() -> None:
    tables = tomllib.loads(LANCHESTER.read_text(encoding="utf-8"))
    before = pickle.dumps(tables)
    laufruhe.load(tables).with_values({"front web.mass": "1 kg"})
    assert pickle.dumps(tables) == before


def test_a_value_by_name_is_that_of_a_file(problem: Problem) -> None:
    text = LANCHESTER.read_text(encoding="utf-8")
    changed = text.replace("rod_ratio = 0.26", "rod_ratio = 0.28").replace(
        'mass  = { between = ["0 kg", "3 kg"] }', 'mass  = { between = ["0 kg", "3 kg"], start = "1.2 kg" }', 1
    )
    result = problem.with_values({"front web.mass": "1.2 kg", "engine.rod_ratio": 0.28})
    assert result.engine == laufruhe.load(changed).engine
    assert result.decisions == laufruhe.load(changed).decisions
    assert result.decisions != problem.decisions
    assert problem.decisions[0].start == 0.0


def test_every_decision_is_found_by_the_name_that_results_show() -> None:
    for path in (LANCHESTER, ELASTIC, PROBLEMS / "tractor-four-shaft-heights.toml", PROBLEMS / "vee-six-60.toml"):
        problem = laufruhe.load(path)
        # a weight of nothing has no place to decide
        sizes = {d.name: "0.001 kg m" for d in problem.decisions if d.unit == "kg m" and d.place_drives == ()}
        for decision in problem.decisions:
            fixed = problem.fix(decision.name, sizes.get(decision.name) if decision.unit == "kg m" else None)
            assert decision.name not in {other.name for other in fixed.decisions}


@pytest.mark.parametrize(
    "name",
    [
        "opposed-pistons-masses",
        "tractor-four-seven-metres",
        "geared-inertia",
        "powertrain-load-cases",
    ],
)
def test_masses_shares_and_weights_named_like_a_table_are_found(name: str) -> None:
    problem = laufruhe.load(PROBLEMS / f"{name}.toml")
    for decision in problem.decisions:
        middle = 0.5 * (decision.lower + decision.upper)
        fixed = problem.fix(decision.name, f"{middle!r} {decision.unit}" if decision.unit else middle)
        assert decision.name not in {other.name for other in fixed.decisions}


def test_fixed_where_it_starts_is_the_design_as_given(problem: Problem) -> None:
    fixed = problem
    for decision in problem.decisions:
        fixed = fixed.fix(decision.name)
    assert fixed.decisions == ()
    one, other = laufruhe.evaluate(fixed), laufruhe.evaluate(problem)
    assert one.objective is not None
    assert other.objective is not None
    assert one.objective.value == pytest.approx(other.objective.value, rel=1e-12)


def test_open_and_fixed_undo_each_other(problem: Problem) -> None:
    opened = problem.open("left.y", "60 mm", "120 mm")
    assert next(d for d in opened.decisions if d.name == "left.y").start == pytest.approx(0.1)
    assert opened.fix("left.y").engine == problem.engine


@pytest.mark.parametrize(
    "name",
    [
        "geared-three-leads",
        "two-machines-angle",
        "diesel-70-hp-flywheel",
        "opposed-pistons-lead",
    ],
)
def test_leads_and_rims_take_values_by_the_names_that_results_show(name: str) -> None:
    problem = laufruhe.load(PROBLEMS / f"{name}.toml")
    for decision in problem.decisions:
        for entry in decision_values(decision, 0.3 * decision.lower + 0.7 * decision.upper):
            result = problem.with_values({entry.name: f"{entry.value!r} {entry.unit}".rstrip()})
            moved = {d.name: d.start for d in result.decisions}
            assert moved.pop(decision.name) == pytest.approx(entry.value, rel=1e-12)
            assert moved == {d.name: d.start for d in problem.decisions if d is not decision}


def test_throws_take_values_by_the_names_that_results_show() -> None:
    """Check that values of all open throws close them, and that one throw between bounds starts at its value."""
    tables = tomllib.loads((PROBLEMS / "twin-vee-open.toml").read_text(encoding="utf-8"))
    problem = laufruhe.load(tables)
    result = laufruhe.solve(problem)
    values = {d.name: f"{d.value!r} {d.unit}".rstrip() for d in result.decisions}
    assert {"throw 1", "bank angle"} <= set(values)
    again = laufruhe.evaluate(problem.with_values(values))
    assert result.objective is not None
    assert again.objective is not None
    assert again.objective.value == pytest.approx(result.objective.value, rel=1e-9)
    with pytest.raises(InputError, match="give values for all throws"):
        problem.with_values({"throw 2": "40 deg"})
    variant = laufruhe.load(LANCHESTER).with_values({"throw 2": "170 deg"})
    assert variant.engine.slider_cranks[1].throw == pytest.approx(math.radians(170))


def test_shafts_that_a_star_leaves_out_are_left_out() -> None:
    problem = laufruhe.load(PROBLEMS / "two-stroke-four-open.toml")
    throws = {f"throw {k + 1}": f"{angle} deg" for k, angle in enumerate((0, 90, 270, 180))}
    for built in (0, 1):
        result = problem.with_values({**throws, "balancer built": built})
        assert any(rotor.shaft.name == "balancer" for rotor in result.engine.rotors) is bool(built)
        assert result.phasing is None or result.phasing.throws is not None


def test_more_freedom_is_never_worse(problem: Problem) -> None:
    less = laufruhe.solve(problem.fix("left.unbalance", "0.01 kg m"))
    more = laufruhe.solve(problem)
    assert less.objective is not None
    assert more.objective is not None
    assert more.objective.value <= less.objective.value * (1.0 + 1e-6)


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("front web.mas", "1 kg", "did you mean 'front web.mass'?"),
        ("front web.mass", "5 kg", "starts outside its bounds"),
        ("front web.mass", "5 m", "'m' is not a unit of a mass"),
        ("engine.strok", "100 mm", "is not a key here"),
        ("counterweights.nobody.mass", "1 kg", "is not the path of a quantity of this problem"),
        ("whatever", "1", "is not the name of a number of this problem"),
    ],
)
def test_bad_edits_are_refused_as_in_a_file(problem: Problem, name: str, value: str, line: str) -> None:
    with pytest.raises(InputError) as refused:
        problem.with_values({name: value})
    assert line in str(refused.value)
    assert str(refused.value).startswith(str(LANCHESTER))


def test_a_problem_changed_in_code_has_no_file(problem: Problem) -> None:
    with pytest.raises(ModelError, match="made or changed in code"):
        problem.changed(tolerance=1e-2).fix("front web.mass")


@pytest.mark.parametrize("given", [5, None, [], "none.toml", "title = 5", {}, b"x", Path("/nowhere/x.toml")])
def test_errors_are_those_of_the_package(given: object) -> None:
    for call in (laufruhe.load, laufruhe.solve, laufruhe.evaluate, laufruhe.study):
        with pytest.raises(LaufruheError):
            call(given)  # type: ignore[operator]


def test_an_engine_without_points_is_refused(problem: Problem) -> None:
    with pytest.raises(ModelError, match="has no operating point"):
        laufruhe.evaluate(problem.engine)


def test_a_problem_goes_to_another_process(problem: Problem) -> None:
    result = pickle.loads(pickle.dumps(problem))
    assert result.fix("front web.mass", "1 kg").engine == problem.fix("front web.mass", "1 kg").engine


@pytest.mark.parametrize(("names", "rotor_names"), [
    ([None], ["s"]), (["a"], ["s.a"]), ([None, None], ["s.1", "s.2"]), (["a", None, "b"], ["s.a", "s.2", "s.b"]),
])  # fmt: skip
def test_unbalances_of_a_shaft_have_the_same_name_everywhere(names: list[str | None], rotor_names: list[str]) -> None:
    """Compare names in results and in edits."""
    tables = tomllib.loads(LANCHESTER.read_text(encoding="utf-8"))
    weights = [{"x": f"{10 * k} mm", "unbalance": "0.01 kg m"} for k in range(len(names))]
    for weight, name in zip(weights, names, strict=True):
        weight.update({} if name is None else {"name": name})
    del tables["constraints"]
    tables["balancer_shafts"] = [{"name": "s", "ratio": 2, "position": ["0 mm", "0 mm"], "unbalances": weights}]
    problem = laufruhe.load(tables)
    assert [rotor.name for rotor in problem.engine.rotors if rotor.shaft.name == "s"] == rotor_names
    for k, name in enumerate(rotor_names):
        other = problem.with_values({f"{name}.unbalance": "0.02 kg m"})
        moved = [one.name for one in other.engine.rotors if one.shaft.name == "s" and abs(one.unbalance) > 0.015]
        assert moved == [rotor_names[k]]
