"""Run-up of a block on mounts without bump stops: linear in its loads, so that loads add up (E28a).

    z' = A z + b(t),   z_{k+1} = e^{A h} z_k + integral of e^{A (h - s)} b(t_k + s) ds

in the modes of A, with b a polynomial through its values at the Gauss points of every step. The same steps for all
loads make the answer linear in them to a rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.physics.time_model import TimeModel

Loads: TypeAlias = Sequence[tuple[Array, ComplexArray]]

NODES, FINE = 4, 64
_STIFFEST, _DEFECTIVE = 200.0, 1e8
_AT_ONCE = 20_000


@dataclass(frozen=True, eq=False)
class Response:
    """Of the mounts and the block at equal steps of time.

    Attributes
    ----------
    force, travel
        Shapes (steps, mounts, 3) [N], [m].
    twist
        Roll of the block, shape (steps, 1, 1) [rad].
    """

    force: Array
    travel: Array
    twist: Array


class LinearRun:
    """Steps of one run, for any loads.

    Parameters
    ----------
    first, gain
        Crank speed at the start [rad/s], and by how much it grows [rad/s2].
    step, count
        Of time [s].
    """

    def __init__(self, model: TimeModel, first: float, gain: float, step: float, count: int) -> None:
        self._model, self._first, self._gain, self._step, self._count = model, first, gain, step, count
        one = np.eye(model.size)
        matrix = np.block([[np.zeros_like(one), one], [-model.stiffness, -model.damping]])
        rates, shapes = np.linalg.eig(matrix)
        self._rates, self._shapes = rates.astype(complex), shapes.astype(complex)

    @property
    def is_known(self) -> bool:
        """Whether modes tell the motion: none alike, none that hardly moves within a step, and no bump stop."""
        stiff = float(np.abs(self._rates).max()) * self._step > _STIFFEST
        return not (self._model.has_stops or stiff or np.linalg.cond(self._shapes) > _DEFECTIVE)

    def response(self, loads: Loads) -> Response:
        """Under loads by order: the first grows with the square of speed, others do not (E28)."""
        model, driven = self._model, self._driven(loads)
        states = (self._shapes @ self._stepped(driven)).real
        y, rate = np.split(states, 2)
        travel = model.mount_travels(y)
        return Response(model.mount_forces(y, rate), travel, (model.roll @ y)[:, None, None])

    def _driven(self, loads: Loads) -> ComplexArray:
        """What every step adds to the modes, shape (2 n, steps)."""
        inverse = np.linalg.inv(self._shapes)[:, self._model.size :]
        nodes, weights = _weights(np.asarray(self._rates * self._step, dtype=complex))
        out = np.zeros((len(self._rates), self._count), dtype=complex)
        for k in range(0, self._count, _AT_ONCE):
            starts = self._step * np.arange(k, min(k + _AT_ONCE, self._count))
            for node, weight in zip(nodes, weights.T, strict=True):
                load = self._load(starts + node * self._step, loads)
                out[:, k : k + len(starts)] += self._step * weight[:, None] * (inverse @ load.T)
        return out

    def _load(self, times: Array, loads: Loads) -> Array:
        """Shape (times, n), in the coordinates of the model."""
        speed, angle = self._first + self._gain * times, self._first * times + 0.5 * self._gain * times**2
        total = np.zeros((len(times), self._model.size))
        for k, (orders, coefficients) in enumerate(loads):
            kept = np.any(coefficients != 0.0, axis=1)
            part = (np.exp(1j * np.outer(angle, orders[kept])) @ coefficients[kept]).real
            total += part if k else speed[:, None] ** 2 * part
        return total

    def _stepped(self, driven: ComplexArray) -> ComplexArray:
        """Modes after every step, from rest, shape (2 n, steps + 1)."""
        out = np.zeros((self._count + 1, len(self._rates)), dtype=complex)
        decay, state = np.exp(self._rates * self._step), out[0]
        for k, own in enumerate(np.ascontiguousarray(driven.T), 1):
            state = decay * state + own
            out[k] = state
        return out.T


def _weights(rates: ComplexArray) -> tuple[Array, ComplexArray]:
    """Gauss points of a step of one, and of each rate r integrals of e^{r (1 - s)} L_i(s), shape (rates, points)."""
    nodes = 0.5 * (np.polynomial.legendre.leggauss(NODES)[0] + 1.0)
    points, shares = np.polynomial.legendre.leggauss(FINE)
    points = 0.5 * (points + 1.0)
    bases = np.array([
        np.prod([(points - other) / (node - other) for other in nodes if other != node], axis=0) for node in nodes
    ])  # fmt: skip
    grown = np.exp(np.outer(rates, 1.0 - points))
    return nodes, np.asarray(grown @ (0.5 * shares * bases).T)
