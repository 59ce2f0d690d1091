"""Speed ranges: peaks against dense speeds of an own model, designs against SciPy, limits, complaints (P22, P23)."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

import laufruhe
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.comparison.designs import Design
from laufruhe.extensions.speed_ranges.exchange import solve_ranges
from laufruhe.extensions.speed_ranges.peaks import Response
from laufruhe.extensions.speed_ranges.picture import figure
from laufruhe.extensions.speed_ranges.ranges import SpeedRanges
from laufruhe.extensions.speed_ranges.section import SECTION
from laufruhe.extensions.worst_mean.norm import WorstRms
from laufruhe.numerics.norms import RMS, Grid
from laufruhe.present.measures import is_met
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.report.json_result import as_dict
from laufruhe.solvers import Result

RPM = 30.0 / math.pi
ENGINE = """
title = "Single on springs"
[engine]
layout = "inline"
cycle = "four-stroke"
bore = "84 mm"
stroke = "90 mm"
rod_ratio = 0.26
reciprocating_mass = "0.55 kg"
throws = [0]
[[operating_points]]
name = "road"
speed = "4000 rpm"
[gas]
model = "wiebe"
start = -20
duration = 60
compression_ratio = 9
imep = "5 bar"
[block]
mass = "{mass:g} kg"
centre_of_gravity = ["0 mm", "{y:g} mm", "{z:g} mm"]
inertia = ["0.85 kg m^2", "0.7 kg m^2", "0.6 kg m^2"]
[mounts]
kind = "elastic"
loss_factor = {loss:g}
stiffness = ["{stiffness:g} N/mm", "{stiffness:g} N/mm", "{stiffness:g} N/mm"]
[[mounts.places]]
name = "front"
position = ["0 mm", "-180 mm", "-20 mm"]
[[mounts.places]]
name = "left"
position = ["90 mm", "230 mm", "-60 mm"]
[[mounts.places]]
name = "right"
position = ["-110 mm", "230 mm", "-60 mm"]
[[receivers]]
name = "grip"
point = ["-370 mm", "-300 mm", "520 mm"]
weighting = "Wh"
[[counterweights]]
name = "web"
opposite_throw = 1
unbalance = { between = ["0 kg m", "0.03 kg m"] }
angle = { between = [0, 360] }
[fidelity]
orders = 4
[objective]
minimise = "rms receiver acceleration"
[[speed_ranges]]
name = "all"
speeds = ["1500 rpm", "7000 rpm"]
"""


def written(folder: Path, more: str = "", seed: int = 0, old: str = "", new: str = "") -> Path:
    """Return the file of a random engine with further keys of its speed range."""
    random = np.random.default_rng(seed)
    numbers = {
        "mass": random.uniform(35.0, 60.0), "y": random.uniform(20.0, 90.0), "z": random.uniform(10.0, 80.0),
        "loss": random.uniform(0.03, 0.2), "stiffness": random.uniform(150.0, 900.0),
    }  # fmt: skip
    text = ENGINE
    for name, number in numbers.items():
        text = text.replace(f"{{{name}:g}}", f"{number:g}")
    path = folder / "engine.toml"
    path.write_text(text.replace(old, new) + more, encoding="utf-8")
    return path


def solved_range(path: Path) -> tuple[laufruhe.Problem, Response]:
    problem = laufruhe.load(path)
    extra = problem.extra(SpeedRanges)
    assert extra is not None
    base = problem.changed(extras=())
    return base, Response(base, evaluate_start(base), extra.ranges[0])


def own_values(problem: laufruhe.Problem, speeds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rms of the grip at crank speeds, from the modes of the block and its loads at two speeds [m/s2]."""
    engine, point = problem.engine, problem.points[0]
    # loads are those of inertia, times the square of speed, and those of the gas
    pair = [evaluate(replace(problem, points=(replace(point, speed=s),))).loads[0].wrench for s in (200.0, 400.0)]
    slow, fast = (one.coefficients for one in pair)
    inertia = (fast - slow) / (400.0**2 - 200.0**2)
    gas = slow - inertia * 200.0**2
    block = engine.block
    assert block is not None
    centre = np.array(block.centre_of_gravity)

    def motion(place: Any) -> NDArray[np.float64]:
        x, y, z = np.array(place) - centre
        return np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])

    stiffness = sum(motion(m.position).T @ np.diag(m.stiffness) @ motion(m.position) for m in engine.mounts)
    mass = np.zeros((6, 6))
    mass[:3, :3], mass[3:, 3:] = block.mass * np.eye(3), np.array(block.inertia)
    factor = np.linalg.inv(np.linalg.cholesky(mass))
    squares, vectors = np.linalg.eigh(factor @ stiffness @ factor.T)
    shapes = factor.T @ vectors
    shift = np.eye(6)
    shift[3:, :3] = -np.cross(np.eye(3), centre) @ np.eye(3)
    x, y, z = centre
    shift[3:, :3] = -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    grip = motion((-0.37, -0.3, 0.52)) @ shapes
    weighting = problem.engine.extras[0].receivers[0].weightings[0]  # type: ignore[attr-defined]
    total = np.zeros(len(speeds))
    for k, order in enumerate(pair[0].orders.tolist()):
        if order == 0.0:
            continue
        omega = order * speeds
        loads = (speeds[:, None] ** 2 * inertia[k] + gas[k]) @ shift.T @ shapes
        damped = squares * (1.0 + 1j * engine.mounts[0].loss_factor) - omega[:, None] ** 2
        response = -(omega[:, None] ** 2) * (loads / damped) @ grip.T
        response = response * weighting.at(omega / math.tau)[:, None]
        total += 0.5 * (np.abs(response) ** 2).sum(axis=1)
    return np.sqrt(total)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_no_speed_of_a_hundred_thousand_exceeds_the_peak(seed: int, tmp_path: Path) -> None:
    problem, response = solved_range(written(tmp_path, seed=seed))
    speeds = np.linspace(response.span.low, response.span.high, 100_000)
    values = own_values(problem, speeds)
    worst = response.values[response.worst]
    assert own_values(problem, response.speeds) == pytest.approx(response.values, rel=1e-8)
    assert values.max() <= worst * (1.0 + 1e-6)
    assert values.max() >= worst * (1.0 - 1e-6)


def rows_at(problem: laufruhe.Problem, speeds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return squared values of columns 1, x, y of the weight as quadratic forms, shape (speeds, 3, 3)."""

    def squares(weight: complex) -> NDArray[np.float64]:
        engine = problem.design([weight])
        return own_values(replace(problem, engine=engine), speeds) ** 2

    unit = 0.01
    zero, one, other, both = (squares(unit * w) for w in (0.0, 1.0, 1.0j, 1.0 + 1.0j))
    minus, below = squares(-unit), squares(-1j * unit)
    forms = np.zeros((len(speeds), 3, 3))
    forms[:, 0, 0] = zero
    for k, (plus, negative) in enumerate(((one, minus), (other, below)), 1):
        forms[:, k, k] = 0.5 * (plus + negative) - zero
        forms[:, 0, k] = forms[:, k, 0] = 0.25 * (plus - negative)
    cross = 0.5 * (both - zero - forms[:, 1, 1] - forms[:, 2, 2]) - forms[:, 0, 1] - forms[:, 0, 2]
    forms[:, 1, 2] = forms[:, 2, 1] = cross
    return forms


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_the_design_for_a_range_is_that_of_scipy(seed: int, tmp_path: Path) -> None:
    """SLSQP minimises the largest of many speeds, close together near the peaks: no value or bound is beyond it."""
    path = written(tmp_path, "minimise = true\n", seed)
    problem, result = laufruhe.load(path), laufruhe.solve(laufruhe.load(path))
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.kind == "global"
    response = result.details.final[0]  # type: ignore[union-attr]
    near = np.multiply.outer(response.speeds[response.tops], np.linspace(0.997, 1.003, 300)).reshape(-1)
    speeds = np.union1d(np.geomspace(1500.0, 7000.0, 600) / RPM, near[(near > 1500.0 / RPM) & (near < 7000.0 / RPM)])
    forms = rows_at(problem.changed(extras=()), speeds)

    def values(x: NDArray[np.float64]) -> NDArray[np.float64]:
        columns = np.array([1.0, *x[:2]])
        return np.sqrt(np.maximum(np.einsum("i,sij,j->s", columns, forms, columns), 0.0))

    rules = [
        {"type": "ineq", "fun": lambda x: x[2] - values(x)},
        {"type": "ineq", "fun": lambda x: 9.0 - x[0] ** 2 - x[1] ** 2},
    ]
    rival = min(
        (minimize(lambda x: x[2], [*start, values(np.array(start)).max()], constraints=rules, method="SLSQP",
                  options={"maxiter": 200, "ftol": 1e-12}) for start in ((0.0, 0.0), (1.0, -0.5))),
        key=lambda answer: float(values(answer.x).max()),
    )  # fmt: skip
    best = float(values(rival.x).max())
    assert result.objective.value == pytest.approx(best, rel=2e-4)
    assert result.certificate.lower_bound <= best * (1.0 + 1e-5)
    engine = result.final.engine
    assert own_values(replace(problem, engine=engine), speeds).max() <= result.objective.value * (1.0 + 1e-6)


@pytest.mark.slow
def test_a_curve_holds_at_every_speed(tmp_path: Path) -> None:
    """The limit of a CSV file is active, and no speed between those of the program violates it."""
    free = laufruhe.solve(laufruhe.load(written(tmp_path)))
    response = free.details.final[0]  # type: ignore[union-attr]
    level = 0.95 * float((response.values / np.interp(RPM * response.speeds, [1500.0, 7000.0], [1.0, 2.0])).max())
    (tmp_path / "curve.csv").write_text(f"speed [rpm],limit [mm/s^2]\n1500,{1e3 * level}\n7000,{2e3 * level}\n")
    path = written(tmp_path, 'max = "curve.csv"\n')
    result = laufruhe.solve(laufruhe.load(path))
    assert result.status == "optimal"
    assert free.objective is not None
    assert result.objective is not None
    assert result.objective.value > free.objective.value
    speeds = np.geomspace(1500.0, 7000.0, 20_000) / RPM
    values = own_values(replace(laufruhe.load(path), engine=result.final.engine), speeds)
    limits = np.interp(RPM * speeds, [1500.0, 7000.0], [level, 2.0 * level])
    assert (values / limits).max() == pytest.approx(1.0, abs=2e-5)
    ratio = result.details.final[0].ratio  # type: ignore[union-attr]
    assert ratio == pytest.approx((values / limits).max(), rel=1e-5)
    assert any(limit.shadow_price for limit in result.limits)
    # report, files and picture show it
    assert SECTION.record is not None
    record = SECTION.record(result)["ranges"]["all"]
    assert record["final"]["of_limit"] == ratio
    assert record["final"]["worst"] == pytest.approx(values.max(), rel=1e-5)
    table, peaks = SECTION.tables(result)
    assert peaks.rows
    assert [row[1] for row in table.rows] == ["initial", "final"]
    rows = SECTION.number_tables["over-speed-ranges"][1](result).rows
    assert max(row[3] / row[4] for row in rows if row[1] == "final") == pytest.approx(ratio)
    panels = figure(result).axes
    assert len(panels) == 2
    assert panels[0].get_ylabel() == "rms receiver acceleration [m/s²]"


def test_the_mean_has_the_shares_of_time(tmp_path: Path) -> None:
    """Equal shares give the mean over speed; a share of one end gives the value near it."""
    problem, response = solved_range(written(tmp_path))
    speeds = np.linspace(response.span.low, response.span.high, 20_000)
    assert response.mean == pytest.approx(own_values(problem, speeds).mean(), rel=1e-3)
    shares = 'time_shares = [["1500 rpm", 0], ["6990 rpm", 0], ["7000 rpm", 1]]\n'
    _, late = solved_range(written(tmp_path, shares))
    assert late.mean == pytest.approx(late.values[-1], rel=1e-2)


def test_an_evaluation_shows_ranges_and_the_state_of_their_curves(tmp_path: Path) -> None:
    curve = 'quantity = "rms receiver acceleration"\nmax = "1 mm/s^2"\n[[speed_ranges]]\nname = "whole"\n'
    problem = laufruhe.load(written(tmp_path, f'{curve}speeds = ["1500 rpm", "7000 rpm"]\nminimise = true\n'))
    assert ", 1 limit;" in problem.summary
    result = laufruhe.evaluate(problem)
    table, peaks = SECTION.tables(result)
    assert [row[:2] for row in table.rows] == [("all", "initial"), ("whole", "initial")]
    _, response = solved_range(written(tmp_path))
    worst = response.values[response.worst]
    assert result.objective is not None
    assert result.objective.name == "worst rms receiver acceleration over whole"
    assert result.objective.value == pytest.approx(worst)
    assert max(limit.value for limit in result.limits) == pytest.approx(worst)
    assert not any(is_met(limit) for limit in result.limits)
    # peaks are in ascending order of speed, with their order, and tables of loads leave them out
    assert {f"{order:g}" for order, _ in response.strongest_at(response.tops[:4])} == {
        row[4].partition(",")[0] for row in peaks.rows if row[0] == "whole"
    }
    assert len(result.problem.points) > 1
    assert [loads.point.name for loads in result.at_own_points.final.loads] == ["road"]
    assert [point["name"] for point in as_dict(result)["points"]] == ["road"]


def test_a_comparison_evaluates_the_range_for_another_design(tmp_path: Path) -> None:
    problem = laufruhe.load(written(tmp_path, "minimise = true\n"))
    record, engine = as_dict(laufruhe.evaluate(problem)), problem.design([0.02])
    first, second = Design("a", record, {}, problem, problem.engine), Design("b", record, {}, problem, engine)
    base = replace(problem.changed(extras=()), engine=engine)
    response = Response(base, evaluate(base), problem.extra(SpeedRanges).ranges[0])  # type: ignore[union-attr]
    assert second.value_for(first) == pytest.approx(response.values[response.worst])
    assert second.value_for(first) != pytest.approx(first.value_for(first))
    assert first.has_objective_of(second)


def test_worst_rms_is_a_norm_with_its_dual() -> None:
    """The dual inequality holds for random rows, with equality at a subgradient; one point has the ordinary rms."""
    random, norm = np.random.default_rng(3), WorstRms()
    weights = np.full(12, 1.0 / 12.0)
    grid, single = Grid(weights, 4, points=3), Grid(weights, 12)
    for _ in range(20):
        rows, z = random.normal(size=(12, 2)), random.normal(size=(12, 2))
        assert (z * rows).sum() <= norm.dual_norm(grid, z) * norm.value(grid, rows) * (1.0 + 1e-12)
        subgradient = norm.subgradient(grid, rows)
        assert norm.dual_norm(grid, subgradient) == pytest.approx(1.0)
        assert (subgradient * rows).sum() == pytest.approx(norm.value(grid, rows))
        aligned = norm.aligned_dual(grid, rows, z)
        assert norm.dual_norm(grid, aligned) == pytest.approx(norm.dual_norm(grid, z))
        assert norm.value(single, rows) == pytest.approx(RMS.value(single, rows))
        parts = [RMS.value(Grid(np.full(4, 0.25), 4), rows[k : k + 4]) for k in (0, 4, 8)]
        assert norm.value(grid, rows) == pytest.approx(max(parts))


WRONG = {
    "minimise = true\nquantity = \"rms mount force\"\n": "speed_ranges[1].minimise",
    'quantity = "rms mount forc"\n': "speed_ranges[1].quantity",
    'quantity = "total stiffness"\n': "speed_ranges[1].quantity",
    'quantity = "rms receiver velocity"\n': "speed_ranges[1].quantity",
    'operating_point = "town"\n': "speed_ranges[1].operating_point",
    'operating_points = ["road"]\n': "speed_ranges[1].operating_points",
    'max = [["3000 rpm", "1 m/s^2"], ["2000 rpm", "1 m/s^2"]]\n': "speed_ranges[1].max",
    'receivers = ["grip"]\n': "speed_ranges[1].quantity",
    "max = 5\n": "speed_ranges[1].max",
    'max = [["1000 rpm"]]\n': "speed_ranges[1].max",
    'max = [["1000 rpm", 5]]\n': "speed_ranges[1].max",
    'max = "0 m/s^2"\n': "speed_ranges[1].max",
    'max = "5 mm/s"\n': "speed_ranges[1].max",
    'max = "none.csv"\n': "speed_ranges[1].max",
    'time_shares = [["3000 rpm", 0]]\n': "speed_ranges[1].time_shares",
    'minimise = true\n[[speed_ranges]]\nname = "b"\nspeeds = ["2 rpm", "3 rpm"]\nminimise = true\n':
        "speed_ranges[2].minimise",
    '[[speed_ranges]]\nname = "b"\nspeeds = ["3 rpm", "3 rpm"]\n': "speed_ranges[2].speeds",
}  # fmt: skip


@pytest.mark.parametrize("more", WRONG)
def test_a_wrong_range_is_refused_in_one_line(more: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        laufruhe.solve(laufruhe.load(written(tmp_path, more)))
    (complaint,) = error.value.complaints
    assert complaint.where == WRONG[more]
    assert complaint.remedy


def test_a_worst_value_needs_its_norm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("laufruhe.extensions.speed_ranges.file.is_installed", lambda _: False)
    with pytest.raises(InputError, match="minimise: needs the extension 'worst_mean'"):
        laufruhe.load(written(tmp_path, "minimise = true\n"))


def test_an_undamped_resonance_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    text = path.read_text(encoding="utf-8")
    line = next(line for line in text.splitlines() if line.startswith("loss_factor"))
    path.write_text(text.replace(line, "loss_factor = 0"), encoding="utf-8")
    with pytest.raises(ModelError, match=r"crosses a resonance|undamped|driven at"):
        laufruhe.solve(laufruhe.load(path))


def test_a_limited_range_has_the_peak_of_its_value_too(tmp_path: Path) -> None:
    """A steep limit is tightest far from the largest value, whose peak is found between samples all the same."""
    _, free = solved_range(written(tmp_path, seed=2))
    worst = float(free.values[free.worst])
    steep = f'max = [["1500 rpm", "{9e3 * worst} mm/s^2"], ["7000 rpm", "{10.0 * worst} mm/s^2"]]\n'
    _, limited = solved_range(written(tmp_path, steep, seed=2))
    assert limited.tightest != limited.worst == limited.tops[0]
    assert limited.values[limited.worst] == pytest.approx(worst, rel=1e-9)
    assert limited.tightest in limited.tops[:2]


def test_every_solved_problem_is_a_round(tmp_path: Path) -> None:
    problem, programs = laufruhe.load(written(tmp_path)), []

    def decide(program: laufruhe.Problem) -> Result:
        programs.append(program)
        return laufruhe.solve(program)

    result = solve_ranges(problem, decide, decide)
    assert result.details.rounds == len(programs)  # type: ignore[union-attr]
    assert result.objective.value == pytest.approx(laufruhe.solve(problem).objective.value, rel=1e-9)  # type: ignore[union-attr]


def test_a_value_that_rises_to_the_end_of_a_range_has_its_peak_there(tmp_path: Path) -> None:
    _, whole = solved_range(written(tmp_path))
    resonance = RPM * float(whole.speeds[whole.worst])
    narrow = f'["{0.9 * resonance} rpm", "{0.99 * resonance} rpm"]'
    _, below = solved_range(written(tmp_path, old='["1500 rpm", "7000 rpm"]', new=narrow))
    assert below.tops[0] == below.worst == len(below.values) - 1
    assert len(below.tops) == 1
