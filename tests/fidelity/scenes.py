"""Random engines for tests of accuracy."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from laufruhe.machine import Block, Cycle, Engine, GasModel, Mount, OperatingPoint, Rotor, Seiliger, Shaft, Wiebe
from laufruhe.machine.layouts import build, inline, vee
from laufruhe.numerics.norms import NORMS
from laufruhe.problem import channels
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.problem import Problem
from mechanisms import mechanism_of

SUBJECTS = (channels.MOUNT_FORCE, channels.SHAKING_FORCE, channels.ROLL_MOMENT, channels.ROCKING_COUPLE)


def random_problem(rng: random.Random, gas: bool | None = None) -> Problem:
    """Return an engine of one to eight cylinders, its mounts and one or two operating points, on one measure."""
    count, cycle = rng.randint(1, 8), rng.choice(list(Cycle))
    radius = rng.uniform(0.02, 0.1)
    ratio = rng.uniform(0.05, 0.5)
    mechanism = mechanism_of(
        radius, radius / ratio, rng.uniform(0.1, 5.0), rotating_mass=rng.choice([0.0, rng.uniform(0.1, 3.0)]),
        rod_inertia_deficit=rng.choice([0.0, rng.uniform(-0.01, 0.01)]),
        offset=rng.choice([0.0, rng.uniform(-0.1, 0.1) * radius]), bore=rng.uniform(0.05, 0.15),
    )  # fmt: skip
    throws = [rng.choice([math.tau * k / count, rng.uniform(0.0, math.tau)]) for k in range(count)]
    if count % 2 == 0 and rng.random() < 0.3:
        layout = vee(count, 0.1, rng.uniform(0.3, 2.5), bank_stagger=0.02)
        throws = throws[: count // 2]
    else:
        layout = inline(count, 0.1)
    parts, _ = build(cycle, layout, mechanism, throws)
    shaft = Shaft("balancer", rng.choice([-2.0, -1.0, 1.0, 2.0]), 0.1, -0.1)
    rotors = (Rotor("balancer", 0.1, rng.uniform(0.0, 0.05) + 0j, shaft),) if rng.random() < 0.5 else ()
    mounts = tuple(
        Mount(f"m{k}", (x, y, rng.uniform(-0.1, 0.1)), (rng.uniform(0.3, 1.0), 1.0, rng.uniform(0.5, 2.0)))
        for k, (x, y) in enumerate([(0.5, 0.25), (0.5, -0.25), (-0.8, 0.25), (-0.8, -0.25)])
    )
    points = tuple(
        OperatingPoint(f"p{k}", rng.uniform(50.0, 600.0), _gas(rng, gas), rng.uniform(0.5, 2.0))
        for k in range(rng.choice([1, 1, 2]))
    )
    subject = rng.choice(SUBJECTS if count > 1 else SUBJECTS[:3])
    norm = rng.choice(list(NORMS.values()))
    return Problem(
        "random", "random", Engine("random", cycle, parts, rotors, mounts), points,
        objective=(Term(Measure(subject, norm)),),
    )  # fmt: skip


def random_elastic_problem(rng: random.Random, gas: bool | None = None) -> Problem:
    """Return the random problem on elastic mounts: stiff, soft, with loss or damping, some symmetric."""
    problem = random_problem(rng, gas)
    engine = problem.engine
    mass, symmetric = rng.uniform(50.0, 600.0), rng.random() < 0.4
    x, y, z = (mass * rng.uniform(0.02, 0.06) for _ in range(3))
    inertia = ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, min(z, 0.9 * (x + y))))
    if inertia[2][2] + min(x, y) <= max(x, y):
        inertia = ((x, 0.0, 0.0), (0.0, x, 0.0), (0.0, 0.0, x))
    side = 0.0 if symmetric else rng.uniform(-0.05, 0.05)
    block = Block(mass, inertia, (rng.uniform(-0.2, 0.2), side, rng.uniform(0.0, 0.2)))
    stiff = 10.0 ** rng.uniform(4.5, 8.5)
    damping = rng.choice([0.0, 10.0 ** rng.uniform(1.0, 3.0)])
    loss = rng.uniform(0.02, 0.3) if damping == 0.0 or rng.random() < 0.5 else 0.0
    mounts = tuple(
        replace(
            mount, stiffness=tuple(stiff * k for k in mount.stiffness), loss_factor=loss, damping=(damping,) * 3,
        )
        for mount in engine.mounts
    )  # fmt: skip
    if symmetric:
        mounts = tuple(
            replace(mount, position=(a, b if k % 2 == 0 else -mounts[k - 1].position[1],
                                     (mount if k % 2 == 0 else mounts[k - 1]).position[2]),
                    stiffness=mounts[k - k % 2].stiffness)
            for k, mount in enumerate(mounts) for a, b, _ in [mount.position]
        )  # fmt: skip
    elastic = replace(problem, engine=replace(engine, mounts=mounts, block=block))
    subject = rng.choice([channels.MOUNT_FORCE, channels.MOUNT_FORCE, channels.MOUNT_TRAVEL])
    quantity = replace(problem.objective[0].measure, channel=subject)
    return replace(elastic, objective=(Term(quantity),))


def _gas(rng: random.Random, with_gas: bool | None) -> GasModel | None:
    if with_gas is False or (with_gas is None and rng.random() < 0.7):
        return None
    if rng.random() < 0.5:
        return Seiliger(peak_pressure=rng.uniform(60e5, 75e5), imep=rng.uniform(6e5, 9e5))
    return Wiebe(imep=rng.uniform(4e5, 12e5), start=-0.2, duration=rng.uniform(0.6, 1.2), compression_ratio=10.0)


def finer(problem: Problem, samples: int) -> Problem:
    """Return the problem at a fidelity above any that the package chooses."""
    return replace(problem, fidelity=replace(problem.fidelity, kinematics="exact", samples=samples, orders=None,
                                             rod="rigid", gas=True, gas_samples=None, mounts="frequency", modes=None,
                                             tolerance=None))  # fmt: skip
