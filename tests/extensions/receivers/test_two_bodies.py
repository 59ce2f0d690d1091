"""Motion of engine and frame, and forces between them, against twelve equations of motion assembled here."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from extensions.receivers import two_bodies as own
from laufruhe.extensions.receivers.machine import Frame, FrequencyFunction, Receiver, Receivers
from laufruhe.machine import Block, Cycle, Engine, Mount

PLACE = (0.3, -0.4, 0.7)
SAME = 1e-9


def function(rows: list[np.ndarray], frequencies: np.ndarray) -> FrequencyFunction:
    return FrequencyFunction("f", tuple(frequencies.tolist()), tuple(tuple(row.ravel().tolist()) for row in rows))


@pytest.mark.parametrize("seed", range(6))
def test_points_move_as_the_two_bodies_do(seed: int) -> None:
    engine, frame = own.scene(seed)
    loads, none = own.wrenches(seed), np.zeros((len(engine.mounts), 3))
    points = [own.point("engine", PLACE, False), own.point("frame", PLACE, True)]
    result = own.response(engine, Receivers(tuple(points), frame), loads)
    assert not result[0].any()
    for k, load in enumerate(loads[1:], 1):
        w = 0.5 * k * own.SPEED
        moved = own.answer(engine, frame, own.at_centre(load, engine.block.centre_of_gravity), none, w)
        for j, (motion, body) in enumerate(((moved.engine, engine.block), (moved.frame, frame.body))):
            expected = -(w**2) * own.arm(np.array(PLACE), np.array(body.centre_of_gravity)) @ motion
            assert result[k, j] == pytest.approx(expected, rel=SAME, abs=SAME * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(4))
def test_both_forces_with_their_functions_give_the_motion_of_the_frame(seed: int) -> None:
    """Force on rigid ground times the function with the engine, or on the frame times that without, are the motion."""
    engine, frame = own.scene(seed)
    loads, none = own.wrenches(seed), np.zeros((len(engine.mounts), 3))
    w = 0.5 * own.SPEED * np.arange(1, len(loads))
    at = own.arm(np.array(PLACE), np.array(frame.body.centre_of_gravity))
    loose = [replace(mount, stiffness=(0.0,) * 3, damping=(0.0,) * 3) for mount in engine.mounts]
    without_engine = replace(engine, mounts=tuple(loose))
    with_engine, without = [], []
    for omega in w:
        for matrices, body in ((with_engine, engine), (without, without_engine)):
            units = np.eye(none.size).reshape(-1, *none.shape)
            motions = [own.answer(body, frame, np.zeros(6), unit, omega).frame for unit in units]
            matrices.append(-(omega**2) * at @ np.array(motions).T)
    frequencies = w / math.tau
    band = (float(frequencies[0]), float(frequencies[-1]))
    receivers = [own.point("motion", PLACE, True)]
    for name, matrices, on_frame in (("ground", with_engine, False), ("frame", without, True)):
        functions = tuple(function([matrix[axis] for matrix in matrices], frequencies) for axis in range(3))
        receivers.append(Receiver(name, "acceleration", None, False, functions, on_frame, band))
    result = own.response(engine, Receivers(tuple(receivers), frame), loads)
    size = np.abs(result).max()
    assert result[1:, 1] == pytest.approx(result[1:, 0], rel=1e-8, abs=SAME * size)
    assert result[1:, 2] == pytest.approx(result[1:, 0], rel=1e-8, abs=SAME * size)
    # the mixture differs: a force on rigid ground with the function without the engine
    mixed = replace(receivers[2], takes_frame_force=False)
    wrong = own.response(engine, Receivers((mixed,), frame), loads)[:, 0]
    assert np.abs(wrong - result[:, 0]).max() > 0.05 * size


def test_a_heavy_frame_is_rigid_ground() -> None:
    """A frame of ten thousand tonnes leaves the engine the motion that it has on rigid ground."""
    engine, _ = own.scene(1)
    heavy = Frame(Block(1e7, ((1e7, 0.0, 0.0), (0.0, 1e7, 0.0), (0.0, 0.0, 1e7))))
    loads = own.wrenches(1)
    head = own.point("head", PLACE, False)
    alone, held = (own.response(engine, Receivers((head,), frame), loads) for frame in (None, heavy))
    assert held == pytest.approx(alone, rel=1e-4, abs=1e-4 * np.abs(alone).max())


@pytest.mark.parametrize(
    ("ratio", "frequencies"), [(1.0, (0.618034, 1.618034)), (0.2, (0.689, 3.244)), (2.0, (0.541, 1.307))]
)
def test_two_stage_isolator_has_the_textbook_frequencies(ratio: float, frequencies: tuple[float, float]) -> None:
    """Equal springs, machine of 1, block of `ratio`: the response has poles at these multiples of the root of k / m."""
    k, unit = 1e4, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    corners = [(0.1, 0.1, 0.0), (0.1, -0.1, 0.0), (-0.1, 0.1, 0.0), (-0.1, -0.1, 0.0)]
    springs = tuple(Mount(f"m{j}", place, (k / 4.0,) * 3, loss_factor=1e-6) for j, place in enumerate(corners))
    engine = Engine("machine", Cycle.FOUR_STROKE, (), mounts=springs, block=Block(1.0, unit))
    frame = Frame(Block(ratio, unit), tuple(replace(one, name=f"s{j}") for j, one in enumerate(springs)))
    load = np.zeros((2, 6), dtype=complex)
    load[1, 2] = 1.0
    for frequency in frequencies:
        sizes = []
        for w in np.linspace(0.98, 1.02, 81) * frequency * 100.0:
            point = own.point("block", (0.0, 0.0, 0.0), True)
            sizes.append(np.abs(own.response_at(engine, Receivers((point,), frame), load, w)[1, 0, 2]))
        assert 0 < int(np.argmax(sizes)) < 80
        assert (0.98 + 0.0005 * int(np.argmax(sizes))) == pytest.approx(1.0, abs=1.5e-3)


CHAIN = {10.0: (1.3100, 3.054e-4, 2.3316e-4), 25.0: (0.3418, 2.801e-5, 8.1949e-5), 50.0: (0.0630, 2.534e-6, 4.0241e-5),
         100.0: (0.0148, 2.958e-7, 2.0030e-5)}  # fmt: skip
"""Mount force per force on the engine, seat acceleration per this force and per mount force, by frequency [Hz]."""


@pytest.mark.parametrize("frequency", CHAIN)
def test_a_seat_on_a_cab_responds_to_the_force_on_rigid_ground(frequency: float) -> None:
    """Engine 180 kg, cab 450 kg and driver 75 kg in a vertical chain, by its own three equations of motion."""
    w = math.tau * frequency
    k1, k2, k3 = 1.0233e6 * (1.0 + 0.1j), 1.8653e5 + 2969.0j * w, 6662.0 + 424.1j * w
    chain = np.array([[k1, -k1, 0.0], [-k1, k1 + k2 + k3, -k3], [0.0, -k3, k3]]) - w**2 * np.diag([180.0, 450.0, 75.0])
    of_engine, of_cab = np.linalg.solve(chain, np.eye(3)[:, :2]).T
    force, seat = k1 * (of_engine[0] - of_engine[1]), -(w**2) * of_engine[2]
    printed = CHAIN[frequency]
    assert [abs(force), abs(seat), abs(seat / force)] == pytest.approx(printed, rel=3.5e-3)
    # the engine alone on four mounts that stand on rigid ground, and the function of the cab with the engine
    corners = [(x, y, 0.0) for x in (0.3, -0.3) for y in (0.2, -0.2)]
    mounts = tuple(Mount(f"m{k}", at, (1.0233e6 / 4.0,) * 3, loss_factor=0.1) for k, at in enumerate(corners))
    block = Block(180.0, ((20.0, 0.0, 0.0), (0.0, 20.0, 0.0), (0.0, 0.0, 20.0)))
    engine = Engine("chain", Cycle.FOUR_STROKE, (), mounts=mounts, block=block)
    row = tuple([0.0, 0.0, complex(-(w**2) * of_cab[2])] * 4)
    seat_function = FrequencyFunction("f", (0.5 * frequency, 2.0 * frequency), (row, row))
    receiver = Receiver("seat", "acceleration", None, False, (None, None, seat_function), band=(frequency, frequency))
    load = np.zeros((2, 6), dtype=complex)
    load[1, 2] = 1.0
    answer = own.response_at(engine, Receivers((receiver,)), load, w)[1, 0]
    assert answer[2] == pytest.approx(seat, rel=SAME)
