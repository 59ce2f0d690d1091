"""Uneven throws with gas: the smooth program against the exact model, grids, symmetry and a bound in closed form."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from laufruhe.errors import InputError
from laufruhe.files.reader import load
from laufruhe.load_models import uneven_model
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.load_models.uneven_model import UnevenModel
from laufruhe.numerics.norms import NORMS
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.prove.throws.firing_windows_bound import steady_bound
from laufruhe.solvers import solve
from laufruhe.solvers.throws.uneven_throws import local_optimum
from phasing import engines
from smooth import smooth_value

GAS = '[gas]\nmodel = "seiliger"\npeak_pressure = "70 bar"\nimep = "8 bar"\n'
SPLIT = "bank_angle = { between = [60, 100] }\nsplit_pin_angle = { between = [0, 60] }\n"
ALLOWED = 'intervals = { largest_deviation = "40 deg" }'
MOUNT_FORCE = engines.MOUNTS + engines.MOUNT_FORCE
DISPLACED = math.pi / 4.0 * 0.1**2 * 0.12
SCENES = {
    "two-stroke four": ("inline", "two-stroke", 4, (1, 3, 4, 2), None),
    "four-stroke five": ("inline", "four-stroke", 5, (1, 2, 4, 5, 3), None),
    "four-stroke vee": ("vee", "four-stroke", 6, (1, 6, 3, 5, 2, 4), (math.radians(90.0), math.radians(20.0))),
}


def scene(folder, name, rest=MOUNT_FORCE):
    """Return a star with its firing order, what may move of it, and its problem."""
    layout, cycle, count, order, angles = SCENES[name]
    open_ = engines.OPEN + (SPLIT if angles else "")
    phasing = engines.problem(folder, count, cycle, open_, ALLOWED, GAS + rest, layout, 480).phasing
    geometry = angles or (None, None)
    places = phasing.layout(*geometry)
    # the even star of the order, and for the vee the one of its right angle
    throws = {
        "two-stroke four": (0.0, 1.0, 3.0, 2.0),
        "four-stroke five": (0.0, 3.0, 2.0, 1.0, 4.0),
        "four-stroke vee": (0.0, 2.0, 1.0),
    }[name]
    first = places.banks[0] - places.pin_offsets[0]
    start = Candidate(tuple(first + math.tau * t / len(throws) for t in throws), order, *geometry)
    return phasing, start, ThrowMoves(phasing, places, start, phasing.intervals)


def model_of(moves, x, start=None):
    """Return the smooth model at deviations x, of the problem of a start."""
    return UnevenModel(replace(moves.phasing.problem_of(start or moves.start), phasing=None), moves, x, ca.DM(0, 1))


def moved(moves, x):
    """Return the exact problem at deviations x."""
    return replace(moves.phasing.problem_of(moves.candidate(x)), phasing=None)


@pytest.mark.parametrize("name", SCENES)
def test_every_order_is_that_of_the_exact_model(tmp_path, name, monkeypatch):
    monkeypatch.setattr(uneven_model, "LEFT_OUT", 0.0)
    monkeypatch.setattr(uneven_model, "HIGHEST", math.inf)
    moves = scene(tmp_path, name)[2]
    rng = np.random.default_rng(3)
    for _ in range(3):
        x = rng.uniform(-0.25, 0.25, moves.size)
        exact = moved(moves, x)
        wrench = evaluate(exact).loads[0].wrench
        lines = model_of(moves, x).wrench(exact.points[0])
        parts = [np.array(part, dtype=float) for part in (lines.real, lines.imaginary)]
        smooth = {float(h): np.stack([part[:, k] for part in parts], axis=1) for k, h in enumerate(lines.orders)}
        assert 0.0 in smooth
        assert max(abs(smooth[h]).max() for h in smooth if h not in (0.0, 1.0, 2.0)) > 10.0
        peak = np.abs(wrench.sample(480)).max(axis=0)
        for h in wrench.orders:
            result = smooth.get(float(h), np.zeros((6, 2)))
            assert np.abs(result[:, 0] + 1j * result[:, 1] - wrench.at(h)).max() <= 1e-9 * peak.max()


@pytest.mark.parametrize("name", SCENES)
def test_measures_and_slopes_are_those_of_the_exact_model(tmp_path, name, monkeypatch):
    monkeypatch.setattr(uneven_model, "LEFT_OUT", 0.0)
    monkeypatch.setattr(uneven_model, "HIGHEST", math.inf)
    rms = engines.MOUNTS + engines.MOUNT_FORCE.replace("mean", "rms")
    moves = scene(tmp_path, name, rms)[2]
    x = ca.SX.sym("x", moves.size)
    model = model_of(moves, x)
    quantity = model.problem.objective[0].measure
    norm = smooth_value(model, quantity, 1e-9)
    smooth = ca.Function("norm", [x], [norm, ca.gradient(norm, x)])
    point = np.random.default_rng(4).uniform(-0.2, 0.2, moves.size)

    def exact(x):
        return evaluate(moved(moves, x)).value(quantity)

    value, slope = (np.array(part, dtype=float).ravel() for part in smooth(point))
    # bends of the torque that the exact model carries beside its orders
    assert value[0] == pytest.approx(exact(point), rel=1e-6)
    step = 1e-5
    for k, unit in enumerate(np.eye(moves.size)):
        difference = (exact(point + step * unit) - exact(point - step * unit)) / (2.0 * step)
        assert slope[k] == pytest.approx(difference, rel=1e-5, abs=1e-5 * value[0])


@pytest.mark.parametrize("measure", ["mean", "maximum"])
def test_orders_left_out_hardly_change_sampled_measures(tmp_path, measure):
    objective = engines.MOUNTS + engines.MOUNT_FORCE.replace("mean", measure)
    moves = scene(tmp_path, "four-stroke five", objective)[2]
    x = np.random.default_rng(5).uniform(-0.2, 0.2, moves.size)
    exact = moved(moves, x)
    model = model_of(moves, x)
    quantity = exact.objective[0].measure
    assert float(smooth_value(model, quantity, 1e-6)) == pytest.approx(evaluate(exact).value(quantity), rel=1e-2)


def test_all_points_have_the_samples_that_the_highest_order_of_any_needs(tmp_path):
    """A motored point has few orders; the mean of the fired one is that of the exact model all the same."""
    motored = '[[operating_points]]\nname = "motored"\nspeed = "3000 rpm"\ngas = false\nweight = 2\n'
    moves = scene(tmp_path, "four-stroke five", MOUNT_FORCE + motored)[2]
    x = np.random.default_rng(5).uniform(-0.2, 0.2, moves.size)
    exact = moved(moves, x)
    quantity = exact.objective[0].measure
    smooth = float(smooth_value(model_of(moves, x), quantity, 1e-9))
    assert smooth == pytest.approx(evaluate(exact).value(quantity), rel=1e-5)


def test_neither_the_origin_of_the_angle_nor_the_numbering_matters(tmp_path):
    phasing, start, moves = scene(tmp_path, "four-stroke five")
    x = np.random.default_rng(6).uniform(-0.2, 0.2, moves.size)
    exact = moved(moves, x)
    rms = replace(exact.objective[0].measure, norm=NORMS["rms"])
    own = float(smooth_value(model_of(moves, x), rms, 1e-9))
    further = replace(start, throws=tuple(angle + 0.7 for angle in start.throws))
    turned = model_of(ThrowMoves(phasing, moves.layout, further, moves.intervals), x, start)
    assert float(smooth_value(turned, rms, 1e-9)) == pytest.approx(own, rel=1e-12)
    # counted from the other end the roll moment is the same
    roll = '[objective]\nminimise = "mean roll moment"\n'
    phasing, start, moves = scene(tmp_path, "four-stroke five", roll)
    throws = moves.candidate(np.full(moves.size, 0.1)).throws
    values = [
        objective_value(problem, evaluate(problem))
        for problem in (
            phasing.problem_of(replace(start, throws=throws)),
            phasing.problem_of(
                replace(start, throws=throws[::-1], firing_order=tuple(6 - k for k in start.firing_order))
            ),
        )
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("cycle", ["two-stroke", "four-stroke"])
def test_one_open_throw_is_where_a_fine_grid_is_least(tmp_path, cycle):
    throws, order, low, high = {
        "two-stroke": ("[0, { between = [70, 170] }, 240]", (1, 3, 2), 70, 170),
        "four-stroke": ("[0, { between = [110, 250] }]", (1, 2), 110, 250),
    }[cycle]
    count = len(order)
    engine = f"throws = {throws}\nfiring_order = {list(order)}"
    allowed = 'intervals = { largest_deviation = "300 deg" }'
    # bounds are not looked at here
    few = "[search]\nboxes = 2\n"
    problem = engines.problem(tmp_path, count, cycle, engine, allowed, GAS + MOUNT_FORCE + few)
    result = solve(problem)
    phasing = problem.phasing
    # all of it coarsely, and about what was found finely
    grid, near = {}, 2 * round(0.5 * math.degrees(result.decisions[1].value))
    for degrees in sorted({*range(low, high + 1, 10), *range(near - 10, near + 11, 2)}):
        middle = (math.radians(degrees),)
        tail = (math.radians(240.0),) if count == 3 else ()
        exact = replace(phasing.problem_of(Candidate((0.0, *middle, *tail), order)), phasing=None)
        grid[degrees] = objective_value(exact, evaluate(exact))
    minimum = min(grid, key=grid.get)
    assert result.objective.value <= grid[minimum] * (1.0 + 2e-4)
    assert abs(math.degrees(result.decisions[1].value) - minimum) < 2.0
    assert result.objective.value < result.objective.initial
    # gas is what decides here
    motored = solve(engines.problem(tmp_path, count, cycle, engine, allowed, MOUNT_FORCE + few))
    assert abs(motored.decisions[1].value - result.decisions[1].value) > math.radians(0.5)


@pytest.mark.parametrize(("orders", "stays"), [("orders = [1, 2]", True), ("", False)])
def test_even_firing_stays_where_it_is_best(tmp_path, orders, stays):
    """Check gas alone: even firing cancels orders 1 and 2 of three cylinders and adds up order 3."""
    rest = GAS + f'[objective]\nminimise = "rms roll moment"\n{orders}\n'
    phasing = engines.problem(tmp_path, 3, phasing=ALLOWED, rest=rest).phasing
    light = replace(phasing, problem_of=lambda candidate: _light(phasing.problem_of(candidate)))
    start = Candidate(tuple(math.tau * t / 3.0 for t in (0, 1, 2)), (1, 3, 2))
    star_problem = light.problem_of(start)
    even = objective_value(star_problem, evaluate(star_problem))
    result = local_optimum(light, start, phasing.intervals)
    if stays:
        assert not result.has_moved_throws
        assert result.candidate.throws == start.throws
        assert result.value < 1e-6
        return
    assert result.has_moved_throws
    assert result.value < even * (1.0 - 1e-3)
    rng = np.random.default_rng(7)
    for _ in range(20):
        throws = tuple(a + rng.uniform(-0.2, 0.2) * (k > 0) for k, a in enumerate(result.candidate.throws))
        near = light.problem_of(replace(result.candidate, throws=throws))
        if phasing.intervals.holds(near.engine.firing_intervals):
            assert objective_value(near, evaluate(near)) > result.value * (1.0 - 2e-4)


def _light(problem):
    parts = tuple(replace(part, reciprocating_mass=1e-6) for part in problem.engine.slider_cranks)
    return replace(problem, engine=replace(problem.engine, slider_cranks=parts))


def test_the_bound_is_the_steady_torque(tmp_path):
    """Check the bound of imep times displacement over the angle of the cycle, on any star."""
    rest = GAS + '[search]\nboxes = 4\n[objective]\nminimise = "rms roll moment"\n'
    allowed = 'intervals = { largest_deviation = "5 deg" }\nbest = 1'
    problem = engines.problem(tmp_path, 3, phasing=allowed, rest=rest)
    assert steady_bound(problem) == pytest.approx(8e5 * DISPLACED * 3.0 / math.tau, rel=1e-3)
    result = solve(problem)
    assert result.certificate.lower_bound >= steady_bound(problem)
    assert result.certificate.lower_bound <= result.objective.value
    assert all(point.lower_bound <= point.value for point in result.phasing.trade)


def test_an_uneven_crank_speed_is_refused(tmp_path):
    speed = '[objective]\nminimise = "rms roll moment"\n'
    engines.problem(tmp_path, 3, phasing=ALLOWED, rest=GAS + speed)
    (path,) = tmp_path.glob("*.toml")
    text = path.read_text(encoding="utf-8").replace("[fidelity]\n", '[fidelity]\ncrank_inertia = "0.5 kg m^2"\n')
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"fidelity.crank_inertia.*even speed"):
        load(path)


def test_throws_between_bounds_start_at_their_most_even_firing(tmp_path):
    """Check that the initial throws within bounds have an even firing order, though none is given."""
    engine = "throws = [0, { between = [170, 190] }, { between = [170, 190] }, { between = [-10, 10] }]"
    problem = engines.problem(tmp_path, 4, "four-stroke", engine, ALLOWED, GAS + MOUNT_FORCE)
    assert problem.engine.firing_intervals == pytest.approx([math.pi] * 4, abs=1e-9)
