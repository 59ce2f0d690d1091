"""Natural modes as variables of a smooth program, with objectives and limits on them (E21, E23, E24)."""

from __future__ import annotations

import math
from itertools import permutations
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.problem import channels
from laufruhe.problem.channels import motion_indices
from laufruhe.problem.measure import Limit, Measure, Side
from laufruhe.problem.problem import Problem
from laufruhe.solvers.smooth.constraint_collector import ConstraintCollector

_ORDERS = np.array(list(permutations(range(6))))
OF_MODES = (channels.FREQUENCIES, channels.DECOUPLING, channels.DECOUPLING_SHORTFALL)


class ModeVariables:
    """Shapes V and squared frequencies l of the modes; empty if the problem has no measure of modes.

    Parameters
    ----------
    constraints
        Constraints of the program, to which those of the modes are added.
    """

    def __init__(self, problem: Problem, constraints: ConstraintCollector) -> None:
        measures = (*(limit.measure for limit in problem.limits), *(term.measure for term in problem.objective))
        self.has_modes = any(measure.channel in OF_MODES for measure in measures)
        self._constraints, self._bands = constraints, list[tuple[Limit, int]]()
        self._vectors, self._squares = ca.MX.sym("V", 36 * self.has_modes), ca.MX.sym("l", 6 * self.has_modes)

    @property
    def symbols(self) -> Any:
        """Column of shapes, then squared frequencies."""
        return ca.vertcat(self._vectors, self._squares)

    def hold(self, stiffness: Any, root: Array, mounting: ElasticMounting) -> None:
        """Add the constraints that the variables are natural modes of a stiffness, in coordinates with unit mass (E21).

        Parameters
        ----------
        stiffness
            Expression of the stiffness in these coordinates, shape (6, 6).
        root
            Map to these coordinates, shape (6, 6).
        mounting
            Initial mounting, which sets the unit of squared frequencies.
        """
        self._root, self._unit = root, float(np.trace(root @ mounting.stiffness @ root.T)) / 6.0
        if not self.has_modes:
            return
        v = ca.reshape(self._vectors, 6, 6)
        identity = v.T @ v - ca.DM.eye(6)
        diagonal = v.T @ (stiffness / self._unit) @ v - ca.diag(self._squares)
        lower = [(j, k) for j in range(6) for k in range(j + 1)]
        for matrix in (identity, diagonal):
            self._constraints.add(ca.vertcat(*(matrix[j, k] for j, k in lower)), 0.0, 0.0, "modes")

    def limit(self, limit: Limit) -> bool:
        """Add a limit on modes; return False for a limit on another measure."""
        limiters = ((channels.DECOUPLING, self._least_shares), (channels.FREQUENCIES, self._frequencies))
        for channel, add_limit in limiters:
            if limit.measure.channel == channel:
                add_limit(limit)
                return True
        return False

    def _shares(self, measure: Measure) -> list[Any]:
        # E24: share of motion j in mode j; the columns start at their motions
        v = ca.reshape(self._vectors, 6, 6)
        shapes, momenta = ca.DM(self._root.T) @ v, ca.DM(np.linalg.inv(self._root)) @ v
        return [shapes[j, j] * momenta[j, j] for j in motion_indices(measure)]

    def _least_shares(self, limit: Limit) -> None:
        for share in self._shares(limit.measure):
            minimum = (limit, "at least"), 1.0
            self._constraints.add(share, max(limit.minimum, 0.0), np.inf, limit.name, minimum)

    def shortfall(self, measure: Measure) -> Any:
        """Return the decoupling shortfall: the sum of the energy shares that motions lack in their best mode (E47).

        Each share is a variable, at least zero and at least the missing share.
        """
        total, collector = ca.MX(0.0), self._constraints.named(measure.name)
        for share in self._shares(measure):
            # the start value is the whole share, because modes are not yet known
            shortfall = collector.head(ca.MX(measure.wanted))
            collector.hold(measure.wanted - share - shortfall)
            total += shortfall
        return total

    def _frequencies(self, limit: Limit) -> None:
        # E23 for bands; each side is relative to its squared edge, so its slope is 2 / edge
        for edge, side in ((limit.minimum, "at least"), (limit.maximum, "at most")):
            if math.isfinite(edge):
                low, high = (1.0, np.inf) if side == "at least" else (-np.inf, 1.0)
                slope = (limit, side), 2.0 / edge
                self._constraints.add(self._squares / self._square(edge), low, high, limit.name, slope, slope)
        if limit.outside is not None:
            a, b = (self._square(edge) for edge in limit.outside)
            self._bands.append((limit, len(self._constraints.lower)))
            self._constraints.add((self._squares - a) * (self._squares - b) / (b * b), 0.0, np.inf, limit.name)

    def _square(self, frequency: float) -> float:
        # from a frequency [Hz] to the unit of the program
        return float((math.tau * frequency) ** 2 / self._unit)

    def prices(self, values: Array, multipliers: Array) -> dict[Side, float]:
        """Return shadow prices of the edges of frequency bands, from values of the symbols and multipliers."""
        prices_by_side: dict[Side, float] = {}
        for limit, row in self._bands:
            low, high = limit.outside or (math.nan, math.nan)
            a, b = self._square(low), self._square(high)
            for square, m in zip(values[36:], multipliers[row : row + 6], strict=True):
                # the nearer edge of the band limits each mode
                side, slope = ("at most", 2.0 * a / low) if 2.0 * square < a + b else ("at least", 2.0 * b / high)
                price = float(max(-m, 0.0) * slope * (b - a) / (b * b))
                prices_by_side[limit, side] = prices_by_side.get((limit, side), 0.0) + price
        return prices_by_side

    def start(self, mounting: ElasticMounting) -> list[Array]:
        """Return start values of mode shapes and squared frequencies, each mode in the column of its main motion."""
        if not self.has_modes:
            return []
        modes = mounting.modes
        # assignment of modes to motions with the largest total energy
        order = _ORDERS[modes.energy[np.arange(6), _ORDERS].sum(axis=1).argmax()]
        vectors = np.linalg.solve(self._root.T, modes.shapes)[:, order]
        return [np.asarray(vectors.T.reshape(-1), dtype=np.float64), modes.squares[order] / self._unit]
