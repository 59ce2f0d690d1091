"""Bounds of boxes against designs within, and division that ends at a proven optimum (E37-E41)."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linprog

from lanes import first_fast
from laufruhe.errors import InputError
from laufruhe.files.reader import load
from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.problem.problem import Problem
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import Proof
from laufruhe.prove.mounts.box_norms import LinearRelaxation, counted_rows, lower_bound_of_norm, norm_under
from laufruhe.prove.mounts.box_numbers import sag, sag_under
from laufruhe.prove.mounts.box_series import LinearResponse
from laufruhe.prove.mounts.subdivision import StiffnessBoxes, is_stiffness_problem, stiffness_bounds
from laufruhe.prove.witness import Witness
from laufruhe.report.wording import explained
from laufruhe.solvers import solve
from laufruhe.solvers.mounts.starts import evaluate_design_at
from mounts.files import BLOCK, ENGINE, MOUNTS, changed, problem_of
from problem_files import PROBLEMS

DAMPED = changed(
    MOUNTS,
    ('position  = ["300', 'damping = ["0 N s/m", "300 N s/m", "900 N s/m"]\nposition  = ["300'),
    ('stiffness = ["120 N/mm", "120 N/mm"', 'stiffness = [{ between = ["60 N/mm", "300 N/mm"] }, "120 N/mm"'),
)
TWO_POINTS = ENGINE + '[[operating_points]]\nname = "fast"\nspeed = "1500 rpm"\nweight = 3\n'
GAS = """
[gas]
model = "wiebe"
imep  = "4 bar"
start = -10
duration = 60
compression_ratio = 11
[fidelity]
samples = 720
orders = 24
"""


def divided_bound(problem: Problem, value: float, room: float, known: Witness | None = None) -> BoxResult:
    """Return the bound by all boxes that are worth it; of no boxes zero."""
    return next(stiffness_bounds(problem, value, room, (1.0,), known), BoxResult(0.0, 0))


OBJECTIVES = {
    "rms": 'minimise = "rms mount force"',
    "mean": 'minimise = "mean mount force"',
    "maximum": 'minimise = "maximum mount force"',
    "narrowed": """minimise = "rms mount force"
orders = [2, 4]
mounts = ["front left"]
direction_weights = [1, 0.5, 2]""",
    "at one point": 'minimise = "mean mount travel"\noperating_points = ["fast"]',
    "largest travel": 'minimise = "maximum mount travel"',
    "transmissibility": 'minimise = "transmissibility"',
    "of orders": 'minimise = "transmissibility"\norders = [2, 4]',
    "peak to peak": 'minimise = "peak to peak mount force"',
    "worst mean": 'minimise = "worst mean mount force"',
    "torque roll": 'minimise = "torque-roll residual"\nfrequency = "9 Hz"',
    "sum": """[[objective.terms]]
quantity = "rms mount force"
[[objective.terms]]
quantity = "static sag"
weight = 1e4""",
}


def stiffness_problem(folder: Path, text: str, more: str = "", mounts: str = DAMPED) -> Problem:
    head = text if text.startswith("[[") else f"[objective]\n{text}"
    gas = changed(TWO_POINTS, ('stroke = "120 mm"', 'stroke = "120 mm"\nbore = "100 mm"')) + GAS
    return problem_of(folder, gas, BLOCK, mounts, head + "\n" + more)


def boxes(problem: Problem, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the boxes within the bounds, from nearly all of them to a thousandth, stiffness by ratio."""
    generator = np.random.default_rng(seed)
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    centres = low * (high / low) ** generator.random((count, len(low)))
    widths = (high - low) * 10.0 ** -generator.uniform(0.2, 4.0, (count, 1)) * generator.random((count, len(low)))
    return np.clip(centres - widths, low, high), np.clip(centres + widths, low, high)


@pytest.mark.parametrize("name", first_fast(OBJECTIVES, 2))
def test_no_design_in_a_box_is_under_its_bound(name: str, tmp_path: Path) -> None:
    problem = stiffness_problem(tmp_path, OBJECTIVES[name])
    assert is_stiffness_problem(problem)
    evaluation = evaluate(problem)
    search = StiffnessBoxes(problem, 1e-4 * objective_value(problem, evaluation))
    low, high = boxes(problem, 25, 1)
    bounds, _ = search.bounds(low, high)
    generator = np.random.default_rng(2)
    tight = []
    for below, above, bound in zip(low, high, bounds, strict=True):
        corners = generator.integers(0, 2, (3, len(below))).astype(float)
        found = []
        for share in (*generator.random((3, len(below))), *corners):
            engine = problem.design((below + share * (above - below)).tolist())
            found.append(objective_value(problem, with_mounts(evaluation, engine)))
        assert bound <= min(found) * (1.0 + 1e-9)
        tight.append(bound / min(found))
    assert max(tight) > 0.99
    assert np.count_nonzero(np.array(tight) > 0.5) > 5


def test_a_small_box_is_known_to_the_square_of_its_size(tmp_path: Path) -> None:
    problem = stiffness_problem(tmp_path, OBJECTIVES["mean"])
    search, measure = StiffnessBoxes(problem, 0.0), problem.objective[0].measure
    centre = np.array([d.start for d in problem.mount_decisions])
    value, lines = objective_value(problem, evaluate(problem)), search.model.loaded_orders(measure)
    lacking = []
    for share in (1e-2, 1e-3):
        low, high = centre * (1.0 - share), centre * (1.0 + share)
        at = search.model.expanded(lines, low[None], high[None])
        result = lower_bound_of_norm(search.model, measure, lines, at)
        assert float(result.value[0]) == pytest.approx(value, abs=float(result.remainder[0]))
        lacking.append(float(result.remainder[0]) / value)
    assert lacking[1] < 1.1e-2 * lacking[0]


NORMS = {
    "rms": lambda lengths, _: np.sqrt(np.mean(lengths**2)),
    "mean": lambda lengths, _: np.mean(lengths),
    "maximum": lambda lengths, _: lengths.max(),
    "peak to peak": lambda _, rows: np.linalg.norm(rows[:, None] - rows, axis=-1).max(),
}


@pytest.mark.parametrize("norm", NORMS)
def test_no_response_that_is_linear_in_a_box_is_under_the_bound_of_its_norm(norm: str, tmp_path: Path) -> None:
    """Random amplitudes of two orders with random slopes: every norm as it is defined, at random places of a box."""
    objective = f'[objective]\nminimise = "{norm} mount force"\norders = [2, 4]\n[fidelity]\nsamples = 72\n'
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, objective)
    measure, r = problem.objective[0].measure, np.random.default_rng(7)
    lines, count = StiffnessBoxes(problem, 0.0).model.loaded_orders(measure), len(counted_rows(problem, measure)[0])
    angles, k = np.linspace(0.0, np.pi, 180, endpoint=False), len(lines.orders)
    tight = []
    for size in (1.0, 0.1, 0.01):
        value, slopes = (r.normal(size=(5, k, *more, 2 * count)).view(np.complex128) for more in ((), (2,)))
        slopes = size * slopes
        left_out = LinearResponse(value, slopes, np.zeros((5, k)), np.zeros((5, k, 2)))
        result = norm_under(problem, measure, left_out, lines)
        for s in np.vstack([np.zeros(2), r.uniform(-1.0, 1.0, (6, 2)), r.choice([-1.0, 1.0], (4, 2))]):
            minorants = result.value - result.remainder + result.slopes @ s
            amplitudes = value + np.einsum("n,bknr->bkr", s, slopes)
            signal = np.einsum("bkr,kt->btr", amplitudes, np.exp(1j * np.outer(lines.orders, angles))).real
            for own, at_box in zip(minorants, signal, strict=True):
                rows = at_box.reshape(len(angles), -1, 3).swapaxes(0, 1)
                true = [NORMS[norm](np.linalg.norm(each, axis=-1), each[::2]) for each in rows]
                exact = {"rms": np.sqrt(np.mean(np.square(true))), "mean": np.mean(true)}.get(norm, max(true))
                assert own <= exact * (1.0 + 1e-3)
                tight.append(own / exact)
    # the middle of a box is known
    assert max(tight) > 0.99


def test_a_line_under_the_sag_touches_it_in_the_middle(tmp_path: Path) -> None:
    problem = stiffness_problem(tmp_path, 'minimise = "static sag"')
    search, measure = StiffnessBoxes(problem, 0.0), problem.objective[0].measure
    low, high = boxes(problem, 40, 5)
    result = sag_under(search.model, measure, low, high)
    assert result.value == pytest.approx(sag(search.model, 0.5 * (low + high)), rel=1e-12)
    for share in np.random.default_rng(6).random((20, low.shape[1])):
        line = result.value + result.slopes @ (2.0 * share - 1.0)
        assert np.all(line <= sag(search.model, low + share * (high - low)) * (1.0 + 1e-12))


def test_a_box_with_a_soft_corner_has_a_line_below_its_sag(tmp_path: Path) -> None:
    """Check that no design is below the line, which is zero if the middle carries no load either."""
    bottomless = changed(MOUNTS, *[('"20 N/mm", "4000 N/mm"', '"0 N/mm", "4000 N/mm"')] * 2)
    problem = stiffness_problem(tmp_path, 'minimise = "static sag"', mounts=bottomless)
    search, measure = StiffnessBoxes(problem, 0.0), problem.objective[0].measure
    high = np.array([search.model.upper, 0.0 * search.model.upper])
    result = sag_under(search.model, measure, 0.0 * high, high)
    assert result.minimum[1] == 0.0
    shares = np.random.default_rng(6).uniform(1e-3, 1.0, (200, high.shape[1]))
    values = sag(search.model, shares * high[0])
    lines = result.value[0] + (2.0 * shares - 1.0) @ result.slopes[0]
    assert np.all(lines <= values * (1.0 + 1e-12))
    assert np.max(lines / values) > 0.9


LIMITS = """
[[constraints]]
limit = "natural frequencies"
min = "4 Hz"
outside = ["9 Hz", "11 Hz"]
[[constraints]]
limit = "static sag"
max = "6 mm"
[[constraints]]
limit = "total stiffness"
max = "6000 N/mm"
[[constraints]]
limit = "maximum mount force"
max = "1500 N"
[[constraints]]
limit = "transmissibility"
max = "4"
[[constraints]]
limit = "kinetic-energy decoupling"
motions = ["yaw", "bounce"]
min = 0.6
[[constraints]]
limit = "torque-roll residual"
frequency = "9 Hz"
max = 6
[[constraints]]
limit = "peak to peak mount force"
max = "6000 N"
"""


@pytest.mark.slow
def test_only_boxes_without_an_allowed_design_are_ruled_out(tmp_path: Path) -> None:
    problem = stiffness_problem(tmp_path, OBJECTIVES["rms"], LIMITS)
    evaluation = evaluate(problem)
    low, high = boxes(problem, 60, 3)
    bounds, _ = StiffnessBoxes(problem, 0.0).bounds(low, high)
    generator = np.random.default_rng(4)
    allowed_ones = 0
    for below, above, bound in zip(low, high, bounds, strict=True):
        engine = problem.design(generator.uniform(below, above).tolist())
        design = with_mounts(evaluation, engine)
        broken = any(design.check_limit(limit).violation > 0.0 for limit in problem.mount_limits)
        broken |= any(design.value(limit.measure) > limit.maximum for limit in problem.load_limits)
        allowed_ones += not broken
        assert np.isfinite(bound) or broken
    assert 10 < np.count_nonzero(np.isinf(bounds)) < 55
    assert allowed_ones > 5


@pytest.mark.slow
@pytest.mark.parametrize(
    "objective",
    [OBJECTIVES["rms"], 'minimise = "transmissibility"\norders = [2]', 'minimise = "mean mount travel"\norders = [2]'],
)
def test_few_open_stiffnesses_are_decided_with_proof(objective: str, tmp_path: Path) -> None:
    """Check by a grid of all designs that none is better."""
    limit = '[[constraints]]\nlimit = "static sag"\nmax = "4 mm"\n[search]\nstarts = 2\n'
    problem = replace(problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, "[objective]", objective, limit), tolerance=1e-3)
    result = solve(problem)
    assert result.certificate is not None
    assert result.objective is not None
    assert result.status == "optimal"
    assert result.certificate.kind == "global"
    assert result.certificate.gap <= problem.tolerance
    assert "bounds of mounts from" in result.certificate.method
    initial = evaluate(problem)

    axes = [np.geomspace(d.lower, d.upper, 17) for d in problem.mount_decisions]
    values = []
    for x in itertools.product(*axes):
        design = with_mounts(initial, problem.design(list(x)))
        if all(design.check_limit(each).violation <= 0.0 for each in problem.mount_limits):
            values.append(objective_value(problem, design))
    assert len(values) > 100
    assert min(values) >= result.certificate.lower_bound
    assert result.objective.value <= min(values) * (1.0 + 1e-6)


FAR_FROM_ALL_STARTS = """
title = "Two cylinders on four unlike mounts, one stiffness open"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "126.6 mm"
rod_length = "209 mm"
reciprocating_mass = "0.407 kg"
rotating_mass = "0.46 kg"
cylinder_spacing = "91.1 mm"
throws = [0, 90.08]
[[operating_points]]
speed = "159 rad/s"
[[operating_points]]
name = "slow"
speed = "155.9 rad/s"
[block]
mass = "246.5 kg"
centre_of_gravity = ["-55.6 mm", "-8.3 mm", "-64 mm"]
inertia = ["5.22 kg m^2", "12.7 kg m^2", "10.8 kg m^2"]
inertia_products = ["0.457 kg m^2", "0.62 kg m^2", "0.593 kg m^2"]
[mounts]
kind = "elastic"
loss_factor = 0.05
[[mounts.places]]
name = "m0"
position = ["334 mm", "195 mm", "-90.8 mm"]
stiffness = ["186.9 N/mm", { between = ["111.6 N/mm", "2791 N/mm"], start = "558.2 N/mm" }, "378 N/mm"]
damping = ["146 N s/m", "396 N s/m", "377 N s/m"]
[[mounts.places]]
name = "m1"
position = ["319 mm", "-397 mm", "-79.6 mm"]
stiffness = ["307.6 N/mm", "161 N/mm", "519 N/mm"]
[[mounts.places]]
name = "m2"
position = ["-325 mm", "160 mm", "57.1 mm"]
stiffness = ["569.7 N/mm", "287.7 N/mm", "191.1 N/mm"]
[[mounts.places]]
name = "m3"
position = ["-209 mm", "-267 mm", "20.9 mm"]
stiffness = ["129 N/mm", "473.2 N/mm", "278.9 N/mm"]
[objective]
minimise = "maximum mount travel"
orders = [1, 2]
"""


def test_the_box_with_the_least_bound_gives_a_design(tmp_path: Path) -> None:
    """Check that boxes find the optimum where every start of the smooth search ends 0.4 % worse."""
    path = tmp_path / "far.toml"
    path.write_text(FAR_FROM_ALL_STARTS, encoding="utf-8")
    problem = load(path)
    result = solve(problem)
    assert result.certificate is not None
    assert result.certificate.kind is Proof.GLOBAL
    low, high = problem.decisions[0].lower, problem.decisions[0].upper
    found = [evaluate_design_at(problem, [x], []) for x in np.geomspace(low, high, 60)]
    minimum = min(design.value for design in found if design is not None)
    assert result.objective is not None
    assert result.objective.value <= minimum * (1.0 + problem.tolerance)
    assert "no search ended at this design" in explained(result) or result.certificate.kkt_residual < 1e-3


def test_the_number_of_boxes_can_be_chosen(tmp_path: Path) -> None:
    parts = (ENGINE, BLOCK, MOUNTS, "[objective]", OBJECTIVES["rms"])
    none, few = (problem_of(tmp_path, *parts, f"[search]\nboxes = {count}") for count in (0, 40))
    value = 1.17
    assert divided_bound(none, value, 1e-4).boxes == 0
    assert divided_bound(none, value, 1e-4).bound == 0.0
    result = divided_bound(few, value, 1e-4)
    assert 40 <= result.boxes < 40 + 2 * 64
    assert 0.0 <= result.bound < 1.16
    with pytest.raises(InputError, match=r"search\.boxes"):
        problem_of(tmp_path, *parts, "[search]\nboxes = -1")


def test_open_positions_losses_and_many_numbers_are_not_divided(tmp_path: Path) -> None:
    """Positions, losses and unbalances move more than stiffness; nine numbers are too many."""
    lossy = changed(MOUNTS, ('position  = ["300', 'loss_factor = { between = [0.05, 0.2] }\nposition  = ["300'))
    assert not is_stiffness_problem(problem_of(tmp_path, ENGINE, BLOCK, lossy, "[objective]", OBJECTIVES["rms"]))
    many = load(PROBLEMS / "powertrain-least-force.toml")
    assert is_stiffness_problem(many)
    assert divided_bound(many, 13.1, 1e-3).boxes == 0
    assert not is_stiffness_problem(load(PROBLEMS / "tractor-four-elastic.toml"))
    assert divided_bound(replace(many, search=replace(many.search, boxes=3)), 13.1, 1e-3).boxes >= 3


def test_prices_of_limits_are_never_over_what_a_box_has() -> None:
    """Against linear programs: prices bound the least of a linear function on a box under linear limits from below."""
    generator = np.random.default_rng(4)
    tight = []
    for _ in range(60):
        n, limits = int(generator.integers(1, 5)), int(generator.integers(1, 4))
        value, slopes = generator.uniform(2.0, 6.0), generator.normal(size=n)
        overs, by = generator.uniform(-1.5, 0.5, limits), generator.normal(size=(limits, n))
        boxes = LinearRelaxation(
            np.array([value]), slopes[None], [(overs[k : k + 1], by[k : k + 1]) for k in range(limits)]
        )
        result = float(boxes.minimum[0])
        exact = linprog(slopes, A_ub=by, b_ub=-overs, bounds=[(-1.0, 1.0)] * n)
        if exact.status == 2:
            continue
        assert result <= max(value + exact.fun, 0.0) + 1e-9
        tight.append(result >= value + exact.fun - 1e-6)
    assert np.mean(tight) > 0.6
