"""Natural modes, simulated peaks and static positions in a smooth program (E21, E23, E24, E28b, E55)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.mount_symbols import SymbolicMounts, elimination
from laufruhe.load_models.simulated import peaks_of, simulated_measures
from laufruhe.machine import Engine
from laufruhe.machine.block import LoadCase
from laufruhe.numerics.arrays import Array
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.static_cases import case_wrench, settled, stops_of
from laufruhe.problem import channels
from laufruhe.problem.channels import counted_cases, motion_indices
from laufruhe.problem.decision import decision_vector, domains_of
from laufruhe.problem.measure import Limit, Measure, Side
from laufruhe.problem.problem import Problem
from laufruhe.solvers.smooth.constraint_collector import ConstraintCollector
from laufruhe.solvers.smooth.nonlinear import ExternalValues

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


class SimulatedVariables:
    """Peaks of the simulated measures of a problem, as symbols.

    Parameters
    ----------
    arguments
        Open numbers of mounts and columns of unbalances, as expressions.
    constraints
        Constraints of the program, to which those of the peaks are added.
    coarser
        Time step relative to that of the final evaluation.
    """

    def __init__(self, problem: Problem, arguments: Any, constraints: ConstraintCollector, coarser: int) -> None:
        self._arguments, self._constraints = arguments, constraints
        measures, self._peaks = simulated_measures(problem), peaks_of(problem, coarser)
        self.symbols, self._symbols_of, self._sizes = ca.MX(0, 1), dict[Measure, Any](), dict[Measure, float]()
        if self._peaks is None:
            return
        if not self._peaks.is_known:
            raise ModelError("a simulation of so many turns can be evaluated, but not optimised; make it shorter")
        self.symbols = ca.MX.sym("simulated", sum(self._peaks.counts))
        ends = np.cumsum(self._peaks.counts)
        columns = decision_vector(domains_of(problem.unbalances))
        initial = self.peaks_at([d.real_start for d in problem.mount_decisions], columns)
        for measure, end, count in zip(measures, ends.tolist(), self._peaks.counts, strict=True):
            self._symbols_of[measure] = self.symbols[end - count : end]
            maximum = float(np.max(initial[end - count : end]))
            self._sizes[measure] = maximum if 0.0 < maximum < math.inf else 1.0

    @property
    def external(self) -> ExternalValues | None:
        """External model of the peaks; None without simulated measures."""
        return None if self._peaks is None else ExternalValues(self.symbols, self._arguments, self._peaks)

    def peaks_at(self, mounts: Sequence[float], columns: Array) -> Array:
        """Return the peaks at numbers of the mounts and columns of the unbalances, shape (peaks,)."""
        return np.zeros(0) if self._peaks is None else self._peaks.values(np.concatenate([mounts, columns]))

    def minimum(self, measure: Measure) -> Any:
        """Return a new variable for the largest peak of a simulated measure: it is at least every peak (E22)."""
        size, collector = self._sizes[measure], self._constraints.named(measure.name)
        peaks = self._symbols_of[measure] / size
        largest = collector.head(ca.mmax(peaks))
        collector.hold(peaks - largest)
        return size * largest

    def limit(self, limit: Limit, tight: float) -> None:
        """Add the constraints that every peak of a limited measure is at most the share `tight` of the limit."""
        unit = limit.maximum or 1.0
        side = ((limit, "at most"), tight / unit)
        self._constraints.add(
            self._symbols_of[limit.measure] / unit, -math.inf, tight * limit.maximum / unit, limit.name, maximum=side
        )


# share of a gap over which the force of a stop sets in; the smooth force is never larger than the true one
SOFT = 1e-5


@dataclass(frozen=True, eq=False)
class MountResponse:
    """Deflection [m] and force [N] of the mounts as CasADi expressions, shape (3 mounts,)."""

    travel: Any
    force: Any


class StaticCases:
    """Static positions of the block under load cases.

    With bump stops the position is a variable with an equilibrium constraint.

    Parameters
    ----------
    root
        Map to coordinates in which the mass matrix is one, shape (6, 6).
    constraints
        Constraints of the program, to which those of the cases are added.
    """

    def __init__(
        self, mounts: SymbolicMounts, mounting: ElasticMounting, root: Array, constraints: ConstraintCollector
    ) -> None:
        self._mounts, self._mounting, self._root, self._constraints = mounts, mounting, root, constraints
        self._stops, self._responses = stops_of(mounting), dict[LoadCase, MountResponse]()

    def largest(self, measure: Measure, engine: Engine) -> Any:
        """Return a new variable for the largest static force or travel: it is at least each of them (E22)."""
        part, selected = measure.channel.case_vectors, measure.places([mount.name for mount in engine.mounts])
        assert part is not None
        cases, weights = counted_cases(measure, engine), ca.DM(list(measure.direction_weights or (1.0, 1.0, 1.0)))
        initial = [np.linalg.norm(part(settled(self._mounting, case)), axis=1).max() for case in cases]
        unit, signals = max(map(float, initial)) or 1.0, [part(self._response(case)) for case in cases]
        squares = ca.vertcat(
            *(ca.sumsqr(weights * signal[3 * k : 3 * k + 3] / unit) for signal in signals for k in selected)
        )
        collector = self._constraints.named(measure.name)
        # the start value is that of the initial mounts, because equilibrium with bump stops is not yet known
        largest = collector.head(ca.MX(1.0))
        collector.hold(squares - largest * largest)
        return unit * largest

    def _response(self, case: LoadCase) -> MountResponse:
        if case not in self._responses:
            self._responses[case] = self._new_response(case)
        return self._responses[case]

    def _new_response(self, case: LoadCase) -> MountResponse:
        mounts, load = self._mounts, self._root @ case_wrench(self._mounting.block, case)
        y, _ = elimination()(mounts.stiffness, ca.MX(6, 6), ca.DM(load), ca.DM.zeros(6))
        stops = np.flatnonzero(self._stops.stiffness)
        if not len(stops):
            return MountResponse(mounts.travels @ y, mounts.springs @ y)
        collector, rows = self._constraints.named(case.name), stops.tolist()
        size = float(np.linalg.norm(np.linalg.solve(self._root.T, settled(self._mounting, case).motion)))
        y = size * collector.free((y / size).T).T
        stop_rows, gaps = mounts.spring_travels[rows, :], self._stops.gaps[stops]
        stop_forces = ca.DM(self._stops.stiffness[stops]) * (
            _excess_travel(stop_rows @ y, gaps) - _excess_travel(-(stop_rows @ y), gaps)
        )
        balance = mounts.stiffness @ y + stop_rows.T @ stop_forces - ca.DM(load)
        self._constraints.add(balance / float(np.linalg.norm(load)), 0.0, 0.0, "balance")
        directions = ca.DM(np.ascontiguousarray(self._stops.directions[:, stops]))
        return MountResponse(mounts.travels @ y, mounts.springs @ y + directions @ stop_forces)


def _excess_travel(travel: Any, gaps: Array) -> Any:
    # deflection beyond a one-sided gap: a lower estimate with a continuous derivative
    soft, over = ca.DM(SOFT * gaps), travel - ca.DM(gaps)
    within = ca.fmin(ca.fmax(over, 0.0), soft)
    return within * within / (2.0 * soft) + ca.fmax(over - soft, 0.0)
