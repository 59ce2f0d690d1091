"""Measures that a simulation gives and no expression has (E28b): an extension names it in their channel."""

from __future__ import annotations

from typing import Protocol

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.processes import call_by_name
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

COARSER = 4
"""Times as long as those of the last word steps of a search are."""


class Peaks(Protocol):
    """Local maxima of several measures, those of one after those of the other; the largest is the measure.

    Points are the open numbers of mounts, then columns of unbalances.
    """

    @property
    def is_known(self) -> bool:
        """Return True if the simulation has the peaks."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of peaks of every measure."""

    def values(self, asked: Array, /) -> Array:
        """Return the peaks at a point; not numbers where there are none."""

    def slopes(self, asked: Array, /) -> Array:
        """Return their derivatives, shape (peaks, numbers)."""


def simulated_measures(problem: Problem) -> tuple[Measure, ...]:
    """Return the simulated measures that are minimised or limited, except those whose rows are known.

    Raises
    ------
    ModelError
        If several simulations are asked.
    """
    asked = [m for m in problem.measures if m.channel.simulation and m not in problem.known_rows]
    if len({measure.channel.simulation for measure in asked}) > 1:
        raise ModelError("channels of two simulations are asked together; ask for those of one")
    return tuple(dict.fromkeys(asked))


def peaks_of(problem: Problem, coarser: int, roughly: bool = False) -> Peaks | None:
    """Return the peaks of all simulated measures; None where there are no such measures.

    Parameters
    ----------
    coarser
        Times as long as those of the last word steps are.
    roughly
        Whether the simulation may leave out what costs most.
    """
    measures = simulated_measures(problem)
    if not measures:
        return None
    found: Peaks = call_by_name(f"{measures[0].channel.simulation}:peaks", problem, measures, coarser, roughly)
    return found
