"""Limits of forces, travel and transmissibility of a running engine in the relaxation of spring forces (E61)."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from extensions.mount_relaxation.test_dual import spoilt
from extensions.mount_relaxation.test_spring_bound import POWERTRAIN, powertrain
from laufruhe.extensions.mount_relaxation.box import WORTH, BoxRelaxation, joint_scores
from laufruhe.extensions.mount_relaxation.cone_program import ConeProgram
from laufruhe.extensions.mount_relaxation.limits import UNBOUNDED, Limits
from laufruhe.extensions.mount_relaxation.search import SdpRelaxation
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve

ASKED = {
    "rms": {"limit": "rms mount travel", "operating_points": ["idle"], "orders": [2, 4]},
    "mean": {"limit": "mean mount force", "operating_points": ["idle"], "mounts": ["engine"], "orders": [2]},
    "maximum": {"limit": "maximum mount travel", "operating_points": ["idle"], "orders": [2]},
    "ratio": {"limit": "transmissibility", "operating_points": ["idle"], "orders": [2]},
    "ratio of all": {"limit": "transmissibility", "operating_points": ["idle"], "orders": [2, 4]},
}
UNITS = {"rms": " m", "mean": " N", "maximum": " m"}


def limited(name: str, maximum: float) -> Problem:
    """Three springs of the powertrain open, force at speed against something at idle."""
    tables = powertrain("2", "3 Hz", 3)
    tables["operating_points"] = [{"name": "idle", "speed": "800 rpm"}, {"name": "fast", "speed": "1500 rpm"}]
    tables["objective"] |= {"operating_points": ["fast"], "minimise": "rms mount travel"}
    tables["fidelity"] = {"samples": 144}
    tables["constraints"].append({**ASKED[name], "max": f"{maximum:.9g}{UNITS.get(name, '')}"})
    return load(tables)


def asked_limit(problem: Problem) -> Any:
    return next(limit for limit in problem.limits if limit.maximum < np.inf)


def drawn(problem: Problem, count: int) -> list[tuple[np.ndarray, float, float]]:
    """Designs that keep the other limit, what each is worth, and what it has of the one that is asked."""
    generator, given, found = np.random.default_rng(2), evaluate(problem), []
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    for share in generator.random((count, len(low))):
        x = low * (high / low) ** share
        each = with_mounts(given, problem.design(x.tolist()))
        if each.violation(problem.limits) <= 0.0:
            found.append((x, objective_value(problem, each), each.value(asked_limit(problem).measure)))
    return found


@pytest.mark.parametrize("name", ASKED)
def test_no_design_that_keeps_a_limit_is_under_the_bound(name: str) -> None:
    """Beside multipliers of a solver also spoilt ones; without the limit there is less to prove, or as much."""
    designs = drawn(limited(name, 1e6), 150)
    problem = limited(name, float(np.quantile([each for *_, each in designs], 0.12)))
    generator, maximum = np.random.default_rng(9), asked_limit(problem).maximum
    kept = [(x, value, each) for x, value, each in designs if each <= maximum]
    assert len(kept) > 5
    minimum, near = min(value for _, value, _ in kept), max(kept, key=lambda each: each[2])[0]
    boxes = SdpRelaxation(problem, 1.3 * minimum, 1e-3, near.tolist())
    assert boxes.limits.norms or boxes.limits.ratios
    bound = boxes.bound(boxes.lower, boxes.upper)[0]
    program, _ = boxes.cut_off(boxes.lower, boxes.upper)
    boxes.limits = Limits((), ())
    without = boxes.bound(boxes.lower, boxes.upper)[0]
    assert (1.0 - 1e-3) * without <= bound <= minimum
    # least s of all that is better than the best known
    cones = ConeProgram(program)
    cost = cones.cost(np.eye(program.numbers)[0])
    told = cones.solve(cost)
    half, middle = 0.5 * (boxes.upper - boxes.lower), 0.5 * (boxes.upper + boxes.lower)
    smallest = min((x[0] - middle[0]) / half[0] for x, value, _ in kept if value <= 1.3 * minimum)
    assert told.bound <= smallest
    for by in (0.5, 1.0, 2.0):
        assert cones.bound(cost, spoilt(cones, told.z, by, 0.0, generator)) <= smallest


def test_a_limit_that_holds_the_best_design_back_raises_the_bound() -> None:
    """Least force at speed is soft; a limit at idle that the soft ones break."""
    raised = []
    for name in ("rms", "ratio"):
        designs = drawn(limited(name, 1e6), 150)
        problem = limited(name, 0.98 * min(designs, key=lambda each: each[1])[2])
        kept = [(value, x) for x, value, each in designs if each <= asked_limit(problem).maximum]
        if kept:
            minimum, x = min(kept, key=lambda each: each[0])
            boxes = SdpRelaxation(problem, 1.2 * minimum, 1e-3, x.tolist())
            with_limit = boxes.bound(boxes.lower, boxes.upper)[0]
            boxes.limits = Limits((), ())
            raised.append(with_limit / boxes.bound(boxes.lower, boxes.upper)[0])
    assert max(raised) > 1.001


@pytest.mark.parametrize("name", ["powertrain-hydraulic", "powertrain-joined-springs", "tractor-four-elastic"])
def test_transmissibility_of_lines_is_that_of_the_model(name: str) -> None:
    """Forces of an order and of the same at rest, at the middle of a box of no size."""
    tables = tomllib.loads(POWERTRAIN.with_name(f"{name}.toml").read_text(encoding="utf-8"))
    tables["constraints"] = [{"limit": "transmissibility", "orders": [2], "max": "1e3"}]
    free = load(tables)
    value = evaluate(free).value(free.mount_limits[0].measure)
    tables["constraints"][0]["max"] = f"{1.01 * value:.9g}"
    problem = load(tables)
    boxes = SdpRelaxation(problem, 2.0 * objective_value(problem, evaluate(problem)), 1e-3, problem.start)
    near = np.array([d.real_start for d in problem.mount_decisions])
    box = BoxRelaxation(boxes, boxes._terms[0][1], (np.inf, np.inf), near * (1.0 - 1e-9), near * (1.0 + 1e-9))
    found = []
    for ratio in boxes.limits.ratios:
        (order,) = ratio.orders
        sizes = []
        for each in (order, replace(order, omega=0.0)):
            line, _ = box._state(each, UNBOUNDED)
            v = np.concatenate([[1.0], boxes.basis.reference, np.zeros(line.size - 1 - line.columns)])
            sizes.append(float(np.linalg.norm(line.forces @ v) * line.unit))
        found.append(sizes[0] / sizes[1])
    assert max(found) == pytest.approx(value, rel=1e-7)


@pytest.mark.parametrize("lacking", [0.0, -1e-9, 5e-324, 1e-310])
@pytest.mark.parametrize("size", [5e-324, 1e-305, 1.0, 1e9, 1e300])
def test_sides_are_told_apart_where_nothing_is_lacking(lacking: float, size: float) -> None:
    """Zero and the least numbers there are: no share overflows, which would be an error here, nor is one lost."""
    hidden = size * np.array([0.0, 0.5, 1.0])
    for pull in (np.zeros(3), np.array([5e-324, 0.0, 0.0])):
        found = joint_scores(pull, hidden, lacking)
        assert np.isfinite(found).all()
        assert found[2] == found.max() > 0.0


def test_what_is_hidden_counts_by_what_is_lacking() -> None:
    pull, hidden = np.array([4.0, 1.0]), np.array([0.0, 3.0])
    assert joint_scores(pull, hidden, 6.0) == pytest.approx([1.0, 3.0 / (6.0 * WORTH)])


SIDEWAYS = """
title = "Mirrored mounts, of which what gives way sideways is open"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "90 mm"
rod_ratio = 0.28
reciprocating_mass = "0.8 kg"
throws = [0]
[[operating_points]]
speed = "1500 rpm"
[block]
mass = "180 kg"
centre_of_gravity = ["-60 mm", "0 mm", "25 mm"]
inertia = ["8 kg m^2", "12 kg m^2", "13 kg m^2"]
[mounts]
kind = "elastic"
loss_factor = 0.1
[[mounts.places]]
name = "front"
position = ["320 mm", "200 mm", "0 mm"]
stiffness = ["190 kN/m", { between = ["47 kN/m", "940 kN/m"], start = "180 kN/m" }, "99 kN/m"]
[[mounts.places]]
name = "front other"
mirror_of = "front"
[[mounts.places]]
name = "rear"
position = ["-350 mm", "160 mm", "-25 mm"]
stiffness = ["125 kN/m", "330 kN/m", "225 kN/m"]
[[mounts.places]]
name = "rear other"
mirror_of = "rear"
[objective]
minimise = "rms mount force"
orders = [2]
[[constraints]]
limit = "natural frequencies"
min = "1.5 Hz"
"""


def test_a_half_of_the_motions_may_have_nothing_open() -> None:
    """Sideways, roll and yaw go together: the upright half of them has given stiffness alone."""
    problem = load(tomllib.loads(SIDEWAYS))
    result, given = solve(problem), evaluate(problem)
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    others = [with_mounts(given, problem.design([x])) for x in np.geomspace(47e3, 940e3, 30)]
    minimum = min(objective_value(problem, each) for each in others if each.violation(problem.limits) <= 0.0)
    assert result.certificate.lower_bound <= minimum
    assert result.objective is not None
    assert result.objective.value <= minimum * (1.0 + 1e-6)
