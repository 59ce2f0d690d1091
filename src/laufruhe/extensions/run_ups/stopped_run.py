"""Run-up on mounts with bump stops, in equal steps: the modes of the mounts, and stops as further loads (E28b).

    z_{k+1} = e^{A h} z_k + b_k + integral of e^{A (h - s)} f(s) ds,   f what the stops press on the block

b_k is known before, as on mounts without stops (E28a). While no stop is touched it is all there is, many steps at once.
Else f runs straight from its value at the start of the step to that at a first guess of its end (second order in h).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.extensions.run_ups.linear_run import BLOCK, LinearRun, RunResponse, Sweep
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.physics.time_model import TimeModel

QUICKEST = 0.5
"""Turn of the quickest swing on stops within a step [rad]."""


@dataclass(frozen=True, eq=False)
class _Side:
    """Several designs side by side: first axis the designs, of conjugate modes one, its parts two numbers.

    Attributes
    ----------
    decays
        e^{rate h}, shape (designs, modes).
    seen
        Matrix from modes to travel along the own axes of the springs with stops, shape (designs, springs, 2 modes).
    first, second
        What a load along those axes that stands, and one that grows to itself, add to modes in a step, shape
        (designs, 2 modes, springs).
    gaps, stops
        Shape (designs, springs, 1).
    """

    decays: ComplexArray
    seen: Array
    first: Array
    second: Array
    gaps: Array
    stops: Array

    def pressed(self, z: ComplexArray) -> Array:
        """Return the forces of the stops on the block along the own axes, shape (designs, springs, 1)."""
        travel = np.matmul(self.seen, z.view(float)[..., None])
        inside = np.minimum(np.maximum(travel, -self.gaps), self.gaps)
        inside -= travel
        inside *= self.stops
        return inside

    def next(self, z: ComplexArray, driven: ComplexArray) -> ComplexArray:
        """Return the modes after one step."""
        force = self.pressed(z)
        guess = self.decays * z
        guess += driven
        # parts of modes as columns of real numbers
        parts = guess.view(float)[..., None]
        parts += np.matmul(self.first, force)
        again = self.pressed(guess)
        again -= force
        parts += np.matmul(self.second, again)
        return guess


def responses_to(
    models: Sequence[TimeModel | None], sweep: Sweep, wrenches: Sequence[Array]
) -> list[RunResponse | None]:  # fmt: skip
    """Return the motion of each design under wrenches of `Sweep.wrenches`; None where steps fail.

    With bump stops they are followed side by side, so that one without an answer leaves all without.
    """
    runs = [None if model is None else LinearRun(model, sweep) for model in models]
    known = [run for run in runs if run is not None]
    if not any(run.model.has_stops for run in known):
        return [
            run.response(loads) if run and run.is_known else None for run, loads in zip(runs, wrenches, strict=True)
        ]
    firm = any(quickest(run.model) * sweep.step > QUICKEST or not run.is_resolved for run in known)
    if firm or len(known) < len(runs) or len({len(run.modes[0]) for run in known}) > 1:
        return [None] * len(runs)
    side = _side_by_side(known, sweep.step)
    driven = np.stack([run.driven(loads) for run, loads in zip(known, wrenches, strict=True)])
    return [run.response_of(loads) for run, loads in zip(known, _followed(side, driven), strict=True)]


def quickest(model: TimeModel) -> float:
    """Return a bound of the frequency that the stops alone give the block [rad/s]."""
    return float(np.linalg.norm(np.sqrt(model.stops)[:, None] * model.travels, 2))


def _side_by_side(runs: Sequence[LinearRun], step: float) -> _Side:
    # any design may have its stops elsewhere
    met = np.flatnonzero(np.any([_stiffness(run.model) > 0.0 for run in runs], axis=0))
    parts = []
    for run in runs:
        model, (rates, shapes, inverse) = run.model, run.modes
        into = inverse @ model.travels[met].T
        grown, x = np.exp(rates * step), rates * step
        # series where a rate is next to zero
        small = np.abs(x) < 1e-4
        safe = np.where(small, 1.0, x)
        stands = np.where(small, 1.0 + 0.5 * x, (grown - 1.0) / safe)
        grows = np.where(small, 0.5 + x / 6.0, (grown - 1.0 - x) / safe**2)
        seen = model.travels[met] @ shapes[: model.size]
        first, second = (step * weight[:, None] * into for weight in (stands, grows))
        stiffness = _stiffness(model)[met]
        gaps = np.where(stiffness > 0.0, model.gaps[met], np.inf)
        parts.append((grown, np.stack([seen.real, -seen.imag], axis=-1).reshape(len(met), -1),
                      _as_rows(first), _as_rows(second), gaps[:, None], stiffness[:, None]))  # fmt: skip
    return _Side(*(np.stack(part) for part in zip(*parts, strict=True)))


def _stiffness(model: TimeModel) -> Array:
    return np.where(np.isfinite(model.gaps), model.stops, 0.0)


def _as_rows(into: ComplexArray) -> Array:
    return np.ascontiguousarray(np.stack([into.real, into.imag], axis=1).reshape(2 * len(into), -1))


def _followed(side: _Side, driven: ComplexArray) -> ComplexArray:
    """Return the modes after every step, shape (designs, modes, steps + 1), from what drives them in each."""
    out = np.array(driven)
    powers = side.decays[..., None] ** np.arange(1, BLOCK + 1)
    count, z = driven.shape[-1], np.ascontiguousarray(driven[..., 0])
    for start in range(1, count, BLOCK):
        driving_block = driven[..., start : start + BLOCK]
        free = _free(driving_block, z, side.decays, powers)
        if _touches(side, free) or np.any(side.pressed(z)):
            steps = np.ascontiguousarray(np.moveaxis(driving_block, -1, 0))
            for k, driving in enumerate(steps):
                z = side.next(z, driving)
                steps[k] = z
            free = np.moveaxis(steps, 0, -1)
        out[..., start : start + BLOCK], z = free, np.ascontiguousarray(free[..., -1])
    return out


def _touches(side: _Side, free: ComplexArray) -> bool:
    parts = np.stack([free.real, free.imag], axis=2).reshape(len(free), -1, free.shape[-1])
    return bool(np.any(np.abs(side.seen @ parts) > side.gaps))


def _free(driven: ComplexArray, z: ComplexArray, decays: ComplexArray, powers: ComplexArray) -> ComplexArray:
    out, reach = np.array(driven), 1
    while reach < out.shape[-1]:
        out[..., reach:] += (decays**reach)[..., None] * out[..., :-reach]
        reach *= 2
    return np.asarray(out + powers[..., : out.shape[-1]] * z[..., None])
