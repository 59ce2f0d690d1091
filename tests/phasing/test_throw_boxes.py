"""Boxes of throws: their loads against the exact model, their bounds against random designs and a grid."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from laufruhe.errors import ModelError
from laufruhe.load_models.affine import AffineNorm
from laufruhe.load_models.throw_waves import ThrowWaves, WaveNorm
from laufruhe.load_models.uneven_model import rotor_throws_of
from laufruhe.machine.firing import firing_turns, intervals_of, lap_orders
from laufruhe.numerics.exact_angles import angle_of
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.phasing import Candidate
from laufruhe.prove.certificate import Proof
from laufruhe.prove.throws.arcs import ArcBox
from laufruhe.solvers import Status, solve
from laufruhe.solvers.stars.star_results import StarDesign, solve_fixed
from laufruhe.solvers.throws.riding_weights import Riders
from laufruhe.solvers.throws.throw_boxes import ThrowPrograms, compress
from laufruhe.solvers.throws.throw_windows import firing_bounds, nearest_throws, windows_of
from phasing import engines

GAS = '[gas]\nmodel = "seiliger"\npeak_pressure = "70 bar"\nimep = "8 bar"\n'
ALLOWED = 'intervals = { largest_deviation = "25 deg" }'
FORCE = engines.MOUNTS + engines.MOUNT_FORCE
FACTOR = '[[counterweights]]\nname = "all"\nbalance_factor = { between = [%s, %s] }\n'
RIDERS = """
[[counterweights]]
name = "first"
opposite_throw = 1
unbalance = { between = ["0 kg m", "0.1 kg m"] }
angle = { between = [0, 360] }
[[counterweights]]
name = "second"
opposite_throw = 2
unbalance = { between = ["0.01 kg m", "0.08 kg m"] }
angle = 20
[[counterweights]]
name = "third"
opposite_throw = 3
unbalance = { between = ["0 kg m", "0.08 kg m"] }
angle = { between = [10, 100] }
"""
LIMIT = '[[constraints]]\nlimit = "%s"\nmax = "%s"\n'
MASS = LIMIT % ("added mass", "3 kg")
RADIUS = 'radius = "60 mm"\n'
VEE = engines.OPEN + "bank_angle = 90\nsplit_pin_angle = 30\n"

RMS = FORCE.replace("mean", "rms")

SCENES = {
    "couple": ("inline", "two-stroke", 4, engines.OPEN, engines.COUPLE),
    "mean": ("inline", "two-stroke", 4, engines.OPEN, FORCE),
    "gas": ("inline", "four-stroke", 3, engines.OPEN, GAS + FORCE),
    "maximum": ("inline", "four-stroke", 3, engines.OPEN, FORCE.replace("mean", "maximum")),
    "peak to peak": ("inline", "two-stroke", 3, engines.OPEN, FORCE.replace("mean", "peak to peak")),
    "limited": ("inline", "two-stroke", 4, engines.OPEN, RMS + LIMIT % ("rms rocking couple", "900 N m")),
    "weights": ("inline", "two-stroke", 3, engines.OPEN, engines.WEIGHTS + FORCE),
    "riders": ("inline", "two-stroke", 3, engines.OPEN, RIDERS + FORCE),
    "factor": ("inline", "four-stroke", 3, engines.OPEN, FACTOR % (0.1, 0.7) + GAS + FORCE),
    "factor of both signs": ("inline", "two-stroke", 3, engines.OPEN, FACTOR % (-0.4, 0.6) + RMS),
    "vee with gas": ("vee", "four-stroke", 6, VEE, GAS + FORCE),
    "vee with weights": ("vee", "four-stroke", 6, VEE, RIDERS + RMS),
}  # fmt: skip


def scene(folder, name):
    layout, cycle, count, engine, rest = SCENES[name]
    problem = engines.problem(folder, count, cycle, engine, ALLOWED, rest, layout, 96)
    return problem, problem.phasing, windows_of(problem, problem.phasing)


def programs_of(problem, phasing, window, samples=64):
    """Return the programs of boxes, as the search makes them."""
    throws = nearest_throws(window, 0.5 * sum(window.box))
    candidate = Candidate(tuple(float(a) % math.tau for a in throws), window.order or None, *phasing.minimum_geometry)
    realised = replace(phasing.problem_of(candidate), phasing=None)
    rides = rotor_throws_of(phasing, candidate)
    riders = Riders(realised, rides, candidate.throws)
    waves = ThrowWaves(riders.problem, phasing.layout(*phasing.minimum_geometry), rides)
    return ThrowPrograms(waves, riders, firing_bounds(phasing), samples)


def drawn(rng, window):
    """Return the random throws that keep a window."""
    low, high = window.box
    for k in rng.permutation(len(low)):
        here = np.arange(len(low)) == k
        at = rng.uniform(low[k], high[k])
        low, high = window.within(np.where(here, at, low), np.where(here, at, high))
    return 0.5 * (low + high)


def exact(phasing, window, throws):
    """Return the problem of one crank."""
    candidate = Candidate(tuple(float(a) % math.tau for a in throws), window.order or None, *phasing.minimum_geometry)
    return replace(phasing.problem_of(candidate), phasing=None)


def best_of(phasing, window, throws):
    """Return the objective of one crank, unbalances at their proven optimum; infinite where it breaks a limit."""
    exact_problem = exact(phasing, window, throws)
    return StarDesign(Candidate(tuple(throws)), solve_fixed(exact_problem)).value


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_no_design_in_a_box_goes_under_its_bound(tmp_path, name):
    """Check boxes around random cranks with unbalances at their proven optimum."""
    problem, phasing, windows = scene(tmp_path, name)
    rng = np.random.default_rng(5)
    programs = programs_of(problem, phasing, windows[0])
    shares = []
    for width in (2.0, 10.0, 40.0, 400.0):
        window = windows[rng.integers(len(windows))]
        throws = drawn(rng, window)
        reach = math.radians(width) * rng.uniform(0.0, 1.0, (2, len(throws)))
        box = programs.box(programs.program(window), throws - reach[0], throws + reach[1], 0.0, math.inf)
        value = best_of(phasing, window, throws)
        if math.isinf(value):
            continue
        assert box is not None
        assert box.bound <= value * (1.0 + 1e-9)
        assert np.all(box.lower <= throws + 1e-9)
        assert np.all(throws <= box.upper + 1e-9)
        shares.append(box.bound / value)
    # a small box loses hardly anything
    if problem.limits == ():
        assert shares[0] > 0.8


@pytest.mark.slow
@pytest.mark.parametrize("name", ["couple", "gas", "limited", "riders", "vee with gas"])
def test_no_better_crank_is_cut_off(tmp_path, name):
    """Check that a box cut down to a value keeps all better cranks."""
    problem, phasing, windows = scene(tmp_path, name)
    rng = np.random.default_rng(8)
    window = windows[-1]
    programs = programs_of(problem, phasing, window)
    cranks = [drawn(rng, window) for _ in range(6)]
    values = [best_of(phasing, window, throws) for throws in cranks]
    best = int(np.argmin(values))
    box = programs.box(programs.program(window), *window.box, 0.0, values[best] * (1.0 + 1e-6))
    assert math.isinf(values[best]) or box is not None
    if box is not None and math.isfinite(values[best]):
        assert np.all(box.lower <= cranks[best] + 1e-9)
        assert np.all(cranks[best] <= box.upper + 1e-9)


@pytest.mark.parametrize("name", ["couple", "gas", "vee with gas", "riders"])
def test_waves_add_up_to_the_exact_loads(tmp_path, name):
    problem, phasing, windows = scene(tmp_path, name)
    rng = np.random.default_rng(2)
    waves = programs_of(problem, phasing, windows[0]).waves
    for _ in range(3):
        window = windows[rng.integers(len(windows))]
        throws = drawn(rng, window)
        exact_problem = exact(phasing, window, throws)
        measure = exact_problem.objective[0].measure
        norm = waves.norm(measure, 1500)
        rows = norm.fixed.constant.copy()
        for part, wave in zip(waves.parts, norm.waves, strict=True):
            lap = 0 if part.cylinder is None else window.laps[part.cylinder]
            turned = np.exp(1j * waves.orders[:, 0] * (throws[part.pin] - math.tau * lap))
            rows += np.einsum("h,hkd->kd", turned, wave).real
        design = exact_problem.design([0.0] * len(exact_problem.decisions))
        if any(not np.isclose(d.set.lower, 0.0) for d in exact_problem.unbalances if d.set.width == 1):
            design = exact_problem.design(
                [d.set.lower * d.set.directions[0] if d.set.width == 1 else 0.0 for d in exact_problem.unbalances]
            )
        value = evaluate(exact_problem, design, 6000).value(measure)
        result = norm.fixed.norm.value(norm.fixed.grid, rows)
        assert abs(result - value) <= 2e-4 * value + norm.left_out


@pytest.mark.parametrize(("layout", "cycle", "count"), [("inline", "two-stroke", 4), ("inline", "four-stroke", 4),
                                                        ("vee", "four-stroke", 6)])  # fmt: skip
def test_every_way_to_fire_is_in_one_window(tmp_path, layout, cycle, count):
    """Check that every firing order of a random crank is in one window if its intervals are allowed, else in none."""
    engine = VEE if layout == "vee" else engines.OPEN
    problem = engines.problem(
        tmp_path, count, cycle, engine, ALLOWED, engines.MOUNTS + GAS + engines.MOUNT_FORCE, layout
    )
    phasing = problem.phasing
    windows, firing = windows_of(problem, phasing), firing_bounds(phasing)
    own = phasing.layout(*phasing.minimum_geometry)
    rng = np.random.default_rng(4)
    in_window = 0
    for trial in range(400):
        throws = rng.uniform(0.0, math.tau, len(own.throw_positions))
        if trial % 2:
            throws = drawn(rng, windows[rng.integers(len(windows))])
        throws[0] = angle_of(own.dead_centre_turn(0))
        throws = tuple(float(angle) % math.tau for angle in throws)
        for order in itertools.islice(lap_orders(cycle=phasing.cycle, layout=own, throws=throws), 200):
            intervals = intervals_of(phasing.cycle, firing_turns(own, throws, order))
            holding = 0
            for window in windows if phasing.intervals.holds(intervals) else ():
                low, high = window.box
                # whole turns of a throw are told by its window
                turned = throws + math.tau * np.ceil((low - 1e-6 - np.array(throws)) / math.tau)
                matrix, constants = firing.rows(window)
                same = window.order == order and np.allclose(matrix @ turned + constants, intervals, atol=1e-6)
                holding += bool(same and np.all(turned <= high + 1e-6))
            assert holding == int(phasing.intervals.holds(intervals)), (order, intervals)
            in_window += holding
    assert in_window > 50


@pytest.mark.parametrize("beside", [0, 1, 2])
@pytest.mark.parametrize("seed", range(3))
def test_arcs_are_never_less_than_their_least(seed, beside):
    """Check sums over throws with shared open angles at random angles against their least."""
    rng = np.random.default_rng(seed)
    orders = np.column_stack([[0.5, 1.0, 2.0, 3.5, 6.0], rng.uniform(-4.0, 4.0, (5, beside))])
    waves = rng.standard_normal((3, 5)) + 1j * rng.standard_normal((3, 5))
    slopes, shared = rng.standard_normal(3), rng.standard_normal(beside)
    lower = rng.uniform(-3.0, 3.0, 3 + beside)
    upper = lower + rng.uniform(0.0, 1.0, 3 + beside) * np.array([1.0, 0.01, 0.0, *[1.0] * beside])
    angles = rng.uniform(lower, upper, (20000, 3 + beside))
    angles[:8000] = np.where(rng.random((8000, 3 + beside)) < 0.5, lower, upper)
    values = angles[:, :3] @ slopes + angles[:, 3:] @ shared
    for p in range(3):
        turned = angles[:, [p, *range(3, 3 + beside)]] @ orders.T
        values += (np.exp(1j * turned) @ waves[p]).real
    for followed in (5, 3):
        arcs = ArcBox(orders[:followed], lower, upper).functions(waves, slopes, shared)
        assert arcs.minimum <= values.min() + 1e-12
        low, high = arcs.cut(0.3)
        less = angles[values - arcs.minimum < 0.3]
        assert np.all((less >= low - 1e-12) & (less <= high + 1e-12))
        if followed == 5:
            assert arcs.minimum >= values.min() - (0.03, 0.1, 0.5)[beside]


BOUNDED = 'throws = [0, { between = [60, 180] }, { between = [170, 300] }]\nrotating_mass = "0.7 kg"\n'


@pytest.mark.slow
@pytest.mark.parametrize("rest", [FORCE, engines.MOUNTS + GAS + engines.MOUNT_FORCE, engines.COUPLE])
def test_bound_and_design_enclose_the_best_of_a_grid(tmp_path, rest):
    problem = engines.problem(tmp_path, 3, "two-stroke", BOUNDED, "", rest + "[search]\nboxes = 100\n", samples=96)
    result = solve(problem)
    phasing, values = problem.phasing, []
    for second, third in itertools.product(np.linspace(60, 180, 5), np.linspace(170, 300, 6)):
        throws = (0.0, math.radians(second), math.radians(third))
        order = next(lap_orders(phasing.cycle, phasing.layout(None, None), throws), None)
        try:
            one = replace(phasing.problem_of(Candidate(throws, order)), phasing=None)
        except ModelError:
            continue
        values.append(objective_value(one, evaluate(one)))
    assert result.certificate.lower_bound <= min(values)
    assert result.objective.value <= min(values)
    assert result.certificate.gap < 0.01
    assert result.certificate.kind in (Proof.GLOBAL, Proof.WITHIN_GAP)


@pytest.mark.slow
def test_steps_over_the_cycle_do_not_hold_a_bound_back(tmp_path):
    """Check a gap below 0.3 % where the first 96 steps alone would cost 4 % of the mean force."""
    engine = BOUNDED.replace("{ between = [60, 180] }", "120")
    rest = engines.MOUNTS + GAS + engines.MOUNT_FORCE
    result = solve(engines.problem(tmp_path, 3, "two-stroke", engine, "", rest, samples=720))
    assert result.certificate.gap < 3e-3
    assert "boxes" in result.certificate.method


@pytest.mark.slow
def test_a_limit_that_no_crank_keeps_is_named(tmp_path):
    """Check limits just below the least couple (proven infeasible) and just above it."""
    limit = LIMIT % ("rms rocking couple", "{:.6f} N m") + 'orders = [1, 2]\nname = "couple"\n'
    allowed = 'intervals = { largest_deviation = "3 deg" }'
    best = solve(engines.problem(tmp_path, 5, "four-stroke", phasing=allowed))
    assert best.certificate.kind is Proof.GLOBAL
    rest = engines.MOUNTS + '[objective]\nminimise = "rms mount force"\n'
    under = rest + limit.format(best.certificate.lower_bound * 0.999)
    result = solve(engines.problem(tmp_path, 5, "four-stroke", phasing=allowed, rest=under))
    assert result.status is Status.INFEASIBLE
    assert result.conflict == ("couple",)
    assert "'couple'" in result.message
    over = rest + limit.format(best.objective.value * 1.001)
    result = solve(engines.problem(tmp_path, 5, "four-stroke", phasing=allowed, rest=over))
    assert result.status in (Status.OPTIMAL, Status.FEASIBLE)
    assert result.certificate.gap < 0.05


def test_compressed_rows_lose_only_zero_components():
    """Check that compression removes only the component without constant, slope and wave."""
    constant, slope = np.zeros((5, 4)), np.zeros((5, 4, 2))
    waves = np.zeros((1, 2, 5, 4), dtype=complex)
    constant[1, 0], slope[2, 1, 0], waves[0, 1, 3, 2] = 3.0, -4.0, 5.0j
    grid = Grid(np.full(5, 0.2), 5)
    small = compress(WaveNorm(AffineNorm(NORMS["maximum"], constant, slope, grid), waves, 0.5))
    assert np.array_equal(small.fixed.constant, constant[:, :3])
    assert np.array_equal(small.fixed.slope, slope[:, :3])
    assert np.array_equal(small.waves, waves[..., :3])
    assert small.left_out == 0.5
    # a signal of nothing keeps a row to have a norm
    none = compress(WaveNorm(AffineNorm(NORMS["maximum"], 0.0 * constant, 0.0 * slope, grid), 0.0 * waves, 0.0))
    assert none.fixed.constant.shape == (5, 1)
