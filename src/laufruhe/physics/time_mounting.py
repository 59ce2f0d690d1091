"""Elastic mounting that is integrated in time (E25, E28)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.steady_state import SteadyState, periodic_state
from laufruhe.physics.time_model import time_model

INTEGRATION = 1e-9


@dataclass(frozen=True, eq=False)
class TimeMounting:
    """Steady state by integration, with bump stops, and the viscous loss of E26.

    Attributes
    ----------
    mounting
        Block and mounts.
    samples
        Steps over the period at which the motion is read; orders above half of them are lost.
    """

    mounting: ElasticMounting
    samples: int
    _found: dict[tuple[int, float], tuple[Spectrum, SteadyState]] = field(default_factory=dict, repr=False)

    def forces(self, wrench: Spectrum, speed: float) -> Spectrum:
        """Return the forces of the engine on its mounts, shape (n, mounts, 3) [N] (C7).

        Raises
        ------
        SolverError
            If no motion repeats itself.
        """
        return spectrum_of(self._state(wrench, speed).forces, wrench.base)

    def travel(self, wrench: Spectrum, speed: float) -> Spectrum:
        """Return the displacement of the engine at every mount, shape (n, mounts, 3) [m]."""
        return spectrum_of(self._state(wrench, speed).travels, wrench.base)

    def _state(self, wrench: Spectrum, speed: float) -> SteadyState:
        # forces and travel are of one integration; the wrench is kept, so that its id stays its own
        key = id(wrench), speed
        if key not in self._found:
            state = periodic_state(self.mounting, wrench, speed, self.samples, INTEGRATION)
            self._found[key] = wrench, state
        return self._found[key][1]


def viscous_forces(mounting: ElasticMounting, wrench: Spectrum, speed: float) -> Spectrum:
    """Return the mount forces by order of the equations that time integrates, without bump stops (E25, E26).

    What integration alone is off by shows beside these; what E26 changes shows beside
    `ElasticMounting.forces`.

    Returns
    -------
    Shape (n, mounts, 3) [N].
    """
    model = time_model(mounting)
    omega = wrench.orders[:, None, None] * speed
    impedance = model.stiffness + 1j * omega * model.damping - omega**2 * np.eye(model.size)
    y = np.linalg.solve(impedance, (wrench.coefficients @ model.load.T)[..., None])
    forces = (model.forces + 1j * omega * model.drag) @ y
    return Spectrum(wrench.base, forces.reshape(len(omega), -1, 3))
