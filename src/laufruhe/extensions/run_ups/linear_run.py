"""Run-up of a block on mounts without bump stops: linear in its loads, so that loads add up (E28a).

    z' = A z + b(t),   z_{k+1} = e^{A h} z_k + integral of e^{A (h - s)} b(t_k + s) ds

with time steps h, in the modes z of the rate matrix A, and with b a polynomial through its values at the Gauss points
of each step. All loads have the same steps, so that the response is linear in them to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np

from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.physics.time_model import TimeModel

Loads: TypeAlias = Sequence[tuple[Array, ComplexArray]]
"""Orders and their wrenches, shape (n, 6); the first set is in proportion to the squared speed (E28)."""

# Gauss points of a time step, and points of the quadrature of their polynomials
NODES, FINE = 4, 64
# largest rate times step, and largest condition number of the modes, at which modes give the motion
_STIFFEST, _DEFECTIVE = 200.0, 1e8
# time steps whose wrenches are computed at once, and steps that are followed together
_AT_ONCE, BLOCK = 20_000, 64


@dataclass(frozen=True)
class Sweep:
    """Equal time steps of a run-up or shut-down at constant acceleration.

    Attributes
    ----------
    first, gain
        Crank speed at the start [rad/s], and its acceleration [rad/s2].
    step, count
        Length of a time step [s], and count of steps.
    """

    first: float
    gain: float
    step: float
    count: int

    def wrenches(self, loads: Loads) -> Array:
        """Return the wrenches on the block at the `NODES` Gauss points of each time step, shape (6 NODES, steps).

        Rows are ordered by point, then by component. Wrenches are independent of the mounts.
        """
        wrenches = np.zeros((NODES, 6, self.count))
        for k in range(0, self.count, _AT_ONCE):
            starts = self.step * np.arange(k, min(k + _AT_ONCE, self.count))
            for node, point_wrenches in zip(_nodes(), wrenches, strict=True):
                point_wrenches[:, k : k + len(starts)] = self._wrenches_at(starts + node * self.step, loads)
        return wrenches.reshape(6 * NODES, -1)

    def _wrenches_at(self, times: Array, loads: Loads) -> Array:
        """Return the wrenches at times, shape (6, times)."""
        speed, angle = self.first + self.gain * times, self.first * times + 0.5 * self.gain * times**2
        total = np.zeros((6, len(times)))
        for k, (orders, coefficients) in enumerate(loads):
            part = np.zeros_like(total)
            for order, wrench in zip(orders, coefficients, strict=True):
                for share, wave in ((wrench.real, np.cos), (-wrench.imag, np.sin)):
                    components = np.flatnonzero(share)
                    if len(components):
                        part[components] += np.outer(share[components], wave(order * angle))
            total += part if k else speed**2 * part
        return total


@dataclass(frozen=True, eq=False)
class RunResponse:
    """Motion of the mounts and the block at equal time steps, by the coordinates of the model, shape (n, steps + 1)."""

    model: TimeModel = field(repr=False)
    y: Array
    rate: Array

    @cached_property
    def force(self) -> Array:
        """Forces on the mounts, shape (steps + 1, mounts, 3) [N]."""
        return self.model.mount_forces(self.y, self.rate)

    @cached_property
    def travel(self) -> Array:
        """Travel of the mounts, shape (steps + 1, mounts, 3) [m]."""
        return self.model.mount_travels(self.y)

    @cached_property
    def twist(self) -> Array:
        """Roll of the block, shape (steps + 1, 1, 1) [rad]."""
        return np.asarray((self.model.roll @ self.y)[:, None, None])


class LinearRun:
    """Motion of a block on its mounts over the time steps of one run, under any loads."""

    def __init__(self, model: TimeModel, sweep: Sweep) -> None:
        self.model, self.sweep = model, sweep
        identity = np.eye(model.size)
        matrix = np.block([[np.zeros_like(identity), identity], [-model.stiffness, -model.damping]])
        rates, shapes = np.linalg.eig(matrix)
        self._rates, self._shapes = rates.astype(complex), shapes.astype(complex)

    @property
    def is_resolved(self) -> bool:
        """True if modes give the motion between stops: distinct, and not too stiff for the steps."""
        stiff = float(np.abs(self._rates).max()) * self.sweep.step > _STIFFEST
        return not (stiff or np.linalg.cond(self._shapes) > _DEFECTIVE)

    @property
    def is_known(self) -> bool:
        """True if modes give the whole motion: resolved, and without bump stops."""
        return self.is_resolved and not self.model.has_stops

    @cached_property
    def modes(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Natural modes, one of each conjugate pair: eigenvalues r, shapes, and map from loads to modes.

        Free modes follow e^{r t}, with r in 1/s, shape (m,). The motion is the real part of the shapes, shape (2 n, m),
        times the modes. The map has the shape (m, n).
        """
        upper = self._rates.imag >= 0.0
        rates = self._rates[upper]
        shapes = self._shapes[:, upper] * np.where(rates.imag > 0.0, 2.0, 1.0)
        return rates, shapes, np.linalg.inv(self._shapes)[upper, self.model.size :]

    def excitation(self, wrenches: Array) -> ComplexArray:
        """Return the change of the modal states by the loads in each time step, shape (m, steps + 1).

        `wrenches` are those of `Sweep.wrenches`.
        """
        rates, _, inverse = self.modes
        points, shares = _quadrature()
        # integrals of e^{r (1 - s)} L_i(s) over a step of one, shape (modes, Gauss points)
        weights = self.sweep.step * (np.exp(np.outer(rates * self.sweep.step, 1.0 - points)) @ shares)
        mode_loads = inverse @ self.model.load
        driving = np.concatenate([weight[:, None] * mode_loads for weight in weights.T], axis=1)
        excitation = np.zeros((len(rates), self.sweep.count + 1), dtype=complex)
        excitation.real[:, 1:], excitation.imag[:, 1:] = driving.real @ wrenches, driving.imag @ wrenches
        return excitation

    def response_of(self, states: ComplexArray) -> RunResponse:
        """Return the motion from the modes after each step, shape (m, steps + 1)."""
        shapes = self.modes[1]
        y, rate = np.split(shapes.real @ states.real - shapes.imag @ states.imag, 2)
        return RunResponse(self.model, y, rate)

    def response(self, wrenches: Array) -> RunResponse:
        """Return the motion from rest under wrenches of `Sweep.wrenches`."""
        return self.response_of(_stepped(self.excitation(wrenches), np.exp(self.modes[0] * self.sweep.step)))


def _stepped(excitation: ComplexArray, decays: ComplexArray) -> ComplexArray:
    """Return the modal states z_k = decay z_{k-1} + excitation_k after each time step, shape (modes, steps).

    `decays` are the factors of the modes in a step, shape (modes,).
    """
    modes, count = excitation.shape
    blocks = -(-count // BLOCK)
    states = np.zeros((modes, blocks, BLOCK), dtype=complex)
    states.reshape(modes, -1)[:, :count] = excitation
    accumulate(states, decays[:, None])
    carried, block_decay = np.zeros((blocks, modes), dtype=complex), decays**BLOCK
    for k, block_end in enumerate(np.ascontiguousarray(states[:, :-1, -1].T), 1):
        carried[k] = block_decay * carried[k - 1] + block_end
    states += carried.T[..., None] * decays[:, None, None] ** np.arange(1, BLOCK + 1)
    return states.reshape(modes, -1)[:, :count]


def accumulate(states: ComplexArray, decays: ComplexArray) -> None:
    """Compute modal states z_k = decay z_{k-1} + excitation_k along the last axis, in place; z starts from zero."""
    reach = 1
    while reach < states.shape[-1]:
        # doubles the count of steps that each entry includes
        states[..., reach:] += (decays**reach)[..., None] * states[..., :-reach]
        reach *= 2


@lru_cache
def _nodes() -> Array:
    return np.asarray(0.5 * (np.polynomial.legendre.leggauss(NODES)[0] + 1.0))


@lru_cache
def _quadrature() -> tuple[Array, Array]:
    points, shares = np.polynomial.legendre.leggauss(FINE)
    points = 0.5 * (points + 1.0)
    return points, np.ascontiguousarray((0.5 * shares * _polynomials(points)).T)


def _polynomials(points: Array) -> Array:
    # L_i, one at Gauss point i and zero at the others, at points within a step of one, shape (Gauss points, points)
    nodes = _nodes()
    return np.array(
        [np.prod([(points - other) / (node - other) for other in nodes if other != node], axis=0) for node in nodes]
    )


@lru_cache
def step_moments(count: int) -> Array:
    """Return integrals of (1 - s)^k / k! L_i(s) over 0 <= s <= 1, for k < count and Gauss points i, (count, points)."""
    points, shares = _quadrature()
    powers = [(1.0 - points) ** k / math.factorial(k) for k in range(count)]
    return np.asarray(np.array(powers) @ shares)


@lru_cache
def largest_share() -> float:
    """Return the largest ratio of a polynomial over a step to its largest value at the Gauss points.

    The sum of |L_i| is largest at the ends of the step.
    """
    return float(np.abs(_polynomials(np.ones(1))).sum())
