"""Raw torque-roll residual and decoupling shortfall: closed forms, bounded least squares, brute force, refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import lsq_linear, minimize_scalar

from laufruhe.errors import InputError
from laufruhe.machine import Block
from laufruhe.physics.mount_numbers import decoupling_shortfall, raw_residual, residual_of, torque_roll_frequency
from laufruhe.problem.channels import motion_indices, mounting_in
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.prove.certificate import Proof
from laufruhe.prove.mounts.box_numbers import RANGES, _projection_bounds, maximum_shares, shortfall
from laufruhe.prove.mounts.box_response import BoxModel
from laufruhe.solvers import solve
from mounts.files import BLOCK, ENGINE, MOUNTS, problem_of
from mounts.powertrain import powertrain, random_mounting

TILTED = BLOCK + 'inertia_products = ["2 kg m^2", "-3 kg m^2", "1 kg m^2"]\n'
RAW = '[objective]\nminimise = "raw torque-roll residual"\n'
SHORT = '[objective]\nminimise = "decoupling shortfall"\nmotions = ["bounce", "roll", "pitch"]\n'
ANY = (0.0, math.inf)


def _plain_matrices(mounting):
    """Return K, M and the unit rotation about I^-1 e from their definitions."""
    block = mounting.block
    axis = np.linalg.solve(np.array(block.inertia) - block.turning_inertia * np.diag([1.0, 0.0, 0.0]), [1.0, 0.0, 0.0])
    return mounting.stiffness, block.mass_matrix, np.concatenate([np.zeros(3), axis / np.linalg.norm(axis)])


@pytest.mark.parametrize("band", [ANY, (4.0, 9.0), (30.0, 40.0), (7.0, 7.0)])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_best_square_of_given_stiffness_is_that_of_a_search(seed, band):
    mounting = random_mounting(seed)
    k, m, q = _plain_matrices(mounting)
    low, high = ((math.tau * f) ** 2 for f in (band[0], min(band[1], 200.0)))
    minimum = minimize_scalar(lambda s: np.linalg.norm(k @ q - s * (m @ q)), bounds=(low, high), method="bounded").fun
    minimum = min(minimum, *(float(np.linalg.norm(k @ q - s * (m @ q))) for s in (low, high)))
    assert residual_of(mounting, raw_residual(mounting.block, band)) == pytest.approx(minimum, rel=1e-6)


def test_a_block_that_turns_about_its_axis_in_a_mode_leaves_nothing():
    # springs along a body's own axes, all as far from them: K and M share their eigenvectors
    mounting = powertrain()
    block = Block(140.0, ((4.0, 0.0, 0.0), (0.0, 8.0, 0.0), (0.0, 0.0, 7.0)))
    places = [(x, y, z) for x in (-0.3, 0.3) for y in (-0.2, 0.2) for z in (-0.1, 0.1)]
    mounts = tuple(replace(mounting.mounts[0], name=str(k), position=p) for k, p in enumerate(places))
    even = replace(mounting, block=block, mounts=mounts)
    k, m, q = _plain_matrices(even)
    square = float(q @ k @ q) / float(q @ m @ q)
    assert residual_of(even, raw_residual(block, ANY)) < 1e-9 * np.linalg.norm(k @ q)
    assert torque_roll_frequency(even) == pytest.approx(math.sqrt(square) / math.tau, rel=1e-12)
    assert min(abs(np.sqrt(eigh(k, m)[0]) / math.tau - torque_roll_frequency(even))) < 1e-9


def _joint_least_squares(problem, low, high):
    """Return the least |K(x) q - s M q| over x and s in their bounds: one bounded least-squares problem of SciPy."""
    decisions = problem.decisions

    def rows(x):
        k, _, q = _plain_matrices(mounting_in(problem.design(list(x))))
        return k @ q

    unit, zero = 1e5, rows([0.0] * len(decisions))
    slopes = np.array([(rows([unit * (j == k) for k in range(len(decisions))]) - zero) for j in range(len(decisions))])
    _, m, q = _plain_matrices(mounting_in(problem.engine))
    columns = np.column_stack([slopes.T, -1e4 * (m @ q)])
    lower = [*(d.lower / unit for d in decisions), low / 1e4]
    upper = [*(d.upper / unit for d in decisions), high / 1e4]
    result = lsq_linear(columns, -zero, bounds=(lower, upper), tol=1e-14)
    return math.sqrt(2.0 * result.cost)


@pytest.mark.parametrize(
    ("objective", "band"),
    [("", (1e-9, 1e3)), ('frequency = "9 Hz"', (9.0, 9.0 + 1e-9)),
     ('frequency = { between = ["12 Hz", "14 Hz"] }', (12.0, 14.0))],
)  # fmt: skip
def test_open_stiffness_and_frequency_together_are_a_least_squares_problem(tmp_path, objective, band):
    text = MOUNTS.replace('"120 N/mm", "120 N/mm"', '{ between = ["90 N/mm", "300 N/mm"] }, "120 N/mm"', 1)
    problem = problem_of(tmp_path, ENGINE, TILTED, text, RAW + objective)
    result = solve(problem)
    low, high = ((math.tau * f) ** 2 for f in band)
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value == pytest.approx(_joint_least_squares(problem, low, high), rel=1e-5)


def test_a_wider_band_is_never_worse(tmp_path):
    found = []
    for low, high in ((13.0, 13.1), (12.0, 14.0), (8.0, 20.0)):
        objective = RAW + f'frequency = {{ between = ["{low} Hz", "{high} Hz"] }}'
        found.append(solve(problem_of(tmp_path, ENGINE, TILTED, MOUNTS, objective)).objective.value)
    assert found[0] >= found[1] * (1.0 - 1e-9) >= found[2] * (1.0 - 1e-9)


@pytest.mark.parametrize(
    "objective", [RAW, RAW + 'frequency = { between = ["6 Hz", "9 Hz"] }', SHORT, SHORT + "wanted = 0.9"]
)
def test_no_design_of_a_box_is_under_its_bound(tmp_path, objective):
    problem = problem_of(tmp_path, ENGINE, TILTED, MOUNTS, objective)
    measure, generator = problem.objective[0].measure, np.random.default_rng(3)
    model = BoxModel(problem, evaluate_start(problem))
    informative = 0
    for size in (1.0, 0.05, 2e-4):
        middle = model.lower + generator.random(2) * (model.upper - model.lower)
        half = 0.5 * size * (model.upper - model.lower)
        lower, upper = np.maximum(middle - half, model.lower), np.minimum(middle + half, model.upper)
        (minimum,), _ = RANGES[measure.channel](model, measure, lower[None], upper[None])
        drawn = lower + generator.random((40, 2)) * (upper - lower)
        values = [evaluate(problem, problem.design(list(x))).value(measure) for x in drawn]
        assert minimum <= min(values) * (1.0 + 1e-9)
        informative += minimum > 0.5 * min(values)
    assert informative


def test_every_mode_of_modes_that_coincide_is_allowed_its_share():
    """Check two modes of one frequency, which mix in any way under rounding."""
    r = np.random.default_rng(4)
    for _ in range(20):
        root, basis = r.normal(size=(6, 6)) + 3.0 * np.eye(6), np.linalg.qr(r.normal(size=(6, 6)))[0]
        squares = np.array([2e3, 2e3, *r.uniform(3e3, 9e3, 4)])
        stiffness = (basis * squares) @ basis.T
        model = SimpleNamespace(
            root=root, stiffness=lambda x, k=stiffness: np.repeat(k[None], len(x), axis=0),
            slopes={"stiffness": np.zeros((1, 6, 6))},
        )  # fmt: skip
        measure = SimpleNamespace(motions=("bounce",))
        (shares,) = maximum_shares(model, measure, np.ones((1, 1)), np.ones((1, 1)))
        a, b = root[:, 2] @ basis, np.linalg.inv(root)[2] @ basis
        # the share of a mode in the plane of both is a quadratic form of its direction
        both = np.linalg.eigvalsh(0.5 * (np.outer(a[:2], b[:2]) + np.outer(b[:2], a[:2])))[1]
        assert shares[0] >= max(both, *(a * b)[2:]) * (1.0 - 1e-9)


def test_a_projection_is_no_longer_than_components_allow():
    """Compare bounds of projections of unit vectors with bounded components, which are exact for short vectors."""
    r = np.random.default_rng(9)
    for size in (2.0, 0.6, 0.2):
        vector, parts = r.normal(size=(30, 6)), np.minimum(size * r.random((30, 1, 6)), 1.0)
        bounds = _projection_bounds(vector, parts)[:, 0]
        unit = np.sign(vector) * parts[:, 0]
        length = np.linalg.norm(unit, axis=1)
        true = np.abs(np.sum(vector * unit, axis=1)) / np.maximum(length, 1.0)
        assert np.all(true <= bounds * (1.0 + 1e-12))
        assert bounds[length <= 1.0] == pytest.approx(true[length <= 1.0], rel=1e-12)
    assert np.all(length <= 1.0)


def _share(problem, x):
    """Return the shares of motions from SciPy's generalised eigenproblem."""
    k, m, _ = _plain_matrices(mounting_in(problem.design(list(x))))
    shapes = eigh(k, m)[1]
    return shapes * (m @ shapes)


@pytest.fixture(scope="module")
def decoupled(tmp_path_factory):
    limits = '[[constraints]]\nlimit = "natural frequencies"\nmin = "3.5 Hz"\n[search]\nstarts = 4\nboxes = 30000\n'
    problem = problem_of(tmp_path_factory.mktemp("short"), ENGINE, TILTED, MOUNTS, SHORT + limits)
    return problem, solve(problem)


def test_the_least_shortfall_is_that_of_a_grid(decoupled):
    problem, result = decoupled
    grid = np.geomspace(2e4, 4e6, 40)
    values = np.full((40, 40), np.inf)
    for i, a in enumerate(grid):
        for j, b in enumerate(grid):
            energy = _share(problem, [a, b])
            values[i, j] = sum(max(1.0 - energy[motion].max(), 0.0) for motion in (2, 3, 4))
    assert result.objective.value <= values.min() * (1.0 + 1e-6)
    assert result.objective.value == pytest.approx(values.min(), rel=0.05)
    assert result.certificate.lower_bound <= result.objective.value * (1.0 + 1e-9)
    assert result.certificate.gap <= problem.tolerance


@pytest.mark.parametrize("size", [1.0, 0.1, 1e-2, 1e-4, 1e-8])
def test_no_shares_of_a_box_are_over_what_it_has_at_most(tmp_path, size):
    """Check shares and their shortfalls against the bounds of a box, also where modes nearly cross."""
    problem = problem_of(tmp_path, ENGINE, TILTED, MOUNTS, SHORT + "wanted = 0.9")
    measure, generator = problem.objective[0].measure, np.random.default_rng(5)
    model = BoxModel(problem, evaluate_start(problem))
    low, wide = model.lower, model.upper - model.lower
    drawn = low + generator.random((2000, 2)) * wide
    squares = np.linalg.eigvalsh(model.stiffness(drawn))
    crossing = drawn[np.argsort((np.diff(squares) / squares[:, 1:]).min(axis=1))[:20]]
    middle, half = np.concatenate([crossing, drawn[:20]]), 0.5 * size * generator.random((40, 2)) * wide
    lower, upper = np.maximum(middle - half, low), np.minimum(middle + half, model.upper)
    minimum, maximum = shortfall(model, measure, lower, upper), maximum_shares(model, measure, lower, upper)
    inside = lower + generator.random((30, 1, 1)) * (upper - lower)
    inside[:4] = lower, upper, np.stack([lower[:, 0], upper[:, 1]], 1), np.stack([upper[:, 0], lower[:, 1]], 1)
    modes = np.linalg.eigh(model.stiffness(inside.reshape(-1, 2)))[1]
    along = model.root.T @ modes * (np.linalg.inv(model.root) @ modes)
    shares = along[:, motion_indices(measure)].max(axis=2).reshape(30, 40, -1)
    assert np.all(shares <= maximum.T + 1e-10)
    assert np.all(np.maximum(0.9 - shares, 0.0).sum(axis=2) >= minimum - 1e-10)


def test_the_shortfall_is_what_shares_lack(decoupled):
    problem, result = decoupled
    found = [decision.value for decision in result.decisions]
    energy = _share(problem, found)
    assert result.objective.value == pytest.approx(decoupling_shortfall(energy, (2, 3, 4), 1.0), rel=1e-6)
    assert decoupling_shortfall(energy, (2, 3, 4), 0.0) == 0.0
    assert decoupling_shortfall(energy, (2, 3), 0.9) <= decoupling_shortfall(energy, (2, 3, 4), 0.9)


@pytest.mark.parametrize(
    ("objective", "message"),
    [
        ('[objective]\nminimise = "torque-roll residual"\n', "objective.frequency: is missing"),
        ('[objective]\nminimise = "torque-roll residual"\nfrequency = { between = ["6 Hz", "9 Hz"] }', "is open, and"),
        (RAW + 'motions = ["roll"]', "objective.motions"),
        (RAW + 'frequency = { between = ["9 Hz", "6 Hz"] }', "reversed"),
        (SHORT + "wanted = 1.5", "objective.wanted"),
        (SHORT + '[[constraints]]\nlimit = "decoupling shortfall"\nmin = 0.1', "cannot stand beside"),
    ],
)
def test_meaningless_input_is_refused_in_a_line(tmp_path, objective, message):
    with pytest.raises(InputError, match=message.replace(".", r"\.")):
        problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, objective)
