"""Mounts that stand as in a mirror: symmetric and antisymmetric motions, each by itself (E57).

Where block, mounts and all that is open of them are the same on both sides of the plane y = 0, a mirror R commutes with
mass, stiffness and damping of every design. Responses then are the sum of those to both parts of a load, and no norm
that treats sides alike is under that of either part, which is that of (f + R f) / 2 or (f - R f) / 2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.parameter_maps import PlaceTerm, SpringTerm
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.physics.elastic_mounts import DynamicSprings

# share of the largest of its kind that counts as no difference
SAME = 1e-12
ACROSS = np.diag([1.0, -1.0, 1.0])
MOTION = np.diag([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def split_mounts(mounts: OpenMounts) -> tuple[OpenMounts, ...]:
    """Return the mounts for symmetric and for antisymmetric motions; nothing if they are not symmetric.

    Of two that mirror each other the first stays, its motions longer by the root of two.
    """
    mirror = np.asarray(np.linalg.solve(mounts.root.T, MOTION @ mounts.root.T), dtype=np.float64)
    images = _images(mounts, mirror)
    if mounts.dynamic or not _is_same(mirror, mirror.T) or images is None:
        return ()
    values, vectors = np.linalg.eigh(mirror)
    return tuple(_part(mounts, images, vectors[:, values * sign > 0.0]) for sign in (1.0, -1.0))


def split_signal(signal: ComplexArray, members: Sequence[tuple[int, ...]]) -> tuple[ComplexArray, ComplexArray]:
    """Return the symmetric and the antisymmetric part of a signal, shape (mounts, 3)."""
    image = np.empty_like(signal)
    for own in members:
        image[list(own)] = signal[list(own[::-1])] @ ACROSS
    return 0.5 * (signal + image), 0.5 * (signal - image)


def _images(mounts: OpenMounts, mirror: Array) -> list[int] | None:
    """Return the index of each spring's mirror image, or None if the mounting is not symmetric."""
    opened, damped = (np.zeros((len(mounts.motions), mounts.numbers, 3, 3)) for _ in range(2))
    for spring in mounts.springs:
        for j, matrix in spring.terms:
            term = spring.axes @ matrix @ spring.axes.T
            opened[spring.mount, j] += spring.elastic * term
            damped[spring.mount, j] += spring.viscous * term
    pairs = [(mounts.motions, ACROSS @ mounts.motions @ mirror)]
    pairs += [(each, ACROSS @ each @ ACROSS) for each in (mounts.middles, mounts.dampers, opened, damped)]
    pairs += [(each, each) for each in (mounts.losses, mounts.lags, mounts.softest)]
    sized = [(values, image, float(np.abs(values).max(initial=0.0))) for values, image in pairs]
    images: list[int] = []
    for m in range(len(mounts.motions)):
        rest = [k for k in range(len(mounts.motions)) if k not in images]
        alike = [k for k in rest if all(_is_same(values[k], image[m], size) for values, image, size in sized)]
        if not alike:
            return None
        images.append(m if m in alike else alike[0])
    stands = {int(mounts.stands[m]): int(mounts.stands[k]) for m, k in enumerate(images)}
    for m, k in enumerate(images):
        here, there = int(mounts.stands[m]), int(mounts.stands[k])
        if images[k] != m or stands[here] != there or (m == k) != (here == there):
            return None
    for place in mounts.places:
        side, reaches = float((ACROSS @ place.axis) @ place.axis), dict(place.mounts)
        if any(abs(reaches.get(images[m], 0.0) - side * h) > SAME * abs(h) for m, h in place.mounts):
            return None
    return images


def _is_same(first: Array, second: Array, size: float | None = None) -> bool:
    size = float(np.abs(first).max(initial=0.0)) if size is None else size
    return bool(np.abs(first - second).max(initial=0.0) <= SAME * size)


def _part(mounts: OpenMounts, images: list[int], basis: Array) -> OpenMounts:
    """Return the mounts for motions of a basis, shape (6, k)."""
    retained = [m for m, k in enumerate(images) if m <= k]
    times = np.sqrt([1.0 if images[m] == m else 2.0 for m in retained])
    root = basis.T @ mounts.root
    motions = mounts.motions[retained] @ basis * times[:, None, None]
    number = {m: k for k, m in enumerate(retained)}
    places = []
    for place in mounts.places:
        turns = np.linalg.norm(place.aside @ root.T[3:], axis=1)
        acts = turns > SAME * float(np.linalg.norm(root[:, 3:]))
        reaches = tuple((number[m], float(h * times[number[m]])) for m, h in place.mounts if m in number)
        places.append(replace(place, mounts=reaches, aside=place.aside[acts]))
    springs = [replace(spring, mount=number[spring.mount]) for spring in mounts.springs if spring.mount in number]
    stands, own = np.unique(mounts.stands[retained], return_inverse=True)
    pairs = {int(mounts.stands[m]): int(mounts.stands[images[m]]) for m in retained}

    def within(matrix: Array) -> Array:
        return np.asarray(basis.T @ matrix @ basis)

    return replace(
        mounts, root=root, motions=motions, middles=mounts.middles[retained], dampers=mounts.dampers[retained],
        losses=mounts.losses[retained], lags=mounts.lags[retained], stands=own.astype(np.intp),
        softest=mounts.softest[retained],
        dynamic=DynamicSprings((), np.zeros((0, 6)), np.zeros((3 * len(stands), 0))),
        springs=tuple(spring for spring in springs if _acts(spring, motions, places)),
        places=tuple(place for place in places if len(place.aside)),
        members=tuple(tuple(sorted({int(k), pairs[int(k)]})) for k in stands),
        floors=tuple(map(within, mounts.floors)), ceilings=tuple(map(within, mounts.ceilings)),
        minimum=within(mounts.minimum), maximum=within(mounts.maximum), lossy=within(mounts.lossy),
        lagging=within(mounts.lagging), damping=within(mounts.damping),
    )  # fmt: skip


def _acts(spring: SpringTerm, motions: Array, places: Sequence[PlaceTerm]) -> bool:
    size, motion = float(np.abs(motions).max()), motions[spring.mount]
    moved = [h * place.arms for place in places for m, h in place.mounts if m == spring.mount]
    return any(np.abs(each @ spring.axes).max(initial=0.0) > SAME * size for each in (motion.T, *moved))
