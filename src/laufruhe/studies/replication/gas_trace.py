"""Which gas trace a four-cylinder study may have had: parameters fitted to what it says in words.

Hasselgruber (1964) prints no trace, and says five things that bear on it (`CLAIMS`): the largest mount force of
the gas on a single; the piston speed at which second-order gas and inertia torques cancel; the best share of a
moment pair; what the force pair takes off the mean mount force, and what the moment pair takes off the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Cycle, Engine, GasModel, Seiliger, SliderCrank, Wiebe
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.gas_cycle import cylinder_pressure
from laufruhe.physics.gas_loads import gas_torque
from laufruhe.physics.modes import GRAVITY
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.order_coefficients import inertia_roll_orders
from laufruhe.physics.seiliger_cycle import compression_end_pressure, motored_cycle, seiliger_imep
from laufruhe.physics.shaking_loads import rotor_loads, shaking_loads
from laufruhe.problem.problem import Problem
from laufruhe.studies.replication.quantities import Labelled

Array = NDArray[np.float64]

FOUR = Cycle.FOUR_STROKE
SAMPLES = 720
SHARES = np.linspace(0.0, 1.2, 241)
PRESSURE = 1e4 * GRAVITY
"""One kp/cm2 [Pa]."""
NEARNESS = 0.05
"""Weight of a parameter's distance from its assumed value, over its range, beside what is allowed of a claim."""
CLAIMS = ("gas_force", "cancelling_speed", "best_share", "first_fall", "second_fall")
PARAMETERS = ("ratio", "compression", "expansion", "peak", "rod ratio", "first", "last")
GIVES = (*CLAIMS, "met", "parameters", "highest_pressure")


class Unprinted(NamedTuple):
    """What decides over the gas torque and is not printed.

    `peak` is where that at part load lies between the end of compression (0) and the highest that this load
    and the printed peak allow (1).
    """

    ratio: float
    compression: float
    expansion: float
    peak: float
    rod_ratio: float


class Trace(NamedTuple):
    """A set of parameters, the trace at full load, and the one that claims are judged on."""

    name: str
    full: GasModel | None
    judged: GasModel
    how: Unprinted


@dataclass(frozen=True)
class Study:
    """The four-cylinder with both pairs, and what is said of it, as `fitted_traces` has them."""

    problem: Problem
    said: Mapping[str, Any]

    def cylinder(self, rod_ratio: float, part: SliderCrank | None = None) -> SliderCrank:
        """The first one or another, its rod as long as a rod ratio wants it."""
        part = part or self.problem.engine.slider_cranks[0]
        return replace(part, rod_length=part.crank_radius / rod_ratio)

    def cycle(self, how: Unprinted, imep: float, peak: float) -> Seiliger:
        """The mixed cycle at a load."""
        return Seiliger(peak, imep, how.compression, how.expansion, compression_ratio=how.ratio)

    def fired(self, how: Unprinted, imep: float, share: float = 1.0) -> Seiliger:
        """With the peak at a share between the end of compression and the highest: all heat at constant volume."""
        end = compression_end_pressure(self.cycle(how, 0.0, self.said["peak"]))
        low, high = 40e5, 80e5
        # the mean pressure is linear in the peak pressure
        reached = [seiliger_imep(self.cycle(how, imep, peak), FOUR, 1.0) for peak in (low, high)]
        peak = low + (imep - reached[0]) / (reached[1] - reached[0]) * (high - low)
        return self.cycle(how, imep, end + share * (max(min(peak, self.said["peak"]), end) - end))

    def full(self, how: Unprinted) -> Seiliger:
        """At full load."""
        return self.fired(how, self.said["full_load"])

    def part(self, how: Unprinted) -> Seiliger:
        """At part load."""
        return self.fired(how, self.said["part_load"], how.peak)

    def motored(self, how: Unprinted) -> Seiliger:
        """No heat."""
        return motored_cycle(self.cycle(how, 0.0, self.said["peak"]), FOUR)

    def gas_force(self, gas: GasModel | None, rod_ratio: float, samples: int = 4 * SAMPLES) -> float:
        """Largest mount force A = T / b of a single (eq. 1, Fig. 2) [kp]."""
        if gas is None:
            return math.nan
        torque = gas_torque(gas, self.cylinder(rod_ratio), FOUR, samples)
        across = [mount.position[1] for mount in self.problem.engine.mounts]
        return float(np.abs(torque).max()) / (max(across) - min(across)) / GRAVITY

    def cancelling_speed(self, gas: GasModel, rod_ratio: float) -> float:
        """Mean piston speed [m/s] at which least of the second-order torque is left."""
        part = self.cylinder(rod_ratio)
        torque = complex(spectrum_of(gas_torque(gas, part, FOUR, SAMPLES), Fraction(1, 2)).at(2))
        # m r^2 w^2 at 1 m/s
        scale = part.reciprocating_mass * (0.5 * math.pi) ** 2
        inertia = complex(scale * inertia_roll_orders(rod_ratio, 0.0, 1.0, 4)[2])
        return math.sqrt(max(-(torque * inertia.conjugate()).real / abs(inertia) ** 2, 0.0))

    def balanced(self, gas: GasModel, rod_ratio: float) -> list[float]:
        """Best share of the moment pair, and what force and moment pair take off (Fig. 22): the last three claims."""
        engine = self.problem.engine
        longer = tuple(self.cylinder(rod_ratio, part) for part in engine.slider_cranks)
        plain, point = replace(engine, slider_cranks=longer, rotors=()), replace(self.problem.points[0], gas=gas)
        bare = shaking_loads(plain, point, Fidelity(samples=SAMPLES))
        gain = rod_ratio / self.said["assumed"][-1]
        pair = [replace(r, unbalance=gain * r.unbalance) for r in engine.rotors if r.shaft.name.startswith("force")]
        left = _sampled(plain, bare + rotor_loads(pair, point.speed, FOUR))
        moment = [r for r in engine.rotors if r.shaft.name.startswith("moment")]
        slope = _sampled(plain, rotor_loads(moment, point.speed, FOUR)) / self.said["share"]
        best = SHARES[np.argmin([_mean(left + share * slope) for share in SHARES])]
        second = 1.0 - _mean(left + self.said["share"] * slope) / _mean(left)
        return [float(best), 1.0 - _mean(left) / _mean(_sampled(plain, bare)), second]

    def misses(self, found: Sequence[float], *names: str) -> list[float]:
        """How far claims are missed, over what is allowed."""
        places = [CLAIMS.index(name) for name in names]
        claimed, allowed = ([self.said[key][k] for k in places] for key in ("claimed", "allowed"))
        return [(f - c) / a for f, c, a in zip(found, claimed, allowed, strict=True)]

    def torque_misses(self, gas: GasModel, how: Unprinted) -> list[float]:
        """Of all but the gas force."""
        found = [self.cancelling_speed(gas, how.rod_ratio), *self.balanced(gas, how.rod_ratio)]
        return self.misses(found, *CLAIMS[1:])

    def force_miss(self, how: Unprinted, samples: int = SAMPLES) -> list[float]:
        """Of the gas force at full load."""
        return self.misses([self.gas_force(self.full(how), how.rod_ratio, samples)], CLAIMS[0])

    def speed_miss(self, gas: GasModel, rod_ratio: float) -> list[float]:
        """Of the speed at which torques cancel."""
        return self.misses([self.cancelling_speed(gas, rod_ratio)], CLAIMS[1])


def fitted_traces(problem: Problem, said: Mapping[str, Any]) -> dict[str, Labelled]:
    """What is said of the trace, under parameters assumed and fitted.

    Parameters
    ----------
    problem
        The four-cylinder with its pairs on shafts named "force ..." and "moment ...".
    said
        `claimed` and `allowed` in the order of `CLAIMS`; `assumed`, `lowest`, `highest` and
        `starts` of `Unprinted`; `peak`, `full_load` and `part_load` [Pa]; the `share` of the moment pair.
    """
    study = Study(problem, said)
    traces = _traces(study)
    ratios = [trace.how.rod_ratio for trace in traces]
    found = [
        [study.gas_force(t.full, ratio), study.cancelling_speed(t.judged, ratio), *study.balanced(t.judged, ratio)]
        for t, ratio in zip(traces, ratios, strict=True)
    ]
    names = {"trace": [trace.name for trace in traces]}
    met = [sum(abs(miss) <= 1.0 + 1e-9 for miss in study.misses(row, *CLAIMS)) for row in found]
    highest = [cylinder_pressure(t.judged, study.cylinder(t.how.rod_ratio), FOUR, SAMPLES).max() for t in traces]
    return {
        **{claim: Labelled([row[k] for row in found], names) for k, claim in enumerate(CLAIMS)},
        "met": Labelled(met, names),
        "parameters": Labelled([_parameters(t) for t in traces], {**names, "parameter": list(PARAMETERS)}),
        "highest_pressure": Labelled([float(pressure) / PRESSURE for pressure in highest], names),
    }


def _parameters(trace: Trace) -> list[float]:
    """In the order of `PARAMETERS`; not a number where the trace has none."""
    how, gas = trace.how, trace.judged
    if isinstance(gas, Wiebe):
        burn = [math.degrees(gas.start), math.degrees(gas.start + gas.duration)]
        return [gas.compression_ratio, *[math.nan] * 3, how.rod_ratio, *burn]
    peak = gas.peak_pressure / PRESSURE if isinstance(gas, Seiliger) else math.nan
    return [how.ratio, how.compression, how.expansion, peak, how.rod_ratio, math.nan, math.nan]


def _traces(study: Study) -> list[Trace]:
    assumed, *others = (Unprinted(*start) for start in (study.said["assumed"], *study.said["starts"]))
    starts = [assumed, *others]
    steep = assumed._replace(ratio=_ratio_for_gas_force(study, assumed))
    soft = _fitted(study, lambda how: study.speed_miss(study.part(how), how.rod_ratio), starts)
    fired = _fitted(study, lambda how: study.force_miss(how) + study.torque_misses(study.part(how), how), starts)
    idle = _fitted(study, lambda how: study.torque_misses(study.motored(how), how), [assumed])
    return [
        Trace("assumed here", study.full(assumed), study.part(assumed), assumed),
        Trace("largest force met", study.full(steep), study.part(steep), steep),
        Trace("softest fired", study.full(soft), study.part(soft), soft),
        Trace("fired, all five", study.full(fired), study.part(fired), fired),
        Trace("burn too late", None, _late_burn(study, assumed), assumed),
        Trace("no load, assumed", study.full(assumed), study.motored(assumed), assumed),
        Trace("no load, fitted", study.full(idle), study.motored(idle), idle),
    ]


def _ratio_for_gas_force(study: Study, assumed: Unprinted) -> float:
    # late, for it takes longer than all the rest of a small problem
    from scipy.optimize import brentq

    return float(brentq(lambda x: study.force_miss(assumed._replace(ratio=x), 4 * SAMPLES)[0], 15.0, 22.0, xtol=1e-3))


def _fitted(study: Study, misses: Callable[[Unprinted], list[float]], starts: Sequence[Unprinted]) -> Unprinted:
    """Least squares within bounds of what a diesel engine of the time can have been."""
    from scipy.optimize import least_squares

    low, high, assumed = (np.array(study.said[key]) for key in ("lowest", "highest", "assumed"))

    def scaled(x: Array) -> Array:
        # of what serves equally well the nearest to what is assumed elsewhere
        near = NEARNESS * (x - (assumed - low) / (high - low))
        return np.array([*misses(Unprinted(*(low + x * (high - low)))), *near])

    def fit(start: Unprinted) -> Any:
        first = np.clip((np.array(start) - low) / (high - low), 0.02, 0.98)
        step = [2e-3] * len(low)
        return least_squares(scaled, first, bounds=(0.0, 1.0), diff_step=step, ftol=1e-4, xtol=1e-4, max_nfev=30)

    best = min(map(fit, starts), key=lambda found: float(found.cost))
    return Unprinted(*(low + best.x * (high - low)).tolist())


def _late_burn(study: Study, assumed: Unprinted) -> Wiebe:
    """Finite heat release at part load, its start and duration driven to the speed that is said."""
    from scipy.optimize import least_squares

    def burn(x: Array) -> Wiebe:
        first, lasts = math.radians(x[0]), math.radians(x[1])
        return Wiebe(study.said["part_load"], first, lasts, shape=3.0, compression_ratio=13.0)

    def miss(x: Array) -> Array:
        (found,) = study.speed_miss(burn(x), assumed.rod_ratio)
        return np.array([study.said["allowed"][1] * found])

    bounds = ([-20.0, 30.0], [20.0, 110.0])
    return burn(least_squares(miss, [0.0, 60.0], bounds=bounds, diff_step=[1e-3, 1e-3], max_nfev=15).x)


def _sampled(engine: Engine, load: Spectrum) -> Array:
    """Mount forces of a load over the cycle."""
    return rigid_mounting(engine.mounts).forces(load).rebased(engine.cycle.base_order).sample(SAMPLES)


def _mean(samples: Array) -> float:
    """Mean length of vectors (..., 3)."""
    return float(np.sqrt(np.sum(samples**2, axis=-1)).mean())
