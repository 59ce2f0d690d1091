"""Mounts that stand as in a mirror: motions that it keeps and motions that it turns round, each by itself (E57).

Where block, mounts and all that is open of them are the same on both sides of the plane y = 0, a mirror R commutes with
mass, stiffness and damping of every design. Responses then are the sum of those to both halves of a load, and no
norm that does not tell sides apart is under that of either half, for it is that of (f + R f) / 2 or (f - R f) / 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.opened import Place, Spring
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.physics.dynamic_springs import DynamicSprings

# what counts as the same, beside the largest of its kind
SAME = 1e-12
ACROSS = np.diag([1.0, -1.0, 1.0])
MOTION = np.diag([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def mirrored_parts(mounts: OpenMounts) -> tuple[OpenMounts, ...]:
    """The same mounts for motions that the mirror keeps, and for those that it turns round.

    Of two that mirror each other the first stays, its motions longer by the root of two. None where they do not all.
    """
    mirror = np.asarray(np.linalg.solve(mounts.root.T, MOTION @ mounts.root.T), dtype=np.float64)
    others = _others(mounts, mirror)
    if mounts.dynamic or not _is_same(mirror, mirror.T) or others is None:
        return ()
    values, vectors = np.linalg.eigh(mirror)
    return tuple(_part(mounts, others, vectors[:, values * sign > 0.0]) for sign in (1.0, -1.0))


def mirrored_halves(signal: ComplexArray, members: Sequence[tuple[int, ...]]) -> tuple[ComplexArray, ComplexArray]:
    """What is felt of both parts, shape (mounts, 3): half the sum with what the mirror makes of it, and the rest."""
    image = np.empty_like(signal)
    for own in members:
        image[list(own)] = signal[list(own[::-1])] @ ACROSS
    return 0.5 * (signal + image), 0.5 * (signal - image)


def _others(mounts: OpenMounts, mirror: Array) -> list[int] | None:
    """Of every spring the one that is its image; None where one has none."""
    opened, lost = (np.zeros((len(mounts.motions), mounts.numbers, 3, 3)) for _ in range(2))
    for spring in mounts.springs:
        for j, matrix in spring.terms:
            own = spring.axes @ matrix @ spring.axes.T
            opened[spring.mount, j] += spring.elastic * own
            lost[spring.mount, j] += spring.viscous * own
    pairs = [(mounts.motions, ACROSS @ mounts.motions @ mirror)]
    pairs += [(each, ACROSS @ each @ ACROSS) for each in (mounts.middles, mounts.dampers, opened, lost)]
    pairs += [(each, each) for each in (mounts.losses, mounts.lags, mounts.softest)]
    images = [(given, image, float(np.abs(given).max(initial=0.0))) for given, image in pairs]
    found: list[int] = []
    for m in range(len(mounts.motions)):
        left = [k for k in range(len(mounts.motions)) if k not in found]
        alike = [k for k in left if all(_is_same(given[k], image[m], size) for given, image, size in images)]
        if not alike:
            return None
        found.append(m if m in alike else alike[0])
    stands = {int(mounts.stands[m]): int(mounts.stands[k]) for m, k in enumerate(found)}
    for m, k in enumerate(found):
        here, there = int(mounts.stands[m]), int(mounts.stands[k])
        if found[k] != m or stands[here] != there or (m == k) != (here == there):
            return None
    return found if all(_is_closed(place, found) for place in mounts.places) else None


def _is_closed(place: Place, others: list[int]) -> bool:
    side = float((ACROSS @ place.axis) @ place.axis)
    reaches = dict(place.mounts)
    return all(abs(reaches.get(others[m], 0.0) - side * h) <= SAME * abs(h) for m, h in place.mounts)


def _is_same(first: Array, second: Array, size: float | None = None) -> bool:
    size = float(np.abs(first).max(initial=0.0)) if size is None else size
    return bool(np.abs(first - second).max(initial=0.0) <= SAME * size)


def _part(mounts: OpenMounts, others: list[int], basis: Array) -> OpenMounts:
    """For motions of a basis, shape (6, k)."""
    kept = [m for m, k in enumerate(others) if m <= k]
    times = np.sqrt([1.0 if others[m] == m else 2.0 for m in kept])
    root = basis.T @ mounts.root
    motions = mounts.motions[kept] @ basis * times[:, None, None]
    number = {m: k for k, m in enumerate(kept)}
    places = [_seen(place, number, times, root) for place in mounts.places]
    springs = [replace(spring, mount=number[spring.mount]) for spring in mounts.springs if spring.mount in number]
    stands, own = np.unique(mounts.stands[kept], return_inverse=True)
    images = {int(mounts.stands[m]): int(mounts.stands[others[m]]) for m in kept}
    pairs = [tuple(sorted({int(k), images[int(k)]})) for k in stands]

    def within(matrix: Array) -> Array:
        return np.asarray(basis.T @ matrix @ basis)

    return replace(
        mounts, root=root, motions=motions, middles=mounts.middles[kept], dampers=mounts.dampers[kept],
        losses=mounts.losses[kept], lags=mounts.lags[kept], stands=own.astype(np.intp), softest=mounts.softest[kept],
        dynamic=DynamicSprings((), np.zeros((0, 6)), np.zeros((3 * len(stands), 0))),
        springs=tuple(spring for spring in springs if _moves(spring, motions, places)),
        places=tuple(place for place in places if len(place.aside)), members=tuple(pairs),
        floors=tuple(map(within, mounts.floors)), ceilings=tuple(map(within, mounts.ceilings)),
        least=within(mounts.least), most=within(mounts.most), lossy=within(mounts.lossy),
        lagging=within(mounts.lagging), damping=within(mounts.damping),
    )  # fmt: skip


def _seen(place: Place, number: dict[int, int], times: Array, root: Array) -> Place:
    turns = np.linalg.norm(place.aside @ root.T[3:], axis=1)
    some = turns > SAME * float(np.linalg.norm(root[:, 3:]))
    own = tuple((number[m], float(h * times[number[m]])) for m, h in place.mounts if m in number)
    return replace(place, mounts=own, aside=place.aside[some])


def _moves(spring: Spring, motions: Array, places: Sequence[Place]) -> bool:
    size, motion = float(np.abs(motions).max()), motions[spring.mount]
    moved = [h * place.arms for place in places for m, h in place.mounts if m == spring.mount]
    return any(np.abs(each @ spring.axes).max(initial=0.0) > SAME * size for each in (motion.T, *moved))
