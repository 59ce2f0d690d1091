"""Run-ups over boxes of stiffness (E65), compared with random designs, SciPy, and assumptions of the derivation."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import laufruhe
from lanes import first_fast
from laufruhe.extensions.run_ups.boxes import RunBoxes, _RunBounds, bounds_runs
from laufruhe.extensions.run_ups.channels import FORCE, TRAVEL, TWIST
from laufruhe.extensions.run_ups.dampers import pairs_of, roots
from laufruhe.extensions.run_ups.linear_run import LinearRun
from laufruhe.extensions.run_ups.machine import Run
from laufruhe.extensions.run_ups.matrices import RunMatrices
from laufruhe.extensions.run_ups.moments import RunMoments
from laufruhe.extensions.run_ups.motion import MotionEquations, Steps, _between, _force
from laufruhe.extensions.run_ups.peaks import RunPeaks
from laufruhe.extensions.run_ups.runs import run_loads, run_through
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.numerics.arrays import Array
from laufruhe.physics.time_model import time_model
from laufruhe.problem.evaluation import evaluate, objective_value, with_mounts
from laufruhe.problem.measure import Measure
from laufruhe.problem.mount_resonance import evaluate_start
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.prove.mounts.box_norms import LinearBound
from laufruhe.prove.mounts.box_response import BoxModel
from laufruhe.solvers import Status
from problem_files import PROBLEMS
from prove.test_subdivision import divided_bound

READY = PROBLEMS / "soft-single-run-up-mounts.toml"
OF_RUNS = tuple(Measure(channel) for channel in (FORCE, TRAVEL, TWIST))
SIZES = (0.02, 0.1, 0.3)
FLUID = {"mass": "25 kg", "bulge_stiffness": "260 N/mm", "damping": "500 N s/m"}


def random_tables(seed: int, **changes: Any) -> dict[str, Any]:
    """Return a single on three or four mounts with one to four open stiffnesses and several kinds of damping."""
    r = np.random.default_rng(seed)
    count = int(r.integers(3, 5))
    axes = r.permutation(3 * count)[: int(r.integers(1, 5))]
    places = []
    for m in range(count):
        stiffness: list[Any] = [f"{k} N/mm" for k in r.uniform(60.0, 400.0, 3)]
        for axis in axes[axes // 3 == m] % 3:
            low = r.uniform(30.0, 150.0)
            high = low * r.uniform(1.5, 8.0)
            stiffness[axis] = {"between": [f"{low} N/mm", f"{high} N/mm"], "start": f"{0.5 * (low + high)} N/mm"}
        position = [f"{x} mm" for x in (*r.uniform(-300.0, 300.0, 2), r.uniform(-50.0, 150.0))]
        place = {"name": f"m{m}", "position": position, "stiffness": stiffness}
        chance = r.random(3)
        place |= {"loss_factor": float(r.uniform(0.0, 0.4))} if chance[0] < 0.5 else {}
        place |= {"damping": [f"{r.uniform(0.0, 400.0)} N s/m"] * 3} if chance[1] < 0.25 else {}
        place |= {"damping_per_stiffness": f"{r.uniform(0.0, 4.0)} ms"} if chance[2] < 0.2 else {}
        places.append(place)
    if seed % 4 == 0:
        places[0]["fluid_track"] = FLUID
    rpm = float(r.uniform(500.0, 1500.0))
    return {
        **tables_of(READY),
        "fidelity": {"samples": 360},
        "mounts": {"kind": "elastic", "loss_factor": float(r.choice([0.0, 0.05, 0.1, 0.3])), "places": places},
        "block": {
            "mass": f"{r.uniform(60.0, 250.0)} kg",
            "centre_of_gravity": [f"{x} mm" for x in (*r.uniform(-60.0, 60.0, 2), r.uniform(0.0, 200.0))],
            "inertia": [f"{x} kg m^2" for x in r.uniform(5.0, 9.0, 3)],
        },
        "operating_points": [{"name": "rated", "speed": f"{rpm} rpm"}],
        "run_up": {
            "up_to": f"{rpm} rpm", "time": f"{r.uniform(0.2, 0.5)} s", "shut_down_time": f"{r.uniform(0.2, 0.6)} s",
        },
        "objective": {"minimise": "run-up travel"}, "constraints": [], **changes,
    }  # fmt: skip


def random_problem(seed: int, **changes: Any) -> Problem:
    return load_tables(random_tables(seed, **changes), Path("random.toml"))


class Boxes:
    """Problem, boxes of several sizes within it, and the values of every measure at designs."""

    def __init__(self, seed: int) -> None:
        self.problem = random_problem(seed)
        self.model = BoxModel(self.problem, evaluate_start(self.problem))
        self.runs = RunBoxes(self.model, OF_RUNS)
        self.peaks = RunPeaks(self.problem, OF_RUNS)
        r = self.random = np.random.default_rng(seed + 1000)
        low, high = self.model.lower, self.model.upper
        self.middles = np.exp(r.uniform(np.log(low), np.log(high), (len(SIZES), len(low))))
        self.shares = np.array(SIZES)[:, None] * r.uniform(0.3, 1.0, self.middles.shape)
        self.lower = np.clip(self.middles * (1.0 - self.shares), low, high)
        self.upper = np.clip(self.middles * (1.0 + self.shares), low, high)

    def values(self, x: Array) -> Array:
        """Return the largest lengths over all steps, ends of both runs included."""
        rows = self.peaks.rows([x])
        assert rows is not None
        return np.array([np.linalg.norm(rows[0][measure], axis=-1).max() for measure in OF_RUNS])

    def designs(self, box: int, count: int) -> Array:
        """Return designs of a box, half of them corners."""
        n = len(self.model.lower)
        shares = np.vstack([self.random.random((count - count // 2, n)), self.random.integers(0, 2, (count // 2, n))])
        return self.lower[box] + shares * (self.upper[box] - self.lower[box])


@cache
def of_seed(seed: int) -> Boxes:
    return Boxes(seed)


def minimum(under: LinearBound) -> Array:
    found = under.value - under.remainder - np.abs(under.slopes).sum(axis=1)
    return np.where(np.isfinite(found), found, -np.inf)


@pytest.mark.parametrize("seed", first_fast(range(12), 0, 4))
def test_no_design_of_a_box_is_under_its_bound(seed: int) -> None:
    """Check that none of 48 designs per box is below its linear minorant or bound, and that small boxes are tight."""
    boxes = of_seed(seed)
    found = [boxes.runs.under(measure, boxes.lower, boxes.upper) for measure in OF_RUNS]
    tight = []
    for box in range(len(SIZES)):
        best = np.full(len(OF_RUNS), np.inf)
        half = 0.5 * (boxes.upper[box] - boxes.lower[box])
        for x in boxes.designs(box, 48):
            values = boxes.values(x)
            best = np.minimum(best, values)
            share = (x - boxes.lower[box]) / half - 1.0
            lines = np.array([u.value[box] - u.remainder[box] + u.slopes[box] @ share for u in found])
            assert np.all(lines[np.isfinite(lines)] <= values[np.isfinite(lines)] * (1.0 + 1e-9))
        bounds = np.array([minimum(under)[box] for under in found])
        assert np.all(bounds <= best * (1.0 + 1e-9))
        tight.append(bounds / best)
    assert np.min(tight[0]) > 0.9


@pytest.mark.parametrize("seed", first_fast(range(4), 0, 2))
def test_a_smaller_box_has_no_worse_bound_and_is_known_to_its_cube(seed: int) -> None:
    """Check that boxes shrinking to their middle have rising bounds, up to the exact model's value."""
    boxes = of_seed(seed)
    sizes = np.array([0.2, 0.1, 0.05, 0.02, 0.01, 0.001, 1e-6])
    middle = np.repeat(boxes.middles[1:2], len(sizes), axis=0)
    width = sizes[:, None] * np.minimum(middle - boxes.model.lower, boxes.model.upper - middle)
    for number, measure in enumerate(OF_RUNS):
        result = boxes.runs.under(measure, middle - width, middle + width)
        bounds = minimum(result)
        assert np.all(np.diff(np.maximum(bounds, 0.0)) >= -1e-9 * bounds[-1])
        assert bounds[-1] == pytest.approx(boxes.values(middle[0])[number], rel=1e-5)
        # squares are in the rest as well, as far as they are under
        assert result.remainder[5] < 1.2e-2 * result.remainder[4] + 1e-12 * bounds[-1]


@pytest.mark.parametrize("seed", range(4))
def test_the_place_and_time_with_the_highest_bound_is_taken(seed: int) -> None:
    """Compare with all places and times one by one."""
    rng, (boxes, sides, places, times) = np.random.default_rng(seed), (3, 2, 4, 5)
    pairs = ((0, 0), (0, 1), (1, 1))
    size = rng.uniform(1.0, 4.0, (boxes, places, times))
    slopes = rng.normal(size=(boxes, sides, places, times)) * rng.uniform(0.1, 2.0, (boxes, 1, places, times))
    bent = rng.random((boxes, len(pairs), places, times))
    rest = rng.random((boxes, places, times))
    look = _RunBounds.__new__(_RunBounds)
    look._equations = SimpleNamespace(first=rng.normal(size=(boxes, sides, 2, 2)))
    look._steps = SimpleNamespace(pairs=pairs)
    result = look._best(size, slopes, bent, rest)
    for box in range(boxes):
        each = [
            size[box, p, t] - sum(abs(slopes[box, :, p, t])) - sum(bent[box, :, p, t]) - rest[box, p, t]
            for p in range(places) for t in range(times)
        ]  # fmt: skip
        assert minimum(result)[box] == pytest.approx(max(each), rel=1e-12)


@pytest.mark.slow
def test_scipy_reaches_what_boxes_are_not_under() -> None:
    """Compare bounds with SciPy's eighth order, with loads at every moment and no modes."""
    boxes = of_seed(3)
    problem, run = boxes.problem, boxes.problem.engine.extra(Run)
    assert run is not None
    bounds = np.array([minimum(boxes.runs.under(measure, boxes.lower, boxes.upper)) for measure in OF_RUNS])
    inertia, gas = run_loads(problem.engine, problem.points[0], problem.fidelity)
    for box in range(2):
        for x in boxes.designs(box, 2):
            runs = [
                run_through(boxes.model.mounting(x), inertia, gas, *each, 60, "DOP853", 1e-9)
                for each in ((0.0, run.speed, run.up), (run.speed, 0.0, run.down))
            ]
            values = np.max([own.worst for own in runs], axis=0)
            assert np.all(bounds[:, box] <= values * (1.0 + 1e-3))
        assert np.any(bounds[:, box] > 0.8 * values)


def test_long_steps_end_where_short_ones_do() -> None:
    """Compare motion from moments with the exact model, from any short step on."""
    boxes = of_seed(1)
    whole = (boxes.model.lower[None], boxes.model.upper[None])
    of = MotionEquations(boxes.model, RunMatrices(boxes.model), 80.0, *whole)
    model = time_model(boxes.model.mounting(0.5 * (whole[0][0] + whole[1][0])))
    for sweep, wrenches in zip(boxes.peaks.sweeps, boxes.peaks.wrenches, strict=True):
        exact = LinearRun(model, sweep).response(wrenches)
        moments = RunMoments(sweep, wrenches, model.load, 7)
        steps = Steps(of, moments.step)
        for first in (0, 3):
            long = moments.ending_at(first)
            y, rate = np.split(steps.middle(long.moments.reshape(1, -1, len(long.impulses)))[0], 2)
            ends = (first - 7) % 7 - 7 * (first > 0) + 7 * np.arange(len(long.impulses) + 1)
            inside = ends >= 0
            turned = of.turn[0] @ (y / of.scale), of.turn[0] @ rate
            for own, exact_part in zip(turned, (exact.y, exact.rate), strict=True):
                size = np.abs(exact_part).max()
                assert np.abs(own[:, inside] - exact_part[:, ends[inside]]).max() < 1e-9 * size


def test_roots_of_stiffness_are_as_near_as_they_say() -> None:
    """Check on random matrices that the rest after the second order of A^{-1/2} is within its bounds."""
    r = np.random.default_rng(4)
    for _ in range(30):
        squares = np.sort(r.uniform(200.0, 8000.0, 6))
        slopes = np.stack([np.outer(v, v) for v in r.normal(size=(3, 6))])
        units = np.sqrt(np.outer(squares, squares))
        slopes *= r.uniform(0.05, 0.95) / np.linalg.eigvalsh(slopes.sum(axis=0) / units)[-1]
        result = roots(squares[None], slopes[None], 7)
        assert result.middle.shape == (1, 7, 7)
        assert not result.middle[0, 6].any()
        for d in np.vstack([r.uniform(-1.0, 1.0, (10, 3)), r.choice([-1.0, 1.0], (6, 3))]):
            values, modes = np.linalg.eigh(np.diag(squares) + np.tensordot(d, slopes, axes=1))
            exact = np.pad((modes / np.sqrt(values)) @ modes.T, [(0, 1), (0, 1)])
            once = result.middle[0] + np.tensordot(d, result.first[0], axes=1)
            twice = once + sum(d[j] * d[k] * own for own, (j, k) in zip(result.second[0], pairs_of(3), strict=True))
            for near, left in ((once, result.after_first[0]), (twice, result.after_second[0])):
                assert np.all(np.abs(exact - near) <= left * (1.0 + 1e-9) + 1e-15)


@pytest.mark.parametrize("seed", [0, 1, 2, 5])
def test_losses_add_energy_at_no_more_than_the_growth_rate(seed: int) -> None:
    """Check that damping of every design in a box adds energy at no more than the known rate."""
    boxes = of_seed(seed)
    of = MotionEquations(boxes.model, RunMatrices(boxes.model), 80.0, boxes.lower, boxes.upper)
    for box in range(len(SIZES)):
        for x in boxes.designs(box, 20):
            damping = time_model(boxes.model.mounting(x)).damping
            assert (
                np.linalg.eigvalsh(0.5 * (damping + damping.T))[0]
                >= -of.growth_rates[box] - 1e-9 * np.abs(damping).max()
            )


@pytest.mark.parametrize("seed", first_fast((2, 5, 0), 2))
def test_motion_matrices_are_within_the_rest_of_their_expansion(seed: int) -> None:
    """Check A of z' = A z for every design in a box to second order, with each entry of the rest bounded."""
    boxes, scale = of_seed(seed), 80.0
    of = MotionEquations(boxes.model, RunMatrices(boxes.model), scale, boxes.lower, boxes.upper)
    n, pairs = of.turn.shape[1], pairs_of(of.halves.shape[1])
    bent = 0.0
    for box, turn in enumerate(of.turn):
        middle, half = 0.5 * (boxes.lower + boxes.upper)[box], of.halves[box]
        for x in boxes.designs(box, 12):
            model, s = time_model(boxes.model.mounting(x)), (x - middle) / half
            matrix = of.matrix[box] + np.tensordot(s, of.first[box], axes=1)
            second = sum(s[j] * s[k] * own for own, (j, k) in zip(of.second[box], pairs, strict=True))
            exact = turn.T @ model.stiffness @ turn, turn.T @ model.damping @ turn
            size = np.abs(exact[1]).max() + 1e-12
            assert -scale * matrix[n:, :n] == pytest.approx(exact[0], rel=1e-9, abs=1e-9 * np.abs(exact[0]).max())
            off = np.abs(exact[1] + (matrix + second)[n:, n:])
            assert np.all(off <= of.maps.remainder[box] * (1.0 + 1e-9) + 1e-9 * size)
            bent = max(bent, float((np.abs(exact[1] + matrix[n:, n:]) - of.maps.remainder[box]).max()) / size)
    # the second order is needed
    assert bent > 1e-6 or not of.maps.bends.any()


def test_the_rest_of_expanded_forces_is_within_its_bound() -> None:
    """Check second orders of motion times first ones of forces, bends times both, and the rest."""
    r = np.random.default_rng(8)
    boxes, sides, n, times = 2, 3, 4, 5
    pairs = pairs_of(sides)
    first, bends = r.normal(size=(boxes, sides, 2 * n, 2 * n)), r.normal(size=(boxes, len(pairs), n, n))
    rest = np.abs(r.normal(size=(boxes, n, n)))
    middle, by, bent = (r.normal(size=(boxes, *more, 2 * n, times)) for more in ((), (sides,), (len(pairs),)))
    for shares in ((1.0, 1.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        own, curved, left = (share * each for share, each in zip(shares, (first, bends, rest), strict=True))
        of = SimpleNamespace(count=boxes, first=own, maps=SimpleNamespace(bends=curved, remainder=left))
        bound, maximum = _force(of, middle, by, bent), np.zeros((boxes, times))
        for s in np.vstack([r.uniform(-1.0, 1.0, (20, sides)), r.choice([-1.0, 1.0], (20, sides))]):
            products = np.array([s[j] * s[k] for j, k in pairs])
            once, twice = np.einsum("j,bjmt->bmt", s, by), np.einsum("p,bpmt->bmt", products, bent)
            force = np.einsum("j,bjnm,bmt->bnt", s, own[:, :, n:], twice)
            force += np.einsum("p,bpnm,bmt->bnt", products, curved, (once + twice)[:, n:])
            unknown = r.choice([-1.0, 1.0], left.shape) * left
            force += unknown @ (middle + once + twice)[:, n:]
            maximum = np.maximum(maximum, np.linalg.norm(force, axis=1))
        assert np.all(maximum <= bound * (1.0 + 1e-12))
        assert np.all(bound <= 30.0 * maximum)
    # where nothing has a sign of its own the corner has all of what bends tell
    curved, by, bent = (np.abs(each) for each in (bends, by, bent))
    of = SimpleNamespace(count=boxes, first=0.0 * first, maps=SimpleNamespace(bends=curved, remainder=0.0 * rest))
    force = curved.sum(axis=1) @ (by.sum(axis=1) + bent.sum(axis=1))[:, n:]
    assert _force(of, middle, by, bent) == pytest.approx(np.linalg.norm(force, axis=1), rel=1e-12)


def orders_within(first: Array, second: Array, a: Array, start: Array, load: Array, times: Array) -> list[Array]:
    """Return z0, z_1 and z_11 of one open number at some times under a constant load, by one matrix exponential."""
    m = len(a)
    whole = np.zeros((3 * m + 1, 3 * m + 1))
    for k in range(3):
        whole[k * m : (k + 1) * m, k * m : (k + 1) * m] = a
    whole[m : 2 * m, :m] = whole[2 * m : 3 * m, m : 2 * m] = first
    whole[2 * m : 3 * m, :m] = second
    whole[:m, -1] = load
    z = np.array([expm(t * whole) @ np.append(start, 1.0) for t in times])
    return [z[:, k * m : (k + 1) * m].T for k in range(3)]


@pytest.mark.parametrize("seed", range(8))
def test_forces_within_a_step_exceed_its_ends_by_no_more_than_the_bound(seed: int) -> None:
    """Compare forces of springs under a load that jumps with the exact motion."""
    r, n = np.random.default_rng(seed), 1 + seed % 3
    frequency, rates, zeros = r.uniform(2.0, 8.0), r.choice([0.0, 1.0], 3), np.zeros((n, n))
    spring, change = frequency * np.eye(n), r.uniform(0.1, 1.0) * np.eye(n)
    a = np.block([[zeros, spring], [-spring, -r.choice([0.0, 0.3]) * np.eye(n)]])
    first = np.block([[zeros, zeros], [-change, -r.choice([0.0, 0.2]) * change]])
    bends, rest = rates[0] * r.normal(size=(1, n, n)), rates[1] * np.abs(r.normal(size=(n, n)))
    second = np.block([[zeros, zeros], [zeros, -bends[0]]])
    maps = SimpleNamespace(bends=bends[None], remainder=rest[None])
    of = SimpleNamespace(count=1, matrix=a[None], first=first[None, None], second=second[None, None], maps=maps)
    times, tight = np.linspace(0.0, 0.2 / frequency, 101), []
    step = times[-1]
    position = np.concatenate([np.ones(n), np.zeros(n)])
    # from a motion of first order alone the second one falls to nothing, so that its force is curved downwards
    falling = np.concatenate([0.0 * position, position, frequency * change[0, 0] * step**2 * position])
    starts = [np.repeat(shares, 2 * n) * r.normal(size=6 * n) for shares in (np.ones(3), *np.eye(3))]
    for start, is_loaded in [(falling, 0.0), *((start, rates[2]) for start in starts)]:
        load = is_loaded * np.concatenate([np.zeros(n), r.normal(size=n)])
        z0, z1, z2 = orders_within(first, second, a, start, load, times)
        force = _force(of, z0[None], z1[None, None], z2[None, None])[0]
        ends = [z[..., [0, -1]] for z in (z0[None], z1[None, None], z2[None, None])]
        size = np.full((1, 1), np.linalg.norm(load))
        bound = _between(of, step, *ends, step * size, size)[0, 0]
        excess = np.trapezoid(force, times) / step - 0.5 * (force[0] + force[-1])
        assert excess <= bound * (1.0 + 1e-9) + 1e-12
        tight.append(excess / (bound or 1.0))
    assert max(tight) > 0.01


def test_a_motion_of_unit_energy_has_no_larger_signal_than_its_gain() -> None:
    """Check random maps from motion to signals, with their slopes, for the softest design."""
    r = np.random.default_rng(2)
    boxes, sides, places, d, n, times = 2, 2, 2, 3, 4, 3
    roots_of_stiffness = r.normal(size=(boxes, n, n)) + 3.0 * np.eye(n)
    look = _RunBounds.__new__(_RunBounds)
    look._d = d
    look._equations = SimpleNamespace(softest=roots_of_stiffness @ np.swapaxes(roots_of_stiffness, 1, 2))
    for shares in ((1.0, 1.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0)):
        still, changing, beyond = (share * np.ones(1) for share in shares)
        maps = look._maps = SimpleNamespace(
            position=still * r.normal(size=(boxes, places * d, n)), rate=still * r.normal(size=(boxes, places * d, n)),
            positions=changing * r.normal(size=(boxes, sides, places * d, n)),
            rates=changing * r.normal(size=(boxes, sides, places * d, n)),
            beyond_linear=beyond * np.abs(r.normal(size=(boxes, places * d, n))),
        )  # fmt: skip
        directions = r.normal(size=(boxes, places, d, times))
        directions /= np.linalg.norm(directions, axis=2, keepdims=True)
        bound, maximum = look._gains(directions), np.zeros((boxes, places, times))
        for s in np.vstack([r.uniform(-1.0, 1.0, (20, sides)), r.choice([-1.0, 1.0], (40, sides))]):
            position = maps.position + np.tensordot(s, maps.positions, axes=(0, 1))
            rate = maps.rate + np.tensordot(s, maps.rates, axes=(0, 1))
            rate = rate + r.choice([-1.0, 1.0], rate.shape) * maps.beyond_linear
            at_unit = position @ np.swapaxes(np.linalg.inv(roots_of_stiffness), 1, 2)
            # the largest signal along a direction is the length of its row
            along = [np.einsum("bpdt,bpdn->bptn", directions, m.reshape(boxes, places, d, n)) for m in (at_unit, rate)]
            maximum = np.maximum(maximum, np.linalg.norm(np.concatenate(along, axis=-1), axis=-1))
        assert np.all(maximum <= bound * (1.0 + 1e-12))
        assert np.all(bound <= 10.0 * maximum)


@pytest.mark.slow
def test_a_box_that_reaches_to_a_free_block_is_not_bounded() -> None:
    """Check that a box that includes zero stiffness has the bound minus infinity."""
    tables = random_tables(7)
    for place in tables["mounts"]["places"]:
        place["stiffness"] = [{"between": ["0 N/mm", "300 N/mm"], "start": "100 N/mm"}, "200 N/mm", "200 N/mm"]
    problem = load_tables(tables, Path("loose.toml"))
    model = BoxModel(problem, evaluate_start(problem))
    result = RunBoxes(model, OF_RUNS).under(OF_RUNS[1], model.lower[None], model.upper[None])
    assert minimum(result)[0] == -np.inf


def stopped(maximum: str, stiffness: str = "300 N/mm", further: tuple[str, ...] = (), **more: Any) -> Problem:
    """Return a problem with stops at 1.1 mm and limits of travel."""
    limits = [{"name": each, "limit": "run-up travel", "max": each} for each in (maximum, *further)]
    tables = random_tables(7, constraints=limits, **more)
    for place in tables["mounts"]["places"]:
        place["stop"] = {"gap": "1.1 mm", "stiffness": stiffness}
    return load_tables(tables, Path("stopped.toml"))


@pytest.mark.slow
def test_stops_that_limits_keep_away_from_are_not_met() -> None:
    """Check that run-ups with stops are bounded only under a limit clearly below soft stops."""
    assert bounds_runs(random_problem(1))
    assert not bounds_runs(random_problem(1, objective={"minimise": "static sag"}))
    assert bounds_runs(stopped("1.05 mm"))
    assert not bounds_runs(stopped("1.0995 mm"))
    assert not bounds_runs(stopped("1.2 mm"))
    assert not bounds_runs(stopped("1.05 mm", "1e9 N/mm"))


def test_the_tightest_limit_keeps_away_from_stops() -> None:
    assert bounds_runs(stopped("1.2 mm", further=("1.05 mm", "2 mm")))


@pytest.mark.slow
def test_designs_that_keep_away_from_stops_are_not_under_the_bound() -> None:
    """Check 50 designs with stops: those below the bound break the limit, and the search is near the bound."""
    problem = stopped("1.05 mm", objective={"minimise": "run-up force"}, search={"starts": 1})
    result = laufruhe.solve(problem)
    assert result.certificate.kind is Proof.GLOBAL
    assert "run-ups" in result.certificate.method
    initial, r = evaluate(problem), np.random.default_rng(2)
    low, high = (np.array([getattr(d, side) for d in problem.mount_decisions]) for side in ("lower", "upper"))
    feasible = met = 0
    for x in low + (high - low) * r.random((50, len(low))):
        design = with_mounts(initial, problem.design(x.tolist()))
        met += design.value(OF_RUNS[1]) > 1.1e-3
        if design.violation(problem.limits) <= 0.0:
            feasible += 1
            assert objective_value(problem, design) >= result.certificate.lower_bound
    assert min(feasible, met) > 5
    many, value = replace(problem, search=replace(problem.search, boxes=80)), result.objective.value
    assert 0.97 * value < divided_bound(many, 1.5 * value, 0.05 * value).bound <= value * (1.0 + 1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "objective", "limit"),
    [
        (8, "run-up force", None),
        (3, "mean mount force", ("run-up travel", "mm", 1e3)),
        (7, "static sag", ("run-up force", "N", 1.0)),
    ],
)
def test_no_design_of_a_grid_is_under_the_bound(
    seed: int, objective: str, limit: tuple[str, str, float] | None
) -> None:
    """Check bounds of objective and limit for 100 designs, near the best of them.

    A bound does not exceed the value that it has to reach: with a half worse as target, it stops at the best.
    """
    settings: dict[str, Any] = {"objective": {"minimise": objective}, "search": {"starts": 1}}
    bare = random_problem(seed, **settings)
    initial = evaluate(bare)
    r = np.random.default_rng(seed)
    low, high = (np.array([getattr(d, side) for d in bare.mount_decisions]) for side in ("lower", "upper"))
    designs = [with_mounts(initial, bare.design(x.tolist())) for x in low + (high - low) * r.random((100, len(low)))]
    problem = bare
    if limit is not None:
        name, unit, scale = limit
        measure = next(m for m in OF_RUNS if m.name == name)
        maximum = float(np.quantile([design.value(measure) for design in designs], 0.2))
        problem = random_problem(seed, **settings, constraints=[{"limit": name, "max": f"{maximum * scale} {unit}"}])
    values = [objective_value(problem, d) for d in designs if d.violation(problem.limits) <= 0.0]
    value = min(values)
    result = laufruhe.solve(problem)
    assert result.certificate.lower_bound <= min(value, result.objective.value)
    assert result.certificate.gap < 0.1
    many = replace(problem, search=replace(problem.search, boxes=80))
    bound = divided_bound(many, 1.5 * value, 0.05 * value).bound
    assert 0.97 * value < bound <= min(value, result.objective.value) * (1.0 + 1e-9)
    assert result.objective.value <= value * (1.0 + 1e-3)


@pytest.mark.slow
def test_a_limit_that_no_stiffness_keeps_is_named() -> None:
    """Check limits a little below the least travel (infeasible, named) and a little above it."""
    run = {
        "operating_points": [{"speed": "800 rpm"}],
        "run_up": {"up_to": "800 rpm", "time": "0.2 s", "shut_down_time": "0.2 s"},
        "search": {"starts": 1},
    }
    best = laufruhe.solve(random_problem(13, **run))
    assert best.certificate.kind is Proof.GLOBAL
    force, sag = {"minimise": "mean mount force"}, {"limit": "static sag", "max": "1 m"}
    for share, status in ((0.98, Status.INFEASIBLE), (1.02, Status.OPTIMAL)):
        limit = {"limit": "run-up travel", "max": f"{share * 1e3 * best.objective.value} mm"}
        result = laufruhe.solve(random_problem(13, objective=force, constraints=[sag, limit], **run))
        assert result.status is status
        assert result.conflict == (() if status is Status.OPTIMAL else ("run-up travel",))
