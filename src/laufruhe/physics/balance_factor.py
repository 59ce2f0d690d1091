"""Balance factor of counterweights, as the workshop counts it (L9)."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from laufruhe.machine import Engine, Role, SliderCrank
from laufruhe.numerics.exact_angles import as_turn, cis, direction

_ROUNDING = 1e-9


@dataclass(frozen=True)
class BalanceFactor:
    """Share of the reciprocating mass on a throw that its counterweights balance beyond its rotating mass."""

    cylinders: tuple[str, ...]
    factor: float


def balance_factors(engine: Engine) -> tuple[BalanceFactor, ...]:
    """Return the factors of throws with a counterweight; each weight counts for the nearest throws of its shaft (L9).

    A weight of nothing counts as none.

    kappa = (-Re sum U e^{-i theta} - m_rot r) / (m_rec r), with the unbalances U [kg m] of the counterweights of a
    throw at theta, its rotating mass m_rot [kg] and reciprocating mass m_rec [kg] at the crank radius r [m].
    """
    factors = []
    for shaft in dict.fromkeys(part.shaft for part in engine.slider_cranks):
        on_throws: dict[tuple[float, object], list[SliderCrank]] = defaultdict(list)
        for part in engine.slider_cranks:
            if part.shaft == shaft:
                on_throws[round(part.x, 9), direction(part.throw)].append(part)
        throws = list(on_throws.values())
        places = np.array([throw[0].x for throw in throws])
        opposite, counted = np.zeros(len(throws)), np.zeros(len(throws), dtype=bool)
        weights = [rotor for rotor in engine.rotors if rotor.shaft == shaft and rotor.role is Role.COUNTERWEIGHT]
        masses = [rotor for rotor in engine.rotors if rotor.shaft == shaft and rotor.role is Role.THROW]
        masses += [pin for pin in engine.pins if pin.shaft == shaft]
        for rotor in (*weights, *masses):
            distance = np.abs(places - rotor.x)
            near = np.flatnonzero(distance <= distance.min() + _ROUNDING)
            for j in near.tolist():
                along = (rotor.unbalance * np.conj(cis(as_turn(throws[j][0].throw)))).real
                opposite[j] -= along / len(near)
                counted[j] |= rotor in weights and rotor.unbalance != 0.0
        for k, throw in enumerate(throws):
            unbalance = sum(part.reciprocating_mass * part.crank_radius for part in throw)
            if counted[k] and unbalance > 0.0 and all(part.is_balanced_by_share for part in throw):
                factors.append(BalanceFactor(tuple(part.name for part in throw), float(opposite[k] / unbalance)))
    return tuple(factors)
