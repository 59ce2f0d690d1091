"""Split of mirror-symmetric mounts into symmetric and antisymmetric motions (E57).

Where block, mounts and their open numbers are alike on both sides of the plane y = 0, a mirror R commutes with mass,
stiffness and damping of each design. The response then is the sum of the responses to (f + R f) / 2 and (f - R f) / 2.
A norm that treats both sides alike is at least its value for either of the two responses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.extensions.mount_relaxation.parameter_maps import PlaceTerm, SpringTerm
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.physics.elastic_mounts import DynamicSprings

# relative difference that counts as none
REL_TOL = 1e-12
# mirror at the plane y = 0: of a vector, and of a motion with its turns
ACROSS = np.diag([1.0, -1.0, 1.0])
MOTION = np.diag([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


def split_mounts(mounts: OpenMounts) -> tuple[OpenMounts, ...]:
    """Return models of the mounts for symmetric and for antisymmetric motions; () if mounts are not symmetric.

    The first mount of each mirrored pair stands for both; its motions are longer by the root of two.
    """
    mirror = np.asarray(np.linalg.solve(mounts.root.T, MOTION @ mounts.root.T), dtype=np.float64)
    images = _images(mounts, mirror)
    if mounts.dynamic or not _is_same(mirror, mirror.T) or images is None:
        return ()
    values, vectors = np.linalg.eigh(mirror)
    return tuple(_part(mounts, images, vectors[:, values * sign > 0.0]) for sign in (1.0, -1.0))


def split_signal(signal: ComplexArray, members: Sequence[tuple[int, ...]]) -> tuple[ComplexArray, ComplexArray]:
    """Return symmetric and antisymmetric signals, shape (mounts, 3) each; `members` are mirrored pairs of mounts."""
    image = np.empty_like(signal)
    for pair in members:
        image[list(pair)] = signal[list(pair[::-1])] @ ACROSS
    return 0.5 * (signal + image), 0.5 * (signal - image)


def _images(mounts: OpenMounts, mirror: Array) -> list[int] | None:
    """Return the index of each spring's mirror image, or None if the mounting is not symmetric.

    The matrix `mirror`, shape (6, 6), mirrors a motion in coordinates of unit mass.
    """
    elastic_terms, viscous_terms = (np.zeros((len(mounts.motions), mounts.numbers, 3, 3)) for _ in range(2))
    for spring in mounts.springs:
        for j, matrix in spring.terms:
            term = spring.axes @ matrix @ spring.axes.T
            elastic_terms[spring.mount, j] += spring.elastic * term
            viscous_terms[spring.mount, j] += spring.viscous * term
    pairs = [(mounts.motions, ACROSS @ mounts.motions @ mirror)]
    pairs += [
        (matrices, ACROSS @ matrices @ ACROSS)
        for matrices in (mounts.middles, mounts.dampers, elastic_terms, viscous_terms)
    ]
    pairs += [(matrices, matrices) for matrices in (mounts.losses, mounts.lags, mounts.softest)]
    comparisons = [(values, image, float(np.abs(values).max(initial=0.0))) for values, image in pairs]
    images: list[int] = []
    for m in range(len(mounts.motions)):
        free = [k for k in range(len(mounts.motions)) if k not in images]
        matches = [k for k in free if all(_is_same(values[k], image[m], size) for values, image, size in comparisons)]
        if not matches:
            return None
        images.append(m if m in matches else matches[0])
    spring_mounts = {int(mounts.spring_mounts[m]): int(mounts.spring_mounts[k]) for m, k in enumerate(images)}
    for m, k in enumerate(images):
        mount, mirrored_mount = int(mounts.spring_mounts[m]), int(mounts.spring_mounts[k])
        if images[k] != m or spring_mounts[mount] != mirrored_mount or (m == k) != (mount == mirrored_mount):
            return None
    for place in mounts.places:
        side, reach_of = float((ACROSS @ place.axis) @ place.axis), dict(place.mounts)
        if any(abs(reach_of.get(images[m], 0.0) - side * h) > REL_TOL * abs(h) for m, h in place.mounts):
            return None
    return images


def _is_same(first: Array, second: Array, scale: float | None = None) -> bool:
    scale = float(np.abs(first).max(initial=0.0)) if scale is None else scale
    return bool(np.abs(first - second).max(initial=0.0) <= REL_TOL * scale)


def _part(mounts: OpenMounts, images: list[int], basis: Array) -> OpenMounts:
    """Return the model of the mounts for the motions that the columns of `basis` span, shape (6, k).

    `images` are the indices of the mirror images of all springs.
    """
    retained = [m for m, k in enumerate(images) if m <= k]
    lengths = np.sqrt([1.0 if images[m] == m else 2.0 for m in retained])
    root = basis.T @ mounts.root
    motions = mounts.motions[retained] @ basis * lengths[:, None, None]
    index = {m: k for k, m in enumerate(retained)}
    places = []
    for place in mounts.places:
        turns = np.linalg.norm(place.turn_axes @ root.T[3:], axis=1)
        is_moved = turns > REL_TOL * float(np.linalg.norm(root[:, 3:]))
        reaches = tuple((index[m], float(reach * lengths[index[m]])) for m, reach in place.mounts if m in index)
        places.append(replace(place, mounts=reaches, turn_axes=place.turn_axes[is_moved]))
    springs = [replace(spring, mount=index[spring.mount]) for spring in mounts.springs if spring.mount in index]
    spring_mounts, numbers = np.unique(mounts.spring_mounts[retained], return_inverse=True)
    pairs = {int(mounts.spring_mounts[m]): int(mounts.spring_mounts[images[m]]) for m in retained}

    def projected(matrix: Array) -> Array:
        return np.asarray(basis.T @ matrix @ basis)

    return replace(
        mounts, root=root, motions=motions, middles=mounts.middles[retained], dampers=mounts.dampers[retained],
        losses=mounts.losses[retained], lags=mounts.lags[retained], spring_mounts=numbers.astype(np.intp),
        softest=mounts.softest[retained],
        dynamic=DynamicSprings((), np.zeros((0, 6)), np.zeros((3 * len(spring_mounts), 0))),
        springs=tuple(spring for spring in springs if _acts(spring, motions, places)),
        places=tuple(place for place in places if len(place.turn_axes)),
        members=tuple(tuple(sorted({int(k), pairs[int(k)]})) for k in spring_mounts),
        floors=tuple(map(projected, mounts.floors)), ceilings=tuple(map(projected, mounts.ceilings)),
        minimum=projected(mounts.minimum), maximum=projected(mounts.maximum), loss_floor=projected(mounts.loss_floor),
        lag_floor=projected(mounts.lag_floor), damping=projected(mounts.damping),
    )  # fmt: skip


def _acts(spring: SpringTerm, motions: Array, places: Sequence[PlaceTerm]) -> bool:
    scale, own_motion = float(np.abs(motions).max()), motions[spring.mount]
    place_motions = [reach * place.arms for place in places for m, reach in place.mounts if m == spring.mount]
    return any(
        np.abs(directions @ spring.axes).max(initial=0.0) > REL_TOL * scale
        for directions in (own_motion.T, *place_motions)
    )
