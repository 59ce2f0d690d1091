"""Free forces that manufacturing tolerances leave, at their worst and at random.

Hasselgruber 1964, on errors of balancing: all tolerances at their limits, summed
algebraically, make about 100 kp where the second order of a four-cylinder makes 1000 kp;
so finer balancing promises nothing for engines of fewer than six cylinders.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Engine
from laufruhe.physics.shaking_loads import reciprocating_loads, shaking_loads
from laufruhe.problem.problem import Problem

Array = NDArray[np.float64]

ANGLES = 360
DIRECTIONS = 720
PIECE = 500
CAUSES = ("reciprocating masses", "unbalance", "alignment")


@dataclass(frozen=True)
class Tolerances:
    """How far a built engine may stand from its drawing.

    Attributes
    ----------
    reciprocating_mass
        Of each cylinder, either way [kg].
    unbalance
        Left on each balancing plane [kg m], at any angle.
    planes
        Balancing planes.
    alignment
        Eccentricity of each aligned rotor [m], in any direction.
    aligned_masses
        Of flywheel, clutch and whatever else is centred on the crank [kg].
    """

    reciprocating_mass: float = 0.0
    unbalance: float = 0.0
    planes: int = 2
    alignment: float = 0.0
    aligned_masses: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        numbers = (self.reciprocating_mass, self.unbalance, self.planes, self.alignment, *self.aligned_masses)
        if min(numbers) < 0:
            raise ModelError("tolerances must not be negative; give their size")

    @property
    def unbalances(self) -> tuple[float, ...]:
        """Largest of every unbalance that turns with the crank [kg m]."""
        return (self.unbalance,) * self.planes + tuple(m * self.alignment for m in self.aligned_masses)


def _unit_forces(engine: Engine, speed: float) -> Array:
    """Lateral and vertical force of one kilogram more on each piston, shape (cylinders, angles, 2)."""
    forces = []
    for part in engine.slider_cranks:
        alone = replace(engine, slider_cranks=(replace(part, reciprocating_mass=1.0, rotating_mass=0.0),), rotors=())
        forces.append(_sampled(reciprocating_loads(alone, speed).sample(ANGLES * engine.cycle.turns)))
    return np.array(forces)


def _sampled(wrench: Array) -> Array:
    return np.asarray(wrench[:, 1:3])


def worst_parts(engine: Engine, speed: float, tolerances: Tolerances) -> dict[str, float]:
    """Largest free force [N] of each kind of tolerance, all of that kind at their limits.

    What masses add up to is a sum of segments; its farthest point is sought by support
    functions on directions half a degree apart, so it is 1e-5 low at most.
    """
    angles = np.arange(DIRECTIONS) * (2.0 * np.pi / DIRECTIONS)
    directions = np.stack([np.sin(angles), np.cos(angles)])
    segments = np.abs(_unit_forces(engine, speed) @ directions).sum(axis=0) * tolerances.reciprocating_mass
    sizes = (
        float(segments.max()),
        tolerances.planes * tolerances.unbalance * speed**2,
        sum(tolerances.aligned_masses) * tolerances.alignment * speed**2,
    )
    return dict(zip(CAUSES, sizes, strict=True))


def worst_force(engine: Engine, speed: float, tolerances: Tolerances) -> float:
    """Largest free force [N] that any combination within the tolerances makes.

    Unbalances may point anywhere, so their discs add their radii to the farthest point of
    the segments: the parts add up.
    """
    return sum(worst_parts(engine, speed, tolerances).values())


def random_forces(
    engine: Engine,
    speed: float,
    tolerances: Tolerances,
    builds: int,
    seed: int,
) -> Array:
    """Largest free force over the cycle [N] of each of many engines, the nominal force left out.

    Masses are even over their tolerance, unbalances even over their disc.
    """
    random = np.random.default_rng(seed)
    unit = _unit_forces(engine, speed)
    samples = unit.shape[1]
    masses = random.uniform(-1.0, 1.0, (builds, len(unit))) * tolerances.reciprocating_mass
    most = np.array(tolerances.unbalances)
    sizes = np.sqrt(random.uniform(0.0, 1.0, (builds, len(most)))) * most
    turns = np.exp(2j * np.pi * random.uniform(0.0, 1.0, (builds, len(most))))
    rotating = (sizes * turns).sum(axis=1) * speed**2
    crank = np.exp(2j * np.pi * engine.cycle.turns * np.arange(samples) / samples)
    peaks = np.empty(builds)
    # in pieces: all engines at once would take gigabytes
    for start in range(0, builds, PIECE):
        piece = slice(start, start + PIECE)
        moved = np.tensordot(masses[piece], unit, axes=1)
        zeta = rotating[piece, None] * crank
        peaks[piece] = np.hypot(moved[..., 0] + zeta.imag, moved[..., 1] + zeta.real).max(axis=1)
    return peaks


def nominal_force(problem: Problem) -> float:
    """Largest free force over the cycle [N] of the engine as drawn, at its operating point."""
    point = problem.points[0]
    steps = ANGLES * problem.engine.cycle.turns
    force = _sampled(shaking_loads(problem.engine, point, problem.fidelity).sample(steps))
    return float(np.hypot(force[:, 0], force[:, 1]).max())
