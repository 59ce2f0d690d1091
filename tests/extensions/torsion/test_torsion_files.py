"""Table [torsion] of a problem file: the chain that it makes, and the input that it refuses."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.extensions.flywheel.machine import Flywheel
from laufruhe.extensions.torsion.machine import Torsion, stiffness_of
from laufruhe.extensions.torsion.physics import chain_of
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.physics.torque import reduced_inertia
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS

READY = PROBLEMS / "inline-five-torsion.toml"


def changed(**torsion: Any) -> Problem:
    tables = tables_of(READY)
    tables["torsion"] |= torsion
    return load_tables(tables, Path("five.toml"))


def chain(problem: Problem) -> Torsion:
    return chain_of(problem.engine)


def test_a_disc_at_every_throw_with_its_pistons() -> None:
    engine = laufruhe.load(READY).engine
    own = chain(laufruhe.load(READY))
    assert [disc.name for disc in own.discs] == ["pulley", *(f"throw {k}" for k in range(1, 6)), "flywheel"]
    assert own.sections[0].name == "pulley - throw 1"
    (part, *_) = engine.slider_cranks
    # 0.5 kg at the crank radius turns with the throw, its rods are in the part
    assert own.discs[1].inertia == pytest.approx(0.006 + 0.5 * 0.045**2 + reduced_inertia(part))
    assert own.discs[1].cylinders == ("cylinder 1",)
    assert own.driven == 6


def test_one_number_for_each() -> None:
    own = chain(changed(throw_inertia=[f"0.00{k} kg m^2" for k in range(1, 6)], cylinder_damping="1 N m s/rad"))
    steps = [b.inertia - a.inertia for a, b in zip(own.discs[1:5], own.discs[2:6], strict=True)]
    assert steps == pytest.approx([0.001] * 4)
    assert own.discs[3].damping == 1.0
    pieces = [{"length": "30 mm", "diameter": "50 mm"}, {"length": "20 mm", "diameter": "60 mm", "bore": "20 mm"}]
    section = chain(changed(crank={"pieces": pieces})).sections[2]
    assert section.stiffness == pytest.approx(stiffness_of([(0.03, 0.05, 0.0), (0.02, 0.06, 0.02)]))
    assert section.diameter == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("torsion", "said"),
    [
        ({"crank": {"stiffness": "0 N m/rad"}}, "must be more than 0 N m/rad"),
        ({"crank": {"stiffness": "4e5 N m"}}, "is not a unit of a torsional stiffness"),
        ({"crank": {"stiffness": ["4e5 N m/rad"] * 3}}, "has 3 numbers for 4 shafts between throws"),
        ({"crank": {}}, "torsion.crank.stiffness: is missing; give stiffness or pieces"),
        ({"crank": {"pieces": [{"length": "1 mm", "diameter": "9 mm", "bore": "9 mm"}]}}, "is not smaller than the"),
        ({"throw_inertia": ["1 kg m^2"] * 4}, "has 4 numbers for 5 throws"),
        ({"absorbers": [{"name": "d", "on": "pulley", "damping": "2 N m s/rad"}]}, "absorbers[1].inertia: is missing"),
        ({"absorbers": [{"name": "d", "on": "pulley", "inertia": "0 kg m^2"}]}, "must be more than 0 kg m^2"),
        ({"absorbers": [{"name": "d", "on": "pulley", "inertia": "1 kg m^2"}]}, "then nothing holds the ring"),
        ({"absorbers": [{"name": "d", "on": "puley", "inertia": "1 kg m^2"}]}, "did you mean 'pulley'"),
        ({"output": "gearbox"}, "is no disc"),
        ({"throw_inertia": {"between": ["0.01 kg m^2", "0.001 kg m^2"]}}, "has its bounds reversed"),
        ({"discs": []}, None),
    ],
)
def test_bad_input_is_one_line(torsion: dict[str, Any], said: str | None) -> None:
    if said is None:
        assert len(chain(changed(**torsion)).discs) == 5
        return
    with pytest.raises(InputError) as caught:
        changed(**torsion)
    assert len(str(caught.value).splitlines()) == 1
    assert said in str(caught.value)


def test_quantities_of_torsion_name_missing_keys() -> None:
    tables = tables_of(READY)
    for objective, crank, said in (
        ({"minimise": "maximum shaft stress", "sections": ["throw 1"]}, None, "is no shaft section here"),
        ({"minimise": "rms shaft twist", "bearings": ["1"]}, None, "means nothing for shaft twist"),
        ({"minimise": "absorber heat"}, None, "can be limited but not minimised"),
        ({"minimise": "rms shaft stress"}, "none", "needs the diameter of a shaft"),
    ):
        settings = {**tables, "objective": objective}
        if crank:
            stiff = {"stiffness": "1e5 N m/rad"}
            discs = [{**disc, "shaft": stiff} for disc in tables["torsion"]["discs"]]
            settings["torsion"] = {**tables["torsion"], "crank": stiff, "discs": discs}
        with pytest.raises(InputError, match=said):
            load_tables(settings, Path("five.toml"))
    del tables["torsion"]
    with pytest.raises(InputError, match=r"needs the diameter of a shaft; give one in \[torsion\]"):
        load_tables(tables, Path("five.toml"))


def test_more_discs_than_a_shaft_has() -> None:
    disc = {"end": "rear", "inertia": "0.1 kg m^2", "shaft": {"stiffness": "6e5 N m/rad"}}
    discs = [{**disc, "name": f"disc {k}"} for k in range(61)]
    with pytest.raises(InputError, match="has 61 discs, and at most 60 may be given beside the throws"):
        changed(discs=discs)


def test_the_inertia_of_all_that_turns_follows_from_the_discs() -> None:
    """Check the inertia of the discs by hand, and that another inertia in the file must agree."""
    tables = tables_of(READY)
    tables["constraints"] = [{"limit": "degree of irregularity", "max": "0.05"}]
    engine = load_tables(tables, Path("five.toml")).engine
    discs = chain(load_tables(tables, Path("five.toml"))).turning_inertia(engine.slider_cranks)
    assert discs == pytest.approx(5 * (0.006 + 0.5 * 0.045**2) + 0.008 + 0.14, rel=1e-12)
    flywheel = {"flywheel": {"inertia": f"{1.005 * discs:.6g} kg m^2"}}
    assert load_tables({**tables, **flywheel}, Path("five.toml")).engine.extra(Flywheel) is not None
    ring = {"name": "d", "on": "pulley", "inertia": "0.1 kg m^2", "damping": "2 N m s/rad"}
    opened = [{**disc, "inertia": {"between": ["0.1 kg m^2", "0.2 kg m^2"]}} for disc in tables["torsion"]["discs"]]
    both = {"flywheel": {"inertia": f"{discs + 0.1:.6g} kg m^2"}}
    assert load_tables({**tables, **both, "torsion": {**tables["torsion"], "absorbers": [ring]}}, Path("five.toml"))
    free = {"flywheel": {"inertia": {"between": ["0.1 kg m^2", "0.2 kg m^2"]}}}
    for more, said in (
        (both, "differs from the 0.1831 kg m^2 that the discs of [torsion] have without pistons and rods"),
        ({"fidelity": {"crank_inertia": "1 kg m^2"}}, 'fidelity.crank_inertia = "1 kg m^2": differs from'),
        (free, "flywheel.inertia: is open, but the discs of [torsion] give the inertia of all rotating parts"),
        ({**flywheel, "torsion": {**tables["torsion"], "discs": opened}}, "follows from torsion.pulley.inertia"),
    ):
        with pytest.raises(InputError) as caught:
            load_tables({**tables, **more}, Path("five.toml"))
        assert said in str(caught.value)
        assert len(str(caught.value).splitlines()) == 1


def test_shafts_of_a_crankshaft_take_values_by_the_names_that_results_show() -> None:
    tables = tomllib.loads((PROBLEMS / "inline-five-torsion.toml").read_text(encoding="utf-8"))
    disc = tables["torsion"]["discs"][0]
    disc["inertia"] = {"between": ["0.001 kg m^2", "1 kg m^2"]}
    disc["shaft"] = {"pieces": [{"length": "80 mm", "diameter": {"between": ["20 mm", "80 mm"]}}]}
    problem = laufruhe.load(tables)
    values = {"torsion.pulley.inertia": "0.5 kg m^2", "torsion.pulley.diameter": "60 mm"}
    assert [decision.name for decision in problem.decisions] == list(values)
    assert [decision.start for decision in problem.with_values(values).decisions] == [0.5, 0.06]


def test_dampers_take_values_by_the_names_that_results_show() -> None:
    problem = laufruhe.load(PROBLEMS / "inline-five-damper.toml")
    for decision in problem.decisions:
        value = 0.3 * decision.lower + 0.7 * decision.upper
        result = problem.with_values({decision.name: f"{value!r} {decision.unit}"})
        moved = {d.name: d.start for d in result.decisions}
        assert moved.pop(decision.name) == pytest.approx(value, rel=1e-12)
        assert moved == {d.name: d.start for d in problem.decisions if d is not decision}
