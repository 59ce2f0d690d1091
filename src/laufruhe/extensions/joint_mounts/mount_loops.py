"""Block on mounts as a feedback loop through its open numbers: exact, and linear except for these numbers (E68).

The open numbers are s from -1 to 1 about the middle of a box. Each product with an open number is a channel with the
input z and the feedback w = s z. Under a load r, the motion y and the forces and travel f of the mounts have

    D y + M w = r,    z = C y + F w,    f = V y + E w,    w_i = s_j(i) z_i

A stiffness multiplies the travel along its axis. A position multiplies the rotation of the block, which moves the
mount, and the force of the mount, which turns the block. An angle enters by the tangent of its half (Cayley), which is
the s of a box of angles. With G = C D^-1 M - F, z0 = C D^-1 r and P = E - V D^-1 M this is

    f = V D^-1 r + P S z0 - P S G S z0 + P S (G S)^2 (1 + G S)^-1 z0

so E37 holds for all open numbers of mounts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array, ComplexArray, Indices
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import point_motion, turned_axes
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.decision import DAMPING, LAG, LOSS, POSITION, STIFFNESS, TURNED
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_series import inverses
from laufruhe.prove.mounts.ranges import number_ranges

# axes of a mount turn about x, then y, then z (E2)
_PLANES, _QUARTER = ([1, 2], [2, 0], [0, 1]), np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Loop:
    """Feedback loop about the middle of a box at w frequencies.

    Attributes
    ----------
    numbers
        Index of the open number of each channel, shape (m,).
    forces, travels
        Map V D^-1 from the load, shape (w, 3 mounts, 6), and map P from the feedback, shape (w, 3 mounts, m).
    inputs, gain
        Map from the load r to z0, shape (w, m, 6), and loop gain G, shape (w, m, m).
    """

    numbers: Indices
    forces: tuple[ComplexArray, ComplexArray]
    travels: tuple[ComplexArray, ComplexArray]
    inputs: ComplexArray
    gain: ComplexArray


class _Signals:
    """Growing list of feedback channels; a signal has coefficients of motion and channels, (w, rows, 6 + channels)."""

    def __init__(self, frequencies: int, maximum: int) -> None:
        self.size, self.owners = (frequencies, 6 + maximum), list[int]()
        self._inputs: list[ComplexArray] = []

    def motion(self, rows: Array) -> ComplexArray:
        """Return a signal that depends on the motion alone, from rows of shape (r, 6)."""
        signal = np.zeros((self.size[0], len(rows), self.size[1]), dtype=complex)
        signal[:, :, :6] = rows
        return signal

    def channel(self, signal: ComplexArray, number: int, self_feedback: Array | None = None) -> ComplexArray:
        """Return a new signal: the product of an open number and a signal (a feedback channel).

        `self_feedback`, shape (r, r), feeds the product back into its own input.
        """
        first, count = 6 + len(self.owners), signal.shape[1]
        self.owners += [number] * count
        self._inputs.append(signal.copy())
        if self_feedback is not None:
            self._inputs[-1][:, :, first : first + count] += self_feedback
        product = np.zeros_like(signal)
        product[:, np.arange(count), first + np.arange(count)] = 1.0
        return product

    @property
    def numbers(self) -> Indices:
        """Index of the open number of each channel, shape (m,)."""
        return np.array(self.owners, dtype=np.intp)

    @property
    def inputs(self) -> ComplexArray:
        """Inputs z of all channels, shape (w, m, 6 + m)."""
        none = np.zeros((self.size[0], 0, self.size[1]), dtype=complex)
        return np.concatenate([none, *self._inputs], axis=1)[..., : 6 + len(self.owners)]


def open_stiffness(
    problem: Problem, lower: Array, upper: Array
) -> tuple[Array, Callable[[Array], tuple[Array, float]]]:
    """Return the static stiffness A at the middle of a box of mounts, (6, 6), and a function for y' A y in the box.

    The function takes a motion y. It returns coefficients by (1, s, s s') of n open numbers, shape (1 + n + n^2,), and
    a bound of the remainder. Over the box A = middle + outputs S (1 - feedback S)^-1 inputs.
    """
    equations = _BlockOnMounts(problem, np.zeros(1), lower, upper)
    middle, outputs = np.split(equations.body[0].real, [6], axis=1)
    inputs, feedback = np.split(equations.signals.inputs[0].real, [6], axis=1)
    incidence = (equations.signals.numbers[:, None] == np.arange(len(lower))).astype(float)
    loop = np.abs(feedback)

    def form(y: Array) -> tuple[Array, float]:
        out, travel = y @ outputs, inputs @ y
        second = incidence.T @ (out[:, None] * feedback * travel) @ incidence
        converges = not loop.any() or float(np.abs(np.linalg.eigvals(loop)).max()) < 1.0
        # sum of all powers of the feedback
        power_sum = (
            np.linalg.solve(np.eye(len(loop)) - loop, np.abs(travel)) if converges else np.full_like(travel, math.inf)
        )
        remainder = float(np.abs(out) @ loop @ loop @ power_sum)
        return np.concatenate([[y @ middle @ y], (out * travel) @ incidence, second.ravel()]), remainder

    return middle, form


def mount_loop(problem: Problem, omegas: Array, lower: Array, upper: Array) -> Loop:
    """Return the equations of a block over a box of open numbers of mounts as a feedback loop, at w frequencies.

    `omegas` are the angular frequencies [rad/s]; `lower` and `upper` have the shape (n,).
    """
    equations = _BlockOnMounts(problem, omegas, lower, upper)
    inverse = inverses(equations.body[..., :6])
    back = inverse @ equations.body[..., 6:]

    def without_motion(rows: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        return rows[..., :6] @ inverse, rows[..., 6:] - rows[..., :6] @ back

    inputs, feedback = without_motion(equations.signals.inputs)
    forces, travels = without_motion(equations.forces), without_motion(equations.travels)
    return Loop(equations.signals.numbers, forces, travels, inputs, -feedback)


class _BlockOnMounts:
    """Equations of a block on open mounts, by motion and channels.

    Attributes
    ----------
    body
        Restoring wrench, shape (w, 6, 6 + m).
    forces, travels
        Forces and travel of the mounts, shape (w, 3 mounts, 6 + m).
    """

    def __init__(self, problem: Problem, omegas: Array, lower: Array, upper: Array) -> None:
        mounting = mounting_in(problem.engine)
        low, high = number_ranges(problem, lower, upper)
        middles, drives = 0.5 * (low + high), _drives(problem, 0.5 * (upper - lower))
        root, centre = mass_root(mounting.block), np.array(mounting.block.centre_of_gravity)
        self.signals = signals = _Signals(
            len(omegas), sum(4 * sum(map(len, spring_drives.values())) for spring_drives in drives)
        )
        shape = len(omegas), 3 * len(mounting.mounts), signals.size[1]
        forces, travels = np.zeros(shape, dtype=complex), np.zeros(shape, dtype=complex)
        body = np.zeros((len(omegas), 6, signals.size[1]), dtype=complex)
        body[..., :6] = mounting.dynamic.impedance(omegas, root.T) - (omegas**2)[:, None, None] * np.eye(6)
        forces[..., :6] = mounting.dynamic.forces(omegas, root.T)
        for m, (place, mount) in enumerate(every_spring(mounting.mounts)):
            rows = slice(3 * place, 3 * place + 3)
            spring = _Spring(middles[m], np.subtract(mount.at_rest, mount.stiffness), drives[m], omegas)
            travels[:, rows] = spring.travel(signals, root, centre)
            force = spring.force(signals, travels[:, rows])
            forces[:, rows] += force
            body += spring.wrench_on_body(signals, force, root, centre)
        used = slice(0, 6 + len(signals.owners))
        self.body, self.forces, self.travels = body[..., used], forces[..., used], travels[..., used]


def is_looped(problem: Problem) -> bool:
    """Return True if a feedback loop can represent all open numbers: mounts, and numbers in which loads are affine."""
    mounts = problem.mount_decisions
    if not mounts or any(d not in mounts and not d.is_affine for d in problem.decisions):
        return False
    low, high = number_ranges(problem)
    if np.any(low[:, STIFFNESS] < 0.0) or np.any(low[:, LAG] < high[:, LAG]):
        return False
    moves = np.any((low < high)[:, POSITION], axis=1) | np.any((low < high)[:, TURNED], axis=1)
    # springs with frequency-dependent stiffness must not move
    dynamic = [bool(spring.dynamic) for _, spring in every_spring(mounting_in(problem.engine).mounts)]
    for decision in mounts:
        # the tangent of half an angle has to be one number for all mounts that a decision turns
        turns = {TURNED.start <= drive.number < TURNED.stop for drive in decision.mount_drives}
        if turns == {True, False} or (True in turns and len({abs(d.gain) for d in decision.mount_drives}) > 1):
            return False
    return not np.any(moves & dynamic)


def _drives(problem: Problem, halves: Array) -> list[dict[int, list[tuple[int, float]]]]:
    # for every spring, by its number, pairs of open number and change over half a side
    drives: list[dict[int, list[tuple[int, float]]]] = [{} for _ in problem.mount_numbers]
    for j, decision in enumerate(problem.mount_decisions):
        for drive in decision.mount_drives:
            drives[drive.mount].setdefault(drive.number, []).append((j, drive.gain * float(halves[j])))
    return drives


class _Spring:
    """Spring with its numbers at the middle of a box, further static stiffness, and drives of open numbers."""

    def __init__(
        self, numbers: Array, static: Array, drives: dict[int, list[tuple[int, float]]], omegas: Array
    ) -> None:  # fmt: skip
        self._numbers, self._static, self._drives, self._omegas = numbers, static, drives, omegas

    def _open(self, part: slice) -> list[tuple[int, int, float]]:
        # open entries of a part: index in it, open number, and change over half a side
        return [(k - part.start, j, h) for k in range(part.start, part.stop) for j, h in self._drives.get(k, [])]

    def _across(self) -> list[tuple[int, Array, Array]]:
        # for every open direction of the position: its number, the axes across, and their arms
        directions = []
        for axis, j, h in self._open(POSITION):
            axes_across = np.delete(np.eye(3), axis, axis=0)
            directions.append((j, axes_across, h * np.cross(axes_across, np.eye(3)[axis])))
        return directions

    def _motion(self, centre: Array) -> Array:
        return np.asarray(point_motion(NUMBERS, (self._numbers[POSITION] - centre).tolist()))

    def travel(self, signals: _Signals, root: Array, centre: Array) -> ComplexArray:
        """Return the travel of the mount by motion and feedback channels, shape (w, 3, 6 + channels)."""
        travel = signals.motion(self._motion(centre) @ root.T)
        for j, axes_across, arms in self._across():
            travel = travel + arms.T @ signals.channel(signals.motion(axes_across @ root.T[3:]), j)
        return travel

    def force(self, signals: _Signals, travel: ComplexArray) -> ComplexArray:
        """Return the force of the spring by motion and feedback channels, shape (w, 3, 6 + channels)."""
        own_travel = self._turned(signals, travel, -1.0)
        moving, omegas = (self._omegas > 0.0)[:, None, None], self._omegas[:, None, None]
        elastic = self._numbers[STIFFNESS, None] * own_travel
        for axis, j, h in self._open(STIFFNESS):
            elastic[:, [axis]] += signals.channel(h * own_travel[:, [axis]], j)
        loss = moving * self._numbers[LOSS] + omegas * self._numbers[LAG]
        force = (1.0 + 1j * loss) * elastic + (
            self._static[:, None] + 1j * omegas * self._numbers[DAMPING, None]
        ) * own_travel
        for axis, j, h in self._open(DAMPING):
            force[:, [axis]] += 1j * omegas * signals.channel(h * own_travel[:, [axis]], j)
        for _, j, h in self._open(slice(LOSS, LOSS + 1)):
            force = force + 1j * moving * signals.channel(h * elastic, j)
        return self._turned(signals, force, 1.0)

    def _turned(self, signals: _Signals, vectors: ComplexArray, sign: float) -> ComplexArray:
        """Return vectors rotated to the axes of the mount (sign -1) or back, with channels for open angles (E2)."""
        axes = range(3) if sign > 0.0 else range(2, -1, -1)
        for k in axes:
            angles = np.zeros(3)
            angles[k] = self._numbers[TURNED][k]
            rotation = np.asarray(turned_axes(NUMBERS, angles.tolist()))
            vectors = (rotation.T if sign > 0.0 else rotation) @ vectors
            for axis, j, h in self._open(TURNED):
                if axis != k:
                    continue
                # a turn by t adds w = tan(t / 2) J (vectors + turned vectors)
                turn, pair = sign * math.tan(0.5 * h) * _QUARTER, _PLANES[k]
                back = signals.channel(2.0 * turn @ vectors[:, pair], j, turn)
                vectors[:, pair] += back
        return vectors

    def wrench_on_body(self, signals: _Signals, force: ComplexArray, root: Array, centre: Array) -> ComplexArray:
        """Return the wrench of a mount force on the block in coordinates with unit mass, shape (w, 6, 6 + channels)."""
        moment = self._motion(centre)[:, 3:].T @ force
        for j, axes_across, arms in self._across():
            moment = moment + axes_across.T @ signals.channel(arms @ force, j)
        return np.asarray(root[:, :3] @ force + root[:, 3:] @ moment)
