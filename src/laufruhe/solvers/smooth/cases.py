"""A block under loads that are held, as expressions of what is open (E55)."""

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
from laufruhe.solvers.smooth.gathered import Gathered

# of a gap, over which a stop sets in: under it all along, so that a design does not stand better than it is
SOFT = 1e-5


@dataclass(frozen=True, eq=False)
class MountResponse:
    """Travel and force of the mounts, shape (3 mounts,)."""

    travel: Any
    force: Any


class StaticCases:
    """Static positions of the block; with bump stops, their forces are variables under an equilibrium constraint.

    Parameters
    ----------
    held
        What the program holds.
    """

    def __init__(self, mounts: SymbolicMounts, mounting: ElasticMounting, root: Array, held: Gathered) -> None:
        self._mounts, self._mounting, self._root, self._held = mounts, mounting, root, held
        self._stops, self._found = stops_of(mounting), dict[LoadCase, MountResponse]()

    def largest(self, measure: Measure, engine: Engine) -> Any:
        """A variable that no length of a measure exceeds, in units of what the mounts as given have (E22)."""
        part, chosen = measure.channel.of_cases, measure.places([mount.name for mount in engine.mounts])
        assert part is not None
        cases, weights = counted_cases(measure, engine), ca.DM(list(measure.direction_weights or (1.0, 1.0, 1.0)))
        given = [np.linalg.norm(part(settled(self._mounting, case)), axis=1).max() for case in cases]
        unit, signals = max(map(float, given)) or 1.0, [part(self._symbols(case)) for case in cases]
        squares = ca.vertcat(
            *(ca.sumsqr(weights * signal[3 * k : 3 * k + 3] / unit) for signal in signals for k in chosen)
        )
        named = self._held.named(measure.name)
        # where a search starts, a balance with bump stops is not known yet: it starts at what is given
        top = named.head(ca.MX(1.0))
        named.hold(squares - top * top)
        return unit * top

    def _symbols(self, case: LoadCase) -> MountResponse:
        if case not in self._found:
            self._found[case] = self._solved(case)
        return self._found[case]

    def _solved(self, case: LoadCase) -> MountResponse:
        mounts, load = self._mounts, self._root @ case_wrench(self._mounting.block, case)
        y, _ = elimination()(mounts.stiffness, ca.MX(6, 6), ca.DM(load), ca.DM.zeros(6))
        stops = np.flatnonzero(self._stops.stiffness)
        if not len(stops):
            return MountResponse(mounts.travels @ y, mounts.springs @ y)
        named, rows = self._held.named(case.name), stops.tolist()
        size = float(np.linalg.norm(np.linalg.solve(self._root.T, settled(self._mounting, case).motion)))
        y = size * named.free((y / size).T).T
        own, gaps = mounts.own[rows, :], self._stops.gaps[stops]
        pushed = ca.DM(self._stops.stiffness[stops]) * (_beyond(own @ y, gaps) - _beyond(-(own @ y), gaps))
        balance = mounts.stiffness @ y + own.T @ pushed - ca.DM(load)
        self._held.add(balance / float(np.linalg.norm(load)), 0.0, 0.0, "balance")
        directions = ca.DM(np.ascontiguousarray(self._stops.directions[:, stops]))
        return MountResponse(mounts.travels @ y, mounts.springs @ y + directions @ pushed)


def _beyond(travel: Any, gaps: Array) -> Any:
    # travel beyond a one-sided gap: a lower estimate with a continuous derivative
    soft, over = ca.DM(SOFT * gaps), travel - ca.DM(gaps)
    within = ca.fmin(ca.fmax(over, 0.0), soft)
    return within * within / (2.0 * soft) + ca.fmax(over - soft, 0.0)
