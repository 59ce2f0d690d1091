"""Roll moment of the gas as a smooth expression of the throws, with coefficients from the exact model (S23).

A cylinder's gas turns with its firing dead centre phi_k = 2 pi l_k - (theta_k + o_k - beta_k):
order h of its moment is the coefficient of one cylinder times e^{-i h phi_k}. The number of
turns l_k is the firing order's, and stays while the throws move.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from laufruhe.load_models.lines import Lines, turned
from laufruhe.machine import GasModel, OperatingPoint, SliderCrank
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.gas_cycle import alike_under
from laufruhe.physics.gas_loads import gas_coefficients
from laufruhe.problem.problem import Problem

LEFT_OUT = 1e-2


class GasMoments:
    """Gas of a star whose throws move and whose firing order stays.

    Parameters
    ----------
    problem
        Of the star, its cylinders on one crankshaft.
    left_out
        Share of the torque's root mean square that orders left out may hold together.
    """

    def __init__(self, problem: Problem, left_out: float = LEFT_OUT) -> None:
        self._problem, self._left_out = problem, left_out
        self._kept: dict[tuple[GasModel, int], Spectrum] = {}

    def at(
        self, point: OperatingPoint, stars: Sequence[Any], gain: Callable[[float], float] | None = None
    ) -> list[Lines]:
        """Moment of every cylinder, shape (1, n), the orders that are kept [N m].

        Parameters
        ----------
        stars
            theta + o - beta of every cylinder [rad], counted as its throw in the problem is.
        gain
            What a moment of an order counts for; the same for all when left out.
        """
        gas = self._problem.fidelity.gas_of(point)
        if gas is None:
            return []
        found = []
        for k, (part, star) in enumerate(zip(self._problem.engine.slider_cranks, stars, strict=True)):
            series = self._series(gas, k)
            if gain is not None:
                series = _felt(series, gain, self._left_out)
            found.append(turned(series.orders, series.coefficients, star - math.tau * turns_of(part)))
        return found

    def _series(self, gas: GasModel, k: int) -> Spectrum:
        """Of one cylinder, the orders that matter."""
        parts, fidelity = self._problem.engine.slider_cranks, self._problem.fidelity
        alike = next(j for j, other in enumerate(parts) if alike_under(gas, other) == alike_under(gas, parts[k]))
        if (gas, alike) not in self._kept:
            whole = fidelity.kept(gas_coefficients(gas, parts[alike], self._problem.engine.cycle, fidelity))
            self._kept[gas, alike] = _felt(whole, lambda _: 1.0, self._left_out)
        return self._kept[gas, alike]


def _felt(series: Spectrum, gain: Callable[[float], float], left_out: float) -> Spectrum:
    """The first orders, that hold all but a share of the root mean square once each counts for its gain."""
    sizes = np.abs(series.coefficients) * [gain(float(h)) for h in series.orders]
    tail = np.sqrt(np.cumsum(sizes[::-1] ** 2)[::-1])
    return Spectrum(series.base, series.coefficients[: max(int((tail > left_out * tail[0]).sum()), 1)])


def turns_of(part: SliderCrank) -> int:
    """Turns from the dead centre at -(theta + o - beta) to the one that fires."""
    return round((part.firing_angle + part.throw - part.bank) / math.tau)
