"""Exported loads, read back by other libraries and by a strict reader of Nastran, and exported scripts, run."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import pyuff
import xarray as xr
from typer.testing import CliRunner, Result

import laufruhe
from laufruhe.cli import app
from laufruhe.extensions.exchange.command import Target
from laufruhe.extensions.exchange.components import export_loads
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.solvers import evaluate_only
from problem_files import PROBLEMS

ELASTIC, RIGID, TWISTED = "powertrain-hydraulic", "tractor-two", "inline-five-generator"
GRIDS = {"engine": 101, "torque rod": 102, "gearbox": 103}
TEXT = ", ".join(f"{name}={number}" for name, number in GRIDS.items())


def run(name: str, to: str, path: Path, *options: str) -> Result:
    words = ["export", str(PROBLEMS / f"{name}.toml"), "--to", to, "--out", str(path), "--initial", *options]
    result = CliRunner().invoke(app, words)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture(scope="module")
def elastic() -> laufruhe.Result:
    return laufruhe.evaluate(PROBLEMS / f"{ELASTIC}.toml")


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a file of the loads on elastic mounts in a format."""
    folder = tmp_path_factory.mktemp("exported")

    def file(to: str) -> Path:
        path = folder / to
        if not path.exists():
            assert run(ELASTIC, to, path, "--grids", TEXT).exit_code == 0
        return path

    return file


def series_of(result: laufruhe.Result, point: str, place: str, quantity: str, axis: str) -> Any:
    """Return the complex coefficients of one component, with its mean real."""
    name = {"force": "mount_force", "displacement": "mount_travel", "moment": "shaking_moment"}[quantity]
    labels = {"mount": place} if quantity != "moment" else {}
    series = result.harmonics()[name].isel(design=-1).sel(point=point, direction=axis, **labels)
    return series.where(series.order > 0.0, series.real)


@pytest.mark.slow
def test_universal_file_is_read_by_pyuff(exported: Callable[[str], Path], elastic: laufruhe.Result) -> None:
    path = exported("uff")
    text = path.read_text(encoding="ascii")
    assert max(map(len, text.splitlines())) <= 80
    sets = pyuff.UFF(str(path)).read_sets()
    units, nodes = sets[0], sets[1]
    assert (units["type"], units["units_code"], nodes["type"]) == (164, 1, 15)
    places = dict(zip(map(int, nodes["node_nums"]), zip(nodes["x"], nodes["y"], nodes["z"], strict=True), strict=True))
    assert places == {GRIDS[mount.name]: pytest.approx(mount.position) for mount in elastic.problem.engine.mounts}
    forces = elastic.forces().isel(design=-1)
    functions = [one for one in sets if one["type"] == 58]
    # two kinds of functions of force and displacement along three axes of three mounts at two points
    assert len(functions) == 2 * 2 * 3 * 3 * 2
    for one in functions:
        place = next(name for name, node in GRIDS.items() if node == one["rsp_node"])
        point = next(point for point in elastic.problem.points if f"point {point.name}," in one["id4"])
        assert one["z_axis_value"] == pytest.approx(point.speed * 30.0 / np.pi)
        quantity, axis = {13: "force", 8: "displacement"}[one["ordinate_spec_data_type"]], "xyz"[one["rsp_dir"] - 1]
        assert one["ordinate_axis_units_lab"] == {"force": "N", "displacement": "m"}[quantity]
        if one["func_type"] == 1:
            name = {"force": "mount_force", "displacement": "mount_travel"}[quantity]
            expected = forces[name].sel(point=point.name, mount=place, direction=axis).values
            x, kind = np.radians(forces.angle.values) / point.speed, 17
        else:
            assert one["func_type"] == 12
            expected = series_of(elastic, point.name, place, quantity, axis).sel(order=slice(None, 30.0)).values
            x, kind = np.arange(61) * 0.5 * point.speed / (2.0 * np.pi), 18
        assert one["abscissa_spec_data_type"] == kind
        assert one["x"] == pytest.approx(x, rel=1e-5)
        if one["func_type"] == 12:
            # numerical zeros are 0
            assert np.abs(expected[one["data"] == 0.0]).max(initial=0.0) < 1e-7 * np.abs(expected).max()
            expected = np.where(one["data"] == 0.0, 0.0, expected)
        assert one["data"] == pytest.approx(expected, rel=1e-10, abs=1e-90)


@pytest.mark.slow
@pytest.mark.parametrize("to", ["csv", "json"])
def test_tables_have_amplitude_and_phase(to: str, exported: Callable[[str], Path], elastic: laufruhe.Result) -> None:
    path = exported(to)
    if to == "csv":
        assert "# load at crank angle phi: sum over orders of amplitude cos(order phi + phase)\n" in path.read_text()
        table = pd.read_csv(path, comment="#")
    else:
        table = pd.DataFrame(json.loads(path.read_text())["loads"])
    assert len(table) < 24 * 61
    assert table["frequency [Hz]"].values == pytest.approx((table["order"] * table["speed [rpm]"] / 60.0).values)
    polar = table["amplitude"] * np.exp(1j * np.radians(table["phase [deg]"]))
    assert polar.values == pytest.approx((table["real"] + 1j * table["imaginary"]).values, rel=1e-12, abs=1e-12)
    for (point, place, quantity, axis), rows in table.groupby(["operating point", "place", "quantity", "direction"]):
        if place != "block":
            series = series_of(elastic, point, place, quantity, axis).sel(order=slice(None, 30.0))
            expected = series.sel(order=rows["order"].values).values
            assert rows["real"].values + 1j * rows["imaginary"].values == pytest.approx(expected, rel=1e-12)
            # omitted orders are numerical zeros
            largest = table.loc[table["quantity"] == quantity, "amplitude"].max()
            assert np.abs(series.drop_sel(order=rows["order"].values)).max() < 1e-7 * largest
            assert set(rows["grid"]) == {GRIDS[place]}
    about_x = table[(table.direction == "about x") & (table["operating point"] == "idle")]
    moment = series_of(elastic, "idle", "block", "moment", "x").sel(order=about_x["order"].values).values
    assert about_x["real"].values == pytest.approx(moment.real, rel=1e-12)
    assert set(about_x["unit"]) == {"N m"}


@pytest.mark.slow
@pytest.mark.parametrize(("throw", "angle"), [(0, 45), (45, 0), (135, -90)])
def test_the_head_says_where_cylinder_1_has_its_dead_centre(throw: int, angle: int) -> None:
    tables = tables_of(PROBLEMS / "compressor-two-stage.toml")
    problem = load_tables({**tables, "engine": {**tables["engine"], "throws": [throw]}}, PROBLEMS / "set.toml")
    loads = export_loads(evaluate_only(problem), {}, 10.0, millimetres=False)
    assert loads.heading()[-1] == f"phi = {angle} deg: firing dead centre of cylinder 1"


def test_netcdf_has_the_attributes_of_cf(exported: Callable[[str], Path], elastic: laufruhe.Result) -> None:
    with xr.open_dataset(exported("netcdf"), engine="scipy") as data:
        assert data.attrs["Conventions"] == "CF-1.11"
        for values in data.variables.values():
            assert values.attrs["long_name"]
            if values.dtype.kind == "f":
                assert values.attrs["units"] in {"1", "N", "N m", "m", "s", "degree", "Hz", "rad s-1"}
        forces = elastic.forces().isel(design=-1)
        assert np.array_equal(data.mount_force, forces.mount_force)
        assert data.order.values.tolist() == (0.5 * np.arange(61)).tolist()
        series = data.mount_travel_amplitude * np.exp(1j * np.radians(data.mount_travel_phase))
        expected = elastic.harmonics().mount_travel.isel(design=-1).sel(order=slice(0.5, 30.0))
        assert series.sel(order=slice(0.5, 30.0)).values == pytest.approx(expected.values, rel=1e-12)
        times = data.time.sel(point="idle").values
        assert times == pytest.approx(np.radians(data.angle.values) / elastic.problem.points[0].speed)


def cards_of(text: str) -> list[list[int | float | str | None]]:
    """Read bulk data in large fields strictly: widths, marks of continuation, and numbers that are whole or real."""
    cards: list[list[int | float | str | None]] = []
    continues = False
    for line in text.splitlines():
        if line.startswith("$"):
            continue
        assert len(line) <= 73
        head, fields, mark = line[:8], line[8:72].ljust(64), line[72:]
        assert re.fullmatch(r"([A-Z]+[0-9]?)?\* *", head)
        assert mark in ("", "*")
        values: list[int | float | str | None] = []
        for k in range(4):
            field = fields[16 * k : 16 * k + 16].strip()
            is_real = re.fullmatch(r"[+-]?\d+\.\d*(E[+-]\d+)?", field)
            assert is_real or re.fullmatch(r"\d{1,8}|[A-Z]*", field), field
            values.append(None if not field else float(field) if is_real else int(field) if field.isdigit() else field)
        if head.startswith("*"):
            assert continues
            cards[-1] += values
        else:
            assert not continues
            cards.append([head.strip(" *"), *values])
        continues = bool(mark)
    for card in cards:
        assert len(card) % 8 == 1
        while card[-1] is None:
            card.pop()
    return cards


def test_bulk_data_of_nastran(exported: Callable[[str], Path], elastic: laufruhe.Result) -> None:
    cards = cards_of(exported("nastran").read_text(encoding="ascii"))

    def named(name: str) -> dict[Any, list[Any]]:
        return {card[1]: card[2:] for card in cards if card[0] == name}

    areas, waves, tables = named("DAREA"), named("RLOAD1"), named("TABLED1")
    for k, point in enumerate(elastic.problem.points, 9_000_001):
        frequencies, (scale, *members) = np.array(named("FREQ")[k]), named("DLOAD")[k]
        assert scale == 1.0
        assert set(members[::2]) == {1.0}
        orders = np.round(frequencies * 4.0 * np.pi / point.speed) / 2.0
        loaded = set()
        for number in members[1::2]:
            area, _, _, real, imaginary, kind = waves[number]
            grid, direction, factor = areas[area]
            assert (factor, kind) == (1.0, "LOAD")
            loaded.add((grid, direction))
            place = next(name for name, node in GRIDS.items() if node == grid)
            expected = series_of(elastic, point.name, place, "force", "xyz"[direction - 1]).sel(order=orders).values
            parts = []
            for table in (real, imaginary):
                # a linear axis, pairs that rise from rest, and the end
                assert tables[table][:7] == [None] * 7
                assert tables[table][-1] == "ENDT"
                x, y = np.array(tables[table][7:-1]).reshape(-1, 2).T
                assert np.array_equal(x, [0.0, *frequencies])
                parts.append(y[1:])
            wave = parts[0] + 1j * parts[1]
            assert wave == pytest.approx(np.where(wave == 0.0, 0.0, expected), rel=1e-8, abs=1e-90)
            assert np.abs(expected[wave == 0.0]).max(initial=0.0) < 1e-7 * np.abs(expected).max()
        assert loaded == {(grid, direction) for grid in GRIDS.values() for direction in (1, 2, 3)}
        means = {card[2]: card[4:] for card in cards if card[:2] == ["FORCE", k + 500_000]}
        for place, grid in GRIDS.items():
            expected = [series_of(elastic, point.name, place, "force", axis)[0].real.item() for axis in "xyz"]
            assert means[grid] == [1.0, *(pytest.approx(mean, rel=1e-8) for mean in expected)]


def test_moments_of_nastran_in_newton_millimetres(tmp_path: Path) -> None:
    texts = []
    for options in ((), ("--mm",)):
        assert run(RIGID, "nastran", tmp_path / "a.bdf", "--grids", "block=7", *options).exit_code == 0
        texts.append((tmp_path / "a.bdf").read_text())
    assert "$ units: N, N mm, Hz" in texts[1]
    (metres,), (millimetres,) = ([c for c in cards_of(text) if c[0] == "MOMENT"] for text in texts)
    assert millimetres[5] == pytest.approx(1e3 * metres[5], rel=1e-8)
    assert {card[3] for card in cards_of(texts[0]) if card[0] == "DAREA"} <= {1, 2, 3, 4, 5, 6}


def module_of(path: Path) -> dict[str, Any]:
    names: dict[str, Any] = {"__name__": "exported"}
    exec(compile(path.read_text(encoding="utf-8"), path, "exec"), names)
    return names


@pytest.mark.slow
@pytest.mark.validation
@pytest.mark.parametrize("name", [RIGID, "geared-twin"])
def test_script_for_exudyn_agrees(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "engine.py"
    assert run(name, "exudyn", path).exit_code == 0
    script = module_of(path)
    script["DATA"]["points"] = script["DATA"]["points"][-1:]
    assert script["main"]() == 0
    assert "agrees within 1e-06" in capsys.readouterr().out
    script["DATA"]["cylinders"][0]["piston_mass"] *= 1.0 + 1e-5
    assert script["main"]() == 1


@pytest.mark.slow
def test_script_for_open_torsion_agrees(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Compare a branch at another speed, a ring held by damping, and losses of springs."""
    path = tmp_path / "shaft.py"
    assert run(TWISTED, "opentorsion", path).exit_code == 0
    script = module_of(path)
    assert script["main"]() == 0
    assert "natural frequencies [Hz]: 55.892" in capsys.readouterr().out
    script["DATA"]["points"][0]["shaft"]["loss"][0] += 1.0
    script["DATA"]["points"][0]["shaft"]["stiffness"][0] *= 1.0 + 1e-4
    assert script["main"]() == 1


@pytest.mark.parametrize(
    ("name", "to", "options", "words"),
    [
        (ELASTIC, "nastran", (), 'is missing, and loads act on grids; write --grids "engine=101, torque rod=102'),
        (ELASTIC, "nastran", ("--grids", "front=1"), "names no mount; use engine, torque rod, gearbox, block"),
        (ELASTIC, "nastran", ("--grids", "engine=1"), "leaves out mount 'torque rod'"),
        (ELASTIC, "uff", ("--grids", "engine=0"), "needs a whole number from 1 to 99999999"),
        (ELASTIC, "uff", ("--grids", "engine=1,gearbox=1"), "repeats a place or a number"),
        (ELASTIC, "nastran", ("--grids", f"{TEXT}, block=9"), "counts the loads twice"),
        (ELASTIC, "uff", ("--mm",), "does not apply to uff"),
        (ELASTIC, "csv", ("--highest-order", "-1"), "must be zero or more"),
        (ELASTIC, "opentorsion", (), "add [torsion]"),
        ("radial-seven", "exudyn", (), "export its loads"),
        ("geared-inertia", "exudyn", (), "export the loads"),
    ],
)
def test_wrong_options_are_refused(name: str, to: str, options: tuple[str, ...], words: str, tmp_path: Path) -> None:
    result = run(name, to, tmp_path / "file", *options)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert words in line
    assert not (tmp_path / "file").exists()


def test_results_is_the_folder_by_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    problem = str(PROBLEMS / "tractor-single.toml")
    for to in (Target.netcdf, Target.exudyn, Target.csv):
        assert CliRunner().invoke(app, ["export", problem, "--to", to, "--initial", "-q"]).output == ""
    names = sorted(path.name for path in (tmp_path / "results").iterdir())
    assert names == ["tractor-single-exudyn.py", "tractor-single-loads.csv", "tractor-single-loads.nc"]


@pytest.mark.parametrize("to", [Target.csv, Target.json, Target.netcdf, Target.uff, Target.exudyn])
def test_only_files_of_laufruhe_are_replaced(to: str, tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("measured on Monday")
    refused = run("tractor-single", to, path)
    assert refused.exit_code == 2
    assert "is a file that Laufruhe did not make" in refused.stderr
    assert path.read_text() == "measured on Monday"
    path.unlink()
    assert run("tractor-single", to, path).exit_code == 0
    first = path.read_bytes()
    assert run("tractor-single", to, path).exit_code == 0
    assert path.read_bytes() == first
