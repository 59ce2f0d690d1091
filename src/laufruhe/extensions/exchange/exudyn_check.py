"""Simulate an engine as rigid bodies with Exudyn, and compare the loads on its block with those of Laufruhe.

Run `python FILE`; it needs `pip install exudyn numpy`. Places are complex numbers z + i y across the crankshaft, which
lies along x: x forward, y left, z up, SI units. Pistons, rods and throws are rigid bodies; pins, bearings and cylinder
walls are constraints; each shaft has a prescribed speed. The block bears what bodies and drives exert: loads from two
step sizes are extrapolated to steps of no length.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np

DATA: dict[str, Any] = {}
RUN_IN, TOLERANCE = 180, 1e-6
NAMES = ("Fx [N]", "Fy [N]", "Fz [N]", "Mx [N m]", "My [N m]", "Mz [N m]")


def main() -> int:
    """Print the wrench on the block over the crank angle at each operating point; return 1 if it differs."""
    worst, steps = 0.0, DATA["steps"]
    for point in DATA["points"]:
        wrench = (4.0 * Simulation(point, 2 * steps).wrench()[::2] - Simulation(point, steps).wrench()) / 3.0
        expected = np.array(point["wrench"])
        print(f"{DATA['title']}: {point['name']}, {30.0 / math.pi * point['speed']:.6g} rpm")
        print("angle [deg]", *(f"{name:>13s}" for name in NAMES))
        for k in range(0, len(wrench), steps // 24):
            print(f"{360.0 * k / steps:11.1f}", *(f"{value:13.4f}" for value in wrench[k]))
        # loads that cancel are compared with those of all pistons in phase
        size = np.maximum(abs(expected).max(axis=0), np.array(DATA["unit_loads"]) * point["speed"] ** 2)
        error = (abs(wrench - expected) / size).max()
        print(f"largest difference from Laufruhe: {error:.1e} of the largest load\n")
        worst = max(worst, error)
    print("agrees" if worst < TOLERANCE else "DIFFERS", f"within {TOLERANCE:g}")
    return int(not worst < TOLERANCE)


class Simulation:
    """Bodies in planes across the crankshaft, integrated with `steps` a turn."""

    def __init__(self, point: dict[str, Any], steps: int) -> None:
        import exudyn
        from exudyn import itemInterface

        self.items, self.outputs = itemInterface, exudyn.OutputVariableType
        self.speed, self.start = point["speed"], -math.tau * RUN_IN / steps
        self.step, self.count = math.tau / steps / self.speed, RUN_IN + DATA["turns"] * steps
        self.system = exudyn.SystemContainer().AddSystem()
        self.ground = self.add("Object", "ObjectGround")
        origin = self.add("Node", "NodePointGround")
        self.origin = self.add("Marker", "MarkerNodeCoordinate", nodeNumber=origin, coordinate=0)
        self.bodies, self.drives = list[tuple[float, float, float, list[int]]](), list[tuple[float, int]]()
        throws = [self.add_rotor(**rotor) for rotor in DATA["rotors"]]
        for k, part in enumerate(DATA["cylinders"]):
            gas = np.array(point["gas"][k])[:: 2 * DATA["steps"] // steps] if point["gas"] else None
            (throw, centre), rotor = throws[part["throw"]], DATA["rotors"][part["throw"]]
            self.add_cylinder(throw, centre, rotor, part, gas)
        self.system.Assemble()
        settings = exudyn.SimulationSettings()
        time = settings.timeIntegration
        time.numberOfSteps, time.endTime, time.adaptiveStep = self.count, self.count * self.step, False
        time.generalizedAlpha.spectralRadius = 0.9
        # forces balance to twelve digits of the load of all pistons in phase
        time.newton.relativeTolerance = 0.0
        time.newton.absoluteTolerance = 1e-12 * DATA["unit_loads"][0] * self.speed**2
        settings.linearSolver.solverType = exudyn.LinearSolverType.EigenSparse
        settings.solution.sensors.writePeriod, settings.solution.file.write = 0.5 * self.step, False
        self.system.SolveDynamic(settings)

    def add(self, group: str, kind: str, *values: Any, **options: Any) -> int:
        """Add an item of Exudyn, and return its number."""
        return int(getattr(self.system, f"Add{group}")(getattr(self.items, kind)(*values, **options)))

    def add_sensor(self, kind: str, number: int, quantity: str) -> int:
        """Add a sensor that stores every step."""
        what = getattr(self.outputs, quantity)
        return self.add("Sensor", kind, "", number, storeInternal=True, writeToFile=False, outputVariableType=what)

    def add_body(
        self, x: float, mass: float, inertia: float, place: complex, angle: float, velocity: complex, rate: float
    ) -> Any:
        """Add a rigid body in the plane at x; return its number and that of its node."""
        position, velocities = [place.real, place.imag, angle], [velocity.real, velocity.imag, rate]
        node = self.add("Node", "NodeRigidBody2D", referenceCoordinates=position, initialVelocities=velocities)
        body = self.add("Object", "ObjectRigidBody2D", mass=mass, inertia=inertia, nodeNumber=node)
        kinds = ("Position", "Acceleration", "AngularAcceleration")
        self.bodies.append((x, mass, inertia, [self.add_sensor("SensorBody", body, kind) for kind in kinds]))
        return body, node

    def marker(self, body: int, place: complex, angle: float = 0.0) -> int:
        """Add a frame on a body."""
        (c, s), z, y = (math.cos(angle), math.sin(angle)), place.real, place.imag
        frame = np.array([[c, -s, 0.0, z], [s, c, 0.0, y], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
        return self.add("Marker", "MarkerBodyRigid", bodyNumber=body, localHT=frame)

    def add_joint(self, first: int, second: int, axes: tuple[int, ...] = (1, 1, 0, 0, 0, 0)) -> None:
        """Add a constraint between two frames: a pin, or another along some axes of the first frame."""
        self.add("Object", "ObjectJointGeneric", markerNumbers=[first, second], constrainedAxes=list(axes))

    def add_rotor(self, name: str, x: float, ratio: float, axis: complex, unbalance: complex) -> tuple[int, complex]:
        """Add a body with an unbalance [kg m] at crank angle zero, in a bearing, driven at constant speed."""
        # a centre of mass within 0.1 m keeps the digits of the loads
        mass, angle, rate = max(1.0, 10.0 * abs(unbalance)), ratio * self.start, ratio * self.speed
        centre = unbalance / mass
        arm = centre * np.exp(1j * angle)
        body, node = self.add_body(x, mass, 0.01, axis + arm, angle, 1j * rate * arm, rate)
        self.add_joint(self.marker(self.ground, axis), self.marker(body, -centre))
        ends = [self.origin, self.add("Marker", "MarkerNodeCoordinate", nodeNumber=node, coordinate=2)]
        speed = {"velocityLevel": True, "offset": rate}
        drive = self.add("Object", "ObjectConnectorCoordinate", name, markerNumbers=ends, **speed)
        self.drives.append((ratio, self.add_sensor("SensorObject", drive, "Force")))
        return int(body), centre

    def add_cylinder(self, throw: int, centre: complex, rotor: dict[str, Any], part: dict[str, Any], gas: Any) -> None:
        """Add rod and piston to a throw, and the gas force towards the crank at each step of the cycle [N]."""
        x, axis, pin, length = rotor["x"], rotor["axis"], part["pin"], part["rod_length"]
        along, rate = np.exp(1j * part["bank"]), rotor["ratio"] * self.speed
        arm = pin * np.exp(1j * rotor["ratio"] * self.start)
        local = arm / along - 1j * part["offset"]
        piston = arm + along * (math.sqrt(length**2 - local.imag**2) - 1j * local.imag)
        reach, swing = piston - arm, 1j * rate * arm
        # along the rod, both of its ends have one velocity
        sliding = along * (swing * reach.conjugate()).real / (along * reach.conjugate()).real
        spin = (reach.conjugate() * (sliding - swing)).imag / length**2
        middle, velocity = axis + arm + 0.5 * reach, 0.5 * (swing + sliding)
        rod, _ = self.add_body(x, part["rod_mass"], part["rod_inertia"], middle, np.angle(reach), velocity, spin)
        slider, _ = self.add_body(x, part["piston_mass"], 1e-3, axis + piston, part["bank"], sliding, 0.0)
        self.add_joint(self.marker(throw, pin - centre), self.marker(rod, -0.5 * length))
        self.add_joint(self.marker(rod, 0.5 * length), on_piston := self.marker(slider, 0.0))
        wall = self.marker(self.ground, axis + 1j * part["offset"] * along, part["bank"])
        self.add_joint(wall, on_piston, (0, 1, 0, 0, 0, 1))
        if gas is not None:

            def pressing(_system: Any, time: float, _load: Any) -> list[float]:
                force = -along * gas[(round(time / self.step) - RUN_IN) % len(gas)]
                return [force.real, force.imag, 0.0]

            self.add("Load", "LoadForceVector", markerNumber=on_piston, loadVectorUserFunction=pressing)

    def wrench(self) -> Any:
        """Return the wrench on the block about the origin: inertia of all bodies, and the torque of the drives."""

        def read(sensor: int) -> Any:
            return np.array(self.system.GetSensorStoredData(sensor))[RUN_IN : self.count, 1:].T

        roll = sum(ratio * read(torque)[0] for ratio, torque in self.drives)
        total = np.stack([0.0 * roll, 0.0 * roll, 0.0 * roll, roll, 0.0 * roll, 0.0 * roll])
        for x, mass, inertia, sensors in self.bodies:
            (z, y, _), (vertical, lateral, _), (*_, spin) = map(read, sensors)
            vertical, lateral = -mass * vertical, -mass * lateral
            roll = inertia * spin + y * vertical - z * lateral
            total += np.stack([0.0 * roll, lateral, vertical, roll, -x * vertical, x * lateral])
        return total.T


if __name__ == "__main__":
    sys.exit(main())
