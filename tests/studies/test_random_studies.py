"""Random studies of ready problems: points, tables and pictures, compared with single problems."""

from __future__ import annotations

import csv
import json
import random
import re
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from faults.damage import as_toml
from lanes import first_fast
from laufruhe.cli import app
from laufruhe.files.reader import load
from laufruhe.solvers import solve
from problem_files import READY

# a solve of one of these takes seconds
SLOW = {
    "inline-five-elastic", "inline-five-uneven-gas", "inline-nine-uneven", "inline-seven-uneven",
    "powertrain-least-force", "tractor-four-elastic", "two-stroke-eight-uneven",
    "tractor-four-robust", "inline-five-damper", "tractor-six-bearings", "inline-five-torsion",
    "selective-assembly", "worked-diesel",
}  # fmt: skip
PROBLEMS = {path.stem: tomllib.loads(path.read_text(encoding="utf-8")) for path in READY if path.stem not in SLOW}
TABLES = sorted(READY[0].parent.glob("*.csv"))
KINDS = ("counterweight fraction", "balancer sizing", "layout comparison", "speed map", "tolerance", "free forces")
# one with a tolerance is no value of a sweep
NUMBER = re.compile(r"^(-?[\d.]+)(?:/(\d+))? ([^±]+)$")


def scene(name: str) -> dict[str, Any]:
    """Return a ready problem at few samples."""
    return {**PROBLEMS[name], "fidelity": {"samples": 144}, "search": {"starts": 1}}


def put(tables: dict[str, Any], path: str, value: Any) -> None:
    """Put a value at a path."""
    here: Any = tables
    *before, last = path.split(".")
    for key in before:
        here = here[int(key) - 1] if isinstance(here, list) else here[key]
    here[last] = value


def sweeps_of(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the closed numbers of engine, gas, mounts, points and limits that may be swept."""
    found: dict[str, Any] = {}
    for table in ("engine", "gas", "mounts", "block"):
        for key, value in tables.get(table, {}).items():
            if isinstance(value, str) and NUMBER.match(value) and key not in ("bore", "peak_pressure"):
                found[f"{table}.{key}"] = value
    for key, value in tables["operating_points"][0].items():
        if isinstance(value, str) and NUMBER.match(value):
            found[f"operating_points.1.{key}"] = value
    for k, limit in enumerate(tables.get("constraints", []), 1):
        if isinstance(limit.get("max"), str) and NUMBER.match(limit["max"]):
            found[f"constraints.{k}.max"] = limit["max"]
    return found


def swept(rng: random.Random, path: str, value: str) -> dict[str, Any]:
    """Return the two or three values about the one that the file has; limits are loosened only."""
    match = NUMBER.match(value)
    assert match is not None
    middle, unit = float(match[1]) / float(match[2] or 1), match[3]
    low, high = (1.0, rng.uniform(1.02, 1.5)) if path.startswith("constraints") else (0.97, rng.uniform(1.01, 1.1))
    low, high = sorted((low * middle, high * middle))
    if rng.random() < 0.5:
        return {"quantity": path, "values": [f"{high:.9g} {unit}", f"{low:.9g} {unit}"]}
    more = {"spacing": "log"} if low > 0.0 and rng.random() < 0.3 else {}
    return {"quantity": path, "from": f"{low:.9g} {unit}", "to": f"{high:.9g} {unit}", "points": 2, **more}


def fits(kind: str, tables: dict[str, Any]) -> bool:
    """Return whether a kind of study applies to a problem."""
    closed = "phasing" not in tables and tables["engine"].get("throws") != "open"
    if kind in ("counterweight fraction", "balancer sizing") and not closed:
        return False
    objective = tables["objective"]
    # a study measures the first objective in an order of rank
    first = objective[0] if isinstance(objective, list) else objective
    quantity = first.get("minimise") or first["terms"][0]["quantity"]
    loads = not any(word in quantity for word in ("sag", "torque", "flywheel"))
    if kind == "balancer sizing":
        return loads and "balancer_shafts" in tables
    if kind == "counterweight fraction":
        return loads and any(isinstance(w.get("balance_factor"), dict) for w in tables.get("counterweights", []))
    if kind == "speed map":
        return loads
    if kind == "free forces" and tables["engine"]["layout"] == "radial":
        # the articulated rods move otherwise than the master rod
        return False
    return kind == "layout comparison" or (len(tables["operating_points"]) == 1 and closed)


def drawn(rng: random.Random, folder: Path) -> dict[str, Any]:
    """Return a random study of one part, with its problems in the folder."""
    kind = rng.choice(KINDS)
    names = [name for name in PROBLEMS if "objective" in PROBLEMS[name] and fits(kind, PROBLEMS[name])]
    chosen = [rng.choice(names)]
    same = [n for n in names if PROBLEMS[n]["objective"] == PROBLEMS[chosen[0]]["objective"]]
    one_cylinder = [n for n in same if all(
        PROBLEMS[n]["engine"].get(k) == PROBLEMS[chosen[0]]["engine"].get(k) for k in ("bore", "stroke"))]  # fmt: skip
    chosen += [rng.choice(one_cylinder)] if rng.random() < 0.5 else []
    for name in chosen:
        (folder / f"{name}.toml").write_text(as_toml(scene(name)), encoding="utf-8")
    for numbers in TABLES:
        shutil.copy(numbers, folder)
    cases = [{"name": f"case {k}", "problem": f"{name}.toml"} for k, name in enumerate(chosen)]
    part: dict[str, Any] = {"name": "p", "kind": kind, "title": "t", "cases": cases}
    if kind in KINDS[:3]:
        each = [sweeps_of(PROBLEMS[name]) for name in chosen]
        paths = [path for path in each[0] if all(path in other for other in each)]
        paths = rng.sample(paths, min(len(paths), rng.choice((0, 1, 1, 2))))
        part["sweep"] = [swept(rng, path, each[0][path]) for path in paths]
    elif kind == "speed map":
        part |= {"speeds": {"from": "900 rpm", "to": "2100 rpm", "points": 4}, "by_order": rng.random() < 0.5}
    elif kind == "tolerance":
        part |= {"tolerances": {"reciprocating_mass": "10 g", "unbalance": "1e-4 kg m"}, "engines": 200}
    else:
        part["spacing"] = "125 mm"
    return {"title": "t", "study": {"parts": [part]}}


@pytest.mark.parametrize("seed", first_fast(range(24), 0, long=(0, 3, 4, 6, *range(8, 24))))
def test_a_random_study_has_points_tables_and_pictures(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    study = drawn(rng, tmp_path)
    (part,) = study["study"]["parts"]
    (tmp_path / "s.toml").write_text(as_toml(study), encoding="utf-8")
    answer = CliRunner().invoke(
        app, ["study", str(tmp_path / "s.toml"), "--out", str(tmp_path / "out"), "--jobs", "1", "--json", "-"]
    )
    assert answer.exit_code == 0, answer.output
    assert {path.name for path in (tmp_path / "out").glob("[!.]*")} == {
        "report.md",
        "report.html",
        "tables.xlsx",
        "p.nc",
        "p.csv",
        "p.svg",
    }
    assert "nan" not in (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    if part["kind"] in KINDS[:3]:
        check_a_point(part, json.loads(answer.stdout)["parts"]["p"], rng, tmp_path)


def check_a_point(part: dict[str, Any], data: dict[str, Any], rng: random.Random, folder: Path) -> None:
    """Compare one row of a sweep with the solve of its problem, changed by hand."""
    coords = {name: one["data"] for name, one in data["coords"].items()}
    row = rng.randrange(len(coords["case"]))
    if "shafts" in coords:
        # with all of its shafts it is the problem itself
        row = max(k for k, case in enumerate(coords["case"]) if case == coords["case"][row])
    case = next(case for case in part["cases"] if case["name"] == coords["case"][row])
    tables = tomllib.loads((folder / case["problem"]).read_text(encoding="utf-8"))
    for sweep in part["sweep"]:
        unit = data["coords"][sweep["quantity"]]["attrs"]["units"]
        put(tables, sweep["quantity"], f"{coords[sweep['quantity']][row]!r} {unit}")
    (folder / "one.toml").write_text(as_toml(tables), encoding="utf-8")
    alone = solve(load(folder / "one.toml"))
    values = {name: one["data"] for name, one in data["data_vars"].items()}
    assert coords["status"][row] == alone.status
    if alone.objective is None:
        return
    assert values["objective_given"][row] == pytest.approx(alone.objective.initial, rel=1e-9, abs=1e-9)
    if alone.certificate is not None and alone.status == "optimal":
        assert values["objective"][row] == pytest.approx(alone.objective.value, rel=1e-6, abs=1e-6)
        assert values["lower_bound"][row] == pytest.approx(alone.certificate.lower_bound, rel=1e-3, abs=1e-3)
    with (folder / "out" / "p.csv").open(encoding="utf-8", newline="") as rows:
        written = list(csv.DictReader(rows))[row]
    column = next(name for name in written if name.startswith("objective") and "given" not in name)
    assert written[column] == "" if values["objective"][row] is None else float(written[column]) >= 0.0
