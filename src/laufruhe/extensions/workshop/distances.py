"""Distances between an outline and moving polygons, and the least distance over the turns of a cycle (H6, H7)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.workshop.outlines import Arc, Line, Outline, Piece, corners_of
from laufruhe.numerics.arrays import Array, ComplexArray, Mask

TOLERANCE = 1e-6
"""Accuracy of a least distance [m]."""
FINE = 0.02
"""Angle between points of an arc where only inside and outside matter [rad]."""
_FIRST, _PARTS, _MAX_ANGLES = 72, 4, 2048


def distance_to_polygon(outline: Outline, corners: ComplexArray) -> Array:
    """Return the distance of an outline from polygons [m], shape (n,); minus infinity where they overlap.

    `corners` has shape (k, n): one corner is a point, two are the ends of a line (H6).
    """
    starts, ends = (corners, np.roll(corners, -1, axis=0)) if len(corners) > 2 else (corners[:1], corners[-1:])
    nearest = np.min([_to_piece(piece, starts, ends) for piece in outline], axis=0)
    body = corners_of(outline, FINE)
    is_inside = _is_within(body[:, None], corners[0])
    if len(corners) > 2:
        is_inside = is_inside | _is_within(corners, np.full(corners.shape[1], body[0]))
    distances: Array = np.where(is_inside | (nearest == 0.0), -np.inf, nearest)
    return distances


def _to_piece(piece: Piece, starts: ComplexArray, ends: ComplexArray) -> Array:
    """Return the distance of a piece from the nearest of some lines, shape (n,); lines have shape (k, n)."""
    from_ends = np.minimum(_to_line(piece.start, starts, ends), _to_line(piece.end, starts, ends))
    if isinstance(piece, Line):
        a, b = np.asarray(piece.start), np.asarray(piece.end)
        from_corners = np.minimum(_to_line(starts, a, b), _to_line(ends, a, b))
        crosses = (_side(a, b, starts) * _side(a, b, ends) < 0.0) & (
            _side(starts, ends, a) * _side(starts, ends, b) < 0.0
        )
        return np.asarray(np.where(crosses, 0.0, np.minimum(from_ends, from_corners)).min(axis=0))
    along, length = ends - starts, np.abs(ends - starts)
    unit = along / np.where(length == 0.0, 1.0, length)
    # coordinates of the centre along and across each line
    offset = (piece.centre - starts) * unit.conj()
    foot = starts + unit * np.clip(offset.real, 0.0, length)
    distances = [from_ends, *(_to_arc(piece, points) for points in (starts, ends, foot))]
    half = np.sqrt(np.maximum(piece.radius**2 - offset.imag**2, 0.0))
    crosses = np.zeros(starts.shape, dtype=bool)
    for side in (-half, half):
        reach = offset.real + side
        is_on_line = (reach >= 0.0) & (reach <= length) & (np.abs(offset.imag) < piece.radius)
        crosses |= is_on_line & _faces(piece, starts + unit * reach)
    return np.asarray(np.where(crosses, 0.0, np.minimum.reduce(distances)).min(axis=0))


def _to_line(point: ComplexArray | complex, start: ComplexArray, end: ComplexArray) -> Array:
    along = end - start
    squared = np.maximum(np.abs(along) ** 2, 1e-300)
    share = np.clip(((point - start) * along.conj()).real / squared, 0.0, 1.0)
    distances: Array = np.abs(point - start - share * along)
    return distances


def _side(start: ComplexArray, end: ComplexArray, point: ComplexArray) -> Array:
    areas: Array = ((end - start).conj() * (point - start)).imag
    return areas


def _faces(arc: Arc, points: ComplexArray) -> Mask:
    # the direction from the centre lies within the arc
    turned = np.angle((points - arc.centre) * np.exp(-1j * (arc.first_angle + 0.5 * arc.turn)))
    return np.asarray(np.abs(turned) <= 0.5 * abs(arc.turn))


def _to_arc(arc: Arc, points: ComplexArray) -> Array:
    ends = np.minimum(np.abs(points - arc.start), np.abs(points - arc.end))
    return np.where(_faces(arc, points), np.abs(np.abs(points - arc.centre) - arc.radius), ends)


def _is_within(polygon: ComplexArray, points: ComplexArray) -> Mask:
    # return True for points inside polygons by the even-odd rule; corners (k, n) or (k, 1), points (n,)
    following = np.roll(polygon, -1, axis=0)
    is_between = (polygon.imag > points.imag) != (following.imag > points.imag)
    rise = following.imag - polygon.imag
    share = (points.imag - polygon.imag) / np.where(rise == 0.0, 1.0, rise)
    crosses = is_between & (points.real < polygon.real + share * (following.real - polygon.real))
    return np.asarray(crosses.sum(axis=0) % 2 == 1)


@dataclass(frozen=True)
class Minimum:
    """Least distance over a cycle [m], a lower bound of it, and the crank angle where it occurs [rad]."""

    distance: float
    bound: float
    angle: float


def minimum_over_cycle(
    distance: Callable[[Array], Array], rate: float, cycle: float, wanted: float = -math.inf
) -> Minimum:
    """Return the least value of a distance over crank angles from 0 to `cycle` [rad] (H7).

    Parameters
    ----------
    distance
        Function of crank angles, shape (n,), that returns distances [m].
    rate
        Bound of the change of the distance with the crank angle [m].
    wanted
        The search ends as soon as the least distance is known to be above or below this one [m].
    """
    count = max(int(_FIRST * cycle / math.tau), 1)
    half, best, cleared = 0.5 * cycle / count, Minimum(math.inf, math.inf, 0.0), math.inf
    middles = np.asarray((2.0 * np.arange(count) + 1.0) * half, dtype=float)
    while True:
        values = distance(middles)
        k = int(np.argmin(values))
        if values[k] < best.distance:
            best = Minimum(float(values[k]), -math.inf, float(middles[k]))
        bounds = values - rate * half
        is_left = bounds < best.distance - TOLERANCE
        if math.isfinite(wanted):
            is_left &= bounds < wanted
        cleared = min([cleared, *bounds[~is_left]])
        if best.distance < wanted or not 0 < is_left.sum() * _PARTS <= _MAX_ANGLES:
            return Minimum(best.distance, min([cleared, best.distance, *bounds[is_left]]), best.angle)
        half /= _PARTS
        steps = half * (2.0 * np.arange(_PARTS) + 1.0 - _PARTS)
        middles = (middles[is_left, None] + steps).ravel()


def minimum_of(results: Sequence[Minimum]) -> Minimum:
    """Return the least of some results; infinite without any."""
    return min(results, key=lambda minimum: minimum.distance, default=Minimum(math.inf, math.inf, 0.0))
