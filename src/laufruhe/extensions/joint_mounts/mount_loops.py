"""A block on mounts as a loop through what is open of them: exact, and linear but for the numbers (E68).

About the middle of a box the open numbers are s from -1 to 1. Wherever one of them multiplies something, that is a
channel z, and w = s z what comes back:

    D y + M w = r,    z = C y + F w,    f = V y + E w,    w_i = s_j(i) z_i

A stiffness multiplies the travel along its axis; a place multiplies the turn of the block across it, which moves the
mount, and the force of the mount, which turns the block; an angle goes round both ways by the tangent of its half
(Cayley), which is the s of a box of angles. With G = C D^-1 M - F, z0 = C D^-1 r and P = E - V D^-1 M this is

    f = V D^-1 r + P S z0 - P S G S z0 + P S (G S)^2 (1 + G S)^-1 z0

so that E37 holds of whatever is open.
"""

from __future__ import annotations

import math
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

# turns from own axes to those of C2: about z after y after x (E2)
_PLANES, _QUARTER = ([1, 2], [2, 0], [0, 1]), np.array([[0.0, -1.0], [1.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Loop:
    """About the middle of a box, at frequencies, shapes (frequencies, ...).

    Attributes
    ----------
    own
        The open number of every channel, shape (m,).
    forces, travels
        f0 and P of every mount by r: (w, 3 mounts, 6) and (w, 3 mounts, m) each.
    met, gain
        From r to z0, (w, m, 6), and G, (w, m, m).
    """

    own: Indices
    forces: tuple[ComplexArray, ComplexArray]
    travels: tuple[ComplexArray, ComplexArray]
    met: ComplexArray
    gain: ComplexArray


class _Signals:
    """Channels as they are met; a signal is what it has of motion and of what comes back, (w, rows, 6 + channels)."""

    def __init__(self, frequencies: int, most: int) -> None:
        self.size, self.own = (frequencies, 6 + most), list[int]()
        self._seen: list[ComplexArray] = []

    def motion(self, rows: Array) -> ComplexArray:
        """Of the motion alone, rows (r, 6)."""
        out = np.zeros((self.size[0], len(rows), self.size[1]), dtype=complex)
        out[:, :, :6] = rows
        return out

    def channel(self, signal: ComplexArray, number: int, again: Array | None = None) -> ComplexArray:
        """What a number, from -1 to 1, makes of a signal; of itself again where that comes round."""
        first, count = 6 + len(self.own), signal.shape[1]
        self.own += [number] * count
        self._seen.append(signal.copy())
        if again is not None:
            self._seen[-1][:, :, first : first + count] += again
        out = np.zeros_like(signal)
        out[:, np.arange(count), first + np.arange(count)] = 1.0
        return out

    @property
    def numbers(self) -> Indices:
        """The open number of every channel, (m,)."""
        return np.array(self.own, dtype=np.intp)

    @property
    def seen(self) -> ComplexArray:
        """z of all channels, (w, m, 6 + m)."""
        none = np.zeros((self.size[0], 0, self.size[1]), dtype=complex)
        return np.concatenate([none, *self._seen], axis=1)[..., : 6 + len(self.own)]


@dataclass(frozen=True, eq=False)
class OpenStiffness:
    """A at rest about the middle of a box: middle + moved S (1 - again S)^-1 seen.

    Attributes
    ----------
    own
        The open number of every channel, shape (m,).
    middle, moved, seen, again
        Shapes (6, 6), (6, m), (m, 6) and (m, m).
    """

    own: Indices
    middle: Array
    moved: Array
    seen: Array
    again: Array

    def form(self, y: Array, count: int) -> tuple[Array, float]:
        """y' A y by (1, s, s s') of so many numbers, shape (1 + n + n^2,), and a bound of the rest."""
        out, back = y @ self.moved, self.seen @ y
        own = (self.own[:, None] == np.arange(count)).astype(float)
        second = own.T @ (out[:, None] * self.again * back) @ own
        rest = np.abs(out) @ np.abs(self.again) @ np.abs(self.again) @ self._round(np.abs(back))
        return np.concatenate([[y @ self.middle @ y], (out * back) @ own, second.ravel()]), float(rest)

    def _round(self, size: Array) -> Array:
        """What may come back of as much, however often it goes round: the sum of all powers of what does so once."""
        once = np.abs(self.again)
        ends = not once.any() or float(np.abs(np.linalg.eigvals(once)).max()) < 1.0
        return np.asarray(np.linalg.solve(np.eye(len(once)) - once, size)) if ends else np.full_like(size, math.inf)


def open_stiffness(problem: Problem, lower: Array, upper: Array) -> OpenStiffness:
    """Stiffness at rest of a problem whose open numbers of mounts lie between these."""
    given = _Opened(problem, np.zeros(1), lower, upper)
    body, seen = given.body[0].real, given.signals.seen[0].real
    return OpenStiffness(given.signals.numbers, body[:, :6], body[:, 6:], seen[:, :6], seen[:, 6:])


def mount_loop(problem: Problem, omegas: Array, lower: Array, upper: Array) -> Loop:
    """The loop of a problem whose open numbers of mounts lie between these.

    Parameters
    ----------
    omegas
        [rad/s], shape (w,).
    """
    given = _Opened(problem, omegas, lower, upper)
    inverse = inverses(given.body[..., :6])
    back = inverse @ given.body[..., 6:]

    def answered(rows: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        return rows[..., :6] @ inverse, rows[..., 6:] - rows[..., :6] @ back

    met, fed = answered(given.signals.seen)
    return Loop(given.signals.numbers, answered(given.forces), answered(given.travels), met, -fed)


class _Opened:
    """A block on open mounts before its motion is solved for.

    Attributes
    ----------
    body, forces, travels
        What holds the block, and what its mounts feel, by motion and channels: shapes (w, 6, 6 + m) and (w, 3 mounts,
        6 + m).
    """

    def __init__(self, problem: Problem, omegas: Array, lower: Array, upper: Array) -> None:
        mounting = mounting_in(problem.engine)
        low, high = number_ranges(problem, lower, upper)
        middles, drives = 0.5 * (low + high), _drives(problem, 0.5 * (upper - lower))
        root, centre = mass_root(mounting.block), np.array(mounting.block.centre_of_gravity)
        self.signals = signals = _Signals(len(omegas), sum(4 * sum(map(len, each.values())) for each in drives))
        shape = len(omegas), 3 * len(mounting.mounts), signals.size[1]
        forces, travels = np.zeros(shape, dtype=complex), np.zeros(shape, dtype=complex)
        body = np.zeros((len(omegas), 6, signals.size[1]), dtype=complex)
        body[..., :6] = mounting.dynamic.impedance(omegas, root.T) - (omegas**2)[:, None, None] * np.eye(6)
        forces[..., :6] = mounting.dynamic.forces(omegas, root.T)
        for m, (place, given) in enumerate(every_spring(mounting.mounts)):
            own = slice(3 * place, 3 * place + 3)
            spring = _Spring(middles[m], np.subtract(given.at_rest, given.stiffness), drives[m], omegas)
            travels[:, own] = spring.moved(signals, root, centre)
            force = spring.force(signals, travels[:, own])
            forces[:, own] += force
            body += spring.on_body(signals, force, root, centre)
        whole = slice(0, 6 + len(signals.own))
        self.body, self.forces, self.travels = body[..., whole], forces[..., whole], travels[..., whole]


def is_looped(problem: Problem) -> bool:
    """Whether all that is open is what loads are affine in, and numbers of mounts; few of those that turn alike."""
    mounts = problem.mount_decisions
    if not mounts or any(d not in mounts and not d.is_affine for d in problem.decisions):
        return False
    low, high = number_ranges(problem)
    if np.any(low[:, STIFFNESS] < 0.0) or np.any(low[:, LAG] < high[:, LAG]):
        return False
    moves = np.any((low < high)[:, POSITION], axis=1) | np.any((low < high)[:, TURNED], axis=1)
    # what depends on frequency stays where it is
    dynamic = [bool(spring.dynamic) for _, spring in every_spring(mounting_in(problem.engine).mounts)]
    return _turns_evenly(problem) and not np.any(moves & dynamic)


def _turns_evenly(problem: Problem) -> bool:
    """Whether the tangent of half an angle is one number in a box, for all mounts that a decision turns."""
    for decision in problem.mount_decisions:
        turned = {TURNED.start <= drive.number < TURNED.stop for drive in decision.mount_drives}
        if turned == {True, False} or (True in turned and len({abs(d.gain) for d in decision.mount_drives}) > 1):
            return False
    return True


def _drives(problem: Problem, halves: Array) -> list[dict[int, list[tuple[int, float]]]]:
    """Of every spring by its number: the open number that moves it, and by how much half a side does."""
    found: list[dict[int, list[tuple[int, float]]]] = [{} for _ in problem.mount_numbers]
    for j, decision in enumerate(problem.mount_decisions):
        for drive in decision.mount_drives:
            found[drive.mount].setdefault(drive.number, []).append((j, drive.gain * float(halves[j])))
    return found


class _Spring:
    """One spring: its numbers at the middle of a box, what of it is stiff at rest beside them, and what moves them."""

    def __init__(
        self, numbers: Array, static: Array, drives: dict[int, list[tuple[int, float]]], omegas: Array
    ) -> None:  # fmt: skip
        self._numbers, self._static, self._drives, self._omegas = numbers, static, drives, omegas

    def _moves(self, part: slice) -> list[tuple[int, int, float]]:
        """Entries of a part that are open: place in it, open number, and half of what it may differ by."""
        return [(k - part.start, j, h) for k in range(part.start, part.stop) for j, h in self._drives.get(k, [])]

    def _across(self) -> list[tuple[int, Array, Array]]:
        """Of every direction in which the place is open the number, the axes across, and what these turn it by."""
        found = []
        for axis, j, h in self._moves(POSITION):
            across = np.delete(np.eye(3), axis, axis=0)
            found.append((j, across, h * np.cross(across, np.eye(3)[axis])))
        return found

    def _motion(self, centre: Array) -> Array:
        """G, shape (3, 6)."""
        return np.asarray(point_motion(NUMBERS, (self._numbers[POSITION] - centre).tolist()))

    def moved(self, signals: _Signals, root: Array, centre: Array) -> ComplexArray:
        """Travel of the mount, (w, 3, 6 + channels)."""
        travel = signals.motion(self._motion(centre) @ root.T)
        for j, across, arms in self._across():
            travel = travel + arms.T @ signals.channel(signals.motion(across @ root.T[3:]), j)
        return travel

    def force(self, signals: _Signals, travel: ComplexArray) -> ComplexArray:
        """Force on the mount, (w, 3, 6 + channels)."""
        along = self._turned(signals, travel, -1.0)
        moving, omegas = (self._omegas > 0.0)[:, None, None], self._omegas[:, None, None]
        plain = self._numbers[STIFFNESS, None] * along
        for axis, j, h in self._moves(STIFFNESS):
            plain[:, [axis]] += signals.channel(h * along[:, [axis]], j)
        lost = moving * self._numbers[LOSS] + omegas * self._numbers[LAG]
        force = (1.0 + 1j * lost) * plain + (self._static[:, None] + 1j * omegas * self._numbers[DAMPING, None]) * along
        for axis, j, h in self._moves(DAMPING):
            force[:, [axis]] += 1j * omegas * signals.channel(h * along[:, [axis]], j)
        for _, j, h in self._moves(slice(LOSS, LOSS + 1)):
            force = force + 1j * moving * signals.channel(h * plain, j)
        return self._turned(signals, force, 1.0)

    def _turned(self, signals: _Signals, given: ComplexArray, way: float) -> ComplexArray:
        """To own axes, way -1, or back (E2): about x, then y, then z, each with what is open of its angle."""
        axes = range(3) if way > 0.0 else range(2, -1, -1)
        for k in axes:
            angles = np.zeros(3)
            angles[k] = self._numbers[TURNED][k]
            own = np.asarray(turned_axes(NUMBERS, angles.tolist()))
            given = (own.T if way > 0.0 else own) @ given
            for axis, j, h in self._moves(TURNED):
                if axis != k:
                    continue
                # a turn by t is in + w, w = tan(t / 2) J (in + out)
                turn, pair = way * math.tan(0.5 * h) * _QUARTER, _PLANES[k]
                back = signals.channel(2.0 * turn @ given[:, pair], j, turn)
                given[:, pair] += back
        return given

    def on_body(self, signals: _Signals, force: ComplexArray, root: Array, centre: Array) -> ComplexArray:
        """What the force is on the body, in coordinates in which its mass is one, (w, 6, 6 + channels)."""
        moment = self._motion(centre)[:, 3:].T @ force
        for j, across, arms in self._across():
            moment = moment + across.T @ signals.channel(arms @ force, j)
        return np.asarray(root[:, :3] @ force + root[:, 3:] @ moment)
