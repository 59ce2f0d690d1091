"""Many draws, compared one by one with the exact model and `solve`, in pieces of any size."""

from __future__ import annotations

import errno
import os
import shutil
import socket
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.errors import InputError, SolverError
from laufruhe.extensions.random_studies.draws import Draws
from laufruhe.files.reader import load
from laufruhe.numerics.workers import working_on
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.solvers import solve
from laufruhe.studies import scenes
from laufruhe.studies.reader import load_study
from laufruhe.studies.runner import run
from laufruhe.studies.stores import FINISHED_POINTS
from problem_files import PROBLEMS, changed, written

SINGLE, FOUR = "tractor-single.toml", "tractor-four-lanchester.toml"
HEAD = 'title = "t"\n[study]\n[[study.parts]]\nname = "p"\ntitle = "t"\n'
SPEED = '{ quantity = "operating_points.1.mean_piston_speed", from = "6 m/s", to = "12 m/s" }'
RATIO = '{ quantity = "engine.rod_ratio", from = 0.2, to = 0.33, spacing = "log" }'


def computed(folder: Path, keys: str, problem: str = FOUR) -> xr.Dataset:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "s.toml"
    path.write_text(f'{HEAD}{keys}\ncases = [{{ name = "c", problem = "{problem}" }}]\n', encoding="utf-8")
    return run(load_study(path), PROBLEMS, folder / "out" / FINISHED_POINTS)[0]["p"]


DESIGNS = 'kind = "random designs"\n'
SCENES = 'kind = "random scenes"\n'


def test_pieces_change_no_draw(tmp_path: Path) -> None:
    one = computed(tmp_path / "1", DESIGNS + "draws = 50\nchunk = 7")
    other = computed(tmp_path / "2", DESIGNS + "draws = 50\nchunk = 50")
    # a matrix product of other rows is rounded otherwise
    np.testing.assert_allclose(one["objective"], other["objective"], rtol=1e-12)
    assert one.drop_vars("objective").identical(other.drop_vars("objective"))
    # more draws begin with those that were there
    more = computed(tmp_path / "1", DESIGNS + "draws = 64\nchunk = 7")
    assert more["objective"].values[:, :49].tobytes() == one["objective"].values[:, :49].tobytes()
    seeded = computed(tmp_path / "3", DESIGNS + "draws = 50\nseed = 7")
    assert not np.any(seeded["objective"].values == one["objective"].values)


def angle_of(data: xr.Dataset, name: str, k: int) -> float:
    """Return the angle of an unbalance in a draw [rad], zero where it is not drawn."""
    key = f"{name.rsplit('.', 1)[0]}.angle"
    return float(data[key][k]) if key in data else 0.0


def test_designs_are_those_of_the_exact_model(tmp_path: Path) -> None:
    data = computed(tmp_path, DESIGNS + "draws = 400").isel(case=0)
    problem = load(PROBLEMS / FOUR)
    names = [decision.name for decision in problem.decisions]
    assert names
    assert 0.0 < float(data["within_limits"].mean()) < 1.0
    for k in range(0, 400, 40):
        values = [float(data[name][k]) * np.exp(1j * angle_of(data, name, k)) for name in names]
        exact = evaluate(problem, problem.design(values))
        assert float(data["objective"][k]) == pytest.approx(objective_value(problem, exact), rel=1e-9)
        assert bool(data["within_limits"][k]) == (exact.violation(problem.limits) <= 1e-6)
    for decision in problem.decisions:
        drawn = data[decision.name].values
        assert decision.lower <= drawn.min() < drawn.max() <= decision.upper
    allowed = data["objective"].values[data["within_limits"].values > 0.0]
    best = solve(problem)
    assert float(data["optimum"]) == best.objective.value
    assert float(data["lower_bound"]) <= float(data["optimum"]) <= allowed.min()


@pytest.mark.slow
def test_scenes_are_those_that_are_solved_alone(tmp_path: Path) -> None:
    keys = f"{SCENES}draws = 4\nchunk = 3\nvary = [{SPEED}, {RATIO}]"
    data = computed(tmp_path, keys, SINGLE).isel(case=0)
    ratios = data["engine.rod_ratio"].values
    assert np.all((ratios >= 0.2) & (ratios <= 0.33))
    problem = load(PROBLEMS / SINGLE)
    for k in range(4):
        text = (PROBLEMS / SINGLE).read_text(encoding="utf-8")
        lines = [
            f"rod_ratio = {float(ratios[k])!r}" if line.startswith("rod_ratio")
            else f'mean_piston_speed = "{float(data["operating_points.1.mean_piston_speed"][k])!r} m/s"'
            if line.startswith("mean_piston_speed") else line
            for line in text.splitlines()
        ]  # fmt: skip
        (tmp_path / "one.toml").write_text("\n".join(lines), encoding="utf-8")
        alone = solve(load(tmp_path / "one.toml"))
        assert float(data["objective"][k]) == alone.objective.value
        assert float(data["lower_bound"][k]) == alone.certificate.lower_bound
        assert float(data[problem.decisions[0].name][k]) == alone.decisions[0].value
        assert data["proof"].attrs["flag_meanings"].split()[int(data["proof"][k])] == str(alone.certificate.kind)


@pytest.mark.slow
def test_engines_that_cannot_be_are_counted(tmp_path: Path) -> None:
    """Below about 4.3 kp/cm^2 no cycle reaches the peak pressure; the draws beside it go on."""
    vary = '[{ quantity = "gas.imep", from = "3 kp/cm^2", to = "6 kp/cm^2" }]'
    data = computed(tmp_path, f"{SCENES}draws = 6\nvary = {vary}", SINGLE).isel(case=0)
    impossible = data["gas.imep"].values < 4.3
    assert impossible.any()
    assert (~impossible).any()
    assert data["status"].attrs["flag_meanings"].split()[4] == "impossible"
    np.testing.assert_array_equal(data["status"], np.where(impossible, 4, 0))
    np.testing.assert_array_equal(np.isnan(data["objective"]), impossible)


@pytest.mark.slow
def test_the_ready_study_runs_and_goes_on(tmp_path: Path) -> None:
    """Run the ready study with a tenth of its designs and a third of its engines."""
    text = (PROBLEMS / "many-designs.toml").read_text(encoding="utf-8")
    text = changed(changed(text, "draws = 20_000", "draws = 2_000"), "draws = 24\nchunk = 8", "draws = 8\nchunk = 4")
    for name in (SINGLE, FOUR, "tractor-four-lanchester-and-moment.toml"):
        shutil.copy(PROBLEMS / name, tmp_path)
    words = ["study", str(written(tmp_path, text)), "--out", str(tmp_path / "out"), "--jobs", "1"]
    assert CliRunner().invoke(app, words).exit_code == 0
    made = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"designs.nc", "designs.csv", "designs.svg", "engines.nc", "engines.csv", "engines.svg"} <= made
    with xr.open_dataset(tmp_path / "out/designs.nc") as data:
        assert data.sizes == {"case": 2, "draw": 2_000}
        assert np.all(data["objective"].where(data["within_limits"] > 0.0).min("draw") >= data["lower_bound"])
    with xr.open_dataset(tmp_path / "out/engines.nc") as data:
        assert set(data["proof"].values.ravel().tolist()) == {0}
        assert np.all(data["objective"] <= data["objective_given"])
    assert len(list((tmp_path / "out.draws/designs").glob("*.npz"))) == 2
    again = CliRunner().invoke(app, words)
    assert again.exit_code == 0
    assert "0.0 s on one core" not in again.stdout


def test_any_executor_does(tmp_path: Path) -> None:
    alone = computed(tmp_path / "1", DESIGNS + "draws = 60\nchunk = 7")
    with ThreadPoolExecutor(3) as pool, working_on(pool):
        shared = computed(tmp_path / "2", DESIGNS + "draws = 60\nchunk = 7")
    assert shared.identical(alone)


def test_another_program_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker that runs another version may answer otherwise."""
    here = threading.current_thread()
    monkeypatch.setattr(scenes, "program", lambda: "0.1.0" if threading.current_thread() is here else "0.1.1")
    with (
        ThreadPoolExecutor(1) as pool,
        working_on(pool),
        pytest.raises(SolverError, match=f"another Laufruhe or other libraries on {socket.gethostname()}"),
    ):
        computed(tmp_path, DESIGNS + "draws = 5")


def test_a_full_disk_is_one_line_and_the_study_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys, keep, calls = DESIGNS + "draws = 60\nchunk = 10", Draws.keep, iter(range(99))

    def full(self: Draws, *words: Any) -> None:
        if next(calls) >= 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        keep(self, *words)

    with monkeypatch.context() as patched:
        patched.setattr(Draws, "keep", full)
        with pytest.raises(SolverError, match=r"No space left on device.*make room, and the same command goes on"):
            computed(tmp_path / "1", keys)
    assert len(list((tmp_path / "1/out.draws/p").glob("*.npz"))) == 3
    assert computed(tmp_path / "1", keys).identical(computed(tmp_path / "2", keys))


@pytest.mark.parametrize(
    ("keys", "problem", "said"),
    [
        (DESIGNS + "draws = 0", FOUR, "draws"),
        (DESIGNS + "draws = 5", "boxer-four.toml", "nothing to draw"),
        (DESIGNS + "draws = 5", "vee-six-open.toml", "differ in unbalances alone"),
        (SCENES + "draws = 5\nvary = []", FOUR, "vary"),
        (f"{SCENES}draws = 5\nvary = [{SPEED.replace('6 m/s', '13 m/s')}]", FOUR, "does not lie below to"),
        (
            f"{SCENES}draws = 5\nvary = [{RATIO.replace('rod', 'road')}]",
            FOUR,
            "engine.road_ratio: is not the path of a quantity",
        ),
    ],
)
def test_bad_keys_of_random_studies_are_refused_in_a_line(tmp_path: Path, keys: str, problem: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        computed(tmp_path, keys, problem)
    assert "\n" not in str(caught.value)
