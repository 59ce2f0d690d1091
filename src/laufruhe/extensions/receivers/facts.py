"""Response of receivers for tables, files and pictures: with and without weighting, by frequency and over speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.receivers.channels import CHANNELS
from laufruhe.extensions.receivers.machine import Receiver, Receivers, receivers_of
from laufruhe.extensions.receivers.physics import response
from laufruhe.machine import OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum, order_amplitude
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import Result
from laufruhe.units import readable, usual_unit

SPEEDS = 90
SLOWEST, FASTEST = 0.5, 1.2
"""Ends of the speed range, over the slowest and the fastest operating point."""


@dataclass(frozen=True, eq=False)
class OrderAmplitudes:
    """Response of one receiver at one operating point.

    Attributes
    ----------
    frequencies
        Frequency of each order [Hz], shape (n,).
    plain, weighted
        Amplitude of each order without and with weighting [SI], shape (n,).
    rms_plain, rms
        Root mean square over the cycle without and with weighting [SI].
    """

    frequencies: Array
    plain: Array
    weighted: Array
    rms_plain: float
    rms: float


def has_receivers(result: Result) -> bool:
    """Return True if the result has receivers and finite loads."""
    return bool(receivers_of(result.final.engine)) and bool(result.problem.points) and not result.final.resonance


def unit_of(receiver: Receiver) -> str:
    """Return the SI unit of a receiver."""
    return CHANNELS[receiver.quantity].unit


def unit_and_factor(receiver: Receiver, largest: float) -> tuple[str, float]:
    """Return the unit of reports for a receiver whose largest value is `largest` [SI], and the factor on SI values."""
    unit = unit_of(receiver)
    return readable(unit, usual_unit(largest, unit))


def weighting_words(receiver: Receiver) -> str:
    """Return the names of the weightings of a receiver, once if they are equal."""
    names = ["none" if curve is None else curve.name for curve in receiver.weightings]
    return names[0] if len(set(names)) == 1 else ", ".join(names)


def amplitudes_of(receiver: Receiver, loads: PointLoads) -> OrderAmplitudes:
    """Return the response of a receiver to the loads of a design at an operating point."""
    plain = _alone(replace(receiver, weightings=(None,) * len(receiver.weightings)), loads)
    weighted = _alone(receiver, loads)
    frequencies = weighted.orders * loads.point.speed / math.tau
    sizes = [order_amplitude(spectrum.coefficients[:, 0]) for spectrum in (plain, weighted)]
    return OrderAmplitudes(frequencies, sizes[0], sizes[1], _rms(plain), _rms(weighted))


def _alone(receiver: Receiver, loads: PointLoads) -> Spectrum:
    engine = loads.moving_parts
    if engine is None:
        raise ModelError("receivers need the moving parts of the engine")
    extra = engine.extra(Receivers) or Receivers()
    return response(engine.with_extra(replace(extra, receivers=(receiver,))), loads, receiver.quantity)


def _rms(spectrum: Spectrum) -> float:
    # Parseval; the response has no mean
    return float(np.sqrt(0.5 * np.sum(np.abs(spectrum.coefficients) ** 2)))


def over_speed(receiver: Receiver, problem: Problem, design: Evaluation, point: OperatingPoint) -> tuple[Array, Array]:
    """Return crank speeds [rad/s] and the weighted rms of a receiver [SI] there, with the gas of an operating point.

    The rms is nan at a speed whose loads cannot be computed.
    """
    operating = [one.speed for one in problem.points]
    speeds = np.linspace(SLOWEST * min(operating), FASTEST * max(operating), SPEEDS)
    values = np.full(len(speeds), math.nan)
    for k, speed in enumerate(speeds.tolist()):
        try:
            moved = evaluate(replace(problem, points=(replace(point, speed=speed),)), design.engine)
            values[k] = _rms(_alone(receiver, moved.loads[0]))
        except ModelError:
            continue
    return speeds, values
