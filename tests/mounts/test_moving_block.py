"""Mechanism on the moving block: the part that the linear model omits.

The reference is nonlinear: block, crank, rod and piston as bodies of exudyn in the plane across the crank axis, the
block on springs and dampers, the crank turned at constant speed. The linear model has one body of constant inertia
and the loads of a block at rest; it leaves out that the pistons ride on a block that moves and change its inertia.
"""

from __future__ import annotations

import math
from functools import cache

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import (
    MarkerBodyRigid,
    MarkerNodeCoordinate,
    NodePointGround,
    NodeRigidBody2D,
    ObjectConnectorCartesianSpringDamper,
    ObjectConnectorCoordinate,
    ObjectGround,
    ObjectJointGeneric,
    ObjectJointRevolute2D,
    ObjectRigidBody2D,
    SensorObject,
)

from laufruhe.errors import ModelError
from laufruhe.machine import Block, Cycle, Engine, Mount, OperatingPoint, SliderCrank
from laufruhe.physics.elastic_mounts import elastic_mounting
from laufruhe.physics.shaking_loads import shaking_loads

RADIUS, ROD, SPEED = 0.06, 0.23, 2 * math.pi * 15.0
"""Crank radius and rod length [m], crank speed [rad/s]."""
MASS, INERTIA = 100.0, 6.0
"""Mass and roll inertia of the block without the piston [kg], [kg m2]; its centre of gravity is on the crank axis."""
PLACES, STIFFNESS, DAMPING = ((-0.25, -0.1), (0.25, -0.1)), (6e4, 9e4), (600.0, 900.0)
"""Mounts: (y, z) [m]; lateral and vertical stiffness [N/m] and damping [N s/m]."""
STEPS, TURNS = 720, 30
"""Steps of a turn, and turns until the start has decayed by e^-12 in the least damped motion."""


def linear_forces(piston: float, angles: np.ndarray, flywheel: float = 0.0, turns: bool = True) -> np.ndarray:
    """Return the lateral and vertical force on either side, shape (n, 2, 2) [N]."""
    crank = SliderCrank("one", 0.0, RADIUS, ROD, piston)
    wrench = shaking_loads(Engine("one", Cycle.TWO_STROKE, (crank,)), OperatingPoint("it", SPEED))
    # the piston rides at its mean height
    height, total = math.sqrt(ROD**2 - 0.5 * RADIUS**2), MASS + piston
    roll = INERTIA + MASS * piston / total * height**2 + flywheel
    block = Block(
        total, ((roll, 0, 0), (0, 8.0, 0), (0, 0, 8.0)), (0.0, 0.0, piston * height / total), flywheel * turns
    )
    mounts = [
        Mount(
            f"{x} {y}", (x, y, z), (6e4, STIFFNESS[0] / 2, STIFFNESS[1] / 2),
            damping=(600.0, DAMPING[0] / 2, DAMPING[1] / 2),
        )
        for x in (-0.3, 0.3)
        for y, z in PLACES
    ]  # fmt: skip
    forces = elastic_mounting(block, mounts).forces(wrench, SPEED).values(angles)
    return forces[:, :2, 1:] + forces[:, 2:, 1:]


def _body(system, place: float, mass: float, inertia: float, velocity: float = 0.0, rate: float = 0.0):
    """Return a body at (place, 0) of the plane (X, Y) = (z, y)."""
    node = system.AddNode(NodeRigidBody2D(referenceCoordinates=[place, 0, 0], initialVelocities=[0.0, velocity, rate]))
    return node, system.AddObject(ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node))


@cache
def simulated_forces(piston: float, flywheel: float = 1e-3, steps: int = STEPS) -> np.ndarray:
    """Return the forces from exudyn over the last turn, shape (steps, 2, 2) [N]."""
    system = exu.SystemContainer().AddSystem()
    ground = system.AddObject(ObjectGround())

    def marker(body: int, x: float = 0.0, y: float = 0.0) -> int:
        frame = np.eye(4)
        frame[:2, 3] = x, y
        return system.AddMarker(MarkerBodyRigid(bodyNumber=body, localHT=frame))

    _, block = _body(system, 0.0, MASS, INERTIA)
    crank_node, crank = _body(system, 0.0, 1e-4, flywheel, rate=SPEED)
    # a rod of next to no mass: the linear model's piston carries the rod's share already
    _, rod = _body(system, RADIUS + ROD / 2, 1e-4, 1e-6, RADIUS * SPEED / 2, -RADIUS * SPEED / ROD)
    _, sliding = _body(system, RADIUS + ROD, piston, 1e-4)
    for first, second in (
        (marker(block), marker(crank)),
        (marker(crank, RADIUS), marker(rod, -ROD / 2)),
        (marker(rod, ROD / 2), marker(sliding)),
    ):
        system.AddObject(ObjectJointRevolute2D(markerNumbers=[first, second]))
    system.AddObject(
        ObjectJointGeneric(markerNumbers=[marker(block), marker(sliding)], constrainedAxes=[0, 1, 0, 0, 0, 1])
    )
    still = system.AddMarker(MarkerNodeCoordinate(nodeNumber=system.AddNode(NodePointGround()), coordinate=0))
    turning = system.AddMarker(MarkerNodeCoordinate(nodeNumber=crank_node, coordinate=2))
    system.AddObject(ObjectConnectorCoordinate(markerNumbers=[still, turning], velocityLevel=True, offset=SPEED))
    sensors = []
    for y, z in PLACES:
        spring = system.AddObject(
            ObjectConnectorCartesianSpringDamper(
                markerNumbers=[marker(ground, z, y), marker(block, z, y)],
                stiffness=[STIFFNESS[1], STIFFNESS[0], 0.0],
                damping=[DAMPING[1], DAMPING[0], 0.0],
            )
        )
        force = exu.OutputVariableType.Force
        sensors.append(
            system.AddSensor(SensorObject("", spring, storeInternal=True, writeToFile=False, outputVariableType=force))
        )
    system.Assemble()
    settings = exu.SimulationSettings()
    time = settings.timeIntegration
    time.numberOfSteps, time.endTime = steps * TURNS, TURNS * 2 * math.pi / SPEED
    time.generalizedAlpha.spectralRadius = 0.9
    time.newton.relativeTolerance = time.newton.absoluteTolerance = 1e-9
    settings.solution.sensors.writePeriod = 0.5 * time.endTime / time.numberOfSteps
    settings.solution.file.write = False
    system.SolveDynamic(settings)
    read = [np.array(system.GetSensorStoredData(sensor))[-steps:, [2, 1]] for sensor in sensors]
    return np.stack(read, axis=1)


def left_out(piston: float, flywheel: float = 1e-3, turns: bool = True) -> float:
    angles = 2 * math.pi * np.arange(1, STEPS + 1) / STEPS
    result, expected = simulated_forces(piston, flywheel), linear_forces(piston, angles, flywheel, turns)
    return float(np.abs(result - expected).max() / np.abs(result).max())


@pytest.mark.slow
@pytest.mark.validation
def test_the_linear_model_leaves_out_no_more_than_the_mass_that_moves():
    heavy, light = left_out(2.0), left_out(0.5)
    # about a sixth of the share of the piston in the whole: 3e-3 of the peak for 2 in 100 kg, 9e-4 for 0.5
    assert light < 0.0015
    assert heavy < 0.25 * 2.0 / MASS
    assert 2.5 < heavy / light < 5.0


@pytest.mark.slow
@pytest.mark.validation
def test_parts_at_imposed_speed_do_not_roll_with_the_block():
    """Check E1a for a flywheel of 1/6 of the block's inertia, separate from and part of the rolling mass."""
    assert left_out(0.5, 1.0) < 0.0015
    assert left_out(0.5, 1.0, turns=False) > 0.005


def test_roll_alone_is_slower_with_what_turns_counted_in():
    """Check I - J (E1a) of a block that rolls on springs with a wheel held at its speed."""
    mounts = [Mount(f"{x} {y}", (x, y, 0.0), (1e5, 1e5, 1e5)) for x in (-0.3, 0.3) for y in (-0.25, 0.25)]
    block = Block(100.0, ((6.0, 0, 0), (0, 8.0, 0), (0, 0, 8.0)), turning_inertia=0.5)
    roll = math.sqrt(4 * 1e5 * 0.25**2 / (6.0 - 0.5)) / math.tau
    frequencies = elastic_mounting(block, mounts).modes.frequencies
    assert np.abs(frequencies - roll).min() < 1e-9 * roll


@pytest.mark.parametrize("inertia", [-0.1, 6.0, 7.0])
def test_turning_inertia_above_the_block_is_refused(inertia):
    with pytest.raises(ModelError, match="turning_inertia"):
        Block(100.0, ((6.0, 0, 0), (0, 8.0, 0), (0, 0, 8.0)), turning_inertia=inertia)


@pytest.mark.parametrize("number", [math.nan, math.inf])
@pytest.mark.parametrize("place", [(0, 0), (0, 1), (2, 2)])
def test_an_inertia_of_one_unknown_number_is_refused(place, number):
    tensor = np.diag([6.0, 8.0, 8.0])
    tensor[place] = tensor[place[::-1]] = number
    with pytest.raises(ModelError, match="inertia tensor"):
        Block(100.0, tuple(map(tuple, tensor.tolist())))
