"""Distances between an outline and moving polygons, and the least distance over the turns of a cycle (H6, H7)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.workshop.outlines import Arc, Line, Outline
from laufruhe.numerics.arrays import Array, ComplexArray, Mask

TOLERANCE = 1e-6
"""Accuracy of a least distance [m]."""
_FIRST, _PARTS, _MAX_ANGLES = 72, 4, 2048


def distance_to_polygon(outline: Outline, corners: ComplexArray) -> Array:
    """Return the distance of an outline from polygons [m], shape (n,); minus infinity where they overlap.

    `corners` has shape (k, n): one corner is a point, two are the ends of a line (H6).
    """
    starts, ends = (corners, np.roll(corners, -1, axis=0)) if len(corners) > 2 else (corners[:1], corners[-1:])
    vertices = np.array([piece.start for piece in outline])
    lines = np.array([(piece.start, piece.end) for piece in outline if isinstance(piece, Line)])
    arcs = [piece for piece in outline if isinstance(piece, Arc)]
    # pieces, sides and polygons are the axes
    distances = [_to_line(vertices[:, None, None], starts, ends)]
    if len(lines):
        a, b = lines.T[:, :, None, None]
        crosses = (_side(a, b, starts) * _side(a, b, ends) < 0.0) & (
            _side(starts, ends, a) * _side(starts, ends, b) < 0.0
        )
        distances += [_to_line(corners, a, b), np.where(crosses, 0.0, np.inf)]
    if arcs:
        distances += _to_arcs(arcs, corners, starts, ends)
    nearest = np.min([part.min(axis=(0, 1)) for part in distances], axis=0)
    is_inside = _is_within(vertices[:, None], corners[0])
    for arc in arcs:
        # the outline is its chords, and a segment beyond or within the chord of every arc
        is_inside ^= _is_in_segment(arc, corners[0])
    if len(corners) > 2:
        is_inside |= _is_within(corners, np.full(corners.shape[1], vertices[0]))
    return np.where(is_inside | (nearest == 0.0), -np.inf, nearest)


def _to_arcs(arcs: Sequence[Arc], corners: ComplexArray, starts: ComplexArray, ends: ComplexArray) -> list[Array]:
    """Return distances between the inner points of arcs and the corners and sides of polygons; 0 where they cross."""
    centre = np.array([arc.centre for arc in arcs])[:, None, None]
    radius, half = (np.array(sizes)[:, None, None] for sizes in
                    ([arc.radius for arc in arcs], [0.5 * abs(arc.turn) for arc in arcs]))  # fmt: skip
    middle = np.exp(1j * np.array([arc.first_angle + 0.5 * arc.turn for arc in arcs]))[:, None, None]

    def faces(points: ComplexArray) -> Mask:
        return np.asarray(np.abs(np.angle((points - centre) * middle.conj())) <= half)

    def distance(points: ComplexArray) -> Array:
        return np.where(faces(points), np.abs(np.abs(points - centre) - radius), np.inf)

    along, length = ends - starts, np.abs(ends - starts)
    unit = along / np.where(length == 0.0, 1.0, length)
    # coordinates of the centre along and across each side
    offset = (centre - starts) * unit.conj()
    foot = starts + unit * np.clip(offset.real, 0.0, length)
    chord = np.sqrt(np.maximum(radius**2 - offset.imag**2, 0.0))
    crosses = np.zeros(offset.shape, dtype=bool)
    for reach in (offset.real - chord, offset.real + chord):
        is_on_side = (reach >= 0.0) & (reach <= length) & (np.abs(offset.imag) < radius)
        crosses |= is_on_side & faces(starts + unit * reach)
    return [distance(corners), distance(foot), np.where(crosses, 0.0, np.inf)]


def _to_line(point: ComplexArray, start: ComplexArray, end: ComplexArray) -> Array:
    along = end - start
    squared = np.maximum(np.abs(along) ** 2, 1e-300)
    share = np.clip(((point - start) * along.conj()).real / squared, 0.0, 1.0)
    distances: Array = np.abs(point - start - share * along)
    return distances


def _side(start: ComplexArray, end: ComplexArray, point: ComplexArray) -> Array:
    areas: Array = ((end - start).conj() * (point - start)).imag
    return areas


def _is_in_segment(arc: Arc, points: ComplexArray) -> Mask:
    # the points between an arc and its chord
    from_centre = points - arc.centre
    beyond = (from_centre * np.exp(-1j * (arc.first_angle + 0.5 * arc.turn))).real - arc.radius * math.cos(
        0.5 * arc.turn
    )
    return np.asarray((np.abs(from_centre) < arc.radius) & (beyond > 0.0))


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
