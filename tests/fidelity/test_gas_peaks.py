"""Peaks of loads with gas stand at corners of the torque: cut-off, ends of strokes, begin and end of a burn (L5a)."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from fidelity.scenes import random_problem
from lanes import first_fast
from laufruhe.extensions.bearing_loads.channels import CRANK_PIN_FORCE
from laufruhe.extensions.bearing_loads.physics import pin_forces
from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.machine import GasModel, Seiliger, SliderCrank, Wiebe
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem import channels
from laufruhe.problem.evaluation import evaluate, objective_value, place_measures
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.problem import Problem
from laufruhe.solvers.accuracy import objective_error
from one_cylinder import cylinder_pressure

FAST, USUAL, QUICK = 12, 14, 20_000
SUBJECTS = channels.MOUNT_FORCE, channels.ROLL_MOMENT
ANGLES = 30_000
BEND = """
title = "Single cylinder whose largest force stands at the cut-off"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "70 mm"
bore = "78 mm"
rod_ratio = 0.25
reciprocating_mass = "0.5 kg"
throws = [0]
firing_order = [1]
[[operating_points]]
speed = "3600 rpm"
[gas]
model = "seiliger"
imep = "800000 Pa"
peak_pressure = "6200000 Pa"
[fidelity]
samples = SAMPLES
[mounts]
positions = [["0 mm", "150 mm", "0 mm"], ["0 mm", "-150 mm", "0 mm"]]
[[counterweights]]
name = "web"
balance_fraction = { between = [0, 0.4] }
[objective]
minimise = "maximum mount force"
"""


def _signal(problem: Problem, measure: Measure, k: int, count: int) -> np.ndarray[Any, Any]:
    """Return the measured signal at an operating point, at many angles and on both sides of every pressure jump."""
    engine, point = problem.engine, problem.points[k]
    whole = engine.cycle.angle
    bends = [_bends(point.gas, part, whole) + part.firing_angle for part in engine.slider_cranks]
    angles = np.concatenate([np.arange(count) * whole / count, np.mod(np.concatenate(bends), whole)])
    silent = shaking_loads(engine, replace(point, gas=None), problem.fidelity).with_finer_base(engine.cycle.base_order)
    steady = np.concatenate([silent.sample(count), silent.values(angles[count:])])
    for part in engine.slider_cranks:
        steady[:, 3] += _torque(point.gas, part, np.mod(angles - part.firing_angle, whole), engine.cycle)
    if measure.load is channels.ROLL_MOMENT:
        return steady[:, None, 3:4]
    return np.einsum("mij,nj->nmi", rigid_mounting(engine.mounts).maps, steady)


def _torque(gas: GasModel | None, part: SliderCrank, angles: Any, cycle: Any) -> Any:
    assert gas is not None
    alpha = part.fires_at + part.shaft.ratio * angles
    pressure = gas.pressure(part, cycle, angles) - gas.crankcase_pressure
    return -part.shaft.ratio * part.piston_area * pressure * part.velocity(np, alpha)


def _bends(gas: GasModel | None, part: SliderCrank, whole: float) -> Any:
    """Return many angles with the end of the peak pressure, found by halving without the model."""
    if isinstance(gas, PressureTrace):
        return np.array(gas.angles)
    fine = np.linspace(0.0, whole, 2001)
    found = [fine]
    if isinstance(gas, Wiebe):
        found.append(np.array([gas.start, gas.start + gas.duration]))
    if isinstance(gas, Seiliger):
        # pressure holds its peak up to the cut-off
        low, high = max(part.dead_centres[0], 0.0) + 1e-9, math.pi
        cycle = next(c for c in laufruhe.machine.Cycle if c.angle == whole)
        for _ in range(60):
            middle = 0.5 * (low + high)
            held = gas.pressure(part, cycle, np.array([middle]))[0] >= gas.peak_pressure * (1.0 - 1e-13)
            low, high = (middle, high) if held else (low, middle)
        found.append(np.array([low]))
    return np.concatenate(found)


def truth_of_peak(problem: Problem, count: int = ANGLES) -> float:
    (term,) = problem.objective
    shares, norm = term.measure.shares(problem.points), term.measure.norm
    values = []
    for k in range(len(problem.points)):
        rows = _signal(problem, term.measure, k, count)
        steps = len(rows) if norm.refinement > 1 else count
        rows = rows[:steps].swapaxes(0, 1).reshape(-1, rows.shape[2])
        values.append(norm.value(Grid(np.full(len(rows), 1.0 / len(rows)), steps), rows))
    if norm.refinement > 1:
        return max(values)
    return float(shares @ values) if norm.name == "mean" else math.sqrt(float(shares @ np.square(values)))


def _gas(rng: random.Random) -> GasModel:
    kind = rng.choice(["seiliger", "wiebe", "trace"])
    if kind == "wiebe":
        return Wiebe(
            imep=rng.uniform(4e5, 12e5), start=rng.uniform(-0.4, 0.1), duration=rng.uniform(0.5, 1.5),
            shape=rng.choice([0.0, 0.5, 1.0, 2.0, 3.3]), compression_ratio=10.0, exhaust_pressure=rng.uniform(1e5, 3e5),
            completeness=rng.choice([0.9, 0.999]),
        )  # fmt: skip
    mixed = Seiliger(peak_pressure=rng.uniform(60e5, 75e5), imep=rng.uniform(6e5, 9e5), intake_pressure=1.2e5)
    return mixed


def problem_of_peak(seed: int) -> Problem:
    rng = random.Random(seed)
    problem = random_problem(rng, gas=True)
    points = []
    for point in problem.points:
        gas = _gas(rng)
        if rng.random() < 0.25:
            part, cycle = problem.engine.slider_cranks[0], problem.engine.cycle
            count = rng.choice([72, 144, 360]) * cycle.turns
            pressures = cylinder_pressure(Wiebe(imep=8e5, start=-0.2, duration=0.9), part, cycle, count)
            angles = cycle.angle * np.arange(count) / count
            gas = PressureTrace(tuple(angles), tuple(pressures))
        points.append(replace(point, gas=gas))
    norm = NORMS[rng.choice(["maximum", "maximum", "peak to peak", "mean", "rms"])]
    # the smallest ball of many points in space takes long
    channel = channels.ROLL_MOMENT if norm.name == "peak to peak" else rng.choice(list(SUBJECTS))
    fidelity = replace(problem.fidelity, samples=rng.choice([360, 720, 1440, 1447, 2880]))
    return replace(problem, points=tuple(points), objective=(Term(Measure(channel, norm)),), fidelity=fidelity)


@pytest.mark.parametrize("samples", [360, 1440, 7200])
def test_a_peak_at_the_cut_off_is_found(samples: int, tmp_path: Path) -> None:
    path = tmp_path / "bend.toml"
    path.write_text(BEND.replace("SAMPLES", str(samples)), encoding="utf-8")
    problem = laufruhe.load(path)
    result = laufruhe.solve(problem)
    own = replace(problem, engine=result.final.engine)
    truth = truth_of_peak(own)
    assert result.objective is not None
    assert result.certificate is not None
    assert abs(result.objective.value - truth) <= result.error_estimate * truth
    assert result.objective.value == pytest.approx(truth, rel=1e-6)
    assert max(each.max for each in place_measures(result.final, 0)) == pytest.approx(truth, rel=1e-6)
    assert result.certificate.lower_bound <= truth * (1.0 + (1e-6 if samples < 1440 else 1e-9))
    assert result.certificate.gap <= problem.tolerance


@pytest.mark.parametrize("seed", first_fast(range(150), FAST, USUAL))
def test_error_with_gas_is_not_below_the_true_one(seed: int) -> None:
    problem = problem_of_peak(seed)
    angles = QUICK if seed < FAST else ANGLES if seed < USUAL else 5 * ANGLES
    evaluation = evaluate(problem)
    value = objective_value(problem, evaluation)
    stated = objective_error(problem, evaluation)
    assert abs(value - truth_of_peak(problem, angles)) <= (stated + 1e-9) * value
    # and it is worth reading
    assert stated < 0.05


@pytest.mark.parametrize("seed", first_fast(range(40), 8, 8))
def test_force_on_a_pin_jumps_with_the_pressure(seed: int) -> None:
    """Compare the peak pin force with both sides of every pressure jump, which orders alone overshoot."""
    rng = random.Random(seed)
    result = problem_of_peak(seed)
    point = replace(result.points[0], gas=_gas(rng))
    problem = replace(
        result, points=(point,), objective=(Term(Measure(CRANK_PIN_FORCE, NORMS["maximum"])),),
        fidelity=replace(result.fidelity, samples=1440),
    )  # fmt: skip
    evaluation = evaluate(problem)
    value = objective_value(problem, evaluation)
    engine, cycle = problem.engine, problem.engine.cycle
    truth = 0.0
    for k, part in enumerate(engine.slider_cranks):
        ends = part.shaft.ratio * (np.array(part.dead_centres) - part.fires_at)
        beside = [ends + turn * math.tau + side for turn in range(2) for side in (-1e-9, 1e-9)]
        bends = np.concatenate([_bends(point.gas, part, cycle.angle), *beside])
        angles = np.concatenate([np.arange(QUICK) * cycle.angle / QUICK, np.mod(bends, cycle.angle)])
        silent = pin_forces(engine, replace(point, gas=None)).with_finer_base(cycle.base_order)
        whole = silent.values(angles + part.firing_angle)[:, k]
        assert point.gas is not None
        push = part.piston_area * (point.gas.pressure(part, cycle, angles) - point.gas.crankcase_pressure)
        alpha = part.fires_at + part.shaft.ratio * angles
        tangent = part.rod_ratio * np.sin(alpha) - part.offset_ratio
        tangent = tangent / np.sqrt(1.0 - tangent**2)
        gas = (-push + 1j * push * tangent) * np.exp(1j * part.bank)
        whole[:, 1:] += np.stack([gas.imag, gas.real], axis=1)
        truth = max(truth, float(np.sqrt((whole**2).sum(axis=1)).max()))
    assert value == pytest.approx(truth, rel=1e-4)
    assert abs(value - truth) <= objective_error(problem, evaluation) * value + 1e-9 * value


def test_a_limited_peak_keeps_its_limit_at_the_bend(tmp_path: Path) -> None:
    """Check that a limit on the peak holds at the cut-off, which lies between two steps."""
    path, maximum = tmp_path / "limit.toml", 2100.0
    text = (
        BEND.replace("SAMPLES", "360").replace("[0, 0.4]", "[0, 1]").replace("maximum mount force", "mean mount force")
    )
    limit = f'[[constraints]]\nlimit = "maximum mount force"\nmax = "{maximum} N"\n'
    path.write_text(text + limit, encoding="utf-8")
    problem = laufruhe.load(path)
    result = laufruhe.solve(problem)
    peak = Measure(channels.MOUNT_FORCE, NORMS["maximum"])
    held = truth_of_peak(replace(problem, engine=result.final.engine, objective=(Term(peak),)))
    assert result.limits[0].active
    assert held <= maximum * (1.0 + 1e-5)
    assert result.limits[0].value == pytest.approx(held, rel=1e-6)
