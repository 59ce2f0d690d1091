"""Hydraulic mounts: fluid tracks and measured stiffness against seven degrees of freedom, time, bounds, refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from laufruhe.errors import InputError, ModelError
from laufruhe.load_models.mount_symbols import response, symbolic_mounts
from laufruhe.load_models.symbolic_spectrum import SymbolicSpectrum
from laufruhe.machine import OperatingPoint
from laufruhe.machine.dynamic import FluidTrack, MeasuredStiffness
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ResonanceError, elastic_mounting
from laufruhe.physics.steady_state import periodic_state
from laufruhe.physics.time_model import frequencies_with_fluid, time_model
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.prove.certificate import Proof
from laufruhe.solvers import solve
from mounts.bounds_seen import bounds_over_designs
from mounts.files import BLOCK, ENGINE, MOUNTS, changed, problem_of
from mounts.powertrain import random_mounting, wrench

TRACK = FluidTrack(2, mass=30.0, bulge=2.5e5, stiffness=8e3, damping=600.0)
RMS = '[objective]\nminimise = "rms mount force"\norders = [2, 4]\n'


def hydraulic(seed: int = 0, loss: float = 0.0, damping: float = 40.0, track: FluidTrack = TRACK):
    plain = random_mounting(seed, loss=loss, damping=damping)
    first, second, *rest = plain.mounts
    other = replace(track, axis=0, mass=0.5 * track.mass)
    return elastic_mounting(plain.block, [replace(first, dynamic=(track,)), replace(second, dynamic=(other,)), *rest])


@pytest.mark.parametrize("hertz", [3.0, 12.0, 15.0, 60.0])
def test_the_force_of_a_track_is_that_of_its_fluid_in_time(hertz: float) -> None:
    # the mount is moved by cos W t; its force is that of the rubber which swells, bulge (x - y)
    omega = math.tau * hertz

    def rates(t, state):
        pull = TRACK.bulge * (np.cos(omega * t) - state[0])
        return [state[1], (pull - TRACK.stiffness * state[0] - TRACK.damping * state[1]) / TRACK.mass]

    last = 3.0 + math.tau / omega
    times = np.linspace(3.0, last, 40)
    result = solve_ivp(rates, (0.0, last), [0.0, 0.0], "DOP853", t_eval=times, rtol=1e-11, atol=1e-13).y[0]
    force = TRACK.bulge * (np.cos(omega * times) - result)
    ours = (TRACK.at(np.array([omega]))[0] * np.exp(1j * omega * times)).real
    assert ours == pytest.approx(force, abs=1e-6 * np.abs(force).max())


def test_a_track_is_soft_at_its_notch_and_stiff_above_it() -> None:
    free = replace(TRACK, damping=0.0)
    notch, peak = (math.sqrt(k / free.mass) for k in (free.stiffness, free.stiffness + free.bulge))
    assert abs(free.at(np.array([notch]))[0]) < 1e-9 * free.bulge
    assert abs(free.at(np.array([0.999 * peak]))[0]) > 100.0 * free.bulge
    assert free.at(np.array([1e5]))[0] == pytest.approx(free.bulge, rel=1e-5)
    assert free.at(np.array([0.0]))[0] == pytest.approx(free.static, rel=1e-12)
    assert np.all(TRACK.at(np.linspace(0.0, 900.0, 500)).imag >= 0.0)


def _seven(mounting, omega: float, load: np.ndarray) -> np.ndarray:
    """Return the forces on the mounts from M, C and K of block and fluid written out, shape (mounts, 3)."""
    block, centre = mounting.block, np.array(mounting.block.centre_of_gravity)
    laws = [(k, law) for k, mount in enumerate(mounting.mounts) for law in mount.dynamic]
    size = 6 + len(laws)
    mass, drag, stiffness = np.zeros((size, size)), np.zeros((size, size)), np.zeros((size, size))
    mass[:6, :6] = block.mass_matrix
    motions = []
    for mount in mounting.mounts:
        x, y, z = np.array(mount.position) - centre
        motion = np.hstack([np.eye(3), np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])])
        axes = np.array(mount.orientation)
        stiffness[:6, :6] += motion.T @ axes.T @ np.diag(mount.stiffness) @ axes @ motion
        drag[:6, :6] += motion.T @ axes.T @ np.diag(mount.damping) @ axes @ motion
        motions.append(motion)
    pulls = []
    for n, (k, law) in enumerate(laws):
        row = np.zeros(size)
        row[:6] = np.array(mounting.mounts[k].orientation)[law.axis] @ motions[k]
        row[6 + n] = -1.0
        stiffness += law.bulge * np.outer(row, row)
        stiffness[6 + n, 6 + n] += law.stiffness
        mass[6 + n, 6 + n], drag[6 + n, 6 + n] = law.mass, law.damping
        pulls.append(row)
    about = load.astype(complex)
    about[3:] -= np.cross(centre, load[:3])
    q = np.linalg.solve(stiffness + 1j * omega * drag - omega**2 * mass, np.concatenate([about, np.zeros(len(laws))]))
    forces = np.zeros((len(mounting.mounts), 3), dtype=complex)
    for k, mount in enumerate(mounting.mounts):
        axes = np.array(mount.orientation)
        own = np.array(mount.stiffness) + 1j * omega * np.array(mount.damping)
        forces[k] = axes.T @ np.diag(own) @ axes @ motions[k] @ q[:6]
    for (k, law), row in zip(laws, pulls, strict=True):
        forces[k] += np.array(mounting.mounts[k].orientation)[law.axis] * law.bulge * (row @ q)
    return forces


@pytest.mark.parametrize("seed", [0, 1])
def test_forces_are_those_of_block_and_fluid_together(seed: int) -> None:
    mounting, loads = hydraulic(seed), wrench(seed)
    ours = mounting.forces(loads, 50.0)
    for k in range(1, len(loads.coefficients)):
        theirs = _seven(mounting, 50.0 * k, loads.coefficients[k])
        assert ours.coefficients[k] == pytest.approx(theirs, rel=1e-9, abs=1e-9 * np.abs(theirs).max())


def test_natural_frequencies_with_fluid_are_where_the_whole_is_singular() -> None:
    mounting = hydraulic(2, damping=0.0, track=replace(TRACK, damping=0.0))
    result = frequencies_with_fluid(mounting)
    assert len(result) == 8
    for hertz in result:
        omega = np.array([math.tau * hertz])
        whole = mounting.stiffness + mounting.dynamic.impedance(omega, np.eye(6))[0].real
        values = np.linalg.eigvals(np.linalg.solve(mounting.block.mass_matrix, whole)).real
        assert np.abs(values / omega[0] ** 2 - 1.0).min() < 1e-6
    load = Spectrum(wrench().base, np.array([np.zeros(6), np.full(6, 10.0)], dtype=complex))
    with pytest.raises(ResonanceError, match="fluid tracks"):
        mounting.forces(load, math.tau * result[3])


def test_the_steady_state_in_time_is_that_of_every_order() -> None:
    mounting, load = hydraulic(1), wrench(1, orders=2)
    state = periodic_state(mounting, load, 45.0, samples=64, tolerance=1e-10)
    theirs = mounting.forces(load, 45.0).sample(64)
    assert state.forces == pytest.approx(theirs, abs=1e-6 * np.abs(theirs).max())
    assert state.travels == pytest.approx(
        mounting.travel(load, 45.0).sample(64), abs=1e-6 * np.abs(state.travels).max()
    )


def test_a_dense_table_of_a_track_is_the_track() -> None:
    mounting = hydraulic(0)
    omegas = np.arange(0.0, 900.0, 0.25)

    def tabled(track: FluidTrack) -> MeasuredStiffness:
        return MeasuredStiffness(track.axis, tuple(omegas.tolist()), tuple(track.at(omegas).tolist()))

    mounts = [replace(mount, dynamic=tuple(map(tabled, mount.dynamic))) for mount in mounting.mounts]
    other = elastic_mounting(mounting.block, mounts)
    ours, theirs = (each.forces(wrench(), 50.3).coefficients for each in (mounting, other))
    assert theirs == pytest.approx(ours, rel=1e-4, abs=1e-4 * np.abs(ours).max())
    with pytest.raises(ModelError, match="no law in time"):
        time_model(other)


FLUID = 'fluid_track = { mass = "25 kg", bulge_stiffness = "260 N/mm", damping = "500 N s/m" }\n'
HYDRAULIC = changed(MOUNTS, ('name = "front left"\n', 'name = "front left"\n' + FLUID))
OBJECTIVES = {
    "rms": RMS,
    "mean": '[objective]\nminimise = "mean mount force"\n',
    "travel": '[objective]\nminimise = "maximum mount travel"\n',
    "transmissibility": '[objective]\nminimise = "transmissibility"\norders = [2]\n',
}


@pytest.mark.parametrize("name", OBJECTIVES)
def test_bounds_know_hydraulic_mounts(name: str, tmp_path: Path) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, HYDRAULIC, OBJECTIVES[name])
    ratios = bounds_over_designs(problem)
    assert max(ratios) <= 1.0 + 1e-9
    assert max(ratios) > 0.99


def test_symbols_and_numbers_agree(tmp_path: Path) -> None:
    import casadi as ca

    moved = changed(HYDRAULIC, ('"200 mm", "0 mm"]', '{ between = ["150 mm", "250 mm"], start = "200 mm" }, "0 mm"]'))
    problem = problem_of(tmp_path, ENGINE, BLOCK, moved, RMS)
    x = [float(d.start) * 1.1 for d in problem.decisions]
    mounting, loads = mounting_in(problem.design(x)), wrench(orders=2)
    symbols = symbolic_mounts(problem, mounting.block, ca.DM(x))
    omegas, at = np.array([40.0, 80.0]), loads.coefficients[1:]
    drive = at @ (time_model(mounting).load[:6]).T
    spectrum = SymbolicSpectrum(omegas, ca.DM(drive.real.T.copy()), ca.DM(drive.imag.T.copy()))
    result = response(symbols, OperatingPoint("one", 1.0), spectrum).force
    real, imag = (np.array(ca.evalf(part)) for part in (result.real, result.imaginary))
    theirs = mounting.forces(loads, 40.0).coefficients[1:].reshape(2, -1).T
    assert real + 1j * imag == pytest.approx(theirs, rel=1e-9, abs=1e-9 * np.abs(theirs).max())


@pytest.mark.slow
def test_the_best_stiffness_beside_a_track_is_that_of_a_grid(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, HYDRAULIC, RMS + "[search]\nstarts = 4\n")
    result = solve(problem)
    grid = np.geomspace(2e4, 4e6, 25)
    values = [objective_value(problem, evaluate(problem, problem.design([a, b]))) for a in grid for b in grid]
    assert result.certificate.kind is Proof.GLOBAL
    assert result.objective.value <= min(values) * (1.0 + 1e-6)
    assert result.objective.value == pytest.approx(min(values), rel=0.05)


TABLE = 'dynamic_stiffness = { file = "mount.csv" }\n'
TABLED = changed(MOUNTS, ('name = "front left"\n', 'name = "front left"\n' + TABLE))
ROWS = "frequency, stiffness, loss angle\n1, 200, 5\n10, 150, 30\n40, 420, 8\n"


def test_a_table_is_read_with_its_units(tmp_path: Path) -> None:
    (tmp_path / "mount.csv").write_text(ROWS)
    engine = problem_of(tmp_path, ENGINE, BLOCK, TABLED, RMS).engine
    (law,) = engine.mounts[0].dynamic
    assert law.axis == 2
    assert law.at(np.array([math.tau * 10.0]))[0] == pytest.approx(1.5e5 * np.exp(1j * math.radians(30.0)))
    assert law.static == pytest.approx(2e5 * math.cos(math.radians(5.0)))
    # the mirrored mount has the same
    assert engine.mounts[1].dynamic == engine.mounts[0].dynamic


@pytest.mark.parametrize(
    ("mounts", "rows", "more", "message"),
    [
        (HYDRAULIC, ROWS, '[[constraints]]\nlimit = "natural frequencies"\nmin = "4 Hz"', "depends on frequency"),
        (HYDRAULIC, ROWS, '[[constraints]]\nlimit = "kinetic-energy decoupling"\nmin = 0.5', "depends on frequency"),
        (HYDRAULIC.replace('mass = "25 kg"', 'mass = "0 kg"'), ROWS, "", "fluid_track.mass"),
        (HYDRAULIC.replace("260 N/mm", "0 N/mm"), ROWS, "", "is zero, so no fluid moves in the track"),
        (TABLED, "1, 200, 5\n10, 150, 30\n5, 420, 8\n", "", "must rise"),
        (TABLED, "1, 200, 5\n10, 150, -30\n", "", "has a loss angle of -30 deg in row 2"),
        (TABLED, "1, 200, 5\n", "", "fewer than two rows"),
        (TABLED.replace("mount.csv", "none.csv"), ROWS, "", "cannot be read"),
        (TABLED, ROWS, '[run_up]\nup_to = "900 rpm"', "whose stiffness was measured over frequency"),
        (TABLED.replace('"mount.csv" }', '"mount.csv", columns = "stiffness and loss" }'), "1, 200, 5\n9, 90, -3\n", "",
         "negative loss"),
    ],
)  # fmt: skip
def test_meaningless_input_is_refused_in_a_line(mounts, rows, more, message, tmp_path: Path) -> None:
    (tmp_path / "mount.csv").write_text(rows)
    with pytest.raises(InputError) as refused:
        problem_of(tmp_path, ENGINE, BLOCK, mounts, RMS, more)
    assert message in str(refused.value)


@pytest.mark.parametrize(
    "numbers", [(0.0, 1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (1.0, 1.0, -1.0, 0.0), (1.0, 1.0, 0.0, -1.0)]
)
def test_a_fluid_track_that_cannot_be_is_refused(numbers: tuple[float, float, float, float]) -> None:
    with pytest.raises(ModelError, match="the fluid track"):
        FluidTrack(0, *numbers)
