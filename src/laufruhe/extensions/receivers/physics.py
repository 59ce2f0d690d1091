"""Response of receivers to the loads of an engine, order by order (Q1-Q4).

A receiver is a point of the engine or its frame, or a transfer function H multiplies mount forces:

    a = (i W)^k G q   or   a = H(W) F,    W = order x speed                               (Q1, Q2)

with k = 2 for acceleration and 1 for velocity. F are the forces on rigid ground (E5) for functions of the whole
vehicle with its engine: the motion of the frame is then within H (Q3). For functions of the frame without the engine,
F are the forces on the frame that moves with the engine (Q4):

    [Z + G' k G, -G' k B; -B' k G, Y + B' k B] [q; p] = [w; 0],    F = k (G q - B p)      (Q4)

Z = -W^2 M of the engine, Y = K + i H + i W C - W^2 M of the frame on its springs, k the complex stiffness of the
mounts, and G, B their motion with engine and frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.receivers.machine import Frame, Quantity, Receiver, Receivers, receivers_of
from laufruhe.machine import Engine
from laufruhe.machine.mount import Vector3
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.spectrum import Spectrum, stacked_coefficients
from laufruhe.physics.elastic_mounts import ElasticMounting, ResonanceError, elastic_mounting
from laufruhe.physics.mounting import mounting_of
from laufruhe.physics.rigid_body import carried, moved_wrench, point_motion
from laufruhe.problem.loads import PointLoads

_DERIVATIVES = {"acceleration": 2, "velocity": 1}


def response(engine: Engine, loads: PointLoads, quantity: Quantity) -> Spectrum:
    """Return the weighted response of all receivers of one quantity, shape (n, receivers, components) [SI].

    `engine` is the engine with the parts that make the loads.
    """
    extra = engine.extra(Receivers) or Receivers()
    spectra = [_of_receiver(receiver, extra.frame, engine, loads) for receiver in receivers_of(engine, quantity)]
    base, stacked = stacked_coefficients(spectra)
    return Spectrum(base, np.moveaxis(stacked, 0, 1))


def _of_receiver(receiver: Receiver, frame: Frame | None, engine: Engine, loads: PointLoads) -> Spectrum:
    takes_ground_force = bool(receiver.functions) and not receiver.takes_frame_force
    source = _ground_forces(receiver, engine, loads) if takes_ground_force else loads.wrench
    frequencies = source.orders * loads.point.speed / math.tau
    weights, rows = receiver.weights(frequencies), source.coefficients.reshape(len(frequencies), -1)
    # the steady load moves nothing
    used = np.asarray((frequencies > 0.0) & weights.any(axis=1) & rows.any(axis=1))
    struck: Mask = np.zeros(len(used), dtype=bool)
    in_frequency = loads.fidelity.mounts == "frequency"
    if in_frequency and loads.mount_forces is not None and (takes_ground_force or frame is None):
        # on an undamped resonance the forces on rigid ground are infinite
        struck = np.asarray(used & ~np.isfinite(loads.mount_forces.coefficients).all(axis=(1, 2)))
    used &= ~struck
    out = np.zeros(weights.shape, dtype=complex)
    if not receiver.functions:
        out[used] = _of_point(receiver, frame, engine, loads, used)
    elif takes_ground_force:
        out[used] = _transferred(receiver, frequencies[used], rows[used])
    elif frame is not None:
        moved = _Coupled.of(frame, engine, loads).solved(math.tau * frequencies[used], rows[used])
        out[used] = _transferred(receiver, frequencies[used], moved.forces)
    out *= weights
    out[struck] = np.inf
    return Spectrum(source.base, out)


def _ground_forces(receiver: Receiver, engine: Engine, loads: PointLoads) -> Spectrum:
    if loads.mount_forces is not None:
        return loads.mount_forces
    mounting = mounting_of(engine, loads.fidelity)
    if mounting is None:
        raise ModelError(f"receiver '{receiver.name}' needs mounts; add [mounts]")
    return mounting.forces(loads.wrench, loads.point.speed)


def _transferred(receiver: Receiver, frequencies: Array, forces: ComplexArray) -> ComplexArray:
    # response to mount forces (n, 3 mounts), shape (n, components)
    parts = [
        np.zeros(len(forces)) if function is None else np.sum(function.at(frequencies) * forces, axis=1)
        for function in receiver.functions
    ]
    return np.stack(parts, axis=-1)


def _of_point(receiver: Receiver, frame: Frame | None, engine: Engine, loads: PointLoads, used: Mask) -> ComplexArray:
    """Return acceleration or velocity of a point at the orders of the wrench in a mask, shape (orders, 3)."""
    wrenches, omegas = loads.wrench.coefficients[used], loads.wrench.orders[used] * loads.point.speed
    if frame is not None:
        moved = _Coupled.of(frame, engine, loads).solved(omegas, wrenches)
        body, motion = (frame.body, moved.frame) if receiver.on_frame else (engine.block, moved.engine)
    else:
        mounting, body = mounting_of(engine, loads.fidelity), engine.block
        if isinstance(mounting, ElasticMounting):
            motion = mounting.responses(omegas, wrenches) @ mounting.modes.shapes.T
        else:
            raise ModelError(f"receiver '{receiver.name}' {_IN_FREQUENCY}")
    if body is None or receiver.point is None:
        raise ModelError(f"receiver '{receiver.name}' needs elastic mounts; add [block] and elastic [mounts]")
    factors = (1j * omegas) ** _DERIVATIVES[receiver.quantity]
    return np.asarray(factors[:, None] * (motion @ _motion_at(receiver.point, body.centre_of_gravity).T))


_IN_FREQUENCY = 'needs mounts in the frequency domain; leave fidelity.mounts out, or write "frequency"'


def _motion_at(point: Vector3, centre: Vector3) -> Array:
    return np.asarray(point_motion(NUMBERS, np.array(point) - np.array(centre)))


@lru_cache(maxsize=4)
def _coupled(mounting: ElasticMounting, frame: Frame, modes: tuple[int, ...]) -> _Coupled:
    return _Coupled(mounting, frame, mounting.modes.shapes[:, list(modes)])


def frame_frequencies(frame: Frame, engine: Engine) -> list[float]:
    """Return the natural frequencies of an engine on a frame without damping [Hz]; none on mounts without a block."""
    if engine.block is None:
        return []
    return _coupled(elastic_mounting(engine.block, engine.mounts), frame, tuple(range(6))).frequencies


@dataclass(frozen=True, eq=False)
class _Motion:
    # motion of both bodies at their centres of gravity, shape (n, 6), and forces on the frame, shape (n, 3 mounts)
    engine: ComplexArray
    frame: ComplexArray
    forces: ComplexArray


@dataclass(frozen=True, eq=False)
class _Coupled:
    """Engine on its mounts on a frame on its springs, in the modes of the engine and the motion of the frame (Q4)."""

    mounting: ElasticMounting
    frame: Frame
    shapes: Array

    @classmethod
    def of(cls, frame: Frame, engine: Engine, loads: PointLoads) -> _Coupled:
        """Return the two bodies of an engine with a frame."""
        fidelity = loads.fidelity
        if fidelity.mounts != "frequency" or engine.block is None:
            raise ModelError(f"a frame under the engine {_IN_FREQUENCY}")
        modes = range(6) if fidelity.modes is None else [mode - 1 for mode in fidelity.modes]
        return _coupled(elastic_mounting(engine.block, engine.mounts), frame, tuple(modes))

    def _at(self, position: Vector3) -> Array:
        return _motion_at(position, self.frame.body.centre_of_gravity)

    @cached_property
    def travels(self) -> Array:
        """Travel of every mount per motion of both bodies, shape (3 mounts, modes + 6)."""
        feet = np.concatenate([self._at(mount.position) for mount in self.mounting.mounts])
        return np.concatenate([np.concatenate(list(self.mounting.motions)) @ self.shapes, -feet], axis=1)

    @cached_property
    def inertia(self) -> Array:
        """Inertia of both bodies, shape (modes + 6, modes + 6)."""
        from scipy.linalg import block_diag

        engine = self.shapes.T @ self.mounting.block.mass_matrix @ self.shapes
        return np.asarray(block_diag(engine, self.frame.body.mass_matrix))

    @cached_property
    def _mounts(self) -> tuple[ComplexArray, ComplexArray]:
        # complex stiffness of all mounts, and their viscous damping times i, shape (3 mounts, 3 mounts)
        from scipy.linalg import block_diag

        lossy = block_diag(*self.mounting.springs) + 1j * block_diag(*self.mounting.losses)
        return np.asarray(lossy, dtype=complex), np.asarray(1j * block_diag(*self.mounting.dampers), dtype=complex)

    @cached_property
    def _stiffness(self) -> ComplexArray:
        # complex stiffness of both bodies, shape (modes + 6, modes + 6)
        still: ComplexArray = self.travels.T @ self._mounts[0] @ self.travels
        for spring in self.frame.springs:
            added = carried(self._at(spring.position), spring.stiffness_matrix + 1j * spring.loss_matrix)
            still[-6:, -6:] += added
        return still

    @cached_property
    def _damping(self) -> ComplexArray:
        # viscous damping of both bodies times i, shape (modes + 6, modes + 6)
        moving: ComplexArray = self.travels.T @ self._mounts[1] @ self.travels
        for spring in self.frame.springs:
            moving[-6:, -6:] += 1j * carried(self._at(spring.position), spring.damping_matrix)
        return moving

    @property
    def frequencies(self) -> list[float]:
        """Natural frequencies of both bodies without damping [Hz]."""
        from scipy.linalg import eigh

        squares = eigh(self._stiffness.real, self.inertia, eigvals_only=True)
        # a free body has frequencies of rounding errors
        return [math.sqrt(square) / math.tau for square in squares.tolist() if square > 1e-9 * squares[-1]]

    def solved(self, omegas: Array, wrenches: ComplexArray) -> _Motion:
        """Return the motion under wrenches about the origin, shape (n, 6), at positive angular frequencies [rad/s]."""
        mounting, count = self.mounting, self.shapes.shape[1]
        travels, lossy, viscous = self.travels, *self._mounts
        w = omegas[:, None, None]
        impedance: Any = self._stiffness + w * self._damping - w**2 * self.inertia
        laws, axes = mounting.dynamic, mounting.dynamic.directions
        if laws:
            impedance += np.einsum("wn,ni,nj->wij", laws.added(omegas), axes.T @ travels, axes.T @ travels)
        drive = np.zeros((len(omegas), count + 6), dtype=complex)
        drive[:, :count] = wrenches @ moved_wrench(NUMBERS, mounting.block.centre_of_gravity).T @ self.shapes
        try:
            moved: ComplexArray = np.linalg.solve(impedance, drive[..., None])[..., 0]
        except np.linalg.LinAlgError:
            raise ResonanceError(
                "engine and frame are driven at a natural frequency and nothing damps it; give mounts or frame a loss "
                "factor or damping"
            ) from None
        travel = moved @ travels.T
        forces = travel @ lossy.T + omegas[:, None] * (travel @ viscous.T)
        if laws:
            forces += (laws.added(omegas) * (travel @ axes)) @ axes.T
        return _Motion(moved[:, :count] @ self.shapes.T, moved[:, count:], np.asarray(forces))
