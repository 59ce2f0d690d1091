"""Free forces that manufacturing tolerances leave, at their worst and at random, and what they do to the mounts.

Hasselgruber 1964, on errors of balancing: all tolerances at their limits, summed
algebraically, make about 100 kp where the second order of a four-cylinder makes 1000 kp;
so finer balancing promises nothing for engines of fewer than six cylinders.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.machine import Engine, Role, Rotor
from laufruhe.physics.shaking_loads import reciprocating_loads, shaking_loads
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import MEAN_MOUNT_FORCE
from laufruhe.problem.problem import Problem
from laufruhe.studies.part import variable
from laufruhe.studies.verdict import NEGLIGIBLE, Verdict

Array = NDArray[np.float64]

ANGLES, DIRECTIONS, PIECE = 360, 720, 500
CAUSES = ("reciprocating masses", "unbalance", "alignment")
SHARES = np.arange(201) / 200.0
MOUNTED = 200
"""Most engines whose mount forces are evaluated: one costs as much as a thousand free forces."""


@dataclass(frozen=True)
class Tolerances:
    """How far a built engine may stand from its drawing.

    Attributes
    ----------
    reciprocating_mass
        Of each cylinder, either way [kg].
    unbalance, planes
        Left on each of so many balancing planes [kg m], at any angle.
    alignment, aligned_masses
        Eccentricity [m] of flywheel, clutch and whatever else is centred on the crank [kg].
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

    def unbalances(self, random: np.random.Generator, builds: int) -> NDArray[np.complex128]:
        """Unbalances that turn with the crank [kg m], even over their discs, shape (builds, planes + aligned)."""
        most = np.array((self.unbalance,) * self.planes + tuple(m * self.alignment for m in self.aligned_masses))
        sizes = most * np.sqrt(random.uniform(0.0, 1.0, (builds, len(most))))
        return np.asarray(sizes * np.exp(2j * np.pi * random.uniform(0.0, 1.0, (builds, len(most)))))


def _unit_forces(engine: Engine, speed: float) -> Array:
    """Lateral and vertical force of one kilogram more on each piston, shape (cylinders, angles, 2)."""
    forces = []
    for part in engine.slider_cranks:
        alone = replace(engine, slider_cranks=(replace(part, reciprocating_mass=1.0, rotating_mass=0.0),), rotors=())
        forces.append(reciprocating_loads(alone, speed).sample(ANGLES * engine.cycle.turns)[:, 1:3])
    return np.array(forces)


def worst_parts(engine: Engine, speed: float, tolerances: Tolerances) -> dict[str, float]:
    """Largest free force [N] of each kind of tolerance, all of that kind at their limits.

    Unbalances may point anywhere, so the parts add up to the worst of all together. What
    masses add up to is a sum of segments; its farthest point is sought by support functions
    on directions half a degree apart, so it is 1e-5 low at most.
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


def random_forces(engine: Engine, speed: float, tolerances: Tolerances, builds: int, seed: int) -> Array:
    """Largest free force over the cycle [N] of each of many engines, the nominal force left out.

    Masses are even over their tolerance, unbalances even over their disc.
    """
    random = np.random.default_rng(seed)
    unit = _unit_forces(engine, speed)
    samples = unit.shape[1]
    crank = np.exp(2j * np.pi * engine.cycle.turns * np.arange(samples) / samples)
    peaks = []
    # in pieces: all engines at once would take gigabytes
    for start in range(0, builds, PIECE):
        count = min(PIECE, builds - start)
        masses = random.uniform(-1.0, 1.0, (count, len(unit))) * tolerances.reciprocating_mass
        rotating = tolerances.unbalances(random, count).sum(axis=1) * speed**2
        moved = np.tensordot(masses, unit, axes=1)
        zeta = rotating[:, None] * crank
        peaks.append(np.hypot(moved[..., 0] + zeta.imag, moved[..., 1] + zeta.real).max(axis=1))
    return np.concatenate(peaks)


def built(engine: Engine, tolerances: Tolerances, random: np.random.Generator) -> Engine:
    """One engine out of many, for the exact model.

    Balancing planes stand from the first throw to the last, what is centred on the crank at
    the last: the end where power is taken off (C3).
    """
    front, rear = (pick(part.x for part in engine.slider_cranks) for pick in (max, min))
    planes = [float(x) for x in np.linspace(front, rear, tolerances.planes)]
    places = [*planes, *(rear for _ in tolerances.aligned_masses)]
    (unbalances,) = tolerances.unbalances(random, 1)
    more = random.uniform(-1.0, 1.0, len(engine.slider_cranks)) * tolerances.reciprocating_mass
    pistons = tuple(
        replace(part, reciprocating_mass=max(part.reciprocating_mass + float(change), 0.0))
        for part, change in zip(engine.slider_cranks, more, strict=True)
    )
    left = tuple(
        Rotor(f"left unbalance {k + 1}", x, complex(u), role=Role.THROW)
        for k, (x, u) in enumerate(zip(places, unbalances, strict=True))
    )
    return replace(engine, slider_cranks=pistons, rotors=(*engine.rotors, *left))


def mean_mount_forces(problem: Problem, tolerances: Tolerances, builds: int, seed: int) -> tuple[float, Array]:
    """Mean mount force [N] of the engine as drawn, and of each of many as built."""
    random = np.random.default_rng(seed)
    drawn = evaluate(problem).value(MEAN_MOUNT_FORCE)
    engines = (built(problem.engine, tolerances, random) for _ in range(builds))
    return drawn, np.array([evaluate(problem, engine).value(MEAN_MOUNT_FORCE) for engine in engines])


@dataclass(frozen=True)
class Spread:
    """What tolerances do to the free force of one engine [N], at a crank speed [rad/s].

    The largest over the cycle of the drawing, and the worst that each cause adds; the mean of
    what is added at random, and what each share (SHARES) of engines stays below. Of the mean
    mount force the same, as drawn and at random; NaN without mounts.
    """

    nominal: float
    worst: dict[str, float]
    mean: float
    random: tuple[float, ...]
    mount: float
    mount_random: tuple[float, ...]
    speed: float


def spread(problem: Problem, tolerances: Tolerances, builds: int = 10_000, seed: int = 1964) -> Spread:
    """Nominal free force, the worst that tolerances add, and how it is distributed over random engines.

    Raises
    ------
    ModelError
        If the problem has several operating points.
    """
    if len(problem.points) != 1:
        raise ModelError(f"'{problem.name}' needs one operating point where tolerances are studied; give it one")
    engine, point = problem.engine, problem.points[0]
    drawn = random_forces(engine, point.speed, tolerances, builds, seed)
    mount, forces = math.nan, np.full(1, math.nan)
    if engine.mounts:
        mount, forces = mean_mount_forces(problem, tolerances, min(builds, MOUNTED), seed)
    random, mount_random = (tuple(map(float, np.quantile(of, SHARES))) for of in (drawn, forces))
    free = shaking_loads(engine, point, problem.fidelity).sample(ANGLES * engine.cycle.turns)[:, 1:3]
    nominal, worst = float(np.hypot(*free.T).max()), worst_parts(engine, point.speed, tolerances)
    return Spread(nominal, worst, float(drawn.mean()), random, mount, mount_random, point.speed)


def compared(spreads: Mapping[str, Spread]) -> xr.Dataset:
    """Several engines side by side as one labelled dataset."""
    found = list(spreads.values())
    sizes = {
        "nominal": ("largest free force of the drawing", [own.nominal for own in found]),
        "worst": ("largest free force that tolerances add", [sum(own.worst.values()) for own in found]),
    }
    for cause in CAUSES:
        sizes[f"worst_{cause.replace(' ', '_')}"] = f"from {cause} alone", [own.worst[cause] for own in found]
    sizes["mean"] = "mean of what tolerances add at random", [own.mean for own in found]
    shares, along = variable("share", SHARES, "share of random engines that stay below"), ("case", "share")
    added, mounts = (f"{what} that this share of" for what in ("added free force", "mean mount force"))
    mount = "mean mount force of the drawing"
    return xr.Dataset(
        {
            **{name: variable("case", values, words, "N") for name, (words, values) in sizes.items()},
            "random": variable(along, [own.random for own in found], f"{added} random engines keeps", "N"),
            "mount": variable("case", [own.mount for own in found], mount, "N"),
            "mount_random": variable(along, [own.mount_random for own in found], f"{mounts} built engines keeps", "N"),
        },
        {"case": list(spreads), "share": shares, "speed": ("case", [own.speed for own in found], {"units": "rad/s"})},
    )


def verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """What the source says of finer balancing, engine by engine, confirmed or not.

    It promises nothing where tolerances hardly move the mean mount force: engines built
    without any could not be told from nineteen of twenty built with them (W1 of
    `laufruhe.studies.worth`).
    """
    found = []
    why = f"W1: under {100.0 * NEGLIGIBLE:.0f} % at 95 of 100 engines built"
    for name in data["case"].values:
        row = data.sel(case=name)
        claim, rise = str(row["claim"].item()), rise_of(row)
        if claim:
            agrees = (rise < NEGLIGIBLE) == (claim == "promises nothing")
            statement, unit = f"finer balancing, {name}", "% of the mean mount force"
            found.append(Verdict(statement, claim, 100.0 * rise, unit, agrees, why))
    return tuple(found)


def rise_of(row: xr.Dataset) -> float:
    """Share by which the mean mount force of 95 of 100 built engines is at most over that of the drawing."""
    often = float(row["mount_random"].sel(share=0.95, method="nearest"))
    return often / float(row["mount"]) - 1.0
