"""A powertrain on three mounts (EF7 data, github.com/hojjatkarami/NVHteam), and engines to excite it."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from laufruhe.machine import Block, Mount
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ElasticMounting, elastic_mounting

BLOCK = Block(139.5, ((8.493, -1.187, -0.368), (-1.187, 3.505, 1.476), (-0.368, 1.476, 7.147)))
PLACES = ((-13.5, 389.0, 203.0), (424.0, -92.0, -175.0), (-182.0, -454.0, -68.0))
STIFFNESS = ((91.0, 200.0, 949.90), (147.0, 61.0, 140.0), (80.0, 156.0, 150.0))


def powertrain(loss: float = 0.0, damping: float = 0.0, stiffer: float = 1.0, **more: float) -> ElasticMounting:
    mounts = [
        Mount(
            f"mount {k + 1}", tuple(c * 1e-3 for c in place), tuple(stiffer * c * 1e3 for c in stiffness),
            loss_factor=loss, damping=(damping,) * 3, **more,
        )
        for k, (place, stiffness) in enumerate(zip(PLACES, STIFFNESS, strict=True))
    ]  # fmt: skip
    return elastic_mounting(BLOCK, mounts)


def wrench(seed: int = 0, orders: int = 4, base: Fraction = Fraction(1, 1)) -> Spectrum:
    """Return a load with every component at every order, none at order zero."""
    generator = np.random.default_rng(seed)
    size = np.array([100.0, 100.0, 300.0, 60.0, 40.0, 40.0])
    values = (generator.normal(size=(orders + 1, 6)) + 1j * generator.normal(size=(orders + 1, 6))) * size
    values[0] = 0.0
    return Spectrum(base, values)


def random_mounting(seed: int, count: int = 4, loss: float = 0.1, damping: float = 30.0) -> ElasticMounting:
    """Return the mounts at random places, turned at random, on a body that can exist."""
    from laufruhe.numerics.namespaces import NUMBERS
    from laufruhe.physics.rigid_body import turned_axes

    generator = np.random.default_rng(seed)
    points, masses = generator.normal(size=(12, 3)) * (0.4, 0.25, 0.3), generator.uniform(5.0, 30.0, 12)
    centre = masses @ points / masses.sum()
    arms = points - centre
    tensor = sum(m * (a @ a * np.eye(3) - np.outer(a, a)) for m, a in zip(masses, arms, strict=True))
    block = Block(float(masses.sum()), tuple(map(tuple, tensor.tolist())), tuple(centre.tolist()))
    mounts = [
        Mount(
            f"m{k}", tuple(generator.uniform(-0.6, 0.6, 3).tolist()), tuple(generator.uniform(3e4, 6e5, 3).tolist()),
            tuple(map(tuple, turned_axes(NUMBERS, generator.uniform(-3, 3, 3)).tolist())),
            loss * float(generator.uniform(0.2, 1.0)), tuple((damping * generator.uniform(0.1, 1.0, 3)).tolist()),
        )
        for k in range(count)
    ]  # fmt: skip
    return elastic_mounting(block, mounts)
