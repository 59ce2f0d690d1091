"""Natural modes as variables of a smooth program, and what is asked of them (E21, E23, E24)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import permutations
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel, motion_indices
from laufruhe.problem.measure import Limit, Measure, Side
from laufruhe.problem.problem import Problem
from laufruhe.solvers.smooth.gathered import Gathered

_ORDERS = np.array(list(permutations(range(6))))
OF_MODES = (channels.FREQUENCIES, channels.DECOUPLING, channels.DECOUPLING_SHORTFALL)


class ModeVariables:
    """Shapes V and squares l of the modes, where a problem asks of them; else of no length.

    Parameters
    ----------
    held
        What the program holds, to which their conditions are added.
    """

    def __init__(self, problem: Problem, held: Gathered) -> None:
        asked = (*(limit.measure for limit in problem.limits), *(term.measure for term in problem.objective))
        self.asked = any(measure.channel in OF_MODES for measure in asked)
        self._held, self._bands = held, list[tuple[Limit, int]]()
        self._vectors, self._squares = ca.MX.sym("V", 36 * self.asked), ca.MX.sym("l", 6 * self.asked)

    @property
    def symbols(self) -> Any:
        """Shapes, then squares."""
        return ca.vertcat(self._vectors, self._squares)

    def hold(self, stiffness: Any, root: Array, given: ElasticMounting) -> None:
        """The modes are modes of a stiffness, in coordinates in which the mass is one (E21)."""
        self._root, self._unit = root, float(np.trace(root @ given.stiffness @ root.T)) / 6.0
        if not self.asked:
            return
        v = ca.reshape(self._vectors, 6, 6)
        unit = v.T @ v - ca.DM.eye(6)
        apart = v.T @ (stiffness / self._unit) @ v - ca.diag(self._squares)
        lower = [(j, k) for j in range(6) for k in range(j + 1)]
        for matrix in (unit, apart):
            self._held.add(ca.vertcat(*(matrix[j, k] for j, k in lower)), 0.0, 0.0, "modes")

    def limit(self, limit: Limit) -> bool:
        """Hold a limit; whether it is one on modes."""
        hold = self._limits.get(limit.measure.channel)
        if hold is not None:
            hold(limit)
        return hold is not None

    @property
    def _limits(self) -> Mapping[Channel, Callable[[Limit], None]]:
        return {channels.DECOUPLING: self._least_shares, channels.FREQUENCIES: self._frequencies}

    def _shares(self, measure: Measure) -> list[Any]:
        # E24: share of motion j in mode j; the columns start at their motions
        v = ca.reshape(self._vectors, 6, 6)
        shapes, momenta = ca.DM(self._root.T) @ v, ca.DM(np.linalg.inv(self._root)) @ v
        return [shapes[j, j] * momenta[j, j] for j in motion_indices(measure)]

    def _least_shares(self, limit: Limit) -> None:
        for share in self._shares(limit.measure):
            minimum = (limit, "at least"), 1.0
            self._held.add(share, max(limit.minimum, 0.0), np.inf, limit.name, minimum)

    def shortfall(self, measure: Measure) -> Any:
        """Sum of variables, each over nothing and over what is wanting to a share (E47)."""
        found, held = ca.MX(0.0), self._held.named(measure.name)
        for share in self._shares(measure):
            # where a search starts, modes are not known yet: it starts at all that is wanted
            top = held.head(ca.MX(measure.wanted))
            held.hold(measure.wanted - share - top)
            found += top
        return found

    def _frequencies(self, limit: Limit) -> None:
        # E23 for bands; each side is relative to its squared edge, so its slope is 2 / edge
        for edge, side in ((limit.minimum, "at least"), (limit.maximum, "at most")):
            if math.isfinite(edge):
                low, high = (1.0, np.inf) if side == "at least" else (-np.inf, 1.0)
                slope = (limit, side), 2.0 / edge
                self._held.add(self._squares / self._square(edge), low, high, limit.name, slope, slope)
        if limit.outside is not None:
            a, b = (self._square(edge) for edge in limit.outside)
            self._bands.append((limit, len(self._held.lower)))
            self._held.add((self._squares - a) * (self._squares - b) / (b * b), 0.0, np.inf, limit.name)

    def _square(self, frequency: float) -> float:
        # from a frequency [Hz] to the unit of the program
        return float((math.tau * frequency) ** 2 / self._unit)

    def prices(self, values: Array, multipliers: Array) -> dict[Side, float]:
        """Fall of the objective per unit by which each edge of a band is relaxed; `values` of the symbols."""
        found: dict[Side, float] = {}
        for limit, row in self._bands:
            low, high = limit.outside or (math.nan, math.nan)
            a, b = self._square(low), self._square(high)
            for square, m in zip(values[36:], multipliers[row : row + 6], strict=True):
                # each mode is held by the edge on its own side
                side, slope = ("at most", 2.0 * a / low) if 2.0 * square < a + b else ("at least", 2.0 * b / high)
                own = float(max(-m, 0.0) * slope * (b - a) / (b * b))
                found[limit, side] = found.get((limit, side), 0.0) + own
        return found

    def start(self, mounting: ElasticMounting) -> list[Array]:
        """Values at given mounts, each mode in the column of the motion that is most its own."""
        if not self.asked:
            return []
        modes = mounting.modes
        # of all ways to give each motion a mode of its own, that of most energy
        order = _ORDERS[modes.energy[np.arange(6), _ORDERS].sum(axis=1).argmax()]
        vectors = np.linalg.solve(self._root.T, modes.shapes)[:, order]
        return [np.asarray(vectors.T.reshape(-1), dtype=np.float64), modes.squares[order] / self._unit]
