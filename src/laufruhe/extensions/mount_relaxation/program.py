"""The relaxation of E43-E45 and E52-E54 as Clarabel takes it: nothing depends on how good its multipliers are."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from scipy.sparse import coo_array, vstack

from laufruhe.extensions.mount_relaxation.bound import Cap, Multipliers, Priced, Program, Proposed, Root, follows
from laufruhe.extensions.mount_relaxation.conditions import Held
from laufruhe.extensions.mount_relaxation.dual import Cone, Dual, Plain, solver_for
from laufruhe.extensions.mount_relaxation.modes import Shapes
from laufruhe.extensions.mount_relaxation.quadratics import column, matrix_of, triangle
from laufruhe.numerics.arrays import Array, Indices

# what a solver leaves of a price of one for every square, so that what its multipliers leave over is convex
ASIDE = 3e-7
# how far multipliers may be off, and from what is allowed; when asked again, and of what narrows a box
FINE, FINER, ROUGH = (1e-5, 1e-7), (1e-5, 1e-9), (2e-2, 5e-6)
# equations are solved once and not refined, more regular instead, and steps kept from the ends of cones: bounds are as
# good in less time
_SETTINGS = {
    "verbose": False,
    "tol_gap_abs": 1e-6,
    "max_threads": 1,
    "direct_solve_method": "faer",
    "presolve_enable": False,
    "chordal_decomposition_enable": False,
    "iterative_refinement_enable": False,
    "static_regularization_constant": 1e-7,
    "max_step_fraction": 0.95,
}

ZERO, SIDES, LENGTH, MATRIX = "zero", "not under zero", "a length and its vector", "nowhere indefinite"
_Parts: TypeAlias = defaultdict[Hashable, list[Array]]


def proposed(program: Program) -> Iterator[Proposed]:
    """Multipliers of all conditions, s and moments, whatever the solver says of them; first and, where asked, again."""
    stated = Stated(program)
    for scaled, enough in ((True, FINE), (False, FINER)):
        yield stated.answer(program, scaled, enough)


class Stated:
    """Variables: heads, blocks of the caps, roots and their lengths, s, moments of every order and of every mode."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.rows: list[Any] = []
        self.right: list[Array] = []
        self.cones: list[tuple[str, Hashable]] = []
        self._solvers: dict[tuple[bool, tuple[float, float]], Dual | Plain] = {}
        blocks = [_entries(size) for cap in program.caps for size in cap.blocks]
        heads = len(program.prices)
        self.blocks = np.cumsum([heads, *blocks])
        counts = [1 + sum(len(rows) for _, rows in root.rows) for root in program.roots]
        self.roots = np.cumsum([self.blocks[-1], *counts])
        self.first = int(self.roots[-1])
        self.ends = np.cumsum([self.first + program.numbers, *map(_entries, program.sizes)])
        sizes = [(1 + program.numbers) * _entries(6) for _ in program.shapes]
        self.shapes = np.cumsum([int(self.ends[-1]), *sizes])
        self._whole()
        self._linked()
        self._linear()
        at = 0
        for cap in program.caps:
            self._cap(cap, at)
            at += len(cap.blocks)
        for limit in program.held:
            self._held(limit)
        for number, root in enumerate(program.roots):
            self._root(number, root)
        self._goal()
        for number, shapes in enumerate(program.shapes):
            self._shapes(number, shapes)

    def _shapes(self, number: int, shapes: Shapes) -> None:
        """E56: six kinds of rows."""
        numbers, each = self.program.numbers, _entries(6)
        own = np.arange(self.shapes[number], self.shapes[number + 1])
        corners = own[::each]
        self._add(np.ones((1, 1)), corners[:1], ZERO, right=np.ones(1))
        both = np.concatenate([np.eye(numbers), -np.eye(numbers)], axis=1)
        columns = np.concatenate([corners[1:], self.first + np.arange(numbers)])
        self._add(both, columns, ZERO, ("corners", number))
        for name, matrices, cone in (("equal", shapes.equal, ZERO), ("sides", shapes.sides, SIDES)):
            rows = -column(matrices).reshape(len(matrices), -1)
            self._add(rows, own, cone, (name, number))
        for tensor in shapes.matrices:
            i, j, factor = triangle(tensor.shape[1])
            rows = column(tensor[:, i, j]).transpose(1, 0, 2).reshape(len(i), -1) * factor[:, None]
            self._add(-rows, own, MATRIX, ("matrices", number))
        first = np.arange(each)
        for k in range(1, 1 + numbers):
            for sign in (1.0, -1.0):
                rows = np.concatenate([-np.eye(each), -sign * np.eye(each)], axis=1)
                columns = np.concatenate([own[first], own[k * each + first]])
                self._add(rows, columns, MATRIX, (sign, number))

    def _priced(self, number: int, shapes: Shapes, parts: _Parts) -> Priced:
        """From the multipliers of these rows."""
        matrices = [
            matrix_of(part, tensor.shape[1])
            for part, tensor in zip(parts["matrices", number], shapes.matrices, strict=True)
        ]
        above, under = ([matrix_of(part, 6) for part in parts[sign, number]] for sign in (1.0, -1.0))
        (sides,), (equal,), (corners,) = (parts[name, number] for name in ("sides", "equal", "corners"))
        return Priced(matrices, sides, -equal, corners, [*zip(above, under, strict=True)])

    def _add(
        self, block: Array, columns: Indices, cone: str, name: Hashable = None, right: Array | None = None
    ) -> None:
        """Rows with entries in these columns alone, and what their multipliers are known by."""
        row, place = np.nonzero(block)
        shape = len(block), int(self.shapes[-1])
        self.rows.append(coo_array((block[row, place], (row, columns[place])), shape=shape))
        self.right.append(np.zeros(len(block)) if right is None else np.asarray(right, dtype=float))
        self.cones.append((cone, name))

    def _whole(self) -> None:
        count = len(self.program.sizes)
        self._add(np.eye(count), np.asarray(self.ends[:-1]), ZERO, right=np.ones(count))

    def _linked(self) -> None:
        """(1, u)(1, u)' is the same for all orders."""
        corner, count = self._corner(0), _entries(1 + self.program.columns) - 1
        for order in range(1, len(self.program.sizes) if count else 1):
            both = np.concatenate([-np.eye(count), np.eye(count)], axis=1)
            columns = np.concatenate([corner[1:], self._corner(order)[1:]])
            self._add(both, columns, ZERO, "links")

    def _corner(self, order: int) -> Indices:
        """Where the entries of (1, u)(1, u)' stand: columns come first in a triangle column by column."""
        return np.asarray(self.ends[order] + np.arange(_entries(1 + self.program.columns)))

    def _linear(self) -> None:
        """s between -1 and 1; sets of unbalances, budgets, and traces that are not over their head."""
        program, numbers = self.program, self.program.numbers
        own = self.first + np.arange(numbers)
        for sign in (1.0, -1.0):
            self._add(sign * np.eye(numbers), own, SIDES, right=np.ones(numbers))
        for matrix in program.sets:
            self._add(column(matrix)[None], self._corner(0), SIDES, "sets")
        for budget in program.budgets:
            columns = np.concatenate([self._moment(order) for order, _ in budget.matrices])
            block = np.concatenate([column(matrix) for _, matrix in budget.matrices])[None]
            self._add(block, columns, SIDES, "budgets", np.array([budget.most]))
        if len(program.tops):
            held = np.flatnonzero(np.isfinite(program.tops))
            self._add(np.eye(len(held)), held, SIDES, right=program.tops[held])
        at = 0
        for cap in program.caps:
            if cap.blocks:
                span = np.arange(self.blocks[at], self.blocks[at + len(cap.blocks)])
                traces = np.concatenate([_diagonal(size) for size in cap.blocks])
                block, columns = np.append(traces, -1.0)[None], np.append(span, cap.head)
                self._add(block, columns, SIDES)
            at += len(cap.blocks)

    def _moment(self, order: int) -> Indices:
        return np.arange(self.ends[order], self.ends[order + 1])

    def _cap(self, cap: Cap, at: int) -> None:
        """S - F(M)."""
        i, j, factor = triangle(cap.size)
        columns, blocks = [], []
        for order, rows in cap.rows:
            pairs = np.einsum("pax,pay->axy", rows[:, i], rows[:, j])
            blocks.append(column(0.5 * (pairs + pairs.transpose(0, 2, 1))) * factor[:, None])
            columns.append(self._moment(order))
        if cap.blocks:
            look = {pair: k for k, pair in enumerate(zip(i.tolist(), j.tolist(), strict=True))}
            for k, part in enumerate(cap.parts):
                rows_, columns_, own = triangle(cap.blocks[k])
                block = np.zeros((len(i), len(own)))
                for entry, (a, b) in enumerate(zip(rows_ + part.start, columns_ + part.start, strict=True)):
                    block[look[int(a), int(b)], entry] = -1.0
                blocks.append(block)
                columns.append(np.arange(self.blocks[at + k], self.blocks[at + k + 1]))
        else:
            blocks.append(-column(np.eye(cap.size))[:, None])
            columns.append(np.array([cap.head]))
        whole = np.concatenate(blocks, axis=1)
        self._add(whole, np.concatenate(columns), MATRIX, "caps")

    def _root(self, number: int, root: Root) -> None:
        """Over its line, and over the sum of lengths, each over that of its vector."""
        at, end = int(self.roots[number]), int(self.roots[number + 1])
        ends = np.array([number, at])
        self._add(np.array([[root.slope, -1.0]]), ends, SIDES, "lines", np.array([-root.offset]))
        own = np.arange(at, end)
        sums = np.concatenate([[-1.0], np.ones(end - at - 1)])[None]
        self._add(sums, own, SIDES)
        for order, rows in root.rows:
            for vector in rows:
                at, (count, size) = at + 1, vector.shape
                block = np.zeros((1 + count, 1 + size))
                block[0, 0], block[1:, 1:] = -1.0, -vector
                # of a triangle column by column the first row
                first = self.ends[order] + np.cumsum(np.arange(size))
                # off the diagonal an entry counts by the root of two
                block[1:, 2:] *= math.sqrt(0.5)
                columns = np.concatenate([[at], first])
                self._add(block, columns, LENGTH, ("lengths", number))

    def _goal(self) -> None:
        """The sum of roots at their prices, and of s, is not over a number."""
        goal = self.program.goal
        if goal is not None:
            columns = np.concatenate([self.roots[:-1], self.first + np.arange(self.program.numbers)])
            block = np.concatenate([[root.price for root in self.program.roots], goal.along])[None]
            self._add(block, columns.astype(np.intp), SIDES, "goal", np.array([goal.most]))

    def _held(self, limit: Held) -> None:
        """E43."""
        i, j, factor = triangle(limit.size)
        own = -column(limit.moments[i, j]) * factor[:, None]
        columns = np.concatenate([self.first + np.arange(self.program.numbers), self._moment(limit.order)])
        block = np.concatenate([-column(limit.slopes).T.reshape(len(i), -1), own], axis=1)
        self._add(block, columns, MATRIX, "held", column(limit.constant))

    def _cost(self, program: Program) -> Array:
        """Of heads or roots, of s and of shapes."""
        first = self.first
        cost = np.zeros(int(self.shapes[-1]))
        cost[: len(program.prices)] = program.prices
        for number, (at, root) in enumerate(zip(self.roots, program.roots, strict=False)):
            cost[at] = root.price if program.goal is None else float(number == program.goal.root)
        aim, aims = program.aims
        cost[first : first + program.numbers] = aim
        for at, own in zip(self.shapes, aims, strict=False):
            # entries (0, k) of a triangle column by column, which count by the root of two
            cost[at + np.cumsum(np.arange(1, 6))] = own * math.sqrt(0.5)
        for order, size in enumerate(program.sizes):
            cost[self._moment(order)] = -ASIDE * _diagonal(size)
        return cost

    def least(self, aim: Array | int) -> tuple[float, Array]:
        """Of an aim, or of a root, under the same conditions, as multipliers prove it, and s and w where it is."""
        if isinstance(aim, int):
            assert self.program.goal is not None
            own = replace(self.program, goal=replace(self.program.goal, root=aim))
        else:
            own = replace(self.program, aim=aim)
        found = self.answer(own, True, ROUGH)
        shapes = [each[0, 0, 1:] for each in found.shapes]
        return follows(own, found.multipliers), np.concatenate([found.middle, *shapes])

    def answer(self, program: Program, scaled: bool, enough: tuple[float, float] = FINE) -> Proposed:
        """As multipliers and moments of a program with the same conditions."""
        first, cost = self.first, self._cost(program)
        x, z, least = self._solved(cost, scaled, enough)
        parts: _Parts = defaultdict(list)
        for (_, name), part in zip(self.cones, np.split(z, np.cumsum([*map(len, self.right)])[:-1]), strict=True):
            parts[name].append(part)
        multipliers = Multipliers(
            [matrix_of(part, cap.size) for part, cap in zip(parts["caps"], program.caps, strict=True)],
            [matrix_of(part, limit.size) for part, limit in zip(parts["held"], program.held, strict=True)],
            _numbers(parts["budgets"]),
            _numbers(parts["sets"]),
            [matrix_of(np.append(0.0, part), 1 + program.columns) for part in parts["links"]],
            _numbers(parts["lines"]),
            [_lengths(root, parts["lengths", number]) for number, root in enumerate(program.roots)],
            float(sum(part[0] for part in parts["goal"])),
            [self._priced(number, shapes, parts) for number, shapes in enumerate(program.shapes)],
        )
        moments = [matrix_of(x[self._moment(k)], size) for k, size in enumerate(program.sizes)]
        middle = np.clip(x[first : first + program.numbers], -1.0, 1.0)
        return Proposed(multipliers, middle, moments, least, [self._found(x, k) for k in range(len(program.shapes))])

    def _solved(self, cost: Array, scaled: bool, enough: tuple[float, float]) -> tuple[Array, Array, float]:
        """By one solver for all that is minimised under the same conditions."""
        import clarabel

        solver = self._solvers.get((scaled, enough))
        if solver is None:
            off = dict(zip(("tol_gap_rel", "tol_feas"), enough, strict=True))
            moments = [
                (self._moment(order), clarabel.PSDTriangleConeT(size)) for order, size in enumerate(self.program.sizes)
            ]
            rows, right = vstack(self.rows, format="coo"), np.concatenate(self.right)
            solver = solver_for(rows, right, self._kinds(), moments, scaled, {**_SETTINGS, **off})
            self._solvers[scaled, enough] = solver
        return solver.solved(cost)

    def _kinds(self) -> list[Cone]:
        """Of the rows."""
        import clarabel

        kinds = {SIDES: clarabel.NonnegativeConeT, LENGTH: clarabel.SecondOrderConeT}
        found = []
        for (cone, _), right in zip(self.cones, self.right, strict=True):
            size = len(right)
            if cone == MATRIX:
                # a matrix by the size that has a triangle of so many entries
                found.append(Cone(size, clarabel.PSDTriangleConeT(math.isqrt(2 * size)), True))
            else:
                found.append(Cone(size, None if cone == ZERO else kinds[cone](size), cone == LENGTH))
        return found

    def _found(self, x: Array, number: int) -> Array:
        """Z, Z_1 ... of a mode."""
        own = x[self.shapes[number] : self.shapes[number + 1]].reshape(1 + self.program.numbers, -1)
        return np.array([matrix_of(each, 6) for each in own])


def _lengths(root: Root, parts: Sequence[Array]) -> list[Array]:
    """Of the vectors of its lengths, order by order: what the cones have beside their first number."""
    found, at = [], 0
    for _, rows in root.rows:
        found.append(-np.array([part[1:] for part in parts[at : at + len(rows)]]))
        at += len(rows)
    return found


def _numbers(parts: Sequence[Array]) -> Array:
    return np.concatenate([np.zeros(0), *parts])


def _entries(size: int) -> int:
    return size * (size + 1) // 2


def _diagonal(size: int) -> Array:
    i, j, _ = triangle(size)
    return np.where(i == j, 1.0, 0.0)
