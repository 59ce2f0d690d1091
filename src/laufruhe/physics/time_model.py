"""Matrices of the block on its mounts in time, with bump stops and hydraulic mounts (E25-E27, E50)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.machine.dynamic import FluidTrack
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.elastic_mounts import DynamicSprings, ElasticMounting
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.physics.static_cases import Stops, stops_of

NO_LAW = "a stiffness measured over frequency has no law in time; give a fluid_track, or leave time and run-ups out"


@dataclass(frozen=True, eq=False)
class TimeModel:
    """Matrices of E25 in coordinates in which the mass is one, q = R' y; the fluid of tracks after the block (E50).

    Attributes
    ----------
    load
        From a wrench about the origin to y, shape (n, 6).
    forces, damping_forces
        From y and y' to the mount forces in the axes of C2, shape (3 mounts, n).
    stops
        Bump stops, with rows from y to travel along the own axes of the springs, shape (3 springs, n).
    points
        From y to the travel of the mounts in the axes of C2, shape (3 mounts, n).
    roll
        From y to the turn of the block about x, shape (n,).
    """

    stiffness: Array
    damping: Array
    load: Array
    forces: Array
    damping_forces: Array
    stops: Stops
    points: Array
    roll: Array

    @property
    def size(self) -> int:
        """Number n of coordinates: six, and one for each fluid track."""
        return len(self.stiffness)

    @property
    def has_stops(self) -> bool:
        """True if any bump stop can be met."""
        return bool(np.any(self.stops.stiffness > 0.0))

    def stop_forces(self, y: Array) -> Array:
        """Return the stop forces along the own axes, shape (3 springs, times), of y (n, times) (E27)."""
        return np.asarray((self.stops.beyond((self.stops.rows @ y).T) * self.stops.stiffness).T)

    def mount_forces(self, y: Array, rate: Array) -> Array:
        """Return the mount forces over time, shape (times, mounts, 3), from motion y and its rate, (n, times) each."""
        out = self.forces @ y + self.damping_forces @ rate
        out = out + self.stops.directions @ self.stop_forces(y) if self.has_stops else out
        return np.asarray(out.T.reshape(y.shape[1], -1, 3))

    def mount_travels(self, y: Array) -> Array:
        """Return the mount deflections over time in the axes of C2, (times, mounts, 3), from motion y (n, times)."""
        return np.asarray((self.points @ y).T.reshape(y.shape[1], -1, 3))

    def accelerations(self, y: Array, rate: Array, load: Array) -> Array:
        """Return y'' of columns (n, times)."""
        out = load - self.stiffness @ y - self.damping @ rate
        return out - self.stops.rows.T @ self.stop_forces(y) if self.has_stops else out


def time_model(mounting: ElasticMounting) -> TimeModel:
    """Return the matrices of E25 for a mounting, hysteretic loss as the viscous damping of E26.

    A mount's loss in a mode becomes its loss over that mode's natural frequency, so each
    mode keeps the loss factor that the mounts give it, and forces and motion agree.
    """
    modes = mounting.modes
    root = mass_root(mounting.block)
    vectors = np.linalg.solve(root.T, modes.shapes)
    motions = mounting.motions @ root.T
    stops = stops_of(mounting)
    spread = np.where(modes.squares > 0.0, 1.0 / np.sqrt(np.where(modes.squares > 0.0, modes.squares, 1.0)), 0.0)
    lossy = (mounting.losses @ (mounting.motions @ modes.shapes) * spread) @ vectors.T
    damper_forces = mounting.dampers @ motions + lossy
    mounts = len(mounting.mounts)
    model = TimeModel(
        stiffness=root @ mounting.stiffness @ root.T,
        damping=np.einsum("mai,maj->ij", motions, damper_forces),
        load=root @ moved_wrench(NUMBERS, mounting.block.centre_of_gravity),
        forces=(mounting.springs @ motions).reshape(3 * mounts, 6),
        damping_forces=damper_forces.reshape(3 * mounts, 6),
        stops=replace(stops, rows=stops.rows @ root.T),
        points=motions.reshape(-1, 6),
        roll=root.T[3],
    )
    return _with_fluid(model, mounting.dynamic, root) if mounting.dynamic else model


def frequencies_with_fluid(mounting: ElasticMounting) -> tuple[float, ...]:
    """Return the natural frequencies of block and fluid tracks together [Hz]; none without tracks (E50)."""
    if not (mounting.dynamic and mounting.dynamic.has_law):
        return ()
    squares = np.maximum(np.linalg.eigvalsh(time_model(mounting).stiffness), 0.0)
    return tuple((np.sqrt(squares) / (2.0 * np.pi)).tolist())


def _with_fluid(model: TimeModel, dynamic: DynamicSprings, root: Array) -> TimeModel:
    """Add a coordinate for the fluid of every track, in which its mass is one (E50)."""
    tracks = [law for law in dynamic.laws if isinstance(law, FluidTrack)]
    if len(tracks) < len(dynamic.laws):
        raise ModelError(NO_LAW)
    bulge, mass = (np.array([getattr(track, name) for track in tracks]) for name in ("bulge", "mass"))
    lower, damping = (np.array([getattr(track, name) for track in tracks]) for name in ("stiffness", "damping"))
    static = np.array([track.static for track in tracks])
    seen, swelling = dynamic.rows @ root.T, bulge / np.sqrt(mass)
    block = model.stiffness + seen.T @ ((bulge - static)[:, None] * seen)
    across = -seen.T * swelling
    wider = (0, len(tracks))
    return replace(
        model,
        stiffness=np.block([[block, across], [across.T, np.diag((bulge + lower) / mass)]]),
        damping=np.pad(model.damping, (wider, wider)) + np.diag(np.concatenate([np.zeros(6), damping / mass])),
        load=np.pad(model.load, (wider, (0, 0))),
        stops=replace(model.stops, rows=np.pad(model.stops.rows, ((0, 0), wider))),
        points=np.pad(model.points, ((0, 0), wider)),
        forces=np.hstack([
            model.forces + dynamic.directions @ ((bulge - static)[:, None] * seen), -dynamic.directions * swelling
        ]),
        damping_forces=np.pad(model.damping_forces, ((0, 0), wider)),
        roll=np.pad(model.roll, wider),
    )  # fmt: skip
