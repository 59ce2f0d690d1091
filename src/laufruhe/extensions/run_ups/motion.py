"""Motion of run-up and shut-down over boxes of stiffness: two orders in their sides, and what is left (E65).

With d from -1 to 1 in every side of a box, z' = A z + B p(t) with A = A0 + sum d_j A_j + sum d_j d_k A_jk + rest, and p
the loads of the exact model. Motion at the middle and its orders solve

    z0' = A0 z0 + B p,   z_j' = A0 z_j + A_j z0,   z_jk' = A0 z_jk + A_j z_k + A_k z_j + A_jk z0     (j < k)

and z_jj' = A0 z_jj + A_j z_j + A_jj z0. What is left, r = z - z0 - sum d_j z_j - sum d_j d_k z_jk, is a motion of the
design itself, under a force that these tell:

    r' = A r + (0, f),   f = sum d_i d_j d_k A_i z_jk + sum d_j d_k A_jk (d_i z_i + d_i d_l z_il) + rest (z0 + ...)

Springs keep their energy and dampers take some: |r| <= integral of |f| with |r|^2 = y' K y + y'^2 of the design.
Nothing is asked of the size of a box but that all motions are held, and what is left grows with time alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.run_ups.dampers import Maps, Roots, mapped, pairs_of, roots
from laufruhe.extensions.run_ups.matrices import RunMatrices
from laufruhe.extensions.run_ups.moments import MOMENTS
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.physics.modes import FREE_STIFFNESS
from laufruhe.prove.mounts.box_response import BoxModel

# a long step times the quickest motion: as it is chosen, and as far as moments reach
REACH, FARTHEST = 0.35, 1.0
# stiffness of the softest motion from which it is held, as a share of that of the stiffest
LEAST_HELD = 1e3 * FREE_STIFFNESS
# shapes of modes from which exact steps are none in modes
ALIKE = 1e8


@dataclass(frozen=True, eq=False)
class MotionEquations:
    """Equations of motion on boxes, in the modes of their middles; y is counted in 1 / `scale`.

    Attributes
    ----------
    above, halves, turn, roots
        Boxes, as `mapped` takes them.
    maps
        Maps from motion to its force.
    matrix, first, second
        A0, A_j and A_jk, shapes (boxes, 2 n, 2 n), (boxes, open numbers, ...), (boxes, pairs, ...).
    load
        B, shape (boxes, 2 n, 6).
    softest
        K of the lower corner, shape (boxes, n, n).
    drives
        Largest growth of a rate where losses drive [1/s], shape (boxes,).
    known
        Mask of boxes for which the bounds hold, shape (boxes,).
    """

    scale: float
    above: Array
    halves: Array
    turn: Array
    roots: Roots
    maps: Maps
    matrix: Array
    first: Array
    second: Array
    load: Array
    softest: Array
    drives: Array
    known: Mask

    @property
    def count(self) -> int:
        """Number of boxes."""
        return len(self.halves)


def equations(model: BoxModel, matrices: RunMatrices, scale: float, lower: Array, upper: Array) -> MotionEquations:
    """Return the equations of motion on boxes, shapes (boxes, open numbers)."""
    above, halves, n = 0.5 * (lower + upper) - model.lower, 0.5 * (upper - lower), matrices.size
    squares, modes = np.linalg.eigh(model.stiffness(0.5 * (lower + upper)))
    soft, stiff = (np.linalg.eigvalsh(model.stiffness(x)) for x in (lower, upper))
    is_held = soft[:, 0] > LEAST_HELD * stiff[:, -1]
    turn = np.zeros((len(lower), n, n)) + np.eye(n)
    turn[:, :6, :6] = modes
    slopes = np.swapaxes(modes, 1, 2)[:, None] @ (halves[:, :, None, None] * model.stiffness_slopes) @ modes[:, None]
    root_maps = roots(np.where(is_held[:, None], squares, 1.0), slopes, n)
    maps = mapped(matrices.motion, above, halves, turn, root_maps, True)
    beyond = mapped(matrices.uneven_loss, above, halves, turn, root_maps, True)
    corner = np.swapaxes(modes, 1, 2) @ model.stiffness(lower) @ modes
    first = -np.concatenate([maps.positions / scale, maps.rates], axis=-1)
    second = -np.concatenate([np.zeros_like(maps.bends), maps.bends], axis=-1)
    zeros = np.zeros((len(lower), n, n))
    matrix = np.block([[zeros, zeros + scale * np.eye(n)], [-maps.position / scale, -maps.rate]])
    softest = maps.position - maps.positions.sum(axis=1)
    is_held &= np.linalg.eigvalsh(softest)[:, 0] > 0.0
    load = np.swapaxes(turn, 1, 2) @ matrices.base.load
    drives = _drives(beyond, matrices.loss_factor * _root(corner))
    return MotionEquations(
        scale, above, halves, turn, root_maps, maps, matrix, _under(first), _under(second),
        np.pad(load, [(0, 0), (n, 0), (0, 0)]), softest, drives, is_held & _is_resolved(matrix, scale),
    )  # fmt: skip


def _under(forces: Array) -> Array:
    return np.concatenate([np.zeros_like(forces), forces], axis=-2)


def _root(matrices: Array) -> Array:
    squares, modes = np.linalg.eigh(matrices)
    return np.asarray((modes * np.sqrt(np.maximum(squares, 0.0))[:, None]) @ np.swapaxes(modes, 1, 2))


def _drives(beyond: Maps, even: Array) -> Array:
    uneven = beyond.rate[:, :6, :6]
    smallest = np.linalg.eigvalsh(0.5 * (uneven + np.swapaxes(uneven, 1, 2)) + even)[:, 0]
    change = np.linalg.norm(beyond.rates, axis=(-2, -1)).sum(axis=1) + np.linalg.norm(beyond.bent, axis=(-2, -1))
    return np.asarray(np.maximum(change - smallest, 0.0))


def _is_resolved(matrix: Array, scale: float) -> Mask:
    n = matrix.shape[-1] // 2
    units = np.repeat([scale, 1.0], n)
    shapes = np.linalg.eig(matrix / units[:, None] * units)[1]
    return np.asarray(np.linalg.cond(shapes) <= ALIKE)


@dataclass(frozen=True, eq=False)
class RunMotion:
    """Motion over boxes at the ends of long steps, from rest on.

    Attributes
    ----------
    middle, first, second
        z0, z_j and z_jk, shapes (boxes, 2 n, times), (boxes, open numbers, ...) and (boxes, pairs, ...).
    left
        Bound of |r|, shape (boxes, times).
    """

    middle: Array
    first: Array
    second: Array
    left: Array


class Steps:
    """Long steps on boxes: matrices from motion and from moments of the load to the motion after a step."""

    def __init__(self, of: MotionEquations, step: float, orders: bool = True) -> None:
        self.of, self.step = of, step
        self.pairs = pairs_of(of.halves.shape[1]) if orders else []
        first, second = (of.first, of.second) if orders else (of.first[:, :0], of.second[:, :0])
        now = np.zeros_like(of.matrix) + np.eye(of.matrix.shape[-1])
        powers = [now, np.zeros_like(first), np.zeros_like(second)]
        moves = [np.zeros_like(power) for power in powers]
        loads: tuple[list[Array], ...] = ([], [], [])
        for k in range(MOMENTS):
            for into, sums, power in zip(loads, moves, powers, strict=True):
                sums += power * (step**k / math.factorial(k))
                into.append(power @ (of.load if power.ndim == 3 else of.load[:, None]))
            powers = self._next(powers, first, second)
        self.moves = moves
        # moments stand beside the components of the wrench
        self.loads = [np.concatenate(power, axis=-1) for power in loads]

    def _next(self, powers: list[Array], first: Array, second: Array) -> list[Array]:
        now, by, bent = powers
        a = self.of.matrix[:, None]
        following = [self.of.matrix @ now, a @ by + first @ now[:, None], a @ bent + second @ now[:, None]]
        for number, (j, k) in enumerate(self.pairs):
            following[2][:, number] += first[:, j] @ by[:, k]
            if j != k:
                following[2][:, number] += first[:, k] @ by[:, j]
        return following

    def middle(self, moments: Array) -> Array:
        """z0 from rest under moments (boxes, moments x 6, steps), shape (boxes, 2 n, steps + 1)."""
        return _followed(self.moves[0], (self.loads[0] @ moments)[:, None])[:, 0]

    def orders(self, moments: Array, middle: Array) -> tuple[Array, Array]:
        """z_j and z_jk."""
        before = middle[:, None, :, :-1]
        first = _followed(self.moves[0], self.moves[1] @ before + self.loads[1] @ moments[:, None])
        driven = self.moves[2] @ before + self.loads[2] @ moments[:, None]
        for number, (j, k) in enumerate(self.pairs):
            driven[:, number] += self.moves[1][:, j] @ first[:, k, :, :-1]
            if j != k:
                driven[:, number] += self.moves[1][:, k] @ first[:, j, :, :-1]
        return first, _followed(self.moves[0], driven)


def _followed(moves: Array, driven: Array) -> Array:
    boxes, columns, m, count = driven.shape
    out = np.zeros((count + 1, boxes, m, columns))
    out[1:] = np.moveaxis(driven, (3, 0, 2, 1), (0, 1, 2, 3))
    for k in range(count):
        out[k + 1] += moves @ out[k]
    return np.ascontiguousarray(np.moveaxis(out, (0, 1, 2, 3), (3, 0, 2, 1)))


def motion_of(steps: Steps, moments: Array, pushes: Array, highest: Array) -> RunMotion:
    """Return the motion on boxes, each under its own moments.

    Parameters
    ----------
    moments
        Shape (boxes, moments x 6, steps).
    pushes, highest
        Bounds of the loads, as `LongSteps` has them, shape (boxes, steps).
    """
    middle = steps.middle(moments)
    first, second = steps.orders(moments, middle)
    of, h = steps.of, steps.step
    at_ends = _force(of, middle, first, second)
    between = _between(of, h, middle, first, second, pushes, highest)
    added = h * (0.5 * (at_ends[:, 1:] + at_ends[:, :-1]) + between)
    left = np.concatenate([np.zeros((of.count, 1)), np.cumsum(added, axis=1)], axis=1)
    times = h * np.arange(left.shape[1])
    return RunMotion(middle, first, second, left * np.exp(of.drives[:, None] * times))


def _force(of: MotionEquations, middle: Array, first: Array, second: Array) -> Array:
    # bound of |f| over the boxes at the ends of steps, shape (boxes, times)
    n = middle.shape[1] // 2
    total = np.zeros((of.count, middle.shape[-1]))
    for j in range(first.shape[1]):
        pushed = of.first[:, j, None, n:] @ second
        total += np.linalg.norm(pushed, axis=2).sum(axis=1)
    rates = [np.abs(middle[:, n:]), np.abs(first[:, :, n:]).sum(axis=1), np.abs(second[:, :, n:]).sum(axis=1)]
    bends = np.abs(of.maps.bends).sum(axis=1)
    total += np.linalg.norm(bends @ (rates[1] + rates[2]), axis=1)
    return np.asarray(total + np.linalg.norm(of.maps.rest @ sum(rates), axis=1))


def _between(
    of: MotionEquations, h: float, middle: Array, first: Array, second: Array, pushes: Array, highest: Array
) -> Array:
    """Return a bound of the mean of |f| over a step beyond that of its ends, shape (boxes, steps).

    A curve leaves its chord by an eighth of the square of the step times its largest second derivative, and |y'| of the
    middle, whose loads jump, that of its nearer end by half a step.
    """
    a, b = (np.linalg.norm(matrix, 2, axis=(-2, -1)).reshape(of.count, -1) for matrix in (of.matrix, of.first))
    c, rest = (np.linalg.norm(matrix, axis=(-2, -1)).reshape(of.count, -1) for matrix in (of.second, of.maps.rest))
    a, b, c, rest = (matrix.sum(axis=1)[:, None] for matrix in (a, b, c, rest))
    sizes = [np.linalg.norm(matrix[..., :-1], axis=-2) for matrix in (middle, first, second)]
    grown = np.exp(a * h)
    # sizes within a step, then those of derivatives
    z0 = grown * (sizes[0] + pushes)
    z1 = grown * (sizes[1].sum(axis=1) + h * b * z0)
    z2 = grown * (sizes[2].sum(axis=1) + h * (b * z1 + c * z0))
    rate = a * z0 + highest
    rates = [rate, a * z1 + b * z0, a * z2 + b * z1 + c * z0]
    bends = [a * rates[1] + b * rates[0], a * rates[2] + b * rates[1] + c * rates[0]]
    chord = b * bends[1] + (c + rest) * (bends[0] + bends[1])
    return np.asarray(h**2 / 8.0 * chord + 0.5 * h * rest * rate)
