"""Labels and units of all variables of all datasets."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import laufruhe
from problem_files import PROBLEMS

FOUR = "tractor-four-lanchester"
SWEEP = [{"quantity": "engine.rod_ratio", "from": 0.2, "to": 0.3, "points": 2}]
PARTS = {
    "counterweight fraction": {
        "sweep": [{"quantity": "counterweights.web.balance_factor", "from": 0, "to": 1, "points": 2}],
        "cases": [{"name": "single", "problem": "tractor-single.toml"}],
    },
    "balancer sizing": {"sweep": SWEEP, "cases": [{"name": "four", "problem": f"{FOUR}.toml"}]},
    "speed map": {
        "cases": [{"name": "four", "problem": f"{FOUR}.toml"}],
        "speeds": {"from": "1000 rpm", "to": "2000 rpm", "points": 2},
    },
    "percentile": {"cases": [{"name": "four", "problem": f"{FOUR}.toml"}], "share": 90},
}


def unlabelled(data: xr.Dataset) -> list[str]:
    """Return the variables without a name, or numbers without a unit and without the coordinate of their units."""
    faults = []
    for name, values in data.variables.items():
        has_unit = values.attrs.get("unit_of", "") in data.coords or bool(values.attrs.get("units"))
        if not values.attrs.get("long_name") or (values.dtype.kind in "fiuc" and not has_unit):
            faults.append(f"{name} {values.attrs}")
    return faults


def test_a_variable_without_a_unit_is_noticed() -> None:
    data = xr.Dataset({"force": ("angle", [1.0], {"long_name": "force"})})
    assert unlabelled(data) == ["force {'long_name': 'force'}"]


@pytest.mark.slow
def test_results_and_rows_are_labelled() -> None:
    designs = xr.Dataset({"left.unbalance": ("a", [0.0, 0.01]), "left.angle": ("b", np.array([0.0, 1.0]))})
    datasets = [laufruhe.evaluate_many(FOUR, designs), *laufruhe.load(FOUR).affine().values()]
    for name in (FOUR, "powertrain-least-force", "tractor-four-bearings"):
        result = laufruhe.evaluate(name)
        datasets += [result.forces(36), result.orders(), result.harmonics()]
    datasets.append(laufruhe.evaluate("powertrain-least-force").modes())
    assert {name for data in datasets for name in data} >= {"mount_travel", "main_bearing_force", "slope", "energy"}
    for data in datasets:
        assert unlabelled(data) == []


def test_harmonics_sum_to_the_loads_over_the_crank_angle() -> None:
    """f(phi) = Re sum c e^{i h phi}, on elastic mounts, without the kinks that gas has beyond the listed orders."""
    result = laufruhe.evaluate("inline-five-elastic")
    harmonics, forces, orders = result.harmonics(), result.forces(72), result.orders()
    angle = np.radians(forces.angle)
    for name in ("shaking_force", "shaking_moment", "mount_force"):
        total = (harmonics[name] * np.exp(1j * harmonics.order * angle)).sum("order").real
        xr.testing.assert_allclose(total.transpose(*forces[name].dims), forces[name], rtol=1e-9, atol=1e-8)
        alternating = abs(harmonics[name]).max("direction") - 1e-9
        assert bool((alternating <= orders[name]).all()), name
    hertz = harmonics.frequency.isel(design=0, point=0)
    assert np.allclose(hertz, harmonics.order * result.problem.points[0].speed / (2.0 * np.pi))


@pytest.mark.slow
@pytest.mark.parametrize("kind", PARTS)
def test_studies_are_labelled(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(PROBLEMS)
    part = {"name": "part", "kind": kind, "title": kind, **PARTS[kind]}
    (data,) = laufruhe.study({"title": "One part", "study": {"parts": [part]}}).values()
    assert unlabelled(data) == []


@pytest.mark.slow
def test_mode_shapes_have_a_modal_mass_of_one() -> None:
    result = laufruhe.evaluate("powertrain-least-force")
    modes, block = result.modes().isel(design=0), result.final.engine.block
    assert block is not None
    shapes = np.hstack([modes["shift"], modes["turn"]])
    assert shapes @ block.mass_matrix @ shapes.T == pytest.approx(np.eye(6), abs=1e-12)
