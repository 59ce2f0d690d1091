"""Engines in code are those of problem files: every key is an argument, and the numbers are the same."""

from __future__ import annotations

import inspect
import math
import tomllib
import warnings
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import pint
import pytest

import laufruhe
import python_tables
from lanes import first_fast
from laufruhe import tables
from laufruhe.errors import InputError, LaufruheWarning
from laufruhe.files.fields import Number
from laufruhe.files.nested import Place, at, number_at, tables_on, walk, with_value_at
from laufruhe.files.problem_file import file_model
from laufruhe.problem.problem import Problem
from laufruhe.python import layouts
from laufruhe.python.keys import NAMES
from problem_files import PROBLEMS

ALONE = ("title", "source", "assumptions", "tolerance", "objective", "constraints", "engine", "operating_points")
FIRST = ["tractor-four-lanchester", "vee-six-open", "powertrain-hydraulic", "opposed-pistons-lead", "steam-two-crank"]
READY = [*FIRST, *(p.stem for p in sorted(PROBLEMS.glob("*.toml")) if p.stem not in FIRST)]
unit = pint.UnitRegistry()


def problem_tables(name: str) -> dict[str, Any]:
    """Return the tables of a ready problem; a test of a study is skipped."""
    data = tomllib.loads((PROBLEMS / f"{name}.toml").read_text(encoding="utf-8"))
    if "study" in data:
        pytest.skip("a study has no engine")
    return data


def table_functions(place: Place) -> list[Callable[..., Any]]:
    """Return the functions for the tables that may stand at an address."""
    above, here = ({leaf.__name__ for leaf in tables_on(file_model(), path)} for path in (place, (*place, "")))
    names = [python_tables.snake(name) for name in here - above]
    return [getattr(tables, name) for name in names if hasattr(tables, name)]


def called(node: Any, place: Place) -> Any:
    """Return the tables inside a table, each made by its function."""
    if isinstance(node, list):
        return [called(entry, (*place, k)) for k, entry in enumerate(node)]
    if not isinstance(node, dict):
        return node
    if "between" in node:
        return laufruhe.open(*node["between"], node.get("start"), node.get("tolerance"))
    keys = {name: called(entry, (*place, name)) for name, entry in node.items()}
    arguments = {key: name for name, key in NAMES.items()}
    named = {arguments.get(key, key): entry for key, entry in keys.items() if key != "model"}
    functions = table_functions(place)
    if not functions:  # a table whose keys are names of the user
        return keys
    (made, *_) = [call(**named) for call in functions if takes(call, named)]
    assert made | keys == keys
    return made | keys


def takes(call: Callable[..., Any], named: Mapping[str, Any]) -> bool:
    return set(named) <= set(inspect.signature(call).parameters)


def in_code(found: Mapping[str, Any]) -> Problem:
    """Return the problem of the tables of a file, made by calls in Python."""
    table = found["engine"] if isinstance(found["engine"], dict) else {"catalogue": found["engine"]}
    keys = {key: called(entry, ("engine", key)) for key, entry in table.items() if key != "layout"}
    engine = getattr(laufruhe, table["layout"].replace("-", "_") if "layout" in table else "engine")(**keys)
    for key, value in found.items():
        for entry in value if isinstance(value, list) else [value]:
            if key in (*ALONE, "engine") and key != "operating_points":
                continue
            place = (key, 0) if isinstance(value, list) else (key,)
            name = (
                f"{key}_{entry['model']}" if key == "gas" else key.removesuffix("s") if isinstance(value, list) else key
            )
            named = {part: called(inner, (*place, part)) for part, inner in entry.items() if part != "model"}
            engine = getattr(engine, name)(**named)
    alone = {key: found[key] for key in ("title", "source", "assumptions", "tolerance") if key in found}
    objectives = found.get("objective", [])
    objectives = objectives if isinstance(objectives, list) else [objectives]
    # an engine without mounts needs its objective at once
    problem: Problem = engine.problem(minimise=objectives[0] if objectives else None, **alone)
    for k, goal in enumerate(objectives):
        problem = problem.minimise(**goal) if k == 0 else problem.then_minimise(**goal)
    for limit in found.get("constraints", ()):
        problem = problem.limit(**limit)
    return problem


Write = Callable[[Number, Any], Any]


def in_degrees(number: Number, raw: Any) -> Any:
    """Return an angle with its unit; other numbers as they are."""
    return f"{raw!r} deg" if number.plain is not None and not isinstance(raw, str) else raw


def in_si(number: Number, raw: Any) -> Any:
    """Return a bare SI number; one with a tolerance as it is."""
    return raw if isinstance(raw, str) and any(mark in raw for mark in ("±", "+-", "+/-")) else number.read(raw)


def rewritten(found: Mapping[str, Any], write: Write) -> dict[str, Any]:
    """Return the tables with all numbers written in another way."""
    changed = dict(found)
    for place, node in walk(found):
        number = number_at(file_model(), place)
        if number is None or isinstance(node, list) or (isinstance(node, dict) and "between" not in node):
            continue
        new = node
        if isinstance(node, dict):
            ends = [write(number, bound) for bound in node["between"]]
            new = node | {"between": ends} | ({"start": write(number, node["start"])} if "start" in node else {})
        elif not isinstance(at(changed, place[:-1]), dict) or "between" not in at(changed, place[:-1]):
            new = write(number, node)
        changed = with_value_at(changed, place, new)
    return changed


def same(problem: Problem, other: Problem) -> None:
    assert problem.engine == other.engine
    assert problem.points == other.points
    assert problem.decisions == other.decisions
    assert (problem.objective, problem.limits, problem.ranks) == (other.objective, other.limits, other.ranks)
    assert (problem.title, problem.source, problem.assumptions) == (other.title, other.source, other.assumptions)


@pytest.mark.parametrize("name", first_fast(READY, 5, 24))
def test_a_ready_problem_in_code_is_that_of_its_file(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(PROBLEMS)
    result = problem_tables(name)
    read = laufruhe.load(result)
    for source in (rewritten(result, in_degrees), rewritten(result, in_si)):
        made = in_code(source)
        same(made, read)
        same(laufruhe.load(made.to_toml()), read)


@pytest.mark.parametrize("path", python_tables.MAKERS, ids=lambda path: path.stem)
def test_functions_are_those_of_the_models(path: Any) -> None:
    """`python tests/schemas.py` makes them."""
    assert path.read_text(encoding="utf-8") == python_tables.MAKERS[path]()


def models() -> dict[str, tuple[Place, set[str]]]:
    """Return the keys of every table of a problem file, with an address where it stands."""
    found: dict[str, tuple[Place, set[str]]] = {}
    left: list[Place] = [()]
    while left:
        place = left.pop()
        above = tables_on(file_model(), place)
        for model in tables_on(file_model(), (*place, "")):
            if model not in above and model.__name__ not in found:
                keys = {field.alias or name: name for name, field in model.model_fields.items()}
                found[model.__name__] = (place, set(keys))
                left += [(*place, key) for key in keys] + [(*place, key, 0) for key in keys]
    return found


def test_every_key_of_a_file_is_an_argument() -> None:
    for name, (place, keys) in models().items():
        if name in ("ProblemFile", "EngineTable"):
            continue
        last = python_tables.snake(name)
        goal = {"constraint": "limit", "objective": "then_minimise"}.get(last, "")
        calls = [getattr(tables, last, None), getattr(laufruhe.Problem, goal, None)]
        calls += [getattr(laufruhe.EngineDraft, call, None) for call in (str(place[0]).removesuffix("s"), place[0])]
        calls += [getattr(laufruhe.EngineDraft, f"gas_{last}", None)] if place == ("gas",) else []
        arguments = {NAMES.get(key, key) for key in keys} | keys
        taken = [set(inspect.signature(call).parameters) - {"self"} for call in calls if call is not None]
        inverse = {name: key for key, name in NAMES.items()}
        assert any({inverse.get(key, key) for key in keys - {"model"}} == given for given in taken), (name, arguments)
    engine = {key for call in layout_functions() for key in inspect.signature(call).parameters}
    assert engine == models()["EngineTable"][1] | {"catalogue"}
    assert {"title", "source", "assumptions", "tolerance"} <= set(
        inspect.signature(laufruhe.EngineDraft.problem).parameters
    )


def layout_functions() -> list[Callable[..., Any]]:
    return [call for _, call in inspect.getmembers(layouts, inspect.isfunction) if call.__module__ == layouts.__name__]


def test_every_layout_has_its_function_in_the_package() -> None:
    names = {call.__name__ for call in layout_functions()}
    assert names == {name for name in laufruhe.__all__ if getattr(layouts, name, None) in layout_functions()}
    assert all(getattr(laufruhe, name) is getattr(layouts, name) for name in names)


def test_help_describes_every_argument() -> None:
    calls = [tables.body, laufruhe.vee, laufruhe.EngineDraft.gas_wiebe, laufruhe.EngineDraft.mounts]
    for call in calls:
        lines = (inspect.getdoc(call) or "").splitlines()
        assert set(inspect.signature(call).parameters) - {"self"} <= set(lines)
    assert "    Travel of the piston; with an offset a little more than twice the crank radius [m]." in (
        inspect.getdoc(laufruhe.vee) or ""
    )


def single(**keys: Any) -> laufruhe.EngineDraft:
    return laufruhe.inline(1, cycle="four-stroke", stroke=0.09, rod_ratio=0.3, reciprocating_mass=0.5, **keys)


def test_numbers_are_in_si_units_texts_and_quantities_have_units() -> None:
    for bore in (0.086, "86 mm", 86 * unit.mm, 8.6 * unit.cm, np.float64(0.086)):
        made = single(bore=bore).problem(3000 * unit.rpm, minimise="rms shaking force")
        assert made.engine.cylinders[0].bore == pytest.approx(0.086, rel=1e-15)
        assert made.points[0].speed == pytest.approx(100 * math.pi, rel=1e-15)
    three = partial(laufruhe.inline, cycle="four-stroke", stroke=0.09, rod_ratio=0.3, reciprocating_mass=0.5)
    engines = [
        three(throws=throws, cylinder_spacing=0.1)
        for throws in ([0, 120, 240] * unit.deg, np.radians([0.0, 120.0, 240.0]))
    ]
    assert engines[0].problem(300.0).engine == engines[1].problem(300.0).engine


WRONG: dict[str, Callable[[], Any]] = {
    "engine.throws[2] = 180: is a whole number, and angles without a unit are in radians; write \"180 deg\"":
        lambda: laufruhe.inline(2, cycle="four-stroke", throws=[0, 180]),
    "engine.bank_angle = 22.5: is more than two turns": lambda: laufruhe.vee(4, cycle="four-stroke", bank_angle=22.5),
    "problem: engine.bore = \"86 kg\": 'kg' is not a unit of a length": lambda: single(bore="86 kg").problem(300.0),
    "engine.bore = \"86 kg\": 'kg' is not a unit": lambda: single(bore=86 * unit.kg).problem(300.0),
    "counterweights[1].x = 1j: is complex": lambda: single().counterweight("web", x=1j),
    "counterweights[1].mass = (1+1j): is complex and stands beside an angle":
        lambda: single().counterweight("web", x=0.0, mass=1 + 1j, radius=0.1, angle=0.1),
    "operating_points[1].speed = \"10 m/s\"": lambda: single().problem("10 m/s"),
    "objective: is missing, but numbers of the file are open":
        lambda: single().counterweight("web", balance_factor=laufruhe.open(0, 1)).problem(300.0),
}  # fmt: skip


@pytest.mark.parametrize("message", WRONG)
def test_a_message_names_the_argument(message: str) -> None:
    with pytest.raises(InputError) as caught:
        WRONG[message]()
    assert message in str(caught.value)


def test_an_engine_that_is_not_used_gives_a_warning() -> None:
    engine = single()
    with pytest.warns(LaufruheWarning, match=r"write engine = engine\.counterweight"):
        engine.counterweight("web", x=0.0, mass=1.0, radius=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        heavier = engine.counterweight("web", x=0.0, mass=1.0, radius=0.1)
        assert len(heavier["counterweights"]) == 1
        assert "counterweights" not in engine
        del heavier


def test_a_complex_weight_has_size_and_angle() -> None:
    vector = 0.02 * np.exp(0.3j)
    shaft = partial(single().balancer_shaft, "left", ratio=-1, position=(0.1, 0.0))
    engine = shaft(unbalances=[tables.unbalance(unbalance=vector)])
    (rotor,) = (part for part in engine.problem(300.0).engine.rotors if part.shaft.name == "left")
    assert rotor.unbalance == pytest.approx(vector, rel=1e-15)
    opened = tables.unbalance(unbalance=laufruhe.open(0.0, 0.05), angle=laufruhe.open(0.0, math.tau))
    problem = shaft(unbalances=[opened]).problem(300.0, minimise="rms shaking force")
    for value in (vector, -vector, vector.conjugate()):
        changed = problem.with_values({"left.unbalance": value})
        assert changed.decisions[0].start == pytest.approx(value, rel=1e-12)
        assert changed["left.unbalance"] * np.exp(1j * changed["left.angle"]) == pytest.approx(value, rel=1e-12)
        assert problem.fix("left.unbalance", value).decisions == ()


def test_goals_replace_or_follow_earlier_ones() -> None:
    engine = single().counterweight("web", balance_factor=laufruhe.open(0, 1), radius=0.05)
    problem = engine.problem(300.0, minimise="rms shaking force")
    limited = problem.limit("maximum shaking force", max=2000.0).limit("counterweight mass", max=5)
    assert [limit.maximum for limit in limited.limits] == [2000.0, 5.0]
    assert problem.limits == ()
    assert limited.minimise("mean shaking force", orders=[1]).objective_name == "mean shaking force of order 1"
    ranks = problem.then_minimise("counterweight mass", within=0.1).ranks
    assert [rank.terms[0].measure.name for rank in ranks] == ["rms shaking force", "counterweight mass"]
    assert ranks[0].within == 0.1


def test_numbers_of_a_problem_by_name() -> None:
    problem = laufruhe.load("tractor-four-lanchester")
    assert (problem["left.unbalance"], problem["engine.stroke"], problem["left.y"]) == (0.0, 0.12, 0.1)
    assert problem.quantity("engine.stroke", unit.mm) == 120 * unit.mm
    assert problem.quantity("engine.stroke").to("inch").magnitude == pytest.approx(0.12 / 0.0254)
    with pytest.raises(InputError, match="did you mean 'left"):
        problem["lft.unbalance"]
    with pytest.raises(InputError, match="is no number of this problem"):
        problem["engine.firing_order"]


def test_ready_names_and_lists() -> None:
    examples, engines = laufruhe.examples(), laufruhe.engines()
    assert laufruhe.load("tractor-four-lanchester").title == examples.title["tractor-four-lanchester"]
    assert laufruhe.engine("bmw-b48").problem("3000 rpm").engine.cylinders[0].bore is not None
    assert set(engines.index) >= {"bmw-b48", "yamaha-sr500"}
    with pytest.raises(InputError, match="did you mean 'tractor-four-lanchester'"):
        laufruhe.load("tractor-four-lanchestr")
