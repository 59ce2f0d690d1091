"""Shaper: weights on crank and lever against least squares of positions, and the stroke drives side by side."""

from __future__ import annotations

import math
import tomllib

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import ModelError
from laufruhe.extensions.swinging_yoke.mechanism import SwingingYoke
from laufruhe.files.reader import load_tables
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.report.wording import fired
from laufruhe.solvers import Result, evaluate_only
from problem_files import PROBLEMS

PROBLEM = PROBLEMS / "shaper.toml"
STEPS = 512
PIN_MASS = 6.0
"""Crank pin and block of the problem [kg]."""


@pytest.fixture(scope="module")
def solved() -> Result:
    return laufruhe.solve(PROBLEM)


def acceleration(place: np.ndarray) -> np.ndarray:
    orders = np.fft.fftfreq(STEPS, 1.0 / STEPS)
    return np.fft.ifft(-(orders**2) * np.fft.fft(place))


def columns(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Return the force on the frame of given numbers, and per unit of each open one, from places in the plane."""
    (part,) = problem.engine.slider_cranks
    assert isinstance(part, SwingingYoke)
    alpha = math.tau * np.arange(STEPS) / STEPS
    pin = part.crank_radius * np.exp(1j * alpha)
    lever = (pin + 1j * part.pivot) / np.abs(pin + 1j * part.pivot)
    square = problem.points[0].speed ** 2
    given = part.reciprocating_mass * acceleration((part.lever_length * lever).real)
    given = given + part.lever_mass * part.lever_centre * acceleration(lever) + PIN_MASS * acceleration(pin)
    turning = np.exp(1j * alpha)
    units = [-part.lever_weight_radius * acceleration(lever), acceleration(turning), acceleration(1j * turning)]
    # a weight square to the lever, that the problem does not offer
    units.append(1j * acceleration(lever))
    rows = np.stack(units, axis=1)
    return -square * np.concatenate([given.real, given.imag]), -square * np.concatenate([rows.real, rows.imag])


def test_weights_are_those_of_least_squares(solved: Result) -> None:
    """Compare weights to 1e-6; a weight beside the line of the lever would be zero."""
    assert solved.certificate.kind == "global"
    given, units = columns(solved.problem)
    best, *_ = np.linalg.lstsq(units, -given, rcond=None)
    force = math.sqrt(np.square(given + units @ best).sum() / STEPS)
    assert solved.objective.value == pytest.approx(force, rel=1e-6)
    assert solved.certificate.lower_bound == pytest.approx(force, rel=1e-6)
    weight = solved.final.engine.slider_cranks[0].lever_weight
    assert weight == pytest.approx(best[0], rel=1e-6)
    _, weight_on_crank = solved.final.engine.rotors
    assert abs(weight_on_crank.unbalance) == pytest.approx(math.hypot(best[1], best[2]), rel=1e-6)
    assert best[3] == pytest.approx(0.0, abs=1e-8 * best[0])
    # beside it the crank alone does less
    alone, *_ = np.linalg.lstsq(units[:, 1:3], -given, rcond=None)
    assert np.square(given + units[:, 1:3] @ alone).sum() > 2.0 * np.square(given + units @ best).sum()


def test_quicker_return_shakes_more(solved: Result) -> None:
    """Check the optimum of a return twice as quick, with the same ram and open weights."""
    quicker = laufruhe.solve(solved.problem.with_values({"engine.return_ratio": 2.2}))
    assert quicker.certificate.kind == "global"
    assert quicker.objective.value > solved.objective.value


def test_lever_weight_at_an_uneven_speed_has_no_bound() -> None:
    tables = dict(laufruhe.files.reader.tables_and_path(PROBLEM)[0])
    even = laufruhe.solve(laufruhe.load(tables))
    tables |= {"fidelity": {"crank_inertia": "40 kg m^2", "samples": 180}, "search": {"starts": 1}}
    problem = laufruhe.load(tables)
    result = laufruhe.solve(problem)
    assert result.certificate.kind is Proof.LOCAL
    # the design of an even speed is no better
    values = {decision.name: decision.value for decision in even.decisions}
    other = evaluate_only(problem.with_values(values))
    assert other.objective is not None
    assert result.objective.value <= other.objective.value * (1.0 + 1e-6)


@pytest.mark.parametrize("maximum", [120.0, 60.0])
def test_the_weight_of_the_lever_counts_as_a_counterweight(maximum: float) -> None:
    """Compare both weights under a limit with a scan of their shares by least squares."""
    text = PROBLEM.read_text(encoding="utf-8").replace("unbalance = {", 'radius = "400 mm"\nunbalance = {')
    limit = f'[[constraints]]\nlimit = "counterweight mass"\nmax = "{maximum} kg"\n'
    problem = laufruhe.load(text + limit)
    result = laufruhe.solve(problem)
    (part,), (_, rotor) = result.final.engine.slider_cranks, result.final.engine.rotors
    assert isinstance(part, SwingingYoke)
    assert part.lever_weight + abs(rotor.unbalance) / 0.4 == pytest.approx(maximum, rel=1e-6)
    assert result.limits[0].value == pytest.approx(maximum, rel=1e-6)
    given, units = columns(problem)
    minimum = math.inf
    for share in np.linspace(0.0, 1.0, 401):
        rest = given + units[:, 0] * maximum * share
        turning = units[:, 1:3]
        free, *_ = np.linalg.lstsq(turning, -rest, rcond=None)
        size = 0.4 * maximum * (1.0 - share)
        # columns of a full turn are square to each other, so the nearest is the shorter one
        free = free * min(1.0, size / float(np.linalg.norm(free)))
        minimum = min(minimum, math.sqrt(np.square(rest + turning @ free).sum() / STEPS))
    assert result.objective.value == pytest.approx(minimum, rel=1e-4)
    assert result.objective.value <= minimum * (1.0 + 1e-9)


def test_a_shaper_does_not_fire() -> None:
    assert fired(evaluate_only(laufruhe.load(PROBLEM))) == ""


def test_a_lever_weight_is_found_by_its_name() -> None:
    problem = laufruhe.load(PROBLEM)
    for decision in problem.decisions:
        fixed = problem.fix(decision.name, f"{0.5 * (decision.lower + decision.upper)!r} {decision.unit}")
        assert decision.name not in {other.name for other in fixed.decisions}


def test_forces_on_bearings_of_a_yoke_are_refused_by_name() -> None:
    tables = tomllib.loads(PROBLEM.read_text(encoding="utf-8"))
    tables |= {"main_bearings": [{"x": "0.3 m"}, {"x": "-0.3 m"}], "objective": {"minimise": "mean main-bearing force"}}
    with pytest.raises(ModelError, match="loads of its rod are not modelled"):
        laufruhe.solve(load_tables(tables, PROBLEM))
