"""Better stars near one that is known: throws exchange their steps, two or three at a time (S44)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from laufruhe.load_models.star_model import StarModel
from laufruhe.numerics.budget import in_time, passed
from laufruhe.solvers.stars.program import coarse_value

# a better star is one that is better by more than what few angles blur
WORTH = 1e-6


def improved(model: StarModel, star: tuple[int, ...], built: tuple[int, ...], owners: Sequence[int]) -> tuple[int, ...]:
    """Return the best star that exchanges lead to, everything else at its optimum at few angles."""
    value = coarse_value(model, star, built, owners)
    while not passed():
        found, best = min(
            ((coarse_value(model, other, built, owners), other) for other in in_time(exchanges(star))),
            default=(math.inf, star),
        )
        if not found < value * (1.0 - WORTH):
            break
        value, star = found, best
    return star


def exchanges(star: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Stars in which two or three throws, never the first, have each other's steps."""
    seen = {star}
    for i in range(1, len(star)):
        for j in range(1, i):
            for places in ((i, j), *((i, j, k) for k in range(1, j)), *((j, i, k) for k in range(1, j))):
                other = list(star)
                for place, source in zip(places, (*places[1:], places[0]), strict=True):
                    other[place] = star[source]
                if (found := tuple(other)) not in seen:
                    seen.add(found)
                    yield found
