"""Travel and force under loads that are held, over boxes of stiffness, bump stops included (E37, E55, E60).

With the stops that are met at the centre of a box as springs, motion is linear in the load, and its series is that of
E37. Other motions differ by what stops add, or do not, on the way from the centre on: each no more than it comes past
its gap. Travels stay within any bounds that are wider than what these make of themselves.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics.static_cases import Stops, case_wrench, stops_of
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel, counted_cases
from laufruhe.problem.measure import Measure
from laufruhe.prove.mounts.box_norms import Under, counted_rows, nothing_under
from laufruhe.prove.mounts.box_response import BoxModel, Lines, is_travel
from laufruhe.prove.mounts.box_series import Expansion, mapped, series

STEPS, HALVINGS = 30, 12
# how often bounds of travels are widened, by how much more than they have to be, and by how much more each time
ROUNDS, WIDER, FASTER = 16, 1.0 + 1e-6, 1.4
# share of a gap that a balance is exact to, and how many times what a travel differs by are next to a gap
EXACT, NEXT = 1e-9, 2.0
STILL = Lines(*(np.zeros(1, dtype=np.intp),) * 2, *(np.zeros(1),) * 2, np.zeros((1, 6), dtype=np.complex128))
_AS_LOADS: Mapping[Channel, Channel] = {
    channels.STATIC_TRAVEL: channels.MOUNT_TRAVEL,
    channels.STATIC_FORCE: channels.MOUNT_FORCE,
}


def held_loads(model: BoxModel, asked: Measure, lower: Array, upper: Array) -> Under:
    """A linear function under the largest travel or force under load cases, for every box (E60)."""
    mounting, best = model.mounting(model.lower), nothing_under(lower)
    found = stops_of(mounting)
    some = found.stiffness > 0.0
    # in coordinates in which the mass is one
    stops = Stops(found.rows[some] @ model.root.T, found.gaps[some], found.stiffness[some], found.directions[:, some])
    for case in counted_cases(asked, model.problem.engine):
        load = model.root @ case_wrench(mounting.block, case)
        with np.errstate(invalid="ignore", over="ignore"):
            best = best.or_else(_of_case(model, asked, stops, load, lower, upper))
    return best


def _of_case(model: BoxModel, asked: Measure, stops: Stops, load: Array, lower: Array, upper: Array) -> Under:
    """Under one load case."""
    centres, halves = 0.5 * (lower + upper), 0.5 * (upper - lower)
    matrices, soft = model.stiffness(centres), model.stiffness(lower)
    held = np.linalg.eigvalsh(soft)[:, 0] > 0.0
    matrices, soft = (np.where(held[:, None, None], each, np.eye(6)) for each in (matrices, soft))
    middle = _balanced(matrices, stops, load)
    travel = middle @ stops.rows.T
    signs, best = np.sign(stops.beyond(travel)), nothing_under(lower)
    for _ in range(2):
        found, reach = _with_stops(model, asked, stops, load, (centres, halves, matrices, soft, travel), signs)
        best = best.or_else(found.where(held))
        # a stop that is just not met may be taken as a spring as well
        signs = np.where(np.abs(travel) + NEXT * np.nan_to_num(reach) > stops.gaps, np.sign(travel), signs)
    return best


def _with_stops(
    model: BoxModel, asked: Measure, stops: Stops, load: Array, boxes: tuple[Array, ...], signs: Array
) -> tuple[Under, Array]:
    """With some stops as springs, by the signs of their travel; and what travels differ by all over a box at first."""
    centres, halves, matrices, soft, met = boxes
    on = signs != 0.0
    pushed = load + np.einsum("bk,ki->bi", signs * stops.stiffness * stops.gaps, stops.rows)
    inverse = np.linalg.inv(np.asarray(matrices + stops.added(on), dtype=np.float64))
    at = series(
        centres, halves, inverse[:, None], model.sides, model.sides.inside(model.stiffness_slopes),
        np.einsum("bij,bj->bi", inverse, pushed)[:, None],
    )  # fmt: skip
    corner = np.asarray(np.linalg.cholesky(np.asarray(soft + stops.added(on), dtype=np.float64)))
    off_by, first = _strayed(stops, at, corner, signs, met)
    rows, factors = counted_rows(model.problem, asked)
    maps, turned = model.maps(STILL, at, _AS_LOADS[asked.channel], rows)
    value = maps.real * factors[:, None]
    by_side = None if turned is None else turned.real * factors[:, None]
    ends = stops.directions[rows] * factors[:, None] * (not is_travel(_AS_LOADS[asked.channel]))
    value = value + np.einsum("rk,bk,ki->bri", ends, on * stops.stiffness, stops.rows)[:, None]
    answer = mapped(at, value, by_side)
    points = answer.value[:, 0] - (signs * stops.stiffness * stops.gaps) @ ends.T
    points, bends = (part.reshape(*part.shape[:-1], -1, 3) for part in (points, answer.slopes[:, 0]))
    size = np.linalg.norm(points, axis=-1)
    along = points / np.where(size > 0.0, size, 1.0)[..., None]
    bent = np.einsum("bnpa,bpa->bpn", bends, along)
    # what stops that may be on either side of their gap may add
    reach = _along(corner, value[:, 0])
    if by_side is not None:
        reach = reach + sum(_along(corner, side) for side in model.sides.apart(by_side[:, 0]))
    stray = reach * np.sum(off_by * _along(corner, stops.rows), axis=1, keepdims=True) + off_by @ np.abs(ends).T
    lost = answer.rest[:, 0, None] + np.linalg.norm(stray.reshape(*size.shape, 3), axis=-1)
    # next to a free mode an expansion does not end
    least = np.where(np.isfinite(lost), size - np.abs(bent).sum(axis=-1) - lost, -np.inf)
    own, best = np.arange(len(size)), np.argmax(least, axis=1)
    found = Under(size[own, best], bent[own, best], lost[own, best], answer.bends[:, 0])
    return found.where(np.isfinite(least[own, best])), first


def _balanced(matrices: Array, stops: Stops, load: Array) -> Array:
    """Motion at designs, shape (boxes, 6); nothing depends on how near it comes."""

    def energy(y: Array) -> Array:
        own = 0.5 * np.einsum("bi,bij,bj->b", y, matrices, y) - y @ load
        return np.asarray(own + 0.5 * stops.beyond(y @ stops.rows.T) ** 2 @ stops.stiffness)

    y: Array = np.asarray(np.linalg.solve(matrices, load[:, None])[..., 0], dtype=np.float64)
    for _ in range(STEPS):
        over = stops.beyond(y @ stops.rows.T)
        pull = load - np.einsum("bij,bj->bi", matrices, y) - (over * stops.stiffness) @ stops.rows
        whole = matrices + stops.added(over != 0.0)
        step: Array = np.asarray(np.linalg.solve(whole, pull[..., None])[..., 0], dtype=np.float64)
        here, share = energy(y), np.ones(len(y))
        for _ in range(HALVINGS):
            share = np.where(energy(y + share[:, None] * step) <= here, share, 0.5 * share)
        y = np.asarray(y + share[:, None] * step)
        if np.all(np.linalg.norm(share[:, None] * step, axis=1) <= 1e-12 * np.linalg.norm(y, axis=1)):
            break
    return np.asarray(y)


def _strayed(stops: Stops, at: Expansion, corner: Array, signs: Array, met: Array) -> tuple[Array, Array]:
    """What the force of stops may differ from that of springs or of nothing, (boxes, k), infinite if not known; E60."""
    told = mapped(at, np.broadcast_to(stops.rows, (len(signs), 1, *stops.rows.shape)))
    travel = np.asarray(told.value[:, 0].real)
    first = np.abs(told.slopes[:, 0]).sum(axis=1) + told.rest[:, 0, None]
    # how far springs are past their gaps, and the others within
    apart = np.where(signs != 0.0, signs * travel - stops.gaps, stops.gaps - np.abs(travel))
    along = _along(corner, stops.rows)
    wide = np.maximum(first, np.abs(met - travel) + EXACT * stops.gaps)
    ends = np.zeros(wide.shape, dtype=bool)
    for n in range(ROUNDS):
        past = stops.stiffness * np.maximum(wide - apart, 0.0)
        wider = (first + along * np.sum(past * along, axis=1, keepdims=True)) * WIDER
        ends = wider <= wide
        wide = np.where(ends, wide, wide + FASTER**n * (wider - wide))
    known = np.all(np.isfinite(wide) & ends, axis=1)
    past = stops.stiffness * np.maximum(wide - apart, 0.0)
    return np.where(known[:, None], past, np.inf), first


def _along(root: Array, vectors: Array) -> Array:
    """Length of L^-1 v of vectors, (k, 6) or (boxes, k, 6), to (boxes, k)."""
    whole = np.broadcast_to(vectors, (len(root), *vectors.shape[-2:]))
    return np.asarray(np.linalg.norm(np.linalg.solve(root, whole.swapaxes(1, 2)), axis=1))
