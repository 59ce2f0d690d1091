"""Estimates of synthetic engines against their true numbers, undetermined numbers, and the command."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from typer.testing import CliRunner

import laufruhe as lr
from extensions.identification.synthetic import engine, hits, measured
from laufruhe.cli import app
from laufruhe.errors import InputError
from laufruhe.extensions.identification.estimate import estimate
from laufruhe.extensions.identification.file import MeasurementTable, measurements_of
from laufruhe.files.complaints import Refused
from laufruhe.problem.decision import column_bounds, domains_of
from problem_files import PROBLEMS

READY = PROBLEMS / "built-twin.toml"


def test_exact_orders_give_the_true_numbers() -> None:
    truth = engine(3)
    answer = estimate(measured(truth, np.random.default_rng(0), 1e-9))
    sizes = [answer.polar(domain)[0][0] for domain in answer.domains]
    assert sizes == pytest.approx([abs(value) for value in truth.values], rel=1e-6)


def test_open_unbalances_are_a_linear_least_squares_problem() -> None:
    truth = engine(4, linear=True)
    measurements = measured(truth, np.random.default_rng(1), 0.1)
    answer = estimate(measurements)
    # columns of the orders from differences, one after the other, and another solver of the linear problem
    low, high = column_bounds(domains_of(truth.problem.decisions))
    from laufruhe.extensions.identification.estimate import _Model

    model = _Model(measurements, answer.domains)
    weights = model.weights(answer.deviations)
    rest = model.residual(0.5 * (low + high))
    matrix = np.column_stack([model.residual(0.5 * (low + high) + step) - rest for step in np.diag(0.1 * (high - low))])
    matrix /= 0.1 * (high - low)
    shift = lsq_linear(
        weights[:, None] * matrix, -weights * rest, (low - 0.5 * (low + high), high - 0.5 * (low + high))
    )
    assert answer.is_linear
    assert answer.values == pytest.approx(0.5 * (low + high) + shift.x, abs=1e-5 * float(np.max(high)))


def test_a_stated_deviation_belongs_to_its_file() -> None:
    # true orders, and the same with 30 % of error and a deviation a hundred times as large, in both orders of files
    truth = engine(4, linear=True)
    right = [
        replace(m, deviation=0.01 * float(np.nanmax(np.abs(m.values))))
        for m in measured(truth, np.random.default_rng(1), 0.001)
    ]
    exact = estimate(right).values
    for is_stated in (True, False):
        wrong = [replace(m, values=1.3 * m.values, deviation=100.0 * (m.deviation or 0.0)) for m in right]
        if not is_stated:
            wrong = [replace(m, deviation=None) for m in wrong]
        answers = [estimate([*a, *b]) for a, b in ((right, wrong), (wrong, right))]
        assert answers[0].values == pytest.approx(answers[1].values, rel=1e-6, abs=1e-9)
        assert sorted(answers[0].deviations) == pytest.approx(sorted(answers[1].deviations), rel=1e-6)
        assert np.isinf(answers[0].freedom) == is_stated
        assert answers[0].values == pytest.approx(exact, abs=2e-2 * float(np.max(np.abs(exact))))


@pytest.mark.slow
@pytest.mark.parametrize(("count", "least"), [(4, 15), pytest.param(12, 50, marks=pytest.mark.long)])
def test_intervals_hold_true_numbers(count: int, least: int) -> None:
    # 95 % of 300 engines by `synthetic.py`; 60 intervals of which fewer than 50 do have a chance of 0.1 %, as have
    # 20 of which fewer than 15 do
    found = [
        inside
        for seed in range(count)
        for truth in (engine(seed),)
        for inside in hits(truth, estimate(measured(truth, np.random.default_rng(seed + 10_000), 0.05)))
    ]
    assert len(found) > 4.5 * count
    assert sum(found) >= least / (5 * count) * len(found)


def test_two_discs_in_one_plane_cannot_be_identified() -> None:
    text = READY.read_text().replace('x = "-190 mm"', 'x = "170 mm"')
    text = text.replace('{ between = ["0.4 kg", "0.8 kg"], start = "0.55 kg" }', '"0.61 kg"')
    text = text.replace('{ between = ["100 N/mm", "600 N/mm"], start = "250 N/mm" }', '"310 N/mm"')
    problem = lr.load(text.split("[[measurements]]")[0])
    table = MeasurementTable(file="built-twin-received.csv", quantity="receiver acceleration", deviation="0.15 m/s^2")
    answer = estimate(measurements_of(problem, [table], PROBLEMS))
    assert len(answer.directions) == 2
    # the sum of both is determined, their difference is not
    for row in answer.directions:
        assert row[0] == pytest.approx(-row[2], abs=1e-6)
        assert row[1] == pytest.approx(-row[3], abs=1e-6)
    assert np.all(np.isinf(np.diag(answer.covariance)))


def test_command_estimates_the_built_twin(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["identify", str(READY), "--out", str(tmp_path / "out"), "--json", "-", "--quiet"])
    assert result.exit_code == 0, result.output
    numbers = {row["name"]: row for row in json.loads(result.stdout)["numbers"]}
    # the numbers from which the measurement was computed
    true = {
        "reciprocating mass": 0.61, "crank.pulley.unbalance": 420e-6, "crank.flywheel.unbalance": 690e-6,
        "crank.pulley.angle": np.radians(205.0), "crank.flywheel.angle": np.radians(35.0), "mounts.stiffness.3": 310e3,
    }  # fmt: skip
    for name, value in true.items():
        assert abs(numbers[name]["estimate"] - value) < 1.5 * numbers[name]["half_width"], name
    written = (tmp_path / "out" / "identified.toml").read_text()
    assert "normal batch" in written
    lr.load(written.split("[[measurements]]")[0])


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('"receiver acceleration"', '"receiver accelaration"', "is no load; did you mean 'receiver acceleration'?"),
        ('unbalance" = "200 g mm"', 'unbalances" = "200 g mm"', "did you mean 'crank.trial weight.unbalance'?"),
        ('"3000 rpm"', '"2800 rpm"', "which is no operating point"),
        ('name = "rear"\n', 'name = "back"\n', "has a column 'rear"),
    ],
)
def test_unreadable_measurements_are_refused_in_one_line(tmp_path: Path, old: str, new: str, line: str) -> None:
    for csv in PROBLEMS.glob("built-twin-*.csv"):
        shutil.copy(csv, tmp_path)
    text = READY.read_text()
    assert old in text
    (tmp_path / "engine.toml").write_text(text.replace(old, new, 1))
    result = CliRunner().invoke(app, ["identify", str(tmp_path / "engine.toml"), "--out", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert line in " ".join(result.output.split())
    assert not (tmp_path / "out").exists()


def test_a_file_without_measurements_is_refused(tmp_path: Path) -> None:
    from laufruhe.extensions.identification.report import identified

    with pytest.raises(InputError, match="measurements: is missing"):
        identified(PROBLEMS / "tractor-single.toml", tmp_path, lambda _: None)


def _with_columns(tmp_path: Path, change: Callable[[str], str]) -> Path:
    for csv in PROBLEMS.glob("built-twin-*.csv"):
        head, _, rows = csv.read_text().partition("\n")
        (tmp_path / csv.name).write_text(change(head) + "\n" + rows)
    shutil.copy(READY, tmp_path)
    return tmp_path / READY.name


def test_a_unit_in_the_headings_counts_and_may_not_contradict(tmp_path: Path) -> None:
    def values(path: Path, **keys: str) -> float:
        table = MeasurementTable(file="built-twin-received.csv", quantity="receiver acceleration", **keys)
        (measurement,) = measurements_of(lr.load(path), [table], path.parent)
        return float(np.nanmax(np.abs(measurement.values)))

    plain = values(READY)
    in_mm = _with_columns(tmp_path, lambda head: head.replace("[m/s2]", "[mm/s^2]"))
    assert values(in_mm) == pytest.approx(1e-3 * plain)
    assert values(READY, amplitude="rms") == pytest.approx(np.sqrt(2.0) * plain)
    with pytest.raises(Refused, match="differs from mm/s\\^2 in the headings"):
        values(in_mm, unit="m/s^2")
    with pytest.raises(Refused, match="furlong"):
        values(_with_columns(tmp_path, lambda head: head.replace("[m/s2]", "[furlong]")))


def test_unbalances_stay_within_their_size(tmp_path: Path) -> None:
    # phases of the other sign cannot be explained; loads are affine in what is left open, which is quick
    path = _with_columns(tmp_path, lambda head: head)
    path.write_text(lr.load(READY).fix("mounts.stiffness.3").fix("reciprocating mass").to_toml(), encoding="utf-8")
    for csv in tmp_path.glob("*.csv"):
        head, *rows = csv.read_text().splitlines()
        cells = [row.split(",") for row in rows]
        turned = [
            [f"{-float(c)}" if "phase" in name else c for c, name in zip(row, head.split(","), strict=True)]
            for row in cells
        ]
        csv.write_text("\n".join([head, *(",".join(row) for row in turned)]) + "\n")
    result = CliRunner().invoke(app, ["identify", str(path), "--out", str(tmp_path / "out"), "--json", "-", "--quiet"])
    assert result.exit_code == 0, result.output
    numbers = {row["name"]: row for row in json.loads(result.stdout)["numbers"]}
    for name in ("crank.pulley.unbalance", "crank.flywheel.unbalance"):
        assert numbers[name]["estimate"] <= 2e-3 * (1.0 + 1e-9)
    assert "is not explained" in (tmp_path / "out" / "report.md").read_text()


def test_python_identifies_as_the_command_does(tmp_path: Path) -> None:
    # loads are affine in what is left open, which is quick
    problem = lr.load(READY).fix("mounts.stiffness.3").fix("reciprocating mass")
    for csv in PROBLEMS.glob("built-twin-*.csv"):
        shutil.copy(csv, tmp_path)
    path = tmp_path / "twin.toml"
    path.write_text(problem.to_toml(), encoding="utf-8")
    answer = lr.identify(path)
    assert CliRunner().invoke(app, ["identify", str(path), "--out", str(tmp_path / "out"), "--quiet"]).exit_code == 0
    tmp_path /= "out"
    data = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert json.loads(answer.to_json()) == data
    size = answer.numbers.loc["crank.pulley.unbalance"]
    assert size["from"] < size["estimate"] < size["to"]
    assert answer.identified.to_toml() == (tmp_path / "identified.toml").read_text(encoding="utf-8")
    assert dict(answer.unexplained) == {one["file"]: one["unexplained"] for one in data["measurements"]}
    with pytest.raises(InputError, match="measurements: is missing"):
        lr.identify(PROBLEMS / "tractor-single.toml")
