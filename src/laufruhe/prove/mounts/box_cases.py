"""Lower bounds of travel and force under static load cases over boxes of stiffness, with bump stops (E37, E55, E60).

The stops that touch at the centre of a box count as springs. Motion is then linear in the load, and E37 is its series.
In the rest of the box the motion differs by the force of stops that open or close. The force of such a stop is at most
its stiffness times its overshoot. Assumed bounds of all travels hold if the travels that follow from them lie within.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics.static_cases import Stops, case_wrench, stops_of
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel, counted_cases
from laufruhe.problem.measure import Measure
from laufruhe.prove.mounts.box_norms import LinearBound, counted_rows, zero_bound
from laufruhe.prove.mounts.box_response import BoxModel, LoadedOrders, is_travel
from laufruhe.prove.mounts.box_series import Expansion, mapped, series

STEPS, HALVINGS = 30, 12
# iterations of bounds of travel, factor beyond the implied bound, and growth of a step
ROUNDS, WIDER, FASTER = 16, 1.0 + 1e-6, 1.4
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
    """Return a linear lower bound, on every box, of the largest mount travel or force under static load cases (E60)."""
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
        travel = _equilibrium(matrices, stops, load) @ stops.rows.T
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


def _equilibrium(matrices: Array, stops: Stops, load: Array) -> Array:
    """Return approximate static motions under a load, shape (boxes, 6); bounds hold for any accuracy of them."""

    def energy(y: Array) -> Array:
        elastic = 0.5 * np.einsum("bi,bij,bj->b", y, matrices, y) - y @ load
        return np.asarray(elastic + 0.5 * stops.beyond(y @ stops.rows.T) ** 2 @ stops.stiffness)

    y: Array = np.asarray(np.linalg.solve(matrices, load[:, None])[..., 0], dtype=np.float64)
    for _ in range(STEPS):
        over = stops.beyond(y @ stops.rows.T)
        residual = load - np.einsum("bij,bj->bi", matrices, y) - (over * stops.stiffness) @ stops.rows
        tangent = matrices + stops.added(over != 0.0)
        step: Array = np.asarray(np.linalg.solve(tangent, residual[..., None])[..., 0], dtype=np.float64)
        start_energy, share = energy(y), np.ones(len(y))
        for _ in range(HALVINGS):
            share = np.where(energy(y + share[:, None] * step) <= start_energy, share, 0.5 * share)
        y = np.asarray(y + share[:, None] * step)
        if np.all(np.linalg.norm(share[:, None] * step, axis=1) <= 1e-12 * np.linalg.norm(y, axis=1)):
            break
    return np.asarray(y)


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
    for n in range(ROUNDS):
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
