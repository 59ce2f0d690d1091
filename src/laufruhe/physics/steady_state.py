"""The block on its mounts in the time domain, the judge of the frequency domain (E25-E28).

    M q'' + C q' + K q + stops(q) = w(t)                                                (E25)

Hysteretic loss has no law in time. It is replaced by viscous damping that loses the same
work in each mode at its own natural frequency (E26); away from resonance, where damping
hardly matters, the two differ. A bump stop adds its stiffness along the own axes of a
mount beyond its gap (E27).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from laufruhe.errors import ModelError, SolverError
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.time_model import TimeModel, time_model

MAX_SHOTS = 60
CLOSED = 1e-9
# error of integration over a period, over its tolerance
ROUNDING = 100.0


@dataclass(frozen=True, eq=False)
class SteadyState:
    """Single period of a periodic motion at equal crank angles [rad], shape (n,).

    Attributes
    ----------
    forces, travels
        On the mounts and of them, in the axes of C2, shape (n, mounts, 3) [N], [m].
    mismatch
        Distance between end and start of the period, over its size.
    """

    angles: Array
    forces: Array
    travels: Array
    mismatch: float


def periodic_state(
    mounting: ElasticMounting, wrench: Spectrum, speed: float, samples: int = 360, tolerance: float = 1e-11
) -> SteadyState:
    """Return the periodic motion of a block on mounts, by integration over one period that repeats itself (E28).

    The start that repeats itself is found by Newton's method; the columns of its matrix
    are integrated together with the motion itself.
    """
    if not speed > 0.0:
        raise ModelError(f"a steady state in time needs a speed above zero, not {speed:g} rad/s")
    model = time_model(mounting)
    period = 2.0 * np.pi / (float(wrench.base) * speed)
    loaded = np.any(wrench.coefficients != 0.0, axis=1)
    loads, orders = wrench.coefficients[loaded] @ model.load.T, wrench.orders[loaded]

    rates = motion_rates(model, lambda t: (np.exp(1j * orders * speed * t) @ loads).real)
    # an even star cancels orders: the period is shorter, and closes faster and farther from any resonance
    shortest = period / (math.gcd(*np.flatnonzero(loaded).tolist()) or 1)

    def ends(first: Array) -> Array:
        return _over_period(rates, first, shortest, tolerance)[:, -1].reshape(2 * model.size, -1)

    start = _shot(ends, model.size, static_size(model, loads), tolerance, model.has_stops)
    times = np.arange(samples + 1) * (period / samples)
    states = _over_period(rates, start, period, tolerance, np.minimum(times, period))
    y, rate = np.split(states[:, :-1], 2)
    mismatch = float(np.abs(states[:, -1] - start).max() / max(np.abs(states).max(), 1e-300))
    travels = model.mount_travels(y)
    return SteadyState(np.asarray(times[:-1] * speed, dtype=float), model.mount_forces(y, rate), travels, mismatch)


def motion_rates(model: TimeModel, load: Callable[[float], Array]) -> Callable[[float, Array], Array]:
    """Right side of E25 in columns (y, y'), under a load (n,) that time tells."""

    def rates(t: float, state: Array) -> Array:
        y, rate = state.reshape(2, model.size, -1)
        return np.concatenate([rate, model.accelerations(y, rate, load(t)[:, None])]).reshape(-1)

    return rates


def _over_period(
    rates: Callable[[float, Array], Array], start: Array, until: float, tolerance: float, times: Array | None = None
) -> Array:
    scale = float(np.abs(start).max(initial=0.0)) or 1e-6
    return integrated(
        rates, (0.0, until), start.reshape(-1), "DOP853", t_eval=times, rtol=tolerance,
        atol=tolerance * min(scale, 1e-3), max_step=until / 64,
    )  # fmt: skip


def integrated(*arguments: Any, **more: Any) -> Array:
    """Integrate by SciPy, which is loaded late, and return the states."""
    from scipy.integrate import solve_ivp

    return np.asarray(solve_ivp(*arguments, **more).y)


def _shot(run: Callable[[Array], Array], count: int, size: float, tolerance: float, has_stops: bool) -> Array:
    """Find the start (y, y'), shape (2 n,), that one period of `run` returns to, by Newton's method from rest (E28)."""
    start, step = np.zeros(2 * count), size * 1e-4
    for _ in range(MAX_SHOTS):
        ends = run(start[:, None] + np.column_stack([np.zeros(2 * count), step * np.eye(2 * count)]))
        slope = (ends[:, 1:] - ends[:, :1]) / step
        gap = ends[:, 0] - start
        change = np.linalg.solve(np.eye(2 * count) - slope, gap)
        start = start + change
        scale = max(np.abs(start).max(), size)
        # a gap of the integration's own rounding cannot be closed, only moved
        if np.abs(change).max() <= CLOSED * scale or np.abs(gap).max() <= ROUNDING * tolerance * scale:
            return start
    why = "the bump stops let no motion" if has_stops else "no motion was found to"
    raise SolverError(f"{why} repeat itself in one period; integrate a run-up instead")


def static_size(model: TimeModel, loads: ComplexArray) -> float:
    """Return a typical coordinate of the block under loads; never zero."""
    stiffness = float(np.linalg.norm(model.stiffness)) or 1.0
    return float(np.abs(loads).max(initial=0.0)) / stiffness or 1e-9


INTEGRATION = 1e-9


@dataclass(frozen=True, eq=False)
class TimeMounting:
    """Steady state by integration, with bump stops, and the viscous loss of E26.

    The motion is read at equal steps over the period, `samples` of them; orders above half of them are lost.
    """

    mounting: ElasticMounting
    samples: int
    _states: dict[tuple[int, float], tuple[Spectrum, SteadyState]] = field(default_factory=dict, repr=False)

    def forces(self, wrench: Spectrum, speed: float) -> Spectrum:
        """Return the forces of the engine on its mounts, shape (n, mounts, 3) [N] (C7)."""
        return spectrum_of(self._state(wrench, speed).forces, wrench.base)

    def travel(self, wrench: Spectrum, speed: float) -> Spectrum:
        """Return the displacement of the engine at every mount, shape (n, mounts, 3) [m]."""
        return spectrum_of(self._state(wrench, speed).travels, wrench.base)

    def _state(self, wrench: Spectrum, speed: float) -> SteadyState:
        # forces and travel follow from one integration; the wrench is kept, so that no other one takes its id
        key = id(wrench), speed
        if key not in self._states:
            state = periodic_state(self.mounting, wrench, speed, self.samples, INTEGRATION)
            self._states[key] = wrench, state
        return self._states[key][1]
