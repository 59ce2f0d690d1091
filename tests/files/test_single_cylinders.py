"""Cylinders that differ: keys of their own, pistons that never fire, and a column of pressure for each."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.chambers.gas import Chambers
from laufruhe.machine.gas.base import CylinderGases
from laufruhe.physics.shaking_loads import shaking_loads

ENGINE: dict[str, Any] = {
    "layout": "inline", "cycle": "four-stroke", "bore": "80 mm", "stroke": "90 mm", "rod_ratio": 0.28,
    "reciprocating_mass": "0.6 kg", "rotating_mass": "0.4 kg", "cylinder_spacing": "90 mm",
    "throws": [0, 180, 180, 0], "firing_order": [1, 3, 4, 2],
}  # fmt: skip
GAS: dict[str, Any] = {"model": "seiliger", "peak_pressure": "60 bar", "imep": "8 bar"}


def tables(single: list[dict[str, Any]] | None = None, gas: dict[str, Any] | None = None, **engine: Any) -> Any:
    settings = {"title": "x", "engine": {**ENGINE, **engine}, "operating_points": [{"speed": "3000 rpm"}]}
    settings["engine"] = {key: value for key, value in settings["engine"].items() if value is not None}
    if single is not None:
        settings["engine"]["single_cylinders"] = single
    return {**settings, "gas": GAS if gas is None else gas}


def refusal(tables: Any) -> str:
    with pytest.raises(laufruhe.InputError) as error:
        laufruhe.load(tables)
    return str(error.value)


def loads(problem: Any) -> np.ndarray:
    return np.asarray(shaking_loads(problem.engine, problem.points[0], problem.fidelity).coefficients)


def test_keys_count_for_the_named_cylinders_alone() -> None:
    rows = [{"cylinders": 1, "bore": "79 mm"}, {"cylinders": [2, 3], "reciprocating_mass": "0.7 kg"}]
    parts = laufruhe.load(tables(rows)).engine.slider_cranks
    assert [part.bore for part in parts] == pytest.approx([0.079, 0.08, 0.08, 0.08])
    assert [part.reciprocating_mass for part in parts] == pytest.approx([0.6, 0.7, 0.7, 0.6])


def test_a_throw_carries_the_shares_of_its_cylinders() -> None:
    vee = {"layout": "vee", "bank_angle": 90, "throws": [0, 90], "firing_order": None}
    engine = laufruhe.load(tables([{"cylinders": 3, "rotating_mass": "0.3 kg"}], **vee)).engine
    assert [abs(rotor.unbalance) for rotor in engine.rotors] == pytest.approx([0.5 * 0.045, 0.4 * 0.045])


def test_an_offset_of_its_own_keeps_the_crank_and_fires_at_its_own_dead_centre() -> None:
    problem = laufruhe.load(tables([{"cylinders": 2, "offset": "6 mm"}], throws=None))
    part = problem.engine.slider_cranks[1]
    assert part.crank_radius == 0.045
    assert part.fires_at == pytest.approx(np.arcsin(6.0 / (45.0 + 45.0 / 0.28)))
    assert np.degrees(problem.engine.firing_intervals) == pytest.approx([180.0] * 4)


def test_distances_along_the_crank_count_from_the_front() -> None:
    problem = laufruhe.load(tables(cylinder_spacing=["80 mm", "100 mm", "120 mm"]))
    assert [part.x for part in problem.engine.slider_cranks] == pytest.approx([0.15, 0.07, -0.03, -0.15])


def test_an_open_mass_of_one_cylinder_is_a_decision() -> None:
    settings = tables([{"cylinders": 2, "reciprocating_mass": {"between": ["0.5 kg", "0.9 kg"]}}])
    settings["objective"] = {"minimise": "rms shaking force"}
    result = laufruhe.solve(laufruhe.load(settings))
    assert result.decisions[0].name == "reciprocating mass of cylinder 2"
    assert result.certificate is not None
    assert result.certificate.kind.value == "global"


def test_a_compressor_beside_an_engine_has_chambers_and_no_firing() -> None:
    pump = {"cylinders": [4], "end": "head", "bore": "60 mm", "pump": {"suction": "1 bar", "delivery": "8 bar"}}
    single, order = [{"cylinders": 4, "bore": "0 mm"}], {"throws": [0, 240, 120, 30], "firing_order": [1, 3, 2]}
    problem = laufruhe.load(tables(single, {**GAS, "chambers": [pump]}, **order))
    gas = problem.points[0].gas
    assert isinstance(gas, CylinderGases)
    assert isinstance(gas.of_cylinder("cylinder 4"), Chambers)
    assert len(problem.engine.firing_intervals) == 3
    still = laufruhe.load(tables(single, GAS, **order))
    difference = loads(problem)[:, 3] - loads(still)[: len(loads(problem)), 3]
    # work of the pump over a turn: pressure difference times swept volume
    work = 7e5 * np.pi / 4 * 0.06**2 * problem.engine.slider_cranks[3].stroke
    assert abs(difference[0].real) == pytest.approx(work / (2.0 * np.pi), rel=1e-6)
    # it works every turn
    assert np.abs(difference[1:40:2]).max() < 1e-9 * np.abs(difference).max()


def test_an_imep_of_an_operating_point_keeps_the_ratio_of_single_cylinders() -> None:
    settings = tables(gas={**GAS, "single_cylinders": [{"cylinders": 2, "imep": "6 bar"}]})
    settings["operating_points"][0]["imep"] = "4 bar"
    gas = laufruhe.load(settings).points[0].gas
    assert isinstance(gas, CylinderGases)
    assert [gas.of_cylinder(f"cylinder {k}").imep for k in (1, 2)] == pytest.approx([4e5, 3e5])  # type: ignore[union-attr]


def test_columns_of_pressure_count_from_their_cylinder_or_from_cylinder_1(tmp_path: Path) -> None:
    angles = np.arange(-360.0, 360.0, 2.0)
    peaks = [60.0, 55.0, 62.0, 58.0]
    later = dict(zip([1, 3, 4, 2], [0.0, 180.0, 360.0, 540.0], strict=True))

    def pressure(since: np.ndarray, peak: float) -> np.ndarray:
        local = np.mod(since + 360.0, 720.0) - 360.0
        return np.asarray(1.0 + peak * np.exp(-(((local - 12.0) / 25.0) ** 2)))

    loaded = []
    for kind in ("own", "common"):
        shifts = [later[k + 1] if kind == "common" else 0.0 for k in range(4)]
        columns = [pressure(angles - shift, peak) for shift, peak in zip(shifts, peaks, strict=True)]
        text = "\n".join(",".join(f"{v:.10g}" for v in row) for row in np.column_stack([angles, *columns]))
        (tmp_path / f"{kind}.csv").write_text("angle [deg],P1,P2,P3,P4\n" + text + "\n", encoding="utf-8")
        gas = {
            "model": "trace", "file": str(tmp_path / f"{kind}.csv"), "cylinder_columns": ["P1", "P2", "P3", "P4"],
            "cylinder_angles": kind, "pressure_unit": "bar", "angle_zero": "firing", "smooth": False,
        }  # fmt: skip
        loaded.append(laufruhe.load(tables(gas=gas)))
        if kind == "common":
            assert "after its firing" in refusal(tables(gas={**gas, "cylinder_angles": "own"}))
            wrong = {**gas, "cylinder_columns": ["P1", "P2"]}
            assert "has 2 columns for 4 cylinders that fire" in refusal(tables(gas=wrong))
            open_crank = tables(gas=gas, throws="open", firing_order="open", cylinders=4)
            assert "the crank is open" in refusal(open_crank)
    own, common = map(loads, loaded)
    count = min(len(own), len(common))
    assert own[:count] == pytest.approx(common[:count], abs=1e-6 * np.abs(own).max())
    # cylinder 2 has the second peak
    gas = loaded[0].points[0].gas
    assert max(gas.of_cylinder("cylinder 2").pressures) == pytest.approx(56e5, rel=1e-6)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (tables([{"cylinders": 7, "bore": "70 mm"}]), "is not among 4 cylinders"),
        (tables([{"cylinders": [1, 1], "bore": "70 mm"}]), "is given twice"),
        (tables([{"cylinders": 1, "bore": "0 mm"}]), "name every cylinder with a bore once"),
        (tables([{"cylinders": 1, "bore": "0 mm"}], firing_order=[2, 3, 4], throws=None), "give the throws"),
        (tables(cylinder_spacing=["90 mm", "80 mm"]), "has 2 distances between 4 places along the crank"),
        (tables(layout="vee", bank_angle=90, throws=[0, 90], single=[{"cylinders": 1, "stroke": "80 mm"}],
                firing_order=None), "two crank radii on one throw"),
        (tables([{"cylinders": 4, "bore": "0 mm"}], firing_order="open", throws="open", cylinders=4), "never fires"),
        (tables(gas={**GAS, "single_cylinders": [{"cylinders": 9, "imep": "7 bar"}]}), "is not among 4 cylinders"),
        (tables([{"cylinders": 1, "second_reciprocating_mass": "1 kg"}]), "cannot be that of a single cylinder"),
    ],
)  # fmt: skip
def test_a_wrong_row_is_refused_with_its_reason(settings: Any, message: str) -> None:
    assert message in refusal(copy.deepcopy(settings))
