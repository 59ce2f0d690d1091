"""What moments of an order have to keep, whatever the design of a box (E43, E52, E53).

A matrix M stands for (1, v)(1, v)', v the products of E42 and the unbalances. Where a matrix P(s), linear in the shared
numbers s, is nowhere indefinite, so is

    [1 V]' P(s) [1 V],    V = [Re y, Im y]                                              (E43)

and where P y is affine in v this is linear in s and M.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.mount_relaxation.lines import Line, product
from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.opened import Place, Spring
from laufruhe.numerics.arrays import Array, ComplexArray

ROUNDING = 1e-13
"""Share of parts that cancel, which is left to their rounding."""


@dataclass(frozen=True, eq=False)
class Held:
    """A matrix that is linear in s and M, and must not be indefinite.

    Attributes
    ----------
    order
        Number of the order.
    constant
        What is in neither, shape (p, p).
    slopes
        By s, shape (numbers, p, p).
    moments
        What of M is in every entry, shape (p, p, d, d).
    """

    order: int
    constant: Array
    slopes: Array
    moments: Array

    @property
    def size(self) -> int:
        """Rows."""
        return len(self.moments)


def conditions(order: int, mounts: OpenMounts, line: Line) -> list[Held]:
    """All that one order has to keep."""
    found: list[Held] = []
    for spring, (seen, added) in zip(mounts.springs, line.springs, strict=True):
        found += _spring_sides(order, mounts.numbers, spring, seen, added)
    for place, (seen, moved) in zip(mounts.places, line.places, strict=True):
        found += _place_sides(order, mounts.numbers, place, seen, moved)
    found += _limits_of_stiffness(order, mounts, line)
    return found + _ranges(order, mounts, line)


def _spring_sides(order: int, numbers: int, spring: Spring, seen: ComplexArray, added: ComplexArray) -> list[Held]:
    """Every open stiffness between its bounds, and so is their product (E53)."""
    slopes = spring.slopes(numbers) / spring.size
    found = [
        held(order, given / spring.size, sign * slopes, seen, (given @ seen + sign * added) / spring.size)
        for given, sign in spring.sides
    ]
    spans = [((low @ seen + added) / spring.size, (high @ seen - added) / spring.size) for low, high in spring.spans]
    if len(seen) > 1:
        return [*found, *(_between(order, numbers, product(*pair)[None, None], _whole(*pair)) for pair in spans)]
    return [*found, *(_between(order, numbers, _in_parts(*pair), _whole(*pair)) for pair in spans)]


def _in_parts(first: ComplexArray, second: ComplexArray) -> Array:
    """Products of real and imaginary parts, shape (2, 2, d, d)."""
    rows = [np.concatenate([each.real, each.imag]) for each in (first, second)]
    across = np.einsum("ax,by->abxy", *rows)
    across = across + across.transpose(1, 0, 2, 3)
    return np.asarray(0.25 * (across + across.transpose(0, 1, 3, 2)))


def _between(order: int, numbers: int, moments: Array, whole: float) -> Held:
    """Moments alone, in their own size, with room for the rounding of parts of a size that cancel in them."""
    count, size = len(moments), float(np.abs(moments).max()) or 1.0
    room = min(ROUNDING * whole / size, 1.0) * np.eye(count)
    return Held(order, room, np.zeros((numbers, count, count)), moments / size)


def _whole(first: ComplexArray, second: ComplexArray) -> float:
    """Size of the parts of a product."""
    return float(np.linalg.norm(first) * np.linalg.norm(second))


def held(order: int, given: Array, slopes: Array, seen: ComplexArray, pressed: ComplexArray) -> Held:
    """E43 from y and P y as functions of (1, v), shapes (p, d), P = given + sum s_j slopes_j."""
    p, d = seen.shape
    size = float(np.abs(seen).max()) or 1.0
    parts = [(f(seen) / size, f(pressed) / size) for f in (np.real, np.imag)]
    moments = np.zeros((p + 2, p + 2, d, d))
    for k, (own, turned) in enumerate(parts):
        moments[:p, p + k, 0] += 0.5 * turned
        moments[:p, p + k, :, 0] += 0.5 * turned
        moments[p + k, :p] = moments[:p, p + k]
        for other, (theirs, bent) in enumerate(parts):
            twice = own.T @ bent + theirs.T @ turned
            moments[p + k, p + other] = 0.25 * (twice + twice.T)
    return Held(order, _bordered(given, 2), _bordered(slopes, 2), moments)


def _place_sides(order: int, numbers: int, place: Place, seen: ComplexArray, moved: ComplexArray) -> list[Held]:
    """1 + s and 1 - s, bordered by all turns and moments that s multiplies (E52)."""
    found = []
    plain, rows = _rows(seen, moved)
    for sign in (1.0, -1.0):
        slopes = np.zeros((numbers, 1, 1))
        slopes[place.number] = sign
        moments = _bordering(plain, plain + sign * rows)
        found.append(Held(order, _bordered(np.eye(1), len(plain)), _bordered(slopes, len(plain)), moments))
    squares = [np.einsum("ax,by->abxy", each, each) for each in (plain, rows)]
    left = squares[0] - squares[1]
    whole = float(np.square(plain).sum() + np.square(rows).sum())
    return [*found, _between(order, numbers, 0.5 * (left + left.transpose(0, 1, 3, 2)), whole)]


def _rows(seen: ComplexArray, moved: ComplexArray) -> tuple[Array, Array]:
    """Real and imaginary parts of both, each row in its size."""
    size = np.abs(seen).max(axis=1, keepdims=True)
    size = np.where(size > 0.0, size, 1.0)
    plain, rows = (np.concatenate([each.real, each.imag]) for each in (seen / size, moved / size))
    return plain, rows


def _bordering(plain: Array, pressed: Array) -> Array:
    """What of moments is in one number bordered by what it multiplies, shape (1 + n, 1 + n, d, d)."""
    count, d = plain.shape
    moments = np.zeros((1 + count, 1 + count, d, d))
    moments[0, 1:, 0] += 0.5 * pressed
    moments[0, 1:, :, 0] += 0.5 * pressed
    moments[1:, 0] = moments[0, 1:]
    across = np.einsum("ax,by->abxy", plain, pressed)
    across = across + across.transpose(1, 0, 2, 3)
    moments[1:, 1:] = 0.25 * (across + across.transpose(0, 1, 3, 2))
    return moments


def _limits_of_stiffness(order: int, mounts: OpenMounts, line: Line) -> list[Held]:
    """A - L and U - A; where places move, A itself only in motions that these do not touch (`OpenMounts.still`)."""
    found, unit, still = [], mounts.highest, mounts.still
    for sign, matrix in _edges(mounts):
        pressed = sign * (line.carried - matrix @ line.motion) / unit
        given, slopes = sign * (mounts.middle - matrix) / unit, sign * mounts.slopes / unit
        whole = held(order, given, slopes, line.motion, pressed)
        found.append(_seen_by(whole, still) if mounts.places else whole)
    return found


def _edges(mounts: OpenMounts) -> list[tuple[float, Array]]:
    """Floors and ceilings of stiffness."""
    return [*((1.0, floor) for floor in mounts.floors), *((-1.0, ceiling) for ceiling in mounts.ceilings)]


def of_stiffness(mounts: OpenMounts, size: int) -> list[Held]:
    """A - L and U - A in motions that no order is followed in, beside moments of a size."""
    unit, still, found = mounts.highest, mounts.still, []
    for sign, matrix in _edges(mounts):
        given, slopes = (still.T @ part @ still / unit for part in (mounts.middle - matrix, mounts.slopes))
        none = np.zeros((len(given), len(given), size, size))
        found.append(Held(0, sign * given, sign * slopes, none))
    return found if still.size else []


def _seen_by(whole: Held, still: Array) -> Held:
    """Of its first rows and columns the part that lies in some motions."""
    some = np.zeros((whole.size, still.shape[1] + 2))
    some[: len(still), :-2], some[-2:, -2:] = still, np.eye(2)
    moments = np.einsum("ax,abij,by->xyij", some, whole.moments, some, optimize=True)
    return Held(whole.order, some.T @ whole.constant @ some, some.T @ whole.slopes @ some, moments)


def _ranges(order: int, mounts: OpenMounts, line: Line) -> list[Held]:
    """(A - a)(A - b) is nowhere indefinite where no eigenvalue is between, a - A times A - b where all are (E53)."""
    unit, least = mounts.highest, max(mounts.lowest, 0.0)
    pairs = [(line.carried - a * line.motion, line.carried - b * line.motion) for a, b in mounts.bands]
    pairs.append((line.carried - least * line.motion, unit * line.motion - line.carried))
    # both of a pair are differences of these
    whole = (unit * float(np.linalg.norm(line.motion))) ** 2
    return [_between(order, mounts.numbers, product(first, second)[None, None], whole) for first, second in pairs]


def _bordered(matrices: Array, count: int) -> Array:
    """Rows and columns of zeros more."""
    return np.pad(matrices, [(0, 0)] * (matrices.ndim - 2) + [(0, count)] * 2)
