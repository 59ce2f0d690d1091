"""Coordinates of the open numbers of the crankshaft, in which its dynamic stiffness is affine (V13)."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from laufruhe.extensions.torsion.machine import TORSION, ShaftSection, Torsion
from laufruhe.extensions.torsion.physics import Resonance, chain_of
from laufruhe.numerics.arrays import Array
from laufruhe.problem.problem import Problem


class TwistCoordinates:
    """Coordinates of decisions: inertia, stiffness and damping themselves, and the stiffness that a diameter makes.

    Attributes
    ----------
    lower, upper
        Bounds of the coordinates, shape (n,) each.
    owners
        One where a coordinate changes the stiffness or diameter of a section, else zero, shape (n, sections).
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, self._chain = problem, chain_of(problem.engine)
        # for each decision, pairs of the name of a part of the crankshaft and the name of its number
        self._keys: list[tuple[tuple[str, str], ...]] = [decision.keys(TORSION) for decision in problem.decisions]
        self.lower = self.from_decisions(np.array([decision.lower for decision in problem.decisions]))
        self.upper = self.from_decisions(np.array([decision.upper for decision in problem.decisions]))
        self.owners = np.array(
            [[float(any(part == s.name for part, _ in keys)) for s in self._chain.sections] for keys in self._keys]
        )  # fmt: skip

    @cached_property
    def is_exact(self) -> bool:
        """True if stress is monotone in every stiffness: no open diameter has viscous damping."""
        return all(section.damping == 0.0 for _, section in self._round)

    @property
    def _round(self) -> list[tuple[int, ShaftSection]]:
        named = {section.name: section for section in self._chain.sections}
        return [(k, named[part]) for k, ((part, number), *_) in enumerate(self._keys) if number == "diameter"]

    def from_decisions(self, values: Array) -> Array:
        """Return the coordinates (stiffness in place of diameter) for values of the decisions, shape (n,)."""
        coordinates = np.array(values, dtype=float)
        for k, section in self._round:
            coordinates[k] = section.with_numbers(section.stiffness, float(values[k])).stiffness
        return coordinates

    def decisions(self, coordinates: Array) -> Array:
        """Return the values of the decisions (diameters again) for coordinates, shape (n,)."""
        values = np.array(coordinates, dtype=float)
        for k, section in self._round:
            diameter = section.diameter or 0.0
            solid = section.stiffness / (diameter**4 - section.bore**4)
            values[k] = (values[k] / solid + section.bore**4) ** 0.25
        low, high = (np.array([getattr(d, end) for d in self.problem.decisions]) for end in ("lower", "upper"))
        return np.asarray(np.clip(values, low, high))

    def chain(self, coordinates: Array) -> Torsion:
        """Return the chain for given coordinates."""
        return chain_of(self.problem.design(self.decisions(coordinates).tolist()))

    def ends(self, lower: Array, upper: Array, resonance: Resonance) -> tuple[Torsion, Torsion] | None:
        """Return the torsional chains with the lowest and the highest natural frequencies in a box (V15).

        The result is None if they are not at corners of the box.
        """
        absorbers = {absorber.name: absorber for absorber in self._chain.absorbers}
        falls = np.zeros(len(lower), dtype=bool)
        for k, keys in enumerate(self._keys):
            ratios = [resonance.inertia_ratio(absorbers[part]) if part in absorbers else 1.0 for part, _ in keys]
            if keys[0][1] != "inertia":
                continue
            known = [ratio for ratio in ratios if ratio is not None]
            if len(known) < len(ratios) or min(known) < 0.0 < max(known):
                return None
            falls[k] = max(known) > 0.0
        low, high = self.chain(np.where(falls, upper, lower)), self.chain(np.where(falls, lower, upper))
        # an inertia that changes its sign in between has poles there
        signs = [np.sum(np.linalg.eigvalsh(resonance.inertia(chain)) > 0.0) for chain in (low, high)]
        return (low, high) if signs[0] == signs[1] else None
