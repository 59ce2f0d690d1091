"""Motion of run-up and shut-down over boxes of stiffness: two orders in their sides, and a remainder (E65).

With d from -1 to 1 in each side of a box, the state z has z' = A z + B p(t). Here A is A0 + sum d_j A_j + sum d_j d_k
A_jk + rest, and p are the loads of the exact model. The motion z0 at the middle and its orders solve

    z0' = A0 z0 + B p,   z_j' = A0 z_j + A_j z0,   z_jk' = A0 z_jk + A_j z_k + A_k z_j + A_jk z0     (j < k)

and z_jj' = A0 z_jj + A_j z_j + A_jj z0. The remainder, r = z - z0 - sum d_j z_j - sum d_j d_k z_jk, is a motion of the
design itself, under a force that follows from these orders:

    r' = A r + (0, f),   f = sum d_i d_j d_k A_i z_jk + sum d_j d_k A_jk (d_i z_i + d_i d_l z_il) + rest (z0 + ...)

Springs conserve energy and dampers dissipate it, so |r| <= integral of |f|, with |r|^2 = y' K y + y'^2 of the design.
Boxes may have any size in which springs restrain all motions; the remainder grows with time alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.run_ups.dampers import mapped, pairs_of, roots
from laufruhe.extensions.run_ups.matrices import RunMatrices
from laufruhe.extensions.run_ups.moments import MOMENTS
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.physics.modes import FREE_STIFFNESS
from laufruhe.prove.mounts.box_response import BoxModel

# phase of the fastest motion in a long step [rad]: target, and largest for which the moments suffice
REACH, FARTHEST = 0.35, 1.0
# smallest stiffness of a restrained motion, over the largest stiffness
MIN_STIFFNESS = 1e3 * FREE_STIFFNESS
# condition number of the modes above which the exact model takes no steps in modes
MAX_CONDITION = 1e8


class MotionEquations:
    """Equations of motion on boxes, in the modes of their middles; y has the unit 1 / `scale`.

    Attributes
    ----------
    above, halves, turn, roots
        Boxes, as `mapped` takes them.
    maps
        Maps from motion to its restoring force.
    matrix, first, second
        Matrices A0, A_j and A_jk, shapes (boxes, 2 n, 2 n), (boxes, open numbers, ...), (boxes, pairs, ...).
    load
        Matrix B from a wrench to the rate of the state, shape (boxes, 2 n, 6).
    softest
        Stiffness K at the lower vertex, shape (boxes, n, n).
    growth_rates
        Largest growth rate of a motion by negative damping [1/s], shape (boxes,).
    known, count
        Mask of the boxes with valid bounds, shape (boxes,), and count of boxes.

    Parameters
    ----------
    lower, upper
        Bounds of the boxes, shape (boxes, open numbers).
    """

    def __init__(self, model: BoxModel, matrices: RunMatrices, scale: float, lower: Array, upper: Array) -> None:
        self.scale, self.above, self.halves = scale, 0.5 * (lower + upper) - model.lower, 0.5 * (upper - lower)
        self.count, n, halves = len(lower), matrices.base.size, self.halves
        squares, modes = np.linalg.eigh(model.stiffness(0.5 * (lower + upper)))
        lower_eigenvalues, upper_eigenvalues = (np.linalg.eigvalsh(model.stiffness(x)) for x in (lower, upper))
        is_restrained = lower_eigenvalues[:, 0] > MIN_STIFFNESS * upper_eigenvalues[:, -1]
        self.turn = turn = np.zeros((len(lower), n, n)) + np.eye(n)
        turn[:, :6, :6] = modes
        change = halves[:, :, None, None] * model.slopes["stiffness"]
        slopes = np.swapaxes(modes, 1, 2)[:, None] @ change @ modes[:, None]
        self.roots = roots(np.where(is_restrained[:, None], squares, 1.0), slopes, n)
        self.maps = maps = mapped(matrices.motion, self.above, halves, turn, self.roots, True)
        zeros = np.zeros((len(lower), n, n))
        self.matrix = np.block([[zeros, zeros + scale * np.eye(n)], [-maps.position / scale, -maps.rate]])
        self.first = _force_rows(-np.concatenate([maps.positions / scale, maps.rates], axis=-1))
        self.second = _force_rows(-np.concatenate([np.zeros_like(maps.bends), maps.bends], axis=-1))
        self.load = np.pad(np.swapaxes(turn, 1, 2) @ matrices.base.load, [(0, 0), (n, 0), (0, 0)])
        self.softest = maps.position - maps.positions.sum(axis=1)
        uneven_maps = mapped(matrices.uneven_loss, self.above, halves, turn, self.roots, True)
        corner, corner_modes = np.linalg.eigh(np.swapaxes(modes, 1, 2) @ model.stiffness(lower) @ modes)
        root = (corner_modes * np.sqrt(np.maximum(corner, 0.0))[:, None]) @ np.swapaxes(corner_modes, 1, 2)
        uneven = uneven_maps.rate[:, :6, :6]
        common = matrices.loss_factor * root
        smallest = np.linalg.eigvalsh(0.5 * (uneven + np.swapaxes(uneven, 1, 2)) + common)[:, 0]
        changes = np.linalg.norm(uneven_maps.rates, axis=(-2, -1)).sum(axis=1)
        changes = changes + np.linalg.norm(uneven_maps.beyond_linear, axis=(-2, -1))
        self.growth_rates = np.maximum(changes - smallest, 0.0)
        # the exact model takes steps in modes only if they are distinct
        units = np.repeat([scale, 1.0], n)
        shapes = np.linalg.eig(self.matrix / units[:, None] * units)[1]
        is_resolved = np.linalg.cond(shapes) <= MAX_CONDITION
        self.known: Mask = is_restrained & (np.linalg.eigvalsh(self.softest)[:, 0] > 0.0) & is_resolved


def _force_rows(forces: Array) -> Array:
    return np.concatenate([np.zeros_like(forces), forces], axis=-2)


@dataclass(frozen=True, eq=False)
class RunMotion:
    """Motion over boxes at the ends of long steps, from rest.

    Attributes
    ----------
    middle, first, second
        States z0, z_j and z_jk, shapes (boxes, 2 n, times), (boxes, open numbers, ...) and (boxes, pairs, ...).
    remainder
        Bound of the remainder |r|, shape (boxes, times).
    """

    middle: Array
    first: Array
    second: Array
    remainder: Array


class Steps:
    """Matrices of long steps on boxes: from motion, and from moments of the load, to the motion after a step."""

    def __init__(self, box_equations: MotionEquations, step: float, orders: bool = True) -> None:
        self.equations, self.step = box_equations, step
        self.pairs = pairs_of(box_equations.halves.shape[1]) if orders else []
        count = None if orders else 0
        first, second = box_equations.first[:, :count], box_equations.second[:, :count]
        identity = np.zeros_like(box_equations.matrix) + np.eye(box_equations.matrix.shape[-1])
        powers = [identity, np.zeros_like(first), np.zeros_like(second)]
        moves = [np.zeros_like(power) for power in powers]
        loads: tuple[list[Array], ...] = ([], [], [])
        for k in range(MOMENTS):
            for load_powers, sums, power in zip(loads, moves, powers, strict=True):
                sums += power * (step**k / math.factorial(k))
                load_powers.append(power @ (box_equations.load if power.ndim == 3 else box_equations.load[:, None]))
            power, first_power, second_power = powers
            a = box_equations.matrix[:, None]
            powers = [
                box_equations.matrix @ power,
                a @ first_power + first @ power[:, None],
                a @ second_power + second @ power[:, None],
            ]
            for number, (i, j) in enumerate(self.pairs):
                powers[2][:, number] += first[:, i] @ first_power[:, j]
                if i != j:
                    powers[2][:, number] += first[:, j] @ first_power[:, i]
        self.moves = moves
        # columns: components of the wrench for each moment
        self.loads = [np.concatenate(power, axis=-1) for power in loads]

    def middle(self, moments: Array) -> Array:
        """Return the states at the middle of the boxes, from rest under moments.

        Moments have the shape (boxes, moments x 6, steps), states (boxes, 2 n, steps + 1).
        """
        return _followed(self.moves[0], (self.loads[0] @ moments)[:, None])[:, 0]

    def orders(self, moments: Array, middle: Array) -> tuple[Array, Array]:
        """Return the derivatives z_j and z_jk of the motion by the open numbers, first and second, at all times.

        `moments` are those of the loads, and `middle` the motion of the middle design.
        """
        start_motion = middle[:, None, :, :-1]
        first = _followed(self.moves[0], self.moves[1] @ start_motion + self.loads[1] @ moments[:, None])
        sources = self.moves[2] @ start_motion + self.loads[2] @ moments[:, None]
        for number, (j, k) in enumerate(self.pairs):
            sources[:, number] += self.moves[1][:, j] @ first[:, k, :, :-1]
            if j != k:
                sources[:, number] += self.moves[1][:, k] @ first[:, j, :, :-1]
        return first, _followed(self.moves[0], sources)


def _followed(moves: Array, sources: Array) -> Array:
    boxes, columns, m, count = sources.shape
    states = np.zeros((count + 1, boxes, m, columns))
    states[1:] = np.moveaxis(sources, (3, 0, 2, 1), (0, 1, 2, 3))
    for k in range(count):
        states[k + 1] += moves @ states[k]
    return np.ascontiguousarray(np.moveaxis(states, (0, 1, 2, 3), (3, 0, 2, 1)))


def motion_of(steps: Steps, moments: Array, impulses: Array, peak_loads: Array) -> RunMotion:
    """Return the motion of a run-up over boxes of mounts, each under its own loads.

    Parameters
    ----------
    moments
        Shape (boxes, moments x 6, steps).
    impulses, peak_loads
        Bounds of the loads, as in `LongSteps`, shape (boxes, steps).
    """
    middle = steps.middle(moments)
    first, second = steps.orders(moments, middle)
    box_equations, step = steps.equations, steps.step
    at_ends = _force(box_equations, middle, first, second)
    between_ends = _between(box_equations, step, middle, first, second, impulses, peak_loads)
    increments = step * (0.5 * (at_ends[:, 1:] + at_ends[:, :-1]) + between_ends)
    remainder = np.concatenate([np.zeros((box_equations.count, 1)), np.cumsum(increments, axis=1)], axis=1)
    times = step * np.arange(remainder.shape[1])
    return RunMotion(middle, first, second, remainder * np.exp(box_equations.growth_rates[:, None] * times))


def _force(box_equations: MotionEquations, middle: Array, first: Array, second: Array) -> Array:
    # bound of |f| over the boxes at the ends of steps, shape (boxes, times)
    n = middle.shape[1] // 2
    total = np.zeros((box_equations.count, middle.shape[-1]))
    for j in range(first.shape[1]):
        order_force = box_equations.first[:, j, None, n:] @ second
        total += np.linalg.norm(order_force, axis=2).sum(axis=1)
    rates = [np.abs(middle[:, n:]), np.abs(first[:, :, n:]).sum(axis=1), np.abs(second[:, :, n:]).sum(axis=1)]
    bends = np.abs(box_equations.maps.bends).sum(axis=1)
    total += np.linalg.norm(bends @ (rates[1] + rates[2]), axis=1)
    return np.asarray(total + np.linalg.norm(box_equations.maps.remainder @ sum(rates), axis=1))


def _between(
    box_equations: MotionEquations,
    step: float,
    middle: Array,
    first: Array,
    second: Array,
    impulses: Array,
    peak_loads: Array,
) -> Array:
    """Return a bound of how much the mean of |f| over a time step exceeds that of its ends, shape (boxes, steps).

    A curve leaves its chord by at most an eighth of the squared step times its largest second derivative. |y'| of the
    middle, whose load jumps, differs from that of the nearer end by at most half a step times its derivative.
    """
    spectral = (box_equations.matrix, box_equations.first)
    frobenius = (box_equations.second, box_equations.maps.remainder)
    norms = [np.linalg.norm(matrix, 2, axis=(-2, -1)) for matrix in spectral]
    norms += [np.linalg.norm(matrix, axis=(-2, -1)) for matrix in frobenius]
    matrix_norm, first_norm, second_norm, rest_norm = (
        norm.reshape(box_equations.count, -1).sum(axis=1)[:, None] for norm in norms
    )
    sizes = [np.linalg.norm(matrix[..., :-1], axis=-2) for matrix in (middle, first, second)]
    grown = np.exp(matrix_norm * step)
    # bounds of states within a step, then of their derivatives
    middle_size = grown * (sizes[0] + impulses)
    first_size = grown * (sizes[1].sum(axis=1) + step * first_norm * middle_size)
    second_size = grown * (sizes[2].sum(axis=1) + step * (first_norm * first_size + second_norm * middle_size))
    rate = matrix_norm * middle_size + peak_loads
    rates = [
        rate,
        matrix_norm * first_size + first_norm * middle_size,
        matrix_norm * second_size + first_norm * first_size + second_norm * middle_size,
    ]
    second_derivatives = [
        matrix_norm * rates[1] + first_norm * rates[0],
        matrix_norm * rates[2] + first_norm * rates[1] + second_norm * rates[0],
    ]
    chord = first_norm * second_derivatives[1] + (second_norm + rest_norm) * (
        second_derivatives[0] + second_derivatives[1]
    )
    return np.asarray(step**2 / 8.0 * chord + 0.5 * step * rest_norm * rate)
