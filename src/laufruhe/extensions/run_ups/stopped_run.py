"""Run-up on mounts with bump stops, in equal steps: modes of the mounts, and stops as further loads (E28b).

    z_{k+1} = e^{A h} z_k + b_k + integral of e^{A (h - s)} f(s) ds,   f the force of the stops on the block

z are the modes of the mounts with rates A, and h is the time step. b_k is the contribution of the loads, as on mounts
without stops (E28a). While no stop is touched, it is the only one, and many steps are computed at once. Otherwise f is
linear from its value at the start of the step to that at a first guess of its end (second order in h).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.run_ups.linear_run import BLOCK, LinearRun, RunResponse, Sweep, accumulate
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.physics.time_model import TimeModel

QUICKEST = 0.5
"""Largest phase of the fastest vibration on stops within a step [rad]."""


@dataclass(frozen=True, eq=False)
class _DesignBatch:
    """Modes of several designs, computed together; one of each conjugate pair, as two real numbers.

    Attributes
    ----------
    decays
        Factor e^{rate h} of each mode over a step of length h, shape (designs, modes).
    travel_map
        Map from modes to travel along the axes of springs with stops, shape (designs, springs, 2 modes).
    first, second
        Change of the modes in a step by a constant load along these axes, and by one that rises linearly to 1, shape
        (designs, 2 modes, springs).
    gaps, stops
        Gap [m] and stiffness [N/m] of the stops, shape (designs, springs, 1).
    """

    decays: ComplexArray
    travel_map: Array
    first: Array
    second: Array
    gaps: Array
    stops: Array

    def pressed(self, z: ComplexArray) -> Array:
        """Return the forces of the stops on the block along their axes, shape (designs, springs, 1), at modes `z`."""
        travel = np.matmul(self.travel_map, z.view(float)[..., None])
        stop_force = np.minimum(np.maximum(travel, -self.gaps), self.gaps)
        stop_force -= travel
        stop_force *= self.stops
        return stop_force

    def next(self, z: ComplexArray, excitation: ComplexArray) -> ComplexArray:
        """Return the modal states z after one time step, shape (designs, modes).

        `excitation` is their change by loads.
        """
        force = self.pressed(z)
        next_modes = self.decays * z
        next_modes += excitation
        # real view of the modes as columns
        parts = next_modes.view(float)[..., None]
        parts += np.matmul(self.first, force)
        force_change = self.pressed(next_modes)
        force_change -= force
        parts += np.matmul(self.second, force_change)
        return next_modes


def responses_to(
    models: Sequence[TimeModel | None], sweep: Sweep, wrenches: Sequence[Array]
) -> list[RunResponse | None]:  # fmt: skip
    """Return the motion of each design in a run-up under its wrenches (`Sweep.wrenches`); None if time steps fail.

    A design that has no time model is None in `models`.

    With bump stops all designs are computed together, so that all are None if one fails.
    """
    runs = [None if model is None else LinearRun(model, sweep) for model in models]
    valid_runs = [run for run in runs if run is not None]
    if not any(run.model.has_stops for run in valid_runs):
        return [
            run.response(loads) if run and run.is_known else None for run, loads in zip(runs, wrenches, strict=True)
        ]
    is_too_stiff = any(quickest(run.model) * sweep.step > QUICKEST or not run.is_resolved for run in valid_runs)
    if is_too_stiff or len(valid_runs) < len(runs) or len({len(run.modes[0]) for run in valid_runs}) > 1:
        return [None] * len(runs)
    batch = _batch_of(valid_runs, sweep.step)
    excitation = np.stack([run.excitation(loads) for run, loads in zip(valid_runs, wrenches, strict=True)])
    return [run.response_of(loads) for run, loads in zip(valid_runs, _followed(batch, excitation), strict=True)]


def quickest(model: TimeModel) -> float:
    """Return an upper bound of the angular frequency of the block on its stops alone [rad/s]."""
    return float(np.linalg.norm(np.sqrt(model.stops.stiffness)[:, None] * model.stops.rows, 2))


def _batch_of(runs: Sequence[LinearRun], step: float) -> _DesignBatch:
    # springs with a stop in any design
    with_stops = np.flatnonzero(np.any([_stiffness(run.model) > 0.0 for run in runs], axis=0))
    parts = []
    for run in runs:
        model, (rates, shapes, inverse) = run.model, run.modes
        mode_loads = inverse @ model.stops.rows[with_stops].T
        growth, x = np.exp(rates * step), rates * step
        # series for rates near zero
        is_small = np.abs(x) < 1e-4
        divisor = np.where(is_small, 1.0, x)
        constant_weight = np.where(is_small, 1.0 + 0.5 * x, (growth - 1.0) / divisor)
        linear_weight = np.where(is_small, 0.5 + x / 6.0, (growth - 1.0 - x) / divisor**2)
        travel_of_modes = model.stops.rows[with_stops] @ shapes[: model.size]
        first, second = (step * weight[:, None] * mode_loads for weight in (constant_weight, linear_weight))
        stiffness = _stiffness(model)[with_stops]
        gaps = np.where(stiffness > 0.0, model.stops.gaps[with_stops], np.inf)
        real_travel = np.stack([travel_of_modes.real, -travel_of_modes.imag], axis=-1).reshape(len(with_stops), -1)
        parts.append((growth, real_travel, _real_rows(first), _real_rows(second), gaps[:, None], stiffness[:, None]))
    return _DesignBatch(*(np.stack(part) for part in zip(*parts, strict=True)))


def _stiffness(model: TimeModel) -> Array:
    return np.where(np.isfinite(model.stops.gaps), model.stops.stiffness, 0.0)


def _real_rows(columns: ComplexArray) -> Array:
    return np.ascontiguousarray(np.stack([columns.real, columns.imag], axis=1).reshape(2 * len(columns), -1))


def _followed(batch: _DesignBatch, excitation: ComplexArray) -> ComplexArray:
    """Return the modal states after each time step, shape (designs, modes, steps + 1), from their change by loads."""
    states = np.array(excitation)
    powers = batch.decays[..., None] ** np.arange(1, BLOCK + 1)
    count, z = excitation.shape[-1], np.ascontiguousarray(excitation[..., 0])
    for start in range(1, count, BLOCK):
        driving_block = excitation[..., start : start + BLOCK]
        free = np.array(driving_block)
        accumulate(free, batch.decays)
        free += powers[..., : free.shape[-1]] * z[..., None]
        parts = np.stack([free.real, free.imag], axis=2).reshape(len(free), -1, free.shape[-1])
        touches = np.abs(batch.travel_map @ parts) > batch.gaps
        if np.any(touches) or np.any(batch.pressed(z)):
            steps = np.ascontiguousarray(np.moveaxis(driving_block, -1, 0))
            for k, driving in enumerate(steps):
                z = batch.next(z, driving)
                steps[k] = z
            free = np.moveaxis(steps, 0, -1)
        states[..., start : start + BLOCK], z = free, np.ascontiguousarray(free[..., -1])
    return states
