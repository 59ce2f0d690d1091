"""Studies of elastic mounts whose objective speaks of the mounts alone: sag, stiffness, transmissibility."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.errors import InputError
from laufruhe.extensions.sweeps.sweep import SweepTable, axis_of
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.solvers import evaluate_only, solve
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from mounts.files import BLOCK, ENGINE, MOUNTS, SAG, changed
from problem_files import PROBLEMS

LIMIT = "constraints.1.max"
SHAFT = """
[[balancer_shafts]]
name = "left"
ratio = 2
position = ["90 mm", "-60 mm"]
[[balancer_shafts.unbalances]]
x = "0 mm"
unbalance = { between = ["0 kg m", "0.05 kg m"] }
[search]
starts = 1
boxes = 50
"""


def study(folder: Path, kind: str, more: str = "", in_case: str = "", problem: str = SAG) -> Path:
    (folder / "soft.toml").write_text(ENGINE + BLOCK + MOUNTS + problem)
    path = folder / "s.toml"
    path.write_text(
        f'title = "t"\n[study]\n[[study.parts]]\nname = "p"\nkind = "{kind}"\ntitle = "t"\n{more}\n'
        f'[[study.parts.cases]]\nname = "soft"\nproblem = "soft.toml"\n{in_case}\n'
    )
    return path


def swept(quantity: str, text: str) -> str:
    return f'[[study.parts.sweep]]\nquantity = "{quantity}"\n{text}\n'


def computed(path: Path) -> xr.Dataset:
    return run(load_study(path), path.parent, path.parent / "kept.jsonl")[0]["p"]


SPAN = 'from = "10 Hz"\nto = "16 Hz"\npoints = 3'
FREQUENCIES = swept(LIMIT, SPAN)


def test_sag_over_the_highest_frequency_is_what_solve_finds(tmp_path: Path) -> None:
    data = computed(study(tmp_path, "layout comparison", FREQUENCIES))
    assert data[LIMIT].values.tolist() == [10.0, 13.0, 16.0]
    assert data[LIMIT].attrs["units"] == "Hz"
    assert data.attrs["metric"] == "static sag"
    assert data["objective"].attrs["units"] == "m"
    assert set(data["proof"].values) == {"global"}
    initial = evaluate_only(load(tmp_path / "soft.toml")).objective
    assert initial is not None
    for k, highest in enumerate((10, 13, 16)):
        (tmp_path / "one.toml").write_text(ENGINE + BLOCK + MOUNTS + changed(SAG, ("40/3 Hz", f"{highest} Hz")))
        alone = solve(load(tmp_path / "one.toml"))
        assert alone.objective is not None
        assert data["objective_given"].values[k] == pytest.approx(initial.value, rel=1e-12)
        assert data["objective"].values[k] == pytest.approx(alone.objective.value, rel=1e-7)
        assert data["lower_bound"].values[k] <= data["objective"].values[k] * (1.0 + 1e-9)
    assert (np.diff(data["objective"].values) < 0.0).all(), "more room for frequencies, less sag"


def test_files_of_a_sag_study_are_in_the_units_of_a_reader(tmp_path: Path) -> None:
    named = changed(SAG, ("[[constraints]]", '[[constraints]]\nname = "highest mode"'))
    path = study(tmp_path, "layout comparison", swept("constraints.highest mode.max", SPAN), problem=named)
    answer = CliRunner().invoke(app, ["study", str(path), "--out", str(tmp_path / "out")])
    assert answer.exit_code == 0, answer.output
    report = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert "| highest mode, at most [Hz] | static sag, initial [mm] |" in report
    with xr.open_dataset(tmp_path / "out" / "p.nc") as data:
        assert data["objective"].attrs["units"] == "m"
        assert "constraints.highest_mode.max" in data.coords
        assert f"{1e3 * float(data['objective'][0]):.5g} |" in report


def test_a_metric_of_the_mounts_takes_the_place_of_the_objective(tmp_path: Path) -> None:
    """Least stiffness over the mass of the block: the limit from above on frequencies leaves the lower bounds."""
    sweep = 'metric = "total stiffness"\n' + swept("block.mass", 'values = ["400 kg", "440 kg"]')
    data = computed(study(tmp_path, "layout comparison", sweep))
    assert data["objective"].attrs["units"] == "N/m"
    assert data["objective"].values == pytest.approx(4.0 * (120e3 + 120e3 + 20e3), rel=1e-6)


@pytest.mark.parametrize("kind", ["balancer sizing", "counterweight fraction"])
def test_balancing_that_cannot_change_the_objective_is_refused(tmp_path: Path, kind: str) -> None:
    path = study(tmp_path, kind, problem=SAG + SHAFT)
    with pytest.raises(InputError, match=r"objective: is static sag, which no .* changes"):
        computed(path)


def test_equal_power_does_not_rebuild_a_block_on_springs(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="equal_power_to cannot scale a block"):
        computed(study(tmp_path, "layout comparison", in_case="equal_power_to = 2"))


@pytest.mark.slow
def test_shafts_are_sized_for_transmissibility(tmp_path: Path) -> None:
    """Check that an engine without its shaft minimises transmissibility with its mounts."""
    objective = '[objective]\nminimise = "transmissibility"\norders = [2]\n'
    stiff = changed(MOUNTS, ('"4000 N/mm"', '"300 N/mm"'), ("400 N/mm", "200 N/mm"))
    path = study(tmp_path, "balancer sizing", problem=SHAFT + objective)
    (tmp_path / "soft.toml").write_text(ENGINE + BLOCK + stiff + SHAFT + objective)
    data = computed(path)
    assert data["shafts"].values.tolist() == ["none", "left"]
    assert (data["objective"].values < 0.9 * data["objective_given"].values).all()
    assert data["decision"].values.tolist()[:2] == ["front left.stiffness.z", "rear left.stiffness.z"]
    assert np.isfinite(data["decided"].values[:, :2]).all()


def test_limits_are_swept_in_their_own_dimension() -> None:
    """Check that a swept limit has the unit of its quantity, and that plain numbers stay text."""
    ratio = axis_of(SweepTable.model_validate({"quantity": LIMIT, "from": "0.2", "to": "0.4", "points": 3}))
    assert ratio.values == ("0.2", "0.3", "0.4")
    assert (ratio.unit, ratio.numbers) == ("1", (0.2, 0.3, 0.4))
    listed = axis_of(SweepTable.model_validate({"quantity": "constraints.weight.max", "values": ["2 kg", "500 g"]}))
    assert (listed.unit, listed.numbers, listed.name) == ("kg", (2.0, 0.5), "weight, at most")
    place = axis_of(SweepTable.model_validate({"quantity": "mounts.places.a.position.1", "values": ["1 m", "2 m"]}))
    assert place.name == "position 1"


NEWER_KEYS = {
    "fluid": 'fluid_track = { axis = "z", mass = "28 kg", bulge_stiffness = "220 N/mm", chamber_stiffness = "4 N/mm", '
    'damping = "700 N s/m" }\n',
    "table": 'dynamic_stiffness = { axis = "z", file = "hydraulic-mount.csv" }\n',
    "joined": '[[mounts.places]]\njoined_to = "first"\nturned = [0, 35, 0]\n'
    'stiffness = ["60 N/mm", "60 N/mm", "90 N/mm"]\ndamping_per_stiffness = "0.6 ms"\n',
}


@pytest.mark.slow
@pytest.mark.parametrize("key", NEWER_KEYS)
def test_studies_of_newer_mounts_have_the_loads_of_their_designs(tmp_path: Path, key: str) -> None:
    (tmp_path / "hydraulic-mount.csv").write_bytes((PROBLEMS / "hydraulic-mount.csv").read_bytes())
    places = [("first", 300, 220), ("right", 300, -220), ("rear", -420, 0)]
    mounts = '[mounts]\nkind = "elastic"\nloss_factor = 0.1\n'
    for name, x, y in places:
        mounts += f'[[mounts.places]]\nname = "{name}"\nposition = ["{x} mm", "{y} mm", "0 mm"]\n'
        mounts += 'stiffness = ["120 N/mm", "150 N/mm", "200 N/mm"]\n' + (NEWER_KEYS[key] if name == "first" else "")
    problem = '[objective]\nminimise = "mean mount force"\n' + SHAFT.partition("[search]")[0]
    draws = study(tmp_path, "random designs", "draws = 4", problem="")
    (tmp_path / "soft.toml").write_text(ENGINE + BLOCK + mounts + problem)
    result, scene = computed(draws), load(tmp_path / "soft.toml")
    for unbalance, objective in zip(result["left.unbalance"].values[0], result["objective"].values[0], strict=True):
        design = scene.design([complex(unbalance)])
        assert objective == pytest.approx(objective_value(scene, evaluate(scene, design)), rel=1e-9)
    speed = scene.points[0].speed
    lines = f'speeds = {{ from = "{0.9 * speed!r} rad/s", to = "{speed!r} rad/s", points = 2 }}\n'
    draws.write_text(draws.read_text().replace("random designs", "speed map").replace("draws = 4", lines))
    (tmp_path / "kept.jsonl").unlink(missing_ok=True)
    seen = computed(draws)
    last = np.flatnonzero((seen["design"].values == "initial") & (seen["speed"].values == seen["speed"].values.max()))
    objective = float(seen["value"].values[last[0], 0])
    assert objective == pytest.approx(objective_value(scene, evaluate(scene, scene.engine)), rel=1e-5)


@pytest.mark.slow
def test_explain_says_at_which_stiffness_modes_are() -> None:
    outcome = CliRunner().invoke(app, ["explain", str(PROBLEMS / "powertrain-hydraulic.toml")])
    assert outcome.exit_code == 0
    assert "modes are of the stiffness at rest" in outcome.output
