"""Reference for the shaking loads: an engine as rigid bodies and joints, integrated in time with exudyn.

Nothing here knows a formula of shaking loads. Throws, counterweights, balancer shafts, rods and pistons are rigid
bodies; pins, bearings and cylinder walls are constraints; the loads on the block are the forces in those constraints.
They are found a second time from the accelerations of the bodies alone, and both have to agree.

All bodies move in planes across the crank axis, so the mechanism is plane, and the moments about y and z follow from
the place along x at which each force is taken up. The exudyn plane is (X, Y) = (z, y), the complex plane of C4: its
positive rotation is that of the crank, and its moments are those about -x.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    LoadForceVector,
    MarkerBodyRigid,
    MarkerNodeCoordinate,
    NodePointGround,
    NodeRigidBody2D,
    ObjectConnectorCoordinate,
    ObjectGround,
    ObjectJointGeneric,
    ObjectJointRevolute2D,
    ObjectRigidBody2D,
    SensorBody,
    SensorObject,
)
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SPECTRAL_RADIUS = 0.9
"""Spectral radius of the generalised-alpha method: the factor by which a start decays in a step."""

RUN_IN = 180
"""Steps before the first one that is kept; 0.9^180 is 6e-9 of a start that is consistent already."""


@dataclass(frozen=True)
class Turning:
    """A rigid body that turns at constant speed about an axis along x: throw, counterweight or balancer shaft.

    Attributes
    ----------
    x
        Place along the crank axis [m].
    mass
        [kg].
    centre
        Of gravity, from its axis, when phi = 0 [m], z + i y.
    inertia
        About the centre of gravity [kg m2].
    ratio
        Speed over crank speed.
    axis
        Place of its axis [m], z + i y.
    """

    x: float
    mass: float
    centre: complex = 0j
    inertia: float = 0.01
    ratio: float = 1.0
    axis: complex = 0j


@dataclass(frozen=True)
class ConnectingRod:
    """A rod with its centre of gravity on the line of the pins.

    Attributes
    ----------
    length
        Between the pins [m].
    mass
        [kg].
    centre
        Distance of the centre of gravity from the crank pin [m].
    inertia
        About the centre of gravity [kg m2].
    """

    length: float
    mass: float
    centre: float
    inertia: float


@dataclass(frozen=True)
class Cylinder:
    """Rod and piston on a throw.

    Attributes
    ----------
    throw
        Index of the turning body that carries the crank pin.
    pin
        Crank pin from the axis of the throw, when phi = 0 [m], z + i y.
    rod
        Between crank pin and piston pin.
    piston_mass
        With the piston pin [kg]; its centre of gravity is on the pin's path.
    bank
        Angle of the cylinder axis [rad].
    offset
        Distance of the pin's path from the axis of the throw [m], positive towards +i e^{i bank}.
    gas
        Force on the piston, towards the crank [N], over the crank angle phi [rad].
    """

    throw: int
    pin: complex
    rod: ConnectingRod
    piston_mass: float
    bank: float = 0.0
    offset: float = 0.0
    gas: Callable[[float], float] | None = None


@dataclass(frozen=True)
class Machine:
    """Everything that moves on one block.

    Attributes
    ----------
    turning
        Throws, counterweights and balancer shafts; shafts of any ratio but 1 are geared to the crank.
    cylinders
        Rods and pistons.
    speed
        Of the crank [rad/s].
    """

    turning: tuple[Turning, ...]
    cylinders: tuple[Cylinder, ...]
    speed: float


@dataclass(frozen=True, eq=False)
class Loads:
    """Wrench on the block (Fx, Fy, Fz, Mx, My, Mz) about the origin of C2 [N, N m].

    Attributes
    ----------
    angles
        Crank angles [rad], shape (n,).
    reactions
        From the forces in bearings and at cylinder walls, and the gas on the heads, shape (n, 6).
    momentum
        From the accelerations of the bodies, shape (n, 6).
    bearings
        Force of every turning body on its bearing, z + i y, shape (n, bodies) [N].
    """

    angles: FloatArray
    reactions: FloatArray
    momentum: FloatArray
    bearings: ComplexArray


@dataclass(frozen=True)
class Integrator:
    """Settings of Newton's method in the generalised-alpha method.

    Attributes
    ----------
    tolerance
        Of Newton's method, absolute and relative.
    reuse
        Whether Newton's method keeps its Jacobian while it converges.
    sparse
        Whether the Jacobian is factorised as a sparse matrix.
    """

    tolerance: float = 1e-10
    reuse: bool = False
    sparse: bool = False


ACCURATE = Integrator()


@dataclass(frozen=True)
class _Motion:
    """State of a body in the plane: centre of gravity, angle, and their rates."""

    place: complex
    angle: float
    velocity: complex
    rate: float


@dataclass(frozen=True)
class _Body:
    """A body in the simulation, with sensors for its motion."""

    x: float
    mass: float
    inertia: float
    number: int
    node: int
    position: int
    acceleration: int
    spin: int


@dataclass(frozen=True)
class _Support:
    """A force on the block that the simulation records: sensor, frame, and where it acts."""

    x: float
    sensor: int
    frame: complex
    place: int | complex


@dataclass
class _Model:
    """An exudyn system under construction, and what has to be read from it."""

    system: Any
    machine: Machine
    start: float
    ground: int = 0
    origin: int = 0
    bodies: list[_Body] = field(default_factory=list)
    supports: list[_Support] = field(default_factory=list)
    drives: list[tuple[float, int]] = field(default_factory=list)


def simulate(
    machine: Machine, steps: int, turns: int = 1, run_in: int = RUN_IN, integrator: Integrator = ACCURATE
) -> Loads:
    """Return the loads on the block at equal steps over some turns, from phi = 0.

    Parameters
    ----------
    machine
        Bodies and speed.
    steps
        Per turn, of the integration and of the result.
    turns
        Turns that are kept.
    run_in
        Steps taken before phi = 0.
    integrator
        Settings of the method.

    Returns
    -------
    Loads at `turns * steps` crank angles.
    """
    model = build(machine, -math.tau * run_in / steps)
    integrate(model, steps, run_in + turns * steps, integrator)
    angles = math.tau * np.arange(turns * steps) / steps
    selection = slice(run_in, run_in + turns * steps)
    # a multiplier is what its constraint exerts on the first of two markers, here the ground
    torques = [(ratio, -_read(model, sensor, selection)[:, 0]) for ratio, sensor in model.drives]
    reactions = _reactions(model, torques, selection) + _gas_wrench(machine, angles)
    # a bearing is at rest; a wall moves with its piston
    held = [support for support in model.supports if isinstance(support.place, complex)]
    bearings = [support.frame * _plane(model, support.sensor, selection) for support in held]
    return Loads(angles, reactions, _momentum(model, torques, selection), np.stack(bearings, axis=1))


def build(machine: Machine, start: float) -> _Model:
    """Return the exudyn system at crank angle `start`, turning, with positions and velocities that fit."""
    model = _Model(exu.SystemContainer().AddSystem(), machine, start)
    model.ground = model.system.AddObject(ObjectGround())
    model.origin = _coordinate(model, model.system.AddNode(NodePointGround()), 0)
    turning = [_add_turning(model, part) for part in machine.turning]
    for cylinder in machine.cylinders:
        _add_cylinder(model, cylinder, turning[cylinder.throw])
    model.system.Assemble()
    return model


def integrate(model: _Model, steps: int, count: int, integrator: Integrator = ACCURATE) -> None:
    """Take `count` steps of the generalised-alpha method, `steps` a turn."""
    settings = exu.SimulationSettings()
    duration = math.tau / model.machine.speed / steps
    time = settings.timeIntegration
    time.numberOfSteps = count
    time.endTime = count * duration
    time.adaptiveStep = False
    time.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
    time.newton.useModifiedNewton = integrator.reuse
    time.newton.relativeTolerance = time.newton.absoluteTolerance = integrator.tolerance
    if integrator.sparse:
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.solution.sensors.writePeriod = 0.5 * duration
    settings.solution.file.write = False
    model.system.SolveDynamic(settings)


# bodies and joints


def _add_turning(model: _Model, part: Turning) -> _Body:
    """Return a body in a bearing, driven at constant speed."""
    angle, rate = part.ratio * model.start, part.ratio * model.machine.speed
    arm = part.centre * cmath.exp(1j * angle)
    body = _add_body(model, part.x, part.mass, part.inertia, _Motion(part.axis + arm, angle, 1j * rate * arm, rate))
    bearing = model.system.AddObject(
        ObjectJointGeneric(
            markerNumbers=[_marker(model, model.ground, part.axis), _marker(model, body.number, -part.centre)],
            constrainedAxes=[1, 1, 0, 0, 0, 0],
        )
    )
    model.supports.append(_Support(part.x, _force_sensor(model, bearing), 1.0 + 0j, part.axis))
    drive = model.system.AddObject(
        ObjectConnectorCoordinate(
            markerNumbers=[model.origin, _coordinate(model, body.node, 2)], velocityLevel=True, offset=rate
        )
    )
    model.drives.append((part.ratio, _sensor(model, SensorObject, drive, exu.OutputVariableType.Force)))
    return body


def _add_cylinder(model: _Model, cylinder: Cylinder, throw: _Body) -> None:
    """Add the rod and piston, guided by the wall and pressed by the gas."""
    turning, rod = model.machine.turning[cylinder.throw], cylinder.rod
    at_rod, at_piston = _cylinder_motion(cylinder, turning, model.start, model.machine.speed)
    swinging = _add_body(model, turning.x, rod.mass, rod.inertia, at_rod)
    piston = _add_body(model, turning.x, cylinder.piston_mass, 1e-3, at_piston)
    _add_pin(model, throw, cylinder.pin - turning.centre, swinging, -rod.centre)
    _add_pin(model, swinging, rod.length - rod.centre, piston, 0j)
    axis = cmath.exp(1j * cylinder.bank)
    foot = turning.axis + 1j * cylinder.offset * axis
    wall = model.system.AddObject(
        ObjectJointGeneric(
            markerNumbers=[_marker(model, model.ground, foot, cylinder.bank), _marker(model, piston.number, 0j)],
            constrainedAxes=[0, 1, 0, 0, 0, 1],
        )
    )
    model.supports.append(_Support(turning.x, _force_sensor(model, wall), axis, piston.position))
    if cylinder.gas is not None:
        _add_gas(model, cylinder.gas, axis, piston)


def _add_pin(model: _Model, first: _Body, there: complex, second: _Body, here: complex) -> None:
    markers = [_marker(model, first.number, there), _marker(model, second.number, here)]
    model.system.AddObject(ObjectJointRevolute2D(markerNumbers=markers))


def _add_gas(model: _Model, gas: Callable[[float], float], axis: complex, piston: _Body) -> None:
    start, speed = model.start, model.machine.speed

    def pressing(_system: Any, time: float, _load: Any) -> list[float]:
        force = -axis * gas(start + speed * time)
        return [force.real, force.imag, 0.0]

    marker = _marker(model, piston.number, 0j)
    model.system.AddLoad(LoadForceVector(markerNumber=marker, loadVectorUserFunction=pressing))


def _cylinder_motion(cylinder: Cylinder, throw: Turning, start: float, speed: float) -> tuple[_Motion, _Motion]:
    """Return the motions of rod and piston from the intersection of a circle about the pin with its path."""
    rate, axis, rod = throw.ratio * speed, cmath.exp(1j * cylinder.bank), cylinder.rod
    arm = cylinder.pin * cmath.exp(1j * throw.ratio * start)
    local = arm / axis - 1j * cylinder.offset
    piston = axis * (local.real + math.sqrt(rod.length**2 - local.imag**2) + 1j * cylinder.offset)
    reach, swing = piston - arm, 1j * rate * arm
    # along the rod, both ends have one velocity
    sliding = axis * _dot(swing, reach) / _dot(axis, reach)
    spin = _cross(reach, sliding - swing) / rod.length**2
    share = rod.centre / rod.length
    middle = _Motion(throw.axis + arm + share * reach, cmath.phase(reach), swing + share * (sliding - swing), spin)
    return middle, _Motion(throw.axis + piston, cylinder.bank, sliding, 0.0)


def _add_body(model: _Model, x: float, mass: float, inertia: float, motion: _Motion) -> _Body:
    node = model.system.AddNode(
        NodeRigidBody2D(
            referenceCoordinates=[motion.place.real, motion.place.imag, motion.angle],
            initialVelocities=[motion.velocity.real, motion.velocity.imag, motion.rate],
        )
    )
    number = model.system.AddObject(ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node))
    kinds = exu.OutputVariableType
    sensors = [
        _sensor(model, SensorBody, number, kind)
        for kind in (kinds.Position, kinds.Acceleration, kinds.AngularAcceleration)
    ]
    body = _Body(x, mass, inertia, number, node, *sensors)
    model.bodies.append(body)
    return body


def _marker(model: _Model, body: int, place: complex, angle: float = 0.0) -> int:
    """Return a place on a body, with a frame at an angle to that of the body."""
    c, s = math.cos(angle), math.sin(angle)
    frame = np.array([[c, -s, 0.0, place.real], [s, c, 0.0, place.imag], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    return int(model.system.AddMarker(MarkerBodyRigid(bodyNumber=body, localHT=frame)))


def _coordinate(model: _Model, node: int, coordinate: int) -> int:
    return int(model.system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate)))


def _force_sensor(model: _Model, joint: int) -> int:
    return _sensor(model, SensorObject, joint, exu.OutputVariableType.ForceLocal)


def _sensor(model: _Model, kind: Callable[..., Any], number: int, what: Any) -> int:
    # a sensor's second argument is the number of its object, whatever the kind calls it
    return int(model.system.AddSensor(kind("", number, storeInternal=True, writeToFile=False, outputVariableType=what)))


# loads


def _reactions(model: _Model, torques: list[tuple[float, FloatArray]], steps: slice) -> FloatArray:
    """Return the forces of bearings and walls on the block, with those of gears.

    A drive holds its body at speed from outside the block. That is the flywheel's work for the crank; a shaft of ratio
    n has its torque from the crank by gears, which take n times as much from it, and the block bears the difference.
    """
    total = np.zeros((steps.stop - steps.start, 6))
    for support in model.supports:
        force = support.frame * _plane(model, support.sensor, steps)
        total += _wrench(support.x, _places(model, support.place, steps), force)
    total[:, 3] -= sum((ratio - 1.0) * torque for ratio, torque in torques)
    return total


def _momentum(model: _Model, torques: list[tuple[float, FloatArray]], steps: slice) -> FloatArray:
    """Return the negative rate of momentum of the bodies from block and flywheel, less the flywheel's torque."""
    total = np.zeros((steps.stop - steps.start, 6))
    for body in model.bodies:
        force = -body.mass * _plane(model, body.acceleration, steps)
        total += _wrench(body.x, _places(model, body.position, steps), force)
        total[:, 3] += body.inertia * _read(model, body.spin, steps)[:, 2]
    total[:, 3] -= sum(ratio * torque for ratio, torque in torques)
    return total


def _gas_wrench(machine: Machine, angles: FloatArray) -> FloatArray:
    """Return the wrench of the gas on the cylinder heads."""
    total = np.zeros((len(angles), 6))
    for cylinder in machine.cylinders:
        if cylinder.gas is not None:
            axis, throw = cmath.exp(1j * cylinder.bank), machine.turning[cylinder.throw]
            force = np.array([axis * cylinder.gas(float(angle)) for angle in angles])
            total += _wrench(throw.x, throw.axis + 1j * cylinder.offset * axis, force)
    return total


def _wrench(x: float, place: complex | ComplexArray, force: ComplexArray) -> FloatArray:
    """Return the wrench of forces z + i y at places z + i y in the plane at x, shape (n, 6): r x F."""
    lateral, vertical, arm = force.imag, force.real, np.asarray(place)
    roll = arm.imag * vertical - arm.real * lateral
    return np.stack([np.zeros(len(force)), lateral, vertical, roll, -x * vertical, x * lateral], axis=1)


def _places(model: _Model, place: int | complex, steps: slice) -> complex | ComplexArray:
    return _plane(model, place, steps) if isinstance(place, int) else place


def _plane(model: _Model, sensor: int, steps: slice) -> ComplexArray:
    data = _read(model, sensor, steps)
    return np.asarray(data[:, 0] + 1j * data[:, 1])


def _read(model: _Model, sensor: int, steps: slice) -> FloatArray:
    return np.asarray(model.system.GetSensorStoredData(sensor)[steps, 1:])


def _dot(a: complex, b: complex) -> float:
    return (a * b.conjugate()).real


def _cross(a: complex, b: complex) -> float:
    return (a.conjugate() * b).imag
