"""Equilibrium of a block on its mounts under a static load, bump stops included (E55).

    K q + sum T' s (T q - gap) = w    beyond the gaps

T are the travels along the own axes of the springs. The energy is convex, and its second derivative is constant between
gaps: Newton's method with a line search ends at the one place where forces balance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.errors import SolverError
from laufruhe.machine.block import Block, LoadCase
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.modes import GRAVITY

MAX_STEPS, HALVINGS, CLOSED, ROUNDED = 200, 40, 1e-12, 1e-15


@dataclass(frozen=True, eq=False)
class Stops:
    """Bump stops of all springs along their own axes.

    Attributes
    ----------
    rows
        Travel along each axis per motion, shape (3 springs, 6).
    gaps, stiffness
        Shape (3 springs,); zero stiffness where there is no stop.
    directions
        Of the force along each axis among those of the mounts, shape (3 mounts, 3 springs).
    """

    rows: Array
    gaps: Array
    stiffness: Array
    directions: Array

    def beyond(self, travel: Array) -> Array:
        """Return the part of travels beyond the gaps, shape (..., 3 springs)."""
        return np.asarray(travel - np.clip(travel, -self.gaps, self.gaps))

    def added(self, met: Mask) -> Array:
        """Return the stiffness of a mask of met stops (..., 3 springs), shape (..., 6, 6)."""
        return np.asarray((self.rows.T * (met * self.stiffness)[..., None, :]) @ self.rows)


@dataclass(frozen=True, eq=False)
class Settled:
    """Equilibrium of a block under a static load.

    Attributes
    ----------
    motion
        (u, theta) of its centre of gravity, shape (6,).
    travel, force
        Of the engine at its mounts and on them, in the axes of C2, shape (mounts, 3) [m], [N].
    on_stops
        Mounts that stand on a stop.
    """

    motion: Array
    travel: Array
    force: Array
    on_stops: tuple[str, ...]


def case_wrench(block: Block, case: LoadCase) -> Array:
    """Return the wrench of a load case about the centre of gravity, shape (6,) [N, N m]."""
    arm = np.array(case.place) - np.array(block.centre_of_gravity)
    weight = block.mass * GRAVITY * np.array(case.times_weight)
    return np.concatenate([weight + case.force, np.array(case.moment) + np.cross(arm, case.force)])


def stops_of(mounting: ElasticMounting) -> Stops:
    """Return the bump stops of a mounting as arrays: directions, gaps and stiffness."""
    springs = every_spring(mounting.mounts)
    rows = np.array([np.array(spring.orientation) @ mounting.motions[place] for place, spring in springs])
    directions = np.zeros((3 * len(mounting.mounts), 3 * len(springs)))
    for k, (place, spring) in enumerate(springs):
        directions[3 * place : 3 * place + 3, 3 * k : 3 * k + 3] = np.array(spring.orientation).T
    gaps = np.repeat([spring.stop_gap for _, spring in springs], 3)
    stiffness = np.repeat([spring.stop_stiffness for _, spring in springs], 3)
    return Stops(rows.reshape(-1, 6), gaps, np.where(np.isfinite(gaps), stiffness, 0.0), directions)


def settled(mounting: ElasticMounting, case: LoadCase) -> Settled:
    """Return the equilibrium of the block under a load case (E55)."""
    wrench, stops = case_wrench(mounting.block, case), stops_of(mounting)
    (q,), is_done = equilibria(mounting.stiffness[None], stops, wrench)
    if not is_done.all():
        raise SolverError("no balance was found under a load case; check the stiffness of bump stops")
    beyond = stops.stiffness * stops.beyond(stops.rows @ q)
    travel = mounting.motions @ q
    force = np.einsum("mij,mj->mi", mounting.springs, travel) + (stops.directions @ beyond).reshape(-1, 3)
    met = np.any((stops.directions != 0.0) & (beyond != 0.0), axis=1).reshape(-1, 3).any(axis=1)
    names = tuple(mount.name for mount, is_met in zip(mounting.mounts, met, strict=True) if is_met)
    return Settled(q, travel, force, names)


def equilibria(stiffness: Array, stops: Stops, wrench: Array) -> tuple[Array, Mask]:
    """Return the motions of least energy under a wrench, shape (n, 6), and a mask of those that have converged.

    `stiffness` has the matrix of each of n mountings with the same stops, shape (n, 6, 6).
    """

    def energy(q: Array) -> Array:
        over = stops.beyond(q @ stops.rows.T)
        return np.asarray(
            0.5 * np.einsum("ni,nij,nj->n", q, stiffness, q) + 0.5 * over**2 @ stops.stiffness - q @ wrench
        )

    q: Array = np.asarray(np.linalg.solve(stiffness, wrench[:, None])[..., 0], dtype=np.float64)
    is_done = np.zeros(len(q), dtype=bool)
    for _ in range(MAX_STEPS):
        over = stops.beyond(q @ stops.rows.T)
        pull = wrench - np.einsum("nij,nj->ni", stiffness, q) - (stops.stiffness * over) @ stops.rows
        tangent = stiffness + stops.added(over != 0.0)
        step: Array = np.asarray(np.linalg.solve(tangent, pull[..., None])[..., 0], dtype=np.float64)
        is_done |= np.linalg.norm(step, axis=1) <= CLOSED * np.linalg.norm(q, axis=1)
        start, slope, share = energy(q), np.einsum("ni,ni->n", pull, step), np.ones(len(q))
        for _ in range(HALVINGS):
            # near a gap the fall that is left is below the rounding error of energies
            is_lower = energy(q + share[:, None] * step) <= start - 1e-4 * share * slope + ROUNDED * np.abs(start)
            if np.all(is_lower | is_done):
                break
            share = np.where(is_lower, share, 0.5 * share)
        # without a fall only rounding errors are left
        is_done |= ~is_lower
        if is_done.all():
            break
        q = np.where(is_done[:, None], q, q + share[:, None] * step)
    return q, is_done
