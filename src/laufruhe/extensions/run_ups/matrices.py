"""Matrices of run-ups, linear in the open stiffnesses (E65)."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from laufruhe.extensions.run_ups.dampers import Linear, LinearMaps
from laufruhe.extensions.run_ups.linear_run import RunResponse
from laufruhe.extensions.run_ups.peaks import signal_of
from laufruhe.numerics.arrays import Array
from laufruhe.physics.time_model import time_model
from laufruhe.problem.measure import Measure
from laufruhe.prove.mounts.box_response import BoxModel

Rows: TypeAlias = tuple[LinearMaps, int]
"""Maps from motion to the signal of a measure, and count of rows for each place."""


class RunMatrices:
    """Matrices of run-ups as functions of open stiffnesses; coordinates of fluid tracks follow those of the block.

    The time model `base` has all stiffnesses at their lower bounds, and no bump stops.
    """

    def __init__(self, model: BoxModel) -> None:
        self._model = model
        at_lower = time_model(model.mounting(model.lower))
        no_stops = replace(at_lower.stops, stiffness=np.zeros_like(at_lower.stops.stiffness))
        self.base = replace(at_lower, stops=no_stops)

    @cached_property
    def motion(self) -> LinearMaps:
        """Matrices of stiffness, loss and damping in the equation of motion (E25, E26)."""
        damping = self.base.damping.copy()
        damping[:6, :6] = self._lowest("damping")
        position = Linear(self.base.stiffness, self._square("stiffness").slopes)
        return LinearMaps(position, self._square("loss"), Linear(damping, self._square("damping").slopes))

    @cached_property
    def loss_factor(self) -> float:
        """Mean of the smallest and the largest loss factor of the block's motions.

        This common part drives no motion.
        """
        squares, modes = np.linalg.eigh(self._model.stiffness(self._model.upper[None])[0])
        if not squares[0] > 0.0:
            return 0.0
        scaled = modes / np.sqrt(squares)
        ends = np.linalg.eigvalsh(scaled.T @ self._model.at("loss", self._model.upper[None])[0] @ scaled)
        return float(max(0.5 * (ends[0] + ends[-1]), 0.0))

    @cached_property
    def uneven_loss(self) -> LinearMaps:
        """Loss matrix less the common loss factor times stiffness."""
        loss, stiffness = self.motion.lossy, self._square("stiffness")
        lowest = loss.lowest - self.loss_factor * stiffness.lowest
        slopes = loss.slopes - self.loss_factor * stiffness.slopes
        zero = Linear(np.zeros_like(lowest), np.zeros_like(slopes))
        return LinearMaps(zero, Linear(lowest, slopes), zero)

    def maps_of(self, measure: Measure) -> Rows:
        """Return the linear maps from the motion of the block to the signal of a measure, and the rows of each place.

        The signal is a sum of forces that follow motion (springs) and its rate (losses and dampers).
        """
        no_damping_forces = np.zeros_like(self.base.damping_forces)

        def at_rest(forces: Array) -> Array:
            return self._signal_rows(measure, forces, no_damping_forces, False)

        def moving(damping_forces: Array) -> Array:
            return self._signal_rows(measure, no_damping_forces, self._padded(damping_forces), True)

        def linear(name: str) -> Linear:
            zero = moving(np.zeros((len(no_damping_forces), 6)))
            by_side = [moving(slope) - zero for slope in self._model.slopes[name]]
            return Linear(moving(self._lowest(name)), np.array(by_side))

        springs = [at_rest(self._padded(slope)) - at_rest(no_damping_forces) for slope in self._model.slopes["springs"]]
        maps = LinearMaps(Linear(at_rest(self.base.forces), np.array(springs)), linear("losses"), linear("dampers"))
        zero = np.zeros((self.base.size, 1))
        return maps, signal_of(measure, RunResponse(self.base, zero, zero)).shape[-1]

    def _signal_rows(self, measure: Measure, forces: Array, damping_forces: Array, is_rate: bool) -> Array:
        identity, zero = np.eye(self.base.size), np.zeros((self.base.size, self.base.size))
        model = replace(self.base, forces=forces, damping_forces=damping_forces)
        signal = signal_of(measure, RunResponse(model, *((zero, identity) if is_rate else (identity, zero))))
        return np.asarray(signal.reshape(self.base.size, -1).T)

    def _lowest(self, name: str) -> Array:
        return np.asarray(self._model.at(name, self._model.lower[None])[0])

    def _padded(self, rows: Array) -> Array:
        return np.pad(rows, [(0, 0)] * (rows.ndim - 1) + [(0, self.base.size - 6)])

    def _square(self, name: str) -> Linear:
        padding = [(0, self.base.size - 6)] * 2
        return Linear(np.pad(self._lowest(name), padding), np.pad(self._model.slopes[name], [(0, 0), *padding]))
