"""Measures from simulations in time, which an extension provides by the name in the channel (E28b)."""

from __future__ import annotations

from typing import Protocol

from laufruhe.errors import ModelError
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.processes import call_by_name
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

COARSE_STEP = 4
"""Time step of simulations during a search, over the time step of the final evaluation."""


class Peaks(Protocol):
    """Local maxima in time of several measures; each measure is the largest of its maxima.

    The maxima of all measures stand in one vector, in the order of the measures. A point is the vector of the open
    numbers of the mounts, followed by the columns of the unbalances, shape (n,).
    """

    @property
    def is_known(self) -> bool:
        """Return True if the simulation can give local maxima."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of local maxima of every measure."""

    def values(self, point: Array, /) -> Array:
        """Return the local maxima at a point, shape (peaks,), NaN for missing ones."""

    def slopes(self, point: Array, /) -> Array:
        """Return the derivatives of the local maxima at a point, shape (peaks, n)."""


def simulated_measures(problem: Problem) -> tuple[Measure, ...]:
    """Return the measures of objective and limits that need a simulation in time, such as run-ups.

    Measures that have linearised rows in the problem are left out.

    Raises
    ------
    ModelError
        If the measures need more than one simulation.
    """
    measures = [m for m in problem.measures if m.channel.simulation and m not in problem.known_rows]
    if len({measure.channel.simulation for measure in measures}) > 1:
        raise ModelError("objective and limits need two different simulations in time; use quantities of one of them")
    return tuple(dict.fromkeys(measures))


def peaks_of(problem: Problem, step_factor: int, is_coarse: bool = False) -> Peaks | None:
    """Return a function object for the local maxima over time of all simulated measures; None without such measures.

    The time step is `step_factor` times that of the final evaluation. A coarse simulation may leave out its most
    expensive part.
    """
    measures = simulated_measures(problem)
    if not measures:
        return None
    peaks: Peaks = call_by_name(f"{measures[0].channel.simulation}:peaks", problem, measures, step_factor, is_coarse)
    return peaks
