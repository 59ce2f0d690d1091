"""What run-ups of a problem with open stiffness are made of, linear in the stiffness (E65)."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from laufruhe.extensions.run_ups.dampers import Felt, Linear
from laufruhe.extensions.run_ups.linear_run import Response
from laufruhe.extensions.run_ups.peaks import signal_of
from laufruhe.numerics.arrays import Array
from laufruhe.physics.time_model import time_model
from laufruhe.problem.measure import Measure
from laufruhe.prove.mounts.box_response import BoxModel

Rows: TypeAlias = tuple[Felt, int]
"""What a measure is the largest length of, and how many rows a place has."""


class RunMatrices:
    """Of a problem whose open numbers are stiffnesses alone; the fluid of tracks stands after the block.

    Attributes
    ----------
    base
        All stiffnesses at their lower bounds, bump stops left out.
    """

    def __init__(self, model: BoxModel) -> None:
        self._model = model
        whole = time_model(model.mounting(model.lower))
        self.base = replace(whole, stops=np.zeros_like(whole.stops))

    @property
    def size(self) -> int:
        """n."""
        return self.base.size

    @cached_property
    def motion(self) -> Felt:
        """Stiffness, loss and damping of E25 and E26."""
        drag = self.base.damping.copy()
        drag[:6, :6] = self._lowest("damping")
        return Felt(
            Linear(self.base.stiffness, self._square("stiffness").slopes),
            self._square("loss"),
            Linear(drag, self._square("damping").slopes),
        )

    @cached_property
    def loss_factor(self) -> float:
        """Between those that the mounts give to motions: so much of the loss is surely none that drives."""
        squares, modes = np.linalg.eigh(self._model.stiffness(self._model.upper[None])[0])
        if not squares[0] > 0.0:
            return 0.0
        held = modes / np.sqrt(squares)
        ends = np.linalg.eigvalsh(held.T @ self._model.at("loss", self._model.upper[None])[0] @ held)
        return float(max(0.5 * (ends[0] + ends[-1]), 0.0))

    @cached_property
    def uneven_loss(self) -> Felt:
        """The loss beyond that of one factor for all."""
        loss, stiffness = self.motion.lossy, self._square("stiffness")
        beyond = (
            getattr(loss, k) - self.loss_factor * getattr(stiffness, k) for k in ("lowest", "slopes")
        )  # fmt: skip
        nothing = Linear(np.zeros_like(loss.lowest), np.zeros_like(loss.slopes))
        return Felt(nothing, Linear(*beyond), nothing)

    def asked(self, measure: Measure) -> Rows:
        """What is felt, a place after the other."""
        still = np.zeros_like(self.base.drag)
        count = len(self._model.lower)

        def at_rest(forces: Array) -> Array:
            return self._seen(measure, forces, still, False)

        def moving(drag: Array) -> Array:
            return self._seen(measure, still, self._padded(drag), True)

        def linear(name: str) -> Linear:
            nothing = moving(np.zeros((len(still), 6)))
            by_side = [moving(self._model.slopes[name][j]) - nothing for j in range(count)]
            return Linear(moving(self._lowest(name)), np.array(by_side))

        springs = [at_rest(self._padded(own)) - at_rest(still) for own in self._model.slopes["springs"]]
        felt = Felt(Linear(at_rest(self.base.forces), np.array(springs)), linear("losses"), linear("dampers"))
        return felt, self._shape(measure)[-1]

    def _seen(self, measure: Measure, forces: Array, drag: Array, moves: bool) -> Array:
        """From motion, or from its rate, to what a measure is the length of, shape (rows, n)."""
        one, nothing = np.eye(self.size), np.zeros((self.size, self.size))
        model = replace(self.base, forces=forces, drag=drag)
        found = signal_of(measure, Response(model, *((nothing, one) if moves else (one, nothing))))
        return np.asarray(found.reshape(self.size, -1).T)

    def _shape(self, measure: Measure) -> tuple[int, ...]:
        nothing = np.zeros((self.size, 1))
        return signal_of(measure, Response(self.base, nothing, nothing)).shape

    def _lowest(self, name: str) -> Array:
        return np.asarray(self._model.at(name, self._model.lower[None])[0])

    def _padded(self, rows: Array) -> Array:
        return np.pad(rows, [(0, 0)] * (rows.ndim - 1) + [(0, self.size - 6)])

    def _square(self, name: str) -> Linear:
        wider = [(0, self.size - 6)] * 2
        return Linear(np.pad(self._lowest(name), wider), np.pad(self._model.slopes[name], [(0, 0), *wider]))
