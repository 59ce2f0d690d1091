"""Shadow prices of limits on open mounts are the slopes of the optimum over the limits (P5)."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from lanes import first_fast
from laufruhe.present.numbers import DASH
from laufruhe.problem.measure import Limit
from laufruhe.problem.problem import Problem
from laufruhe.report.sections.values import limits
from laufruhe.solvers import solve
from mounts.files import BLOCK, ENGINE, MOUNTS, problem_of

SHAFT = """
[[balancer_shafts]]
name = "left"
ratio = 2
position = ["100 mm", "-100 mm"]
[[balancer_shafts.unbalances]]
radius = "20 mm"
unbalance = { between = ["0 kg m", "0.05 kg m"] }
angle = { between = [0, 360] }
"""
FORCE = '[objective]\nminimise = "rms mount force"\n'
SAGS = '[objective]\nminimise = "static sag"\n'
SEARCH = "[search]\nstarts = 1\nboxes = 0\n[fidelity]\nsamples = 120\n"
STEP = 1e-5
EXACT, PEAK = 2e-3, 2e-2
CASES = [
    (FORCE, 'limit = "natural frequencies"\nmin = "4.5 Hz"\nmax = "60 Hz"', EXACT),
    (SAGS, 'limit = "natural frequencies"\nmin = "1 Hz"\nmax = "14 Hz"', EXACT),
    (SAGS, 'limit = "natural frequencies"\noutside = ["12 Hz", "60 Hz"]', EXACT),
    (SAGS, 'limit = "maximum mount force"\nmax = "30 N"', PEAK),
    (FORCE, 'limit = "natural frequencies"\nmin = "4.5 Hz"', EXACT),
    (FORCE, 'limit = "natural frequencies"\noutside = ["6.1 Hz", "7 Hz"]', EXACT),
    (FORCE, 'limit = "static sag"\nmax = "4 mm"', EXACT),
    ('[objective]\nminimise = "rms mount travel"\n', 'limit = "static sag"\nmin = "3 mm"\nmax = "9 mm"', EXACT),
    (SAGS, 'limit = "kinetic-energy decoupling"\nmotions = ["pitch"]\nmin = 0.9', EXACT),
    (FORCE, 'limit = "torque-roll residual"\nfrequency = "9 Hz"\nmax = 0.35', EXACT),
    (FORCE, 'limit = "total stiffness"\nmin = "1200 N/mm"\nmax = "3000 N/mm"', EXACT),
    (SAGS, 'limit = "rms mount travel"\nmax = "0.04 mm"', EXACT),
    (SAGS, 'limit = "maximum mount travel"\nmax = "0.06 mm"', PEAK),
    (SAGS, 'limit = "peak to peak mount travel"\nmax = "0.12 mm"', PEAK),
    (SAGS, 'limit = "transmissibility"\norders = [2]\nmax = 0.1', EXACT),
    (SAGS, 'limit = "transmissibility"\nmax = 0.1', EXACT),
    (SAGS, 'limit = "mean mount force"\nmax = "15 N"', EXACT),
    (SHAFT + FORCE, 'limit = "balancer mass"\nmax = "0.1 kg"', EXACT),
]


def moved(problem: Problem, limit: Limit, side: str, step: float) -> float:
    """Return the optimum with one side of a limit moved by a share of it."""
    if limit.outside is not None:
        low, high = limit.outside
        other = replace(limit, outside=(low * (1.0 + step), high) if side == "at most" else (low, high * (1.0 + step)))
    elif side == "at most":
        other = replace(limit, maximum=limit.maximum * (1.0 + step))
    else:
        other = replace(limit, minimum=limit.minimum * (1.0 + step))
    result = solve(replace(problem, limits=tuple(other if each is limit else each for each in problem.limits)))
    assert result.objective is not None
    return result.objective.value


@pytest.mark.parametrize(("objective", "limit", "within"), first_fast(CASES, 4))
def test_a_price_is_the_slope_of_the_optimum(objective: str, limit: str, within: float, tmp_path: Path) -> None:
    block = BLOCK.replace('["0 mm", "0 mm"', '["60 mm", "0 mm"')
    problem = problem_of(tmp_path, ENGINE, block, MOUNTS, objective, "[[constraints]]\n" + limit, "\n" + SEARCH)
    result = solve(problem)
    (shown,), (held,) = result.limits, problem.limits
    assert shown.active
    further, nearer = (moved(problem, held, shown.side, sign * STEP) for sign in (1.0, -1.0))
    slope = abs(further - nearer) / (2.0 * STEP * shown.limit)
    assert shown.shadow_price == pytest.approx(slope, rel=within)


def test_an_active_limit_never_shows_a_dash(tmp_path: Path) -> None:
    """Check that an unknown price shows "not known", and the price of a limit without cost zero."""
    objective = FORCE + '[[constraints]]\nlimit = "static sag"\nmax = "4 mm"\n'
    result = solve(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, objective, SEARCH))
    for price, said in ((math.nan, "not known"), (0.0, "0 "), (2.0, "0.002000 ")):
        shown = replace(result, limits=(replace(result.limits[0], shadow_price=price),))
        assert limits(shown)[0].rows[0][-1].startswith(said)
    slack = replace(result, limits=(replace(result.limits[0], shadow_price=0.0, active=False),))
    assert limits(slack)[0].rows[0][-1] == DASH
