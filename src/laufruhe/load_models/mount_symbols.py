"""The block on its mounts in CasADi symbols: the same kernels as the numbers (E1-E5, E20).

Everything is in coordinates in which the mass matrix is one: q = R' y, so that M -> 1 and
K -> R K R'. One complex symmetric system per order and operating point is eliminated in
closed form; its derivatives are exact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.machine.block import Block
from laufruhe.machine.dynamic import Dynamic
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.namespaces import symbols
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import along_axes, carried, point_motion, turned_axes
from laufruhe.problem.decision import DAMPING, LAG, LOSS, POSITION, STIFFNESS, TURNED
from laufruhe.problem.problem import Problem


@dataclass(frozen=True, eq=False)
class SymbolicMounts:
    """Matrices of the mounts as expressions of the decisions.

    Attributes
    ----------
    stiffness, loss, damping
        R K R', R H R', R C R', shape (6, 6) (E3).
    travels
        G R' of all mounts, stacked, shape (3 mounts, 6) (E1).
    springs, losses, dampers
        Mount forces per motion, stacked alike (E5).
    rows, directions
        Of the springs whose stiffness depends on frequency: travel per motion, shape (n, 6), and where their forces
        act, (3 mounts, n) (E50).
    own
        Travel along the own axes of every spring, shape (3 springs, 6) (E55).
    laws
        Stiffness of those that depend on frequency.
    """

    stiffness: Any
    loss: Any
    damping: Any
    travels: Any
    springs: Any
    losses: Any
    dampers: Any
    rows: Any
    directions: Any
    own: Any
    laws: tuple[Dynamic, ...] = ()

    def added(self, omegas: Array) -> tuple[Any, Any]:
        """Stiffness over that at rest, real and imaginary part, shape (n, frequencies)."""
        found = [law.at(omegas) - law.static for law in self.laws]
        values = np.array(found, dtype=complex).reshape(len(self.laws), len(omegas))
        return ca.DM(values.real.copy()), ca.DM(values.imag.copy())


def mount_matrices(problem: Problem, block: Block) -> Any:
    """A CasADi function from the decisions to the matrices of `SymbolicMounts`, in that order."""
    lib = symbols()
    decisions = ca.SX.sym("mounts", len(problem.mount_decisions))
    root = ca.DM(mass_root(block))
    totals = [ca.SX(6, 6) for _ in range(3)]
    maps: list[list[Any]] = [[], [], [], []]
    found = problem.numbers([decisions[k] for k in range(len(problem.mount_decisions))], problem.mount_decisions)
    rows, directions, own, mounts = [], [], [], len(problem.engine.mounts)
    springs = every_spring(problem.engine.mounts)
    for (place, given), numbers in zip(springs, found.mounts or problem.mount_numbers, strict=True):
        axes = turned_axes(lib, numbers[TURNED])
        arm = [p - c for p, c in zip(numbers[POSITION], block.centre_of_gravity, strict=True)]
        motion = ca.SX(point_motion(lib, arm))
        spring = along_axes(lib, axes, numbers[STIFFNESS])
        held = spring
        own.append(ca.SX(axes) @ motion @ root.T)
        for law in given.dynamic:
            axis = ca.SX(axes)[law.axis, :]
            held = held + law.static * (axis.T @ axis)
            rows.append(axis @ motion @ root.T)
            directions.append(ca.vertcat(ca.SX(3 * place, 1), axis.T, ca.SX(3 * (mounts - place - 1), 1)))
        drag = along_axes(lib, axes, numbers[DAMPING]) + numbers[LAG] * spring
        if place == len(maps[0]):
            maps[0].append(motion @ root.T)
        for k, matrix in enumerate((held, numbers[LOSS] * spring, drag)):
            totals[k] += carried(motion, matrix)
            felt = matrix @ motion @ root.T
            # springs that are joined count together
            maps[k + 1][place:] = [sum(maps[k + 1][place:], felt)]
    stacked = [ca.vertcat(*parts) for parts in maps]
    told = [ca.vertcat(*rows) if rows else ca.SX(0, 6), ca.horzcat(*directions) if rows else ca.SX(3 * mounts, 0)]
    return ca.Function(
        "mounts", [decisions], [*(root @ total @ root.T for total in totals), *stacked, *told, ca.vertcat(*own)]
    )


def symbolic_mounts(problem: Problem, block: Block, decisions: Any) -> SymbolicMounts:
    """Matrices at symbolic decisions."""
    laws = tuple(law for _, spring in every_spring(problem.engine.mounts) for law in spring.dynamic)
    found = mount_matrices(problem, block)(decisions)
    return replace(SymbolicMounts(*found), laws=laws)


def elimination() -> Any:
    """A CasADi function y = (A + i B)^-1 (r + i s), A and B symmetric (E20).

    Inputs A, B (6, 6), r, s (6,); outputs real and imaginary part. Without pivoting:
    loss or damping keeps every pivot from zero, and without either a pivot is zero at
    single frequencies only, where the answer is not a number and the search steps aside.
    """
    a, b, r, s = ca.SX.sym("A", 6, 6), ca.SX.sym("B", 6, 6), ca.SX.sym("r", 6), ca.SX.sym("s", 6)
    rows = [[(a[j, k], b[j, k]) for k in range(6)] + [(r[j], s[j])] for j in range(6)]
    for p in range(6):
        inverse = _inverse(rows[p][p])
        for j in range(p + 1, 6):
            # symmetric all the way: the lower half is never looked at
            factor = _times(rows[p][j], inverse)
            for k in range(j, 7):
                rows[j][k] = _minus(rows[j][k], _times(factor, rows[p][k]))
    y: list[tuple[Any, Any]] = [(0.0, 0.0)] * 6
    for p in reversed(range(6)):
        rest = rows[p][6]
        for k in range(p + 1, 6):
            rest = _minus(rest, _times(rows[p][k], y[k]))
        y[p] = _times(rest, _inverse(rows[p][p]))
    return ca.Function("eliminate", [a, b, r, s], [ca.vertcat(*(v[0] for v in y)), ca.vertcat(*(v[1] for v in y))])


def _times(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _minus(a: tuple[Any, Any], b: tuple[Any, Any]) -> tuple[Any, Any]:
    return a[0] - b[0], a[1] - b[1]


def _inverse(a: tuple[Any, Any]) -> tuple[Any, Any]:
    size = a[0] * a[0] + a[1] * a[1]
    return a[0] / size, -a[1] / size


@dataclass(frozen=True, eq=False)
class SymbolicResponse:
    """Mount forces and travels of loads at several angular frequencies (E4, E5).

    Attributes
    ----------
    force, travel, firm
        Real and imaginary parts, shape (3 mounts, n); `firm` are the forces if the
        mounts gave no way (E11).
    """

    force: tuple[Any, Any]
    travel: tuple[Any, Any]
    firm: tuple[Any, Any]


def response(mounts: SymbolicMounts, omegas: Array, real: Any, imaginary: Any) -> SymbolicResponse:
    """Response to loads R w, real and imaginary parts of shape (6, n), at omegas of shape (n,)."""
    count, one = len(omegas), ca.DM.eye(6)
    stiffer, dragging = mounts.added(omegas)
    lossy = [float(w > 0.0) for w in omegas]
    reactances = [mounts.stiffness - float(w) ** 2 * one for w in omegas]
    resistances = [on * mounts.loss + float(w) * mounts.damping for on, w in zip(lossy, omegas, strict=True)]
    if mounts.laws:
        for k in range(count):
            reactances[k] += mounts.rows.T @ ca.diag(stiffer[:, k]) @ mounts.rows
            resistances[k] += mounts.rows.T @ ca.diag(dragging[:, k]) @ mounts.rows
    reactance, resistance = ca.horzcat(*reactances), ca.horzcat(*resistances)
    eliminate = elimination().map(count)
    yr, yi = eliminate(reactance, resistance, real, imaginary)
    firm = eliminate(ca.repmat(mounts.stiffness, 1, count), ca.MX(6, 6 * count), real, imaginary)
    on, speeds = ca.DM(np.tile(lossy, (6, 1))), ca.DM(np.tile(omegas, (6, 1)))
    force_real = mounts.springs @ yr - mounts.losses @ (yi * on) - mounts.dampers @ (yi * speeds)
    force_imaginary = mounts.springs @ yi + mounts.losses @ (yr * on) + mounts.dampers @ (yr * speeds)
    if mounts.laws:
        along, across = mounts.rows @ yr, mounts.rows @ yi
        force_real += mounts.directions @ (stiffer * along - dragging * across)
        force_imaginary += mounts.directions @ (stiffer * across + dragging * along)
    return SymbolicResponse(
        (force_real, force_imaginary),
        (mounts.travels @ yr, mounts.travels @ yi),
        (mounts.springs @ firm[0], mounts.springs @ firm[1]),
    )
