"""Bounds of sag, natural frequencies, energy shares and other mount numbers over boxes of stiffness (E39, E64).

For energy shares of motions in modes, u_j are the modes at the middle of a box, and s_j the squares of their angular
frequencies. E is the change of the stiffness matrix from the middle, in coordinates of these modes. A mode v of a
design in the box, with components v_j, satisfies

    (l - s_j - E_jj) v_j = sum of E_jk v_k over the others

with l the square of its angular frequency, which is monotone in stiffness. This bounds the sizes |v_j|, and these bound
the difference of v and u_i + sum E_ij / (s_i - s_j) u_j. An energy share is the product of two linear functions of v.
It is therefore linear in stiffness up to the square of the size of the box.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from laufruhe.numerics.arrays import Array, Mask
from laufruhe.physics.modes import weight_wrench
from laufruhe.physics.mount_numbers import total_stiffness
from laufruhe.physics.static_cases import Stops, case_wrench, equilibria, stops_of
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel, counted_cases, motion_indices
from laufruhe.problem.measure import Limit, Measure
from laufruhe.prove.mounts.box_norms import LinearBound, counted_rows, zero_bound
from laufruhe.prove.mounts.box_response import BoxModel, LoadedOrders, is_travel
from laufruhe.prove.mounts.box_series import Expansion, mapped, series
from laufruhe.prove.mounts.ranges import SLACK

# iterations of bounds of travel, factor beyond the implied bound, and growth of a step
MAX_ROUNDS, WIDER, FASTER = 16, 1.0 + 1e-6, 1.4
# accuracy of an equilibrium as a share of a stop's gap, and number of spans of travel within which a stop may close
EXACT, NEXT = 1e-9, 2.0
AT_REST = LoadedOrders(
    *(np.zeros(1, dtype=np.intp),) * 2, *(np.zeros(1),) * 2, np.zeros((1, 6), dtype=np.complex128), 0
)
_AS_LOADS: Mapping[Channel, Channel] = {
    channels.STATIC_TRAVEL: channels.MOUNT_TRAVEL,
    channels.STATIC_FORCE: channels.MOUNT_FORCE,
}


@np.errstate(invalid="ignore", over="ignore")
def static_loads(model: BoxModel, measure: Measure, lower: Array, upper: Array) -> LinearBound:
    """Return a linear lower bound, on every box, of the largest mount travel or force under static load cases (E60).

    The stops that touch at the centre of a box count as springs. Motion is then linear in the load, and E37 is its
    series. In the rest of the box the motion differs by the force of stops that open or close, at most the stiffness
    times the overshoot of each. Assumed bounds of all travels hold if the travels that follow from them lie within.
    """
    mounting, best = model.mounting(model.lower), zero_bound(lower)
    all_stops = stops_of(mounting)
    used = all_stops.stiffness > 0.0
    # in coordinates with unit mass
    stops = Stops(
        all_stops.rows[used] @ model.root.T,
        all_stops.gaps[used],
        all_stops.stiffness[used],
        all_stops.directions[:, used],
    )
    centres, halves = 0.5 * (lower + upper), 0.5 * (upper - lower)
    matrices, soft = model.stiffness(centres), model.stiffness(lower)
    stable = np.linalg.eigvalsh(soft)[:, 0] > 0.0
    matrices, soft = (np.where(stable[:, None, None], matrix, np.eye(6)) for matrix in (matrices, soft))
    for case in counted_cases(measure, model.problem.engine):
        load = model.root @ case_wrench(mounting.block, case)
        travel = equilibria(matrices, stops, load)[0] @ stops.rows.T
        signs, best_of_case = np.sign(stops.beyond(travel)), zero_bound(lower)
        for _ in range(2):
            bound, reach = _with_stops(model, measure, stops, load, (centres, halves, matrices, soft, travel), signs)
            best_of_case = best_of_case.better_of(bound.where(stable))
            # a stop close to contact may count as a spring too
            signs = np.where(np.abs(travel) + NEXT * np.nan_to_num(reach) > stops.gaps, np.sign(travel), signs)
        best = best.better_of(best_of_case)
    return best


def _with_stops(
    model: BoxModel, measure: Measure, stops: Stops, load: Array, boxes: tuple[Array, ...], signs: Array
) -> tuple[LinearBound, Array]:
    """Return a lower bound of a static measure with the touched bump stops as springs, and how far their travels vary.

    The second array has the largest deviation of each stop's travel from its value at the middle of the box, shape
    (boxes, stops).

    Parameters
    ----------
    load
        Wrench of a load case in coordinates with unit mass, shape (6,).
    boxes
        Centres, half widths, stiffness matrices at the centres and at the softest corners, and stop travels at the
        centres.
    signs
        +1 or -1 for a stop that counts as a spring in that direction, 0 for an open stop, shape (boxes, stops).
    """
    centres, halves, matrices, soft, travel = boxes
    on = signs != 0.0
    pushed = load + np.einsum("bk,ki->bi", signs * stops.stiffness * stops.gaps, stops.rows)
    inverse = np.linalg.inv(np.asarray(matrices + stops.added(on), dtype=np.float64))
    expansion = series(
        centres, halves, inverse[:, None], model.sides, model.sides.inside(model.slopes["stiffness"]),
        np.einsum("bij,bj->bi", inverse, pushed)[:, None],
    )  # fmt: skip
    corner = np.asarray(np.linalg.cholesky(np.asarray(soft + stops.added(on), dtype=np.float64)))
    violation, span = _stop_errors(stops, expansion, corner, signs, travel)
    rows, factors = counted_rows(model.problem, measure)
    maps, map_slopes = model.maps(AT_REST, expansion, _AS_LOADS[measure.channel], rows)
    value = maps.real * factors[:, None]
    side_maps = None if map_slopes is None else map_slopes.real * factors[:, None]
    ends = stops.directions[rows] * factors[:, None] * (not is_travel(_AS_LOADS[measure.channel]))
    value = value + np.einsum("rk,bk,ki->bri", ends, on * stops.stiffness, stops.rows)[:, None]
    response = mapped(expansion, value, side_maps)
    points = response.value[:, 0] - (signs * stops.stiffness * stops.gaps) @ ends.T
    points, slopes = (part.reshape(*part.shape[:-1], -1, 3) for part in (points, response.slopes[:, 0]))
    size = np.linalg.norm(points, axis=-1)
    along = points / np.where(size > 0.0, size, 1.0)[..., None]
    slope = np.einsum("bnpa,bpa->bpn", slopes, along)
    # error by stops that may be open or closed
    reach = _along(corner, value[:, 0])
    if side_maps is not None:
        reach = reach + sum(_along(corner, side) for side in model.sides.maps_by_number(side_maps[:, 0]))
    error = reach * np.sum(violation * _along(corner, stops.rows), axis=1, keepdims=True) + violation @ np.abs(ends).T
    remainder = response.remainder[:, 0, None] + np.linalg.norm(error.reshape(*size.shape, 3), axis=-1)
    # the series diverges close to a free mode
    minimum = np.where(np.isfinite(remainder), size - np.abs(slope).sum(axis=-1) - remainder, -np.inf)
    box, best = np.arange(len(size)), np.argmax(minimum, axis=1)
    bound = LinearBound(size[box, best], slope[box, best], remainder[box, best], response.scores[:, 0])
    return bound.where(np.isfinite(minimum[box, best])), span


def _stop_errors(
    stops: Stops, expansion: Expansion, corner: Array, signs: Array, equilibrium: Array
) -> tuple[Array, Array]:
    """Return bounds of the errors of bump stop forces [N], and of the variation of stop travels in each box (E60).

    Both have the shape (boxes, stops). Unknown errors are infinite.

    Parameters
    ----------
    expansion
        Series of the motion with some stops as springs.
    corner
        Cholesky factor L of the stiffness matrix at the softest corner of each box, these stops included, shape
        (boxes, 6, 6).
    signs
        +1 or -1 for a stop that counts as a spring in that direction, 0 for an open stop, shape (boxes, stops).
    equilibrium
        Stop travels of the approximate static motion, shape (boxes, stops).
    """
    response = mapped(expansion, np.broadcast_to(stops.rows, (len(signs), 1, *stops.rows.shape)))
    travel = np.asarray(response.value[:, 0].real)
    span = np.abs(response.slopes[:, 0]).sum(axis=1) + response.remainder[:, 0, None]
    # overshoot of stops that count as springs, and clearance of open stops
    distance = np.where(signs != 0.0, signs * travel - stops.gaps, stops.gaps - np.abs(travel))
    along = _along(corner, stops.rows)
    wide = np.maximum(span, np.abs(equilibrium - travel) + EXACT * stops.gaps)
    ends = np.zeros(wide.shape, dtype=bool)
    for n in range(MAX_ROUNDS):
        force = stops.stiffness * np.maximum(wide - distance, 0.0)
        wider = (span + along * np.sum(force * along, axis=1, keepdims=True)) * WIDER
        ends = wider <= wide
        wide = np.where(ends, wide, wide + FASTER**n * (wider - wide))
    is_bounded = np.all(np.isfinite(wide) & ends, axis=1)
    force = stops.stiffness * np.maximum(wide - distance, 0.0)
    return np.where(is_bounded[:, None], force, np.inf), span


def _along(root: Array, vectors: Array) -> Array:
    # lengths of L^-1 v for Cholesky factors L and vectors v, shape (k, 6) or (boxes, k, 6), to (boxes, k)
    by_box = np.broadcast_to(vectors, (len(root), *vectors.shape[-2:]))
    return np.asarray(np.linalg.norm(np.linalg.solve(root, by_box.swapaxes(1, 2)), axis=1))


# size |v_j| above which components count by their joint length
NEAR = 0.25
# iterations of the bounds of |v_j|
ROUNDS = 4
# rounding of stiffness and squares, relative to the largest square
ROUNDING = 1e-12
_EYE = np.eye(6, dtype=bool)


def sag(model: BoxModel, x: Array) -> Array:
    """Return the static sag of many designs [m], shape (boxes,); infinite if a motion has no stiffness (E9)."""
    weight = weight_wrench(model.mounting(model.lower).block)
    matrices, pull = model.stiffness(x), model.root @ weight
    stable = np.linalg.eigvalsh(matrices)[:, 0] > 0.0
    y = np.linalg.solve(np.where(stable[:, None, None], matrices, np.eye(6)), pull)
    return np.where(stable, y @ pull / -weight[2], math.inf)


def sag_under(model: BoxModel, _: Measure, lower: Array, upper: Array) -> LinearBound:
    """Return a linear lower bound of the static sag on boxes: its tangent at their middles, because sag is convex (E9).

    The bound is zero if mounts leave a motion without stiffness at the middle.
    """
    weight, halves = weight_wrench(model.mounting(model.lower).block), 0.5 * (upper - lower)
    matrices, pull = model.stiffness(0.5 * (lower + upper)), model.root @ weight
    stable = np.linalg.eigvalsh(matrices)[:, 0] > 0.0
    y = np.linalg.solve(np.where(stable[:, None, None], matrices, np.eye(6)), pull)
    slopes = halves * np.einsum("bi,nij,bj->bn", y, model.slopes["stiffness"], y) / weight[2]
    return LinearBound(y @ pull / -weight[2], slopes, np.zeros(len(lower)), np.abs(slopes)).where(stable)


def axis_residual(model: BoxModel, measure: Measure, lower: Array, upper: Array) -> Array:
    """Return lower bounds of the torque-roll residual on boxes, (boxes,), by tangents at their middles (E19, E46)."""
    assert measure.channel.axis_residual is not None
    axis = measure.channel.axis_residual(model.mounting(model.lower).block, measure.frequency)
    bounds = np.zeros(len(lower))
    slopes = axis.left @ model.slopes["stiffness"] @ axis.right
    for k, matrix in enumerate(model.stiffness(0.5 * (lower + upper))):
        rows = axis.rows(matrix)
        y, constant = axis.linear_bound(rows / (float(np.linalg.norm(rows)) or 1.0))
        minimum = float(y @ axis.stiffness_part(matrix)) - constant - np.abs(slopes @ y) @ (0.5 * (upper[k] - lower[k]))
        bounds[k] = max(float(minimum), 0.0)
    return bounds


def stiffness_in_all(model: BoxModel, x: Array) -> Array:
    """Return the sum of all mount stiffnesses of many designs [N/m], from shape (boxes, n) to (boxes,)."""
    decisions = model.problem.mount_decisions
    gains = np.array([sum(drive.gain for drive in decision.mount_drives) for decision in decisions])
    lowest = model.problem.design([float(v) for v in model.lower], decisions)
    return np.asarray(total_stiffness(lowest.mounts) + (x - model.lower) @ gains)


def _frequencies(model: BoxModel, x: Array) -> Array:
    # [Hz], shape (boxes, 6)
    return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(model.stiffness(x)), 0.0)) / math.tau)


@dataclass(frozen=True, eq=False)
class BoxModes:
    """Modes v of designs in boxes, in coordinates of the modes u of the middles; symbols are those of the module.

    Attributes
    ----------
    modes
        Modes u of the middles as columns, shape (boxes, 6, 6).
    parts
        Upper bounds of the components |v_j| of mode i, shape (boxes, i, j).
    deficits
        Upper bounds of 1 - |v_i|, shape (boxes, i).
    first
        Changes of E_ij / (s_i - s_j) by half the width of each open number, shape (boxes, n, i, j).
    rests
        Upper bounds of the difference of v_j and its linear approximation, shape (boxes, i, j).
    """

    modes: Array
    parts: Array
    deficits: Array
    first: Array
    rests: Array


def box_modes(model: BoxModel, lower: Array, upper: Array) -> BoxModes:
    """Return bounds of the natural modes (frequencies, shapes), valid in whole boxes of stiffness [N/m]."""
    squares, modes = np.linalg.eigh(model.stiffness(0.5 * (lower + upper)))
    slopes = np.einsum("bji,njk,bkl->bnil", modes, model.slopes["stiffness"], modes, optimize=True)
    slopes = slopes * (0.5 * (upper - lower))[:, :, None, None]
    rounding = ROUNDING * np.abs(squares[:, -1, None, None])
    # upper bound of |E|
    change = np.abs(slopes).sum(axis=1) + rounding
    low, high = (np.linalg.eigvalsh(model.stiffness(x)) for x in (lower, upper))
    low, high = np.minimum(low, squares) - rounding[:, :, 0], np.maximum(high, squares) + rounding[:, :, 0]
    diagonal = np.einsum("bjj->bj", change)
    over = low[:, :, None] - (squares + diagonal)[:, None, :]
    under = (squares - diagonal)[:, None, :] - high[:, :, None]
    gaps = np.maximum(np.maximum(over, under), 0.0)
    across = np.where(_EYE, 0.0, change)
    parts, maximum = np.ones_like(across), np.linalg.norm(across, axis=2)[:, None, :]
    for _ in range(ROUNDS):
        coupling = np.minimum(np.einsum("bjk,bik->bij", across, parts), maximum)
        bound = np.where(gaps > 0.0, coupling / np.where(gaps > 0.0, gaps, 1.0), 1.0)
        parts = np.where(_EYE, 1.0, np.minimum(parts, bound))
    others = np.where(_EYE, 0.0, parts)
    deficits = 1.0 - np.sqrt(np.maximum(1.0 - np.sum(others**2, axis=2), 0.0))
    square_changes = np.maximum(high - squares, squares - low)
    coupling = np.einsum("bjk,bik->bij", change, others)
    rest = change * deficits[:, :, None] + coupling + square_changes[:, :, None] * parts + rounding
    differences = squares[:, :, None] - squares[:, None, :]
    is_equal = differences == 0.0
    differences = np.where(_EYE | is_equal, np.inf, differences)
    rests = np.where(_EYE, 0.0, np.where(is_equal, np.inf, rest / np.abs(differences)))
    return BoxModes(modes, parts, deficits, slopes / differences[:, None], rests)


def maximum_shares(model: BoxModel, measure: Measure, lower: Array, upper: Array) -> Array:
    """Return upper bounds of the largest energy share of each motion in any mode, (motions, boxes) (E7, E39)."""
    box = box_modes(model, lower, upper)
    return np.array([_shares(model, box, motion)[2].max(axis=1) for motion in motion_indices(measure)])


def shortfall(model: BoxModel, measure: Measure, lower: Array, upper: Array) -> Array:
    """Return lower bounds of the decoupling shortfall (missing energy shares) on boxes, shape (boxes,) (E47, E64)."""
    box = box_modes(model, lower, upper)
    total, slopes, boxes = np.zeros(len(lower)), np.zeros_like(lower), np.arange(len(lower))
    alone = np.zeros(len(lower))
    for motion in motion_indices(measure):
        values, share_slopes, maximum = _shares(model, box, motion)
        alone += np.maximum(measure.wanted - maximum.max(axis=1), 0.0)
        # the largest share is at most that of one mode, and the most by which another mode exceeds it
        best = np.argmax(values, axis=1)
        value, slope = values[boxes, best], share_slopes[boxes, best]
        above = values - value[:, None] + np.abs(share_slopes - slope[:, None]).sum(axis=2)
        above[boxes, best] = 0.0
        # a shortfall is at least zero, and at least its linear bound
        linear = measure.wanted - (value + np.maximum(above, 0.0).max(axis=1))
        counts = (linear > 0.0) & (linear + np.abs(slope).sum(axis=1) > 0.0)
        total += np.where(counts, linear, 0.0)
        slopes += np.where(counts[:, None], slope, 0.0)
    return np.asarray(np.maximum(alone, total - np.abs(slopes).sum(axis=1)))


def _shares(model: BoxModel, box: BoxModes, motion: int) -> tuple[Array, Array, Array]:
    """Return two upper bounds of a motion's kinetic energy share in every mode: value + slopes . s, and a constant.

    The shapes of value, slopes and constant are (boxes, modes), (boxes, modes, n) and (boxes, modes).
    """
    shape, momentum = model.root[:, motion], np.linalg.inv(model.root)[motion]
    a, b = shape @ box.modes, momentum @ box.modes
    near = _projection_bounds(a, box.parts) * _projection_bounds(b, box.parts)
    both = a[:, :, None] * b[:, None, :] + a[:, None, :] * b[:, :, None]
    slopes = np.einsum("bij,bnij->bin", np.where(_EYE, 0.0, both), box.first)
    other_parts = np.where(_EYE, 0.0, box.parts)
    far = [np.abs(c) * box.deficits + np.einsum("bij,bj->bi", other_parts, np.abs(c)) for c in (a, b)]
    with np.errstate(invalid="ignore"):
        rest = np.where(both == 0.0, 0.0, np.abs(both) * box.rests).sum(axis=2)
    rest = rest + np.maximum(-2.0 * a * b, 0.0) * box.deficits + far[0] * far[1]
    value = a * b + rest
    reach = np.abs(slopes).sum(axis=2)
    # use constants where the linear function is not lower
    poor = ~(value + reach < near)
    value, slopes = np.where(poor, near, value), np.where(poor[:, :, None], 0.0, slopes)
    return value, slopes, np.minimum(near, value + np.abs(slopes).sum(axis=2))


def _projection_bounds(components: Array, parts: Array) -> Array:
    # upper bounds of |vector' v| for every mode v, by the vector's components in the modes u, shape (boxes, modes)
    sizes = np.abs(components)[:, None]
    near = parts > NEAR
    total = np.sqrt(np.sum(np.where(near, sizes, 0.0) ** 2, axis=2))
    total += np.sum(np.where(near, 0.0, sizes * parts), axis=2)
    return np.asarray(np.minimum(total, np.sum(sizes * parts, axis=2)))


Ranges: TypeAlias = Callable[[BoxModel, Measure, Array, Array], tuple[Array | float, Array | float]]
RANGES: Mapping[Channel, Ranges] = {
    channels.SAG: lambda model, _, lower, upper: (sag(model, upper), sag(model, lower)),
    channels.TOTAL_STIFFNESS: lambda model, _, lower, upper: (
        stiffness_in_all(model, lower), stiffness_in_all(model, upper)
    ),
    channels.TORQUE_ROLL: lambda *box: (axis_residual(*box), math.inf),
    channels.RAW_TORQUE_ROLL: lambda *box: (axis_residual(*box), math.inf),
    channels.DECOUPLING: lambda *box: (-math.inf, maximum_shares(*box).min(axis=0)),
    channels.STATIC_TRAVEL: lambda *box: (static_loads(*box).minimum, math.inf),
    channels.STATIC_FORCE: lambda *box: (static_loads(*box).minimum, math.inf),
    channels.DECOUPLING_SHORTFALL: lambda *box: (shortfall(*box), math.inf),
    channels.FREQUENCIES: lambda model, _, lower, upper: (
        _frequencies(model, lower)[:, -1], _frequencies(model, upper)[:, 0]
    ),
}  # fmt: skip
"""Lower and upper bounds of mount numbers on boxes: more stiffness lowers sag and raises every frequency (E39).

If a measure has several numbers, the lower bound is that of the largest and the upper bound that of the smallest.
"""
LINEAR_BOUNDS: Mapping[Channel, Callable[[BoxModel, Measure, Array, Array], LinearBound]] = {
    channels.SAG: sag_under,
    channels.STATIC_TRAVEL: static_loads,
    channels.STATIC_FORCE: static_loads,
}
"""Linear lower bounds of mount numbers, so that limits on these numbers have a multiplier on a box (E38)."""
BOUNDED_LINEARLY = frozenset({channels.STATIC_TRAVEL, channels.STATIC_FORCE})
"""Channels whose bounds in `RANGES` are no better than their linear bounds."""


def breaks(model: BoxModel, limit: Limit, lower: Array, upper: Array) -> Mask:
    """Return True for boxes in which every design violates a limit, shape (boxes,) (E39)."""
    minimum, maximum = RANGES[limit.measure.channel](model, limit.measure, lower, upper)
    violated = np.zeros(len(lower), dtype=bool) | (minimum > limit.maximum * (1.0 + SLACK))
    violated |= maximum < limit.minimum * (1.0 - SLACK)
    if limit.outside is not None:
        a, b = limit.outside[0] * (1.0 + SLACK), limit.outside[1] * (1.0 - SLACK)
        violated |= np.any((_frequencies(model, lower) > a) & (_frequencies(model, upper) < b), axis=1)
    return np.asarray(violated)
