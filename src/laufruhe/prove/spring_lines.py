"""Response of an order over a box of stiffnesses, in the forces that open springs add to those of the middle (E42).

A mount's spring along one of its axes has rank one. With the deflection u_i = a_i' y of the springs whose stiffness
x_i = c_i + s_i h_i is open, s_i from -1 to 1,

    D(c) y + sum_i a_i (1 + i eta_i + i W lag_i) h_i t_i = r,    t_i = s_i u_i         (E42)

so that motion, deflections and mount forces are affine in the t_i. What is nonlinear is t_i = s_i u_i alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine.mount import every_spring
from laufruhe.problem.channels import Channel
from laufruhe.prove.box_response import BoxModel, Lines, Matrices, is_travel

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Indices = NDArray[np.intp]

# of the largest part that a variable is counted in, the least
SMALL = 0.1


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs of rank one whose stiffness is open.

    Attributes
    ----------
    decisions
        Number of the open number of each, shape (n,).
    gains
        What one unit of it adds, shape (n,).
    arms
        a_i, in coordinates in which the mass is one, shape (n, 6).
    axes
        Direction of each among the forces of the mounts, shape (3 mounts, n).
    losses, lags
        eta_i, and viscous damping over stiffness [s], shape (n,).
    """

    decisions: Indices
    gains: Array
    arms: Array
    axes: Array
    losses: Array
    lags: Array

    def factors(self, omega: float) -> ComplexArray:
        """1 + i (eta_i + W lag_i), shape (n,) (E48)."""
        return np.asarray(1.0 + 1j * (self.losses + omega * self.lags))


def springs_of(model: BoxModel) -> Springs:
    """The open springs of a problem that `divides`."""
    mounting = model.mounting(model.lower)
    seen = mounting.motions @ model.root.T
    pairs = [(j, drive) for j, decision in enumerate(model.problem.mount_decisions) for drive in decision.mount_drives]
    axes, every = np.zeros((3 * len(mounting.mounts), len(pairs))), every_spring(mounting.mounts)
    for i, (_, drive) in enumerate(pairs):
        place, spring = every[drive.mount]
        axes[3 * place : 3 * place + 3, i] = spring.orientation[drive.number]
    return Springs(
        np.array([j for j, _ in pairs], dtype=np.intp),
        np.array([drive.gain for _, drive in pairs]),
        axes.T @ seen.reshape(-1, 6),
        axes,
        np.array([every[drive.mount][1].loss_factor for _, drive in pairs]),
        np.array([every[drive.mount][1].lag for _, drive in pairs]),
    )


@dataclass(frozen=True, eq=False)
class Response:
    """One order over a box: real and imaginary parts as linear functions of (1, v), shapes (2, ..., d).

    Attributes
    ----------
    motion
        y in units of its size at the middle, shape (2, 6, d).
    shares
        t_i in the same units, shape (2, n, d).
    felt
        Forces or travel, the rows that count, with their factors, shape (2, rows, d).
    added
        h_i of every spring, shape (n,).
    reach
        What |v|^2 is not over for any design of the box.
    """

    motion: Array
    shares: Array
    felt: Array
    added: Array
    reach: float

    @property
    def size(self) -> int:
        """d."""
        return int(self.motion.shape[-1])


@dataclass(frozen=True, eq=False)
class Middle:
    """A box about its middle."""

    half: Array
    lowest: Matrices
    here: Matrices
    highest: float


def middle_of(model: BoxModel, lower: Array, upper: Array) -> Middle:
    """What all orders have in common."""
    top = float(np.linalg.eigvalsh(model.matrices(upper).stiffness)[-1])
    return Middle(0.5 * (upper - lower), model.matrices(lower), model.matrices(0.5 * (lower + upper)), top)


def response(
    model: BoxModel, springs: Springs, at: Middle, lines: Lines, k: int, channel: Channel, rows: Indices, factors: Array
) -> Response:
    """Of one order above zero (E42)."""
    omega, load, here = float(lines.omegas[k]), lines.loads[k], at.here
    impedance = here.stiffness + 1j * (here.loss + omega * here.damping) - omega**2 * np.eye(6)
    impedance = impedance + model.added(lines.omegas[[k]])[0]
    added, shared = springs.gains * at.half[springs.decisions], springs.factors(omega)
    solved = np.linalg.solve(impedance, np.column_stack([load, -springs.arms.T * (added * shared)]))
    given, slopes = solved[:, 0], solved[:, 1:]
    deflection = np.abs(springs.arms @ given)
    unit = float(np.linalg.norm(given)) or 1.0
    scales = np.maximum(deflection, SMALL * deflection.max(initial=0.0)) / unit
    scales = np.where(scales > 0.0, scales, 1.0)
    if is_travel(channel):
        value, direct = model.travels[rows].astype(complex), np.zeros((len(rows), len(added)), dtype=complex)
    else:
        value = here.springs[rows] + 1j * (here.losses[rows] + omega * here.dampers[rows])
        value = value + model.added_forces(lines.omegas[[k]])[0][rows]
        direct = springs.axes[rows] * (added * shared)
    top = at.highest + float(model.rise(lines.omegas[[k]])[0])
    reach = _motion_at_most(at, top, omega, load) * np.linalg.norm(springs.arms, axis=1) / (unit * scales)
    return Response(
        _parted(given / unit, slopes * scales),
        _parted(np.zeros(len(added)), np.diag(scales)),
        factors[:, None] * _parted(value @ given, unit * (value @ slopes + direct) * scales),
        added,
        float(reach @ reach),
    )


def _motion_at_most(at: Middle, highest: float, omega: float, load: ComplexArray) -> float:
    """|y| of no design of the box is over this: damping takes energy, and far above resonance the mass holds."""
    size = float(np.linalg.norm(load))
    loss = float(np.linalg.eigvalsh(at.lowest.loss + omega * at.lowest.damping)[0])
    room = max(loss, omega**2 - highest)
    return size / room if room > 0.0 else math.inf


def _parted(given: ComplexArray | Array, slopes: ComplexArray | Array) -> Array:
    """Real and imaginary part of given + slopes v, in the real and imaginary parts of v."""
    g, s = np.asarray(given, dtype=complex), np.asarray(slopes, dtype=complex)
    real = np.column_stack([g.real, s.real, -s.imag])
    return np.array([real, np.column_stack([g.imag, s.imag, s.real])])


def aligned(at: Response) -> Response:
    """The mounts' forces turned, in space and in time, to where they add up at the middle, and added (E45).

    A sum of the lengths is not under the length of that sum, however each is turned.
    """
    value = (at.felt[0] + 1j * at.felt[1])[:, 0].reshape(-1, 3)
    total = np.zeros((2, 3, at.size))
    for k, here in enumerate(value):
        real, imag = (part[3 * k : 3 * k + 3] for part in at.felt)
        turn = _turning(here)
        total[0] += turn.real @ real - turn.imag @ imag
        total[1] += turn.imag @ real + turn.real @ imag
    return replace(at, felt=total)


def _turning(vector: ComplexArray) -> ComplexArray:
    """A unitary matrix that takes a vector to the first axis."""
    size = float(np.linalg.norm(vector))
    if size == 0.0:
        return np.eye(3, dtype=complex)
    basis, triangle = np.linalg.qr(np.column_stack([vector, np.eye(3)]))
    return np.asarray(basis.conj().T * np.conj(triangle[0, 0] / abs(triangle[0, 0])))
