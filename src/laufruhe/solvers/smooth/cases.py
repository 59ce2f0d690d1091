"""Static positions of a block under constant loads, as expressions of the open numbers (E55)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.load_models.mount_symbols import SymbolicMounts, elimination
from laufruhe.machine import Engine
from laufruhe.machine.block import LoadCase
from laufruhe.numerics.arrays import Array
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.static_cases import case_wrench, settled, stops_of
from laufruhe.problem.channels import counted_cases
from laufruhe.problem.measure import Measure
from laufruhe.solvers.smooth.constraint_collector import ConstraintCollector

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
