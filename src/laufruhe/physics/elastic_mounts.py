"""A rigid block on elastic mounts: response and mount forces, order by order (E1-E5, E11, E12, E50, E51).

Motion q = (u, theta) of the centre of gravity follows from the wrench w about it by

    (K + i H + i W C - W^2 M) q = w,    W = order x speed                               (E4)

with K, H, C the sums of G' k G over the mounts, k their stiffness, stiffness times loss
factor, and viscous damping. In coordinates of the undamped modes M is one and K is
diagonal, so modes that nothing drives, and that no damping couples to driven ones, are
seen and left out (E12). Orders without load are left out as well.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from laufruhe.errors import ModelError, UncarriedLoadError
from laufruhe.machine.block import Block
from laufruhe.machine.dynamic import Dynamic, FluidTrack
from laufruhe.machine.mount import Mount, every_spring
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.modes import Modes, modes_of
from laufruhe.physics.rigid_body import carried, moved_wrench, point_motion

UNDRIVEN = 1e-12
RESONANCE = 1e-8


class ResonanceError(ModelError):
    """Error of an order that excites an undamped mode at its natural frequency."""


@dataclass(frozen=True, eq=False)
class ElasticMounting:
    """Linear map from the wrench on the block to motion and forces, at any speed.

    The modes `answering` answer alone, 1 the lowest; all that are excited when None.
    """

    block: Block
    mounts: tuple[Mount, ...]
    answering: tuple[int, ...] | None = None
    _moved: list[tuple[Spectrum, float, ComplexArray]] = field(default_factory=list, repr=False)

    @cached_property
    def motions(self) -> Array:
        """Motion G of every mount, shape (mounts, 3, 6) (E1)."""
        centre = np.array(self.block.centre_of_gravity)
        arms = [np.array(mount.position) - centre for mount in self.mounts]
        return np.array([point_motion(NUMBERS, arm) for arm in arms]).reshape(-1, 3, 6)

    @cached_property
    def springs(self) -> Array:
        """Stiffness of every mount in the axes of C2, shape (mounts, 3, 3) [N/m] (E2)."""
        return np.array([mount.stiffness_matrix for mount in self.mounts]).reshape(-1, 3, 3)

    @cached_property
    def losses(self) -> Array:
        """Loss factor times k, shape (mounts, 3, 3) [N/m] (E2)."""
        return np.array([mount.loss_matrix for mount in self.mounts]).reshape(-1, 3, 3)

    @cached_property
    def dampers(self) -> Array:
        """Viscous damping in the axes of C2, shape (mounts, 3, 3) [N s/m] (E2)."""
        return np.array([mount.damping_matrix for mount in self.mounts]).reshape(-1, 3, 3)

    def total(self, vectors: Array) -> Array:
        """Return the sum of G' k G over the mounts, shape (6, 6) (E3)."""
        return np.asarray(sum(carried(g, k) for g, k in zip(self.motions, vectors, strict=True)))

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness matrix K, shape (6, 6) (E3)."""
        return self.total(self.springs)

    @cached_property
    def dynamic(self) -> DynamicSprings:
        """Frequency-dependent springs (E50, E51)."""
        springs = [(place, spring, law) for place, spring in every_spring(self.mounts) for law in spring.dynamic]
        axes = np.array([spring.orientation[law.axis] for _, spring, law in springs]).reshape(-1, 3)
        rows = [axis @ self.motions[place] for axis, (place, _, _) in zip(axes, springs, strict=True)]
        directions = np.zeros((3 * len(self.mounts), len(springs)))
        for n, (place, _, _) in enumerate(springs):
            directions[3 * place : 3 * place + 3, n] = axes[n]
        return DynamicSprings(tuple(law for _, _, law in springs), np.array(rows).reshape(-1, 6), directions)

    @cached_property
    def modes(self) -> Modes:
        """Undamped natural modes, of the stiffness at rest (E6)."""
        return modes_of(self.block.mass_matrix, self.stiffness, self.total(self.losses))

    @cached_property
    def _loss(self) -> Array:
        return self._modal(self.total(self.losses))

    @cached_property
    def _met(self) -> Mask:
        seen = np.abs(self.dynamic.rows @ self.modes.shapes)
        is_driven = (seen > UNDRIVEN * seen.max(axis=1, keepdims=True, initial=0.0)).astype(int)
        return np.asarray(is_driven.T @ is_driven > 0)

    @cached_property
    def _damping(self) -> Array:
        return self._modal(self.total(self.dampers))

    def _modal(self, matrix: Array) -> Array:
        shapes = self.modes.shapes
        out = np.asarray(shapes.T @ matrix @ shapes)
        return np.where(np.abs(out) > UNDRIVEN * np.abs(out).max(initial=0.0), out, 0.0)

    @cached_property
    def _about_centre(self) -> Array:
        moved = moved_wrench(NUMBERS, self.block.centre_of_gravity)
        return np.asarray(self.modes.shapes.T @ moved)

    def drives(self, wrenches: ComplexArray) -> ComplexArray:
        """Return the drive of every mode by wrenches about the origin, shape (n, 6) to (n, 6), roundings removed."""
        drive = wrenches @ self._about_centre.T
        # a sum that cancels is compared with the size of its terms
        size = np.abs(wrenches) @ np.abs(self._about_centre).T
        floor = UNDRIVEN * np.maximum(size, np.abs(drive).max(axis=-1, keepdims=True, initial=0.0))
        return np.where((np.abs(drive) > floor) & self._answers, drive, 0.0)

    @cached_property
    def _answers(self) -> Mask:
        modes = range(1, 7) if self.answering is None else self.answering
        return np.isin(np.arange(1, 7), list(modes))

    def excited(self, wrench: Spectrum) -> tuple[int, ...]:
        """Return the modes that a wrench drives, directly or through damping (E12)."""
        return self._reached(self.drives(wrench.coefficients))

    def _reached(self, drive: ComplexArray) -> tuple[int, ...]:
        coupled = ((self._loss != 0.0) | (self._damping != 0.0) | self._met) & self._answers
        reached = np.any(drive != 0.0, axis=0)
        while True:
            further = reached | np.any(coupled[reached], axis=0)
            if np.array_equal(further, reached):
                return tuple(int(j) for j in np.flatnonzero(reached))
            reached = further

    def responses(self, omegas: Array, wrenches: ComplexArray) -> ComplexArray:
        """Return the factors of the mode shapes (n, 6) under wrenches (n, 6) about the origin at `omegas` [rad/s] (E4).

        Raises
        ------
        ResonanceError
            If an undamped mode is driven at its own frequency.
        UncarriedLoadError
            If a steady load drives a free mode.
        """
        return self.driven(omegas, self.drives(wrenches))

    def driven(self, omegas: Array, drive: ComplexArray) -> ComplexArray:
        """Return the amplitudes of the natural modes from modal loads `drive`, shape (n, 6) each (E4)."""
        modes = list(self._reached(drive))
        out = np.zeros(drive.shape, dtype=complex)
        if not modes:
            return out
        self._refuse_resonance(omegas, drive)
        squares, damped = self.modes.squares[modes], (omegas > 0.0)
        loss, damping = self._loss[np.ix_(modes, modes)], self._damping[np.ix_(modes, modes)]
        reactance = squares - omegas[:, None] ** 2
        if not (_coupled(loss) or _coupled(damping) or self.dynamic):
            impedance = reactance + 1j * (damped[:, None] * np.diag(loss) + omegas[:, None] * np.diag(damping))
            out[:, modes] = drive[:, modes] / np.where(impedance == 0.0, 1.0, impedance)
            return out
        full = 1j * (damped[:, None, None] * loss + omegas[:, None, None] * damping)
        diagonal = np.arange(len(modes))
        full[:, diagonal, diagonal] += reactance
        if self.dynamic:
            full += self.dynamic.impedance(omegas, self.modes.shapes[:, modes])
            _refuse_singular(omegas, np.asarray(full, dtype=np.complex128), drive)
        # a free mode under no steady load stays where it is
        still = (omegas == 0.0)[:, None] & (squares == 0.0)
        full[:, diagonal, diagonal] += still
        out[:, modes] = np.linalg.solve(full, drive[:, modes, None])[..., 0]
        return out

    def _refuse_resonance(self, omegas: Array, drive: ComplexArray) -> None:
        square = omegas[:, None] ** 2
        near = np.abs(self.modes.squares - square) <= RESONANCE * square
        undamped = np.diag(self._loss) + omegas[:, None] * np.diag(self._damping) <= RESONANCE * square
        # modes with springs that depend on frequency are judged by their whole impedance
        struck = near & undamped & (drive != 0.0) & ~(np.diag(self._met) & (omegas[:, None] > 0.0))
        if not np.any(struck):
            return
        k, mode = (int(j) for j in np.argwhere(struck)[0])
        if omegas[k] == 0.0:
            raise UncarriedLoadError(
                f"a steady load drives the block in {self.modes.names[mode]}, which no mount resists; add a mount"
            )
        raise ResonanceError(
            f"the {self.modes.names[mode]} mode at {omegas[k] / math.tau:.6g} Hz is driven at its own frequency and "
            "nothing damps it; give the mounts a loss factor or damping"
        )

    def travel(self, wrench: Spectrum, speed: float) -> Spectrum:
        """Return the displacement of the engine at every mount, shape (n, mounts, 3) [m]."""
        return Spectrum(wrench.base, np.einsum("mij,nj->nmi", self._travels, self._modal_motion(wrench, speed)))

    def forces(self, wrench: Spectrum, speed: float) -> Spectrum:
        """Return the forces of the engine on its mounts, shape (n, mounts, 3) [N] (C7, E5)."""
        amplitudes = self._modal_motion(wrench, speed)
        return Spectrum(wrench.base, self.mount_forces(wrench.orders * speed, amplitudes))

    def mount_forces(self, omegas: Array, amplitudes: ComplexArray) -> ComplexArray:
        """Return the mount forces of modal amplitudes (n, 6), shape (n, mounts, 3) (E5)."""
        elastic, lossy, viscous = (matrix.reshape(-1, 6).T for matrix in self._force_maps)
        out = amplitudes @ (elastic + 1j * lossy)
        still = omegas == 0.0
        if np.any(still):
            # hysteretic loss needs motion
            out[still] = amplitudes[still] @ elastic
        if np.any(viscous):
            out += (1j * omegas)[:, None] * (amplitudes @ viscous)
        if self.dynamic:
            out += np.einsum("wrj,wj->wr", self.dynamic.forces(omegas, self.modes.shapes), amplitudes)
        return np.asarray(out.reshape(len(omegas), -1, 3))

    def resonant(self, wrench: Spectrum, speed: float) -> tuple[Mask, str]:
        """Return a mask of orders with an infinite response, shape (n,), and the first of them in words."""
        struck, why = np.zeros(len(wrench.coefficients), dtype=bool), ""
        for k in np.flatnonzero(np.any(wrench.coefficients != 0.0, axis=1)):
            try:
                self.responses(wrench.orders[[k]] * speed, wrench.coefficients[[k]])
            except ResonanceError as error:
                struck[k], why = True, why or str(error).partition(";")[0]
        return struck, why

    def _modal_motion(self, wrench: Spectrum, speed: float) -> ComplexArray:
        # forces and travel follow from one motion, which is kept with its wrench
        if not (self._moved and self._moved[0][0] is wrench and self._moved[0][1] == speed):
            loaded = np.flatnonzero(np.any(wrench.coefficients != 0.0, axis=1))
            motion = np.zeros((len(wrench.coefficients), 6), dtype=complex)
            motion[loaded] = self.responses(wrench.orders[loaded] * speed, wrench.coefficients[loaded])
            self._moved[:] = [(wrench, speed, motion)]
        return self._moved[0][2]

    @cached_property
    def _travels(self) -> Array:
        return np.asarray(self.motions @ self.modes.shapes)

    @cached_property
    def _force_maps(self) -> tuple[Array, Array, Array]:
        return self.springs @ self._travels, self.losses @ self._travels, self.dampers @ self._travels


def _refuse_singular(omegas: Array, impedance: ComplexArray, drive: ComplexArray) -> None:
    """Refuse a frequency at which the block and the fluid of its mounts move by themselves."""
    driven = np.flatnonzero((omegas > 0.0) & drive.any(axis=1))
    matrices, minimum = impedance[driven], RESONANCE * omegas[driven] ** 2
    with suppress(np.linalg.LinAlgError):
        # no singular value is less than one over the Frobenius norm of the inverse, which is found sooner
        doubtful = ~(np.linalg.norm(np.linalg.inv(matrices), axis=(1, 2)) * minimum < 1.0)
        driven, matrices, minimum = driven[doubtful], matrices[doubtful], minimum[doubtful]
    struck = driven[np.linalg.svd(matrices, compute_uv=False)[:, -1] <= minimum]
    if len(struck):
        raise ResonanceError(
            f"block and fluid tracks are driven at {omegas[struck[0]] / math.tau:.6g} Hz, a natural frequency of "
            "theirs, and nothing damps it; give the tracks damping, or the mounts a loss factor"
        )


def _coupled(matrix: Array) -> bool:
    return bool(np.any(matrix[~np.eye(len(matrix), dtype=bool)]))


def elastic_mounting(
    block: Block, mounts: Sequence[Mount], answering: tuple[int, ...] | None = None
) -> ElasticMounting:
    """Return the mounting of a block; `answering` selects modes, all when None."""
    if not any(any(spring.at_rest) for _, spring in every_spring(mounts)):
        raise ModelError("no mount has a stiffness; an elastic mounting needs one")
    return _elastic_mounting(block, tuple(mounts), answering)


_elastic_mounting = lru_cache(maxsize=4)(ElasticMounting)


def single_transmissibility(ratio: Array, loss_factor: float = 0.0, damping_ratio: float = 0.0) -> Array:
    """Return the ratio of foundation force to exciting force of one mass on one spring at a speed ratio (E11; Fig. 31).

    The hysteretic loss factor is psi / (2 pi) of eq. 40; the viscous damping is a part of critical damping.
    """
    lag = loss_factor + 2.0 * damping_ratio * np.asarray(ratio)
    return np.asarray(np.hypot(1.0, lag) / np.hypot(1.0 - np.asarray(ratio) ** 2, lag))


@dataclass(frozen=True, eq=False)
class DynamicSprings:
    """Frequency-dependent springs of a mounting, along their own axes.

    Attributes
    ----------
    rows
        Travel along its axis for each motion of the block, shape (n, 6).
    directions
        Of its force among those of the mounts, shape (3 mounts, n).
    """

    laws: tuple[Dynamic, ...]
    rows: Array
    directions: Array

    def __bool__(self) -> bool:
        return bool(self.laws)

    @property
    def has_law(self) -> bool:
        """True if all of them have equations in time; measured stiffness has none."""
        return all(isinstance(law, FluidTrack) for law in self.laws)

    def added(self, omegas: Array) -> ComplexArray:
        """Return the stiffness beyond that at rest, shape (frequencies, n) [N/m]."""
        additions = [law.at(np.asarray(omegas, dtype=float)) - law.static for law in self.laws]
        return np.array(additions, dtype=complex).reshape(len(self.laws), len(omegas)).T

    def impedance(self, omegas: Array, shapes: Any) -> ComplexArray:
        """Return the added impedance in coordinates of shapes (6, k), shape (frequencies, k, k)."""
        seen = self.rows @ shapes
        return np.asarray(np.einsum("wn,ni,nj->wij", self.added(omegas), seen, seen))

    def forces(self, omegas: Array, shapes: Any) -> ComplexArray:
        """Return the added mount forces per coordinate of shapes (6, k), shape (frequencies, 3 mounts, k)."""
        return np.asarray(np.einsum("wn,rn,nj->wrj", self.added(omegas), self.directions, self.rows @ shapes))
