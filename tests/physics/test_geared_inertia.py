"""Inertia on geared shafts: angular momentum as it is, the textbook's two cranks, and shares decided with proof."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import InputError
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.machine import Engine, GearedInertia
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.physics.speed_map import split_loads
from laufruhe.physics.uneven_speed import crank_motion
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import Result
from problem_files import PROBLEMS
from searched import searched

READY = PROBLEMS / "geared-inertia.toml"
QUICK = {"fidelity": {"samples": 240}}


def problem_of(**more: Any) -> Problem:
    return load_tables({**tables_of(READY), **QUICK, **more}, Path("twin.toml"))


def geared(engine: Engine, *shares: tuple[float, float]) -> Engine:
    own = (GearedInertia(f"shaft {k}", ratio, share) for k, (ratio, share) in enumerate(shares))
    return replace(engine, rotors=(), geared=tuple(own))


@pytest.fixture(scope="module")
def twin() -> tuple[Problem, Result]:
    problem = problem_of()
    return problem, laufruhe.solve(problem)


@pytest.mark.parametrize("shares", [((-1.0, 0.3),), ((-2.0, 0.5), (1.5, 0.2)), ((0.5, 0.9),)])
def test_the_roll_moment_is_what_angular_momentum_and_load_leave(shares: Any) -> None:
    """Compare the roll moment with the rate of angular momentum of discs and point masses at uneven speed."""
    problem = problem_of()
    inertia, steps = 0.05, 1440
    fidelity = Fidelity(samples=steps, crank_inertia=inertia)
    engine, point = geared(problem.engine, *shares), problem.points[1]
    motion = crank_motion(engine, point, fidelity)
    momentum = inertia * motion.speed * (1.0 + sum(share * (1.0 / n - 1.0) for n, share in shares))
    for part in engine.slider_cranks:
        n = part.shaft.ratio
        alpha = n * motion.angle + part.throw - part.bank
        lean = np.arcsin(part.crank_radius / part.rod_length * np.sin(alpha))
        slope = -part.crank_radius * np.sin(alpha + lean) / np.cos(lean)
        # upright: z' m times the distance of the cylinder's axis from the origin, clockwise from the front
        momentum += part.reciprocating_mass * slope * n * motion.speed * -part.shaft.y
    orders = np.fft.rfftfreq(steps, 1.0 / steps) * 0.5 * point.speed
    rate = np.fft.irfft(1j * orders * np.fft.rfft(momentum), steps)
    roll = shaking_loads(engine, point, fidelity).sample(steps)[:, 3]
    # the series of a torque that bends where the gas does ends in ripples there
    assert np.std(roll - rate) < 1e-3 * np.std(roll)


def test_two_cranks_leave_the_difference_of_their_inertias() -> None:
    """Check that (J1 - J2) / (J1 + J2) of the alternating torque remains, and all of the mean (textbook Fig. 4.1)."""
    problem = problem_of()
    parts = tuple(replace(part, reciprocating_mass=0.0) for part in problem.engine.slider_cranks)
    engine, point = replace(problem.engine, slider_cranks=parts), problem.points[1]
    alone = shaking_loads(geared(engine), point).coefficients[:200, 3]
    for one, other in ((3.0, 1.0), (1.0, 1.0), (1.0, 4.0)):
        roll = shaking_loads(geared(engine, (-1.0, other / (one + other))), point).coefficients[:200, 3]
        assert roll[0] == pytest.approx(alone[0])
        assert roll[1:] == pytest.approx((one - other) / (one + other) * alone[1:], abs=1e-12 * np.abs(alone).max())


def test_an_even_speed_is_the_limit_of_much_inertia_and_parts_add_up() -> None:
    problem = problem_of()
    engine, point = geared(problem.engine, (-1.0, 0.3), (2.0, 0.1)), problem.points[1]
    even = shaking_loads(engine, point, Fidelity(samples=1440)).sample(720)
    much = shaking_loads(engine, point, Fidelity(samples=1440, crank_inertia=1e5)).sample(720)
    assert much == pytest.approx(even, abs=1e-4 * np.abs(even).max())
    inertia, gas = split_loads(engine, point)
    whole = point.speed**2 * inertia.sample(720) + gas.sample(720)
    assert shaking_loads(engine, point).sample(720) == pytest.approx(whole, abs=1e-9 * np.abs(whole).max())
    # nothing on a shaft that turns as the crank does
    same = geared(problem.engine, (1.0, 0.5))
    assert shaking_loads(same, point).sample(720) == pytest.approx(
        shaking_loads(geared(problem.engine), point).sample(720), abs=1e-12 * np.abs(even).max()
    )


@pytest.mark.parametrize("inertia", [None, "0.4 kg m^2"])
def test_a_share_is_decided_with_unbalances_and_proven(twin: tuple[Problem, Result], inertia: str | None) -> None:
    """Check by a grid of unbalance and share that no design is better, at even and at uneven speed."""
    problem, result = twin
    if inertia is not None:
        tables = {"samples": 240, "crank_inertia": inertia}
        problem = problem_of(fidelity=tables, objective={"minimise": "rms mount force"})
        result = laufruhe.solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    bounds = [(d.lower, d.upper) for d in problem.decisions]
    grid = [
        objective_value(problem, evaluate(problem, problem.design([float(u), float(s)])))
        for u in np.linspace(*bounds[0], 7) for s in np.linspace(*bounds[1], 7)
    ]  # fmt: skip
    assert result.objective.value <= min(grid)
    assert result.certificate.lower_bound <= result.objective.value
    share = {decision.name: decision.value for decision in result.decisions}["second crank.share"]
    assert 0.45 < share < 0.6


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"geared_inertias": [{"name": "a", "share": 0.7}, {"name": "b", "share": {"between": [0, 0.4]}}]},
         "the sum 1.1"),
        ({"geared_inertias": [{"name": "a", "share": 1.2}]}, "must be at most 1"),
        ({"geared_inertias": [{"name": "a", "share": 0.5, "ratio": 0}]}, "almost a standing shaft"),
        ({"engine": {**tables_of(PROBLEMS / "tractor-single.toml")["engine"], "throws": "open"}}, "need fixed throws"),
    ],
)  # fmt: skip
def test_bad_shares_are_one_line(more: Any, said: str) -> None:
    with pytest.raises(InputError) as caught:
        problem_of(**more)
    assert len(str(caught.value).splitlines()) == 1
    assert said in str(caught.value)


@pytest.mark.slow
def test_masses_and_shares_together_are_searched() -> None:
    """Check a product of mass and share, which no cone program states."""
    engine = {**tables_of(READY)["engine"], "reciprocating_mass": {"between": ["0.4 kg", "0.6 kg"]}}
    searched(problem_of(engine=engine))
