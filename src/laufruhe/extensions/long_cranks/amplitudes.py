"""Bound how even stars differ in norms of forces and couples, order by order (S3, S5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from laufruhe.extensions.long_cranks.halves import Window
from laufruhe.load_models.amplitudes import AmplitudeObjective
from laufruhe.physics.crank_stars import phase_waves
from laufruhe.physics.star_space import StarSpace


class StarAmplitudes(AmplitudeObjective):
    """A sum of norms of forces and couples, with the window of better stars."""

    def largest(self, space: StarSpace) -> float:
        """No crank has more: all throws on the side of their places [SI of the objective]."""
        levers = float(np.abs(space.places).sum())
        return sum(
            term.weight * float(np.hypot(np.multiply(term.force, space.throws), np.multiply(term.couple, levers)).sum())
            for term in self.terms
        )

    def least(self, space: StarSpace) -> float:
        """No star has less: forces alone, which the pattern fixes [SI of the objective]."""
        return min(self._forces(space, pattern) for pattern in space.patterns)

    def window(self, space: StarSpace, pattern: tuple[int, ...], value: float) -> Window | None:
        """Return the window of the order that weighs most: no norm is less than its share in it (S5)."""
        shares = np.sum([np.multiply(term.weight, term.couple) for term in self.terms], axis=0)
        place, room = int(np.argmax(shares)), value - self._forces(space, pattern)
        if room < 0.0:
            return None
        most = room / shares[place] if shares[place] > 0.0 else np.inf
        return Window(self.orders[place], complex(-most, -most), complex(most, most))

    def _forces(self, space: StarSpace, pattern: Sequence[int]) -> float:
        forces = np.abs(phase_waves(space.phases, self.orders) @ np.array(pattern))
        forces[forces <= 1e-12 * space.throws] = 0.0
        pure = [term for term in self.terms if not any(term.couple)]
        return sum(term.weight * float(np.linalg.norm(np.multiply(term.force, forces))) for term in pure)
