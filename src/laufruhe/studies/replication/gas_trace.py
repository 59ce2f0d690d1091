"""Which gas trace a four-cylinder study may have had: parameters fitted to what it says in words.

Hasselgruber (1964) prints no trace, and says five things that bear on it: the largest mount force of the gas on
a single; the piston speed at which second-order gas and inertia torques cancel; the best share of a moment pair;
what the force pair takes off the mean mount force, and what the moment pair takes off the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

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
BURN = {"shape": 3.0, "compression_ratio": 13.0}
CLAIMS = ("gas_force", "cancelling_speed", "best_share", "first_fall", "second_fall")
PARAMETERS = ("ratio", "compression", "expansion", "peak", "rod ratio", "first", "last")
GIVES = (*CLAIMS, "met", "parameters", "highest_pressure")


@dataclass(frozen=True)
class Unprinted:
    """What decides over the gas torque and is not printed.

    Attributes
    ----------
    part_share
        Where the peak at part load lies between the end of compression (0) and the highest
        that this load and the printed peak allow (1).
    """

    compression_ratio: float
    compression_exponent: float
    expansion_exponent: float
    part_share: float
    rod_ratio: float


@dataclass(frozen=True)
class _Trace:
    """A set of parameters, the trace at full load, and the one that statements are judged on."""

    name: str
    full: GasModel | None
    judged: GasModel
    how: Unprinted

    @property
    def parameters(self) -> list[float]:
        """In the order of `PARAMETERS`; not a number where the trace has none."""
        if isinstance(self.judged, Wiebe):
            burn = [math.degrees(self.judged.start), math.degrees(self.judged.start + self.judged.duration)]
            return [self.judged.compression_ratio, *[math.nan] * 3, self.how.rod_ratio, *burn]
        peak = self.judged.peak_pressure / PRESSURE  # type: ignore[union-attr]
        ratio, compression, expansion = astuple(self.how)[:3]
        return [ratio, compression, expansion, peak, self.how.rod_ratio, math.nan, math.nan]


@dataclass(frozen=True)
class _Study:
    """The four-cylinder with both pairs, and what is said of it [SI, forces in kp].

    Attributes
    ----------
    share
        Of the whole moment pair, that the problem has.
    """

    problem: Problem
    said: Mapping[str, Any]

    @cached_property
    def claimed(self) -> dict[str, float]:
        """By the names of `CLAIMS`."""
        return dict(zip(CLAIMS, self.said["claimed"], strict=True))

    @cached_property
    def allowed(self) -> dict[str, float]:
        """What 'about' is taken to mean."""
        return dict(zip(CLAIMS, self.said["allowed"], strict=True))

    @cached_property
    def assumed(self) -> Unprinted:
        """Of every other figure."""
        return Unprinted(*self.said["assumed"])

    def cylinder(self, rod_ratio: float) -> SliderCrank:
        """The first one, its rod as long as a rod ratio wants it."""
        part = self.problem.engine.slider_cranks[0]
        return replace(part, rod_length=part.crank_radius / rod_ratio)

    def cycle(self, how: Unprinted, imep: float, peak: float) -> Seiliger:
        """The mixed cycle at a load."""
        exponents = how.compression_exponent, how.expansion_exponent
        return Seiliger(peak, imep, *exponents, compression_ratio=how.compression_ratio)

    def fired(self, how: Unprinted, imep: float, share: float = 1.0) -> Seiliger:
        """With the peak at a share between the end of compression and the highest: all heat at constant volume."""
        end = compression_end_pressure(self.cycle(how, 0.0, self.said["peak"]))
        low, high = 40e5, 80e5
        # the mean pressure is linear in the peak pressure
        reached = [seiliger_imep(self.cycle(how, imep, peak), FOUR, 1.0) for peak in (low, high)]
        peak = low + (imep - reached[0]) / (reached[1] - reached[0]) * (high - low)
        highest = max(min(peak, self.said["peak"]), end)
        return self.cycle(how, imep, highest if share == 1.0 else end + share * (highest - end))

    def full(self, how: Unprinted) -> Seiliger:
        """At full load."""
        return self.fired(how, self.said["full_load"])

    def part(self, how: Unprinted) -> Seiliger:
        """At part load."""
        return self.fired(how, self.said["part_load"], how.part_share)

    def motored(self, how: Unprinted) -> Seiliger:
        """No heat."""
        return motored_cycle(self.cycle(how, 0.0, self.said["peak"]), FOUR)

    def gas_force(self, gas: GasModel, rod_ratio: float, samples: int = 4 * SAMPLES) -> float:
        """Largest mount force A = T / b of a single (eq. 1, Fig. 2) [kp]."""
        torque = gas_torque(gas, self.cylinder(rod_ratio), FOUR, samples)
        across = [mount.position[1] for mount in self.problem.engine.mounts]
        return float(np.abs(torque).max()) / (max(across) - min(across)) / GRAVITY

    def cancelling_speed(self, gas: GasModel, rod_ratio: float) -> float:
        """Mean piston speed [m/s] at which least of the second-order torque is left."""
        part = self.cylinder(rod_ratio)
        torque = complex(spectrum_of(gas_torque(gas, part, FOUR, SAMPLES), Fraction(1, 2)).at(2))
        # at 1 m/s
        scale = part.reciprocating_mass * part.crank_radius**2 * (math.pi / (2.0 * part.crank_radius)) ** 2
        inertia = complex(scale * inertia_roll_orders(rod_ratio, 0.0, 1.0, 4)[2])
        return math.sqrt(max(-(torque * inertia.conjugate()).real / abs(inertia) ** 2, 0.0))

    def balanced(self, gas: GasModel, rod_ratio: float) -> dict[str, float]:
        """What force pair and moment pair do, and the best share of the latter (Fig. 22)."""
        engine = self.problem.engine
        longer = tuple(replace(part, rod_length=part.crank_radius / rod_ratio) for part in engine.slider_cranks)
        plain = replace(engine, slider_cranks=longer, rotors=())
        point = replace(self.problem.points[0], gas=gas)
        bare = shaking_loads(plain, point, Fidelity(samples=SAMPLES))
        force, moment = ([r for r in engine.rotors if r.shaft.name.startswith(name)] for name in ("force", "moment"))
        gain = rod_ratio / self.assumed.rod_ratio
        pair = [replace(rotor, unbalance=gain * rotor.unbalance) for rotor in force]
        left = _sampled(plain, bare + rotor_loads(pair, point.speed, FOUR))
        slope = _sampled(plain, rotor_loads(moment, point.speed, FOUR)) / self.said["share"]
        means = np.array([_mean(left + share * slope) for share in SHARES])
        second = 1.0 - _mean(left + self.said["share"] * slope) / _mean(left)
        first = 1.0 - _mean(left) / _mean(_sampled(plain, bare))
        return {"best_share": float(SHARES[np.argmin(means)]), "first_fall": first, "second_fall": second}

    def found(self, trace: _Trace) -> dict[str, float]:
        """Every claim's number under a trace."""
        ratio = trace.how.rod_ratio
        return {
            "gas_force": math.nan if trace.full is None else self.gas_force(trace.full, ratio),
            "cancelling_speed": self.cancelling_speed(trace.judged, ratio),
            **self.balanced(trace.judged, ratio),
        }

    def misses(self, gas: GasModel, how: Unprinted, *, speed_alone: bool = False) -> list[float]:
        """How far claims are missed, over what is allowed."""
        found = {"cancelling_speed": self.cancelling_speed(gas, how.rod_ratio)}
        found |= {} if speed_alone else self.balanced(gas, how.rod_ratio)
        return [(value - self.claimed[name]) / self.allowed[name] for name, value in found.items()]

    def force_miss(self, how: Unprinted, samples: int = SAMPLES) -> float:
        """The same of the gas force at full load."""
        found = self.gas_force(self.full(how), how.rod_ratio, samples)
        return (found - self.claimed["gas_force"]) / self.allowed["gas_force"]


def _sampled(engine: Engine, load: Spectrum) -> Array:
    """Mount forces of a load over the cycle."""
    return rigid_mounting(engine.mounts).forces(load).rebased(engine.cycle.base_order).sample(SAMPLES)


def _mean(samples: Array) -> float:
    """Mean length of vectors (..., 3)."""
    return float(np.sqrt(np.sum(samples**2, axis=-1)).mean())


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
    study = _Study(problem, said)
    traces = _traces(study)
    found = [study.found(trace) for trace in traces]
    names = {"trace": [trace.name for trace in traces]}
    met = [
        sum(abs(row[c] - study.claimed[c]) <= study.allowed[c] * (1.0 + 1e-9) for c in CLAIMS) for row in found
    ]  # fmt: skip
    pressure = [cylinder_pressure(t.judged, study.cylinder(t.how.rod_ratio), FOUR, SAMPLES).max() for t in traces]
    return {
        **{claim: Labelled([row[claim] for row in found], names) for claim in CLAIMS},
        "met": Labelled(met, names),
        "parameters": Labelled([t.parameters for t in traces], {**names, "parameter": list(PARAMETERS)}),
        "highest_pressure": Labelled([float(p) / PRESSURE for p in pressure], names),
    }


def _traces(study: _Study) -> list[_Trace]:
    assumed = study.assumed
    starts = [assumed, *(Unprinted(*start) for start in study.said["starts"])]
    steep = replace(assumed, compression_ratio=_ratio_for_gas_force(study))
    soft = _fitted(study, lambda how: study.misses(study.part(how), how, speed_alone=True), starts)
    fired = _fitted(study, lambda how: [study.force_miss(how), *study.misses(study.part(how), how)], starts)
    idle = _fitted(study, lambda how: study.misses(study.motored(how), how), starts[:1])
    return [
        _Trace("assumed here", study.full(assumed), study.part(assumed), assumed),
        _Trace("largest force met", study.full(steep), study.part(steep), steep),
        _Trace("softest fired", study.full(soft), study.part(soft), soft),
        _Trace("fired, all five", study.full(fired), study.part(fired), fired),
        _Trace("burn too late", None, _late_burn(study), assumed),
        _Trace("no load, assumed", study.full(assumed), study.motored(assumed), assumed),
        _Trace("no load, fitted", study.full(idle), study.motored(idle), idle),
    ]


def _ratio_for_gas_force(study: _Study) -> float:
    # late, for it takes longer than all the rest of a small problem
    from scipy.optimize import brentq

    def short(ratio: float) -> float:
        return study.force_miss(replace(study.assumed, compression_ratio=ratio), 4 * SAMPLES)

    return float(brentq(short, 15.0, 22.0, xtol=1e-3))


def _fitted(study: _Study, misses: Callable[[Unprinted], list[float]], starts: Sequence[Unprinted]) -> Unprinted:
    """Least squares within bounds of what a diesel engine of the time can have been."""
    from scipy.optimize import least_squares

    low, high = np.array(study.said["lowest"]), np.array(study.said["highest"])
    assumed = (np.array(astuple(study.assumed)) - low) / (high - low)

    def scaled(x: Array) -> Array:
        # of what serves equally well the nearest to what is assumed elsewhere
        return np.array([*misses(Unprinted(*(low + x * (high - low)))), *(NEARNESS * (x - assumed))])

    def fit(start: Unprinted) -> Any:
        first = np.clip((np.array(astuple(start)) - low) / (high - low), 0.02, 0.98)
        step = [2e-3] * len(low)
        return least_squares(scaled, first, bounds=(0.0, 1.0), diff_step=step, ftol=1e-4, xtol=1e-4, max_nfev=30)

    best = min(map(fit, starts), key=lambda found: float(found.cost))
    return Unprinted(*(float(v) for v in low + best.x * (high - low)))


def _late_burn(study: _Study) -> Wiebe:
    """Finite heat release at part load, its start and duration driven to the speed that is said."""
    from scipy.optimize import least_squares

    def burn(x: Array) -> Wiebe:
        return Wiebe(study.said["part_load"], math.radians(x[0]), math.radians(x[1]), **BURN)

    def miss(x: Array) -> Array:
        ratio = study.assumed.rod_ratio
        return np.array([study.cancelling_speed(burn(x), ratio) - study.claimed["cancelling_speed"]])

    bounds = ([-20.0, 30.0], [20.0, 110.0])
    return burn(least_squares(miss, [0.0, 60.0], bounds=bounds, diff_step=[1e-3, 1e-3], max_nfev=15).x)
