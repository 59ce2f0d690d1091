"""Run-up and shut-down of many designs at once, step by step (E25 to E28), beside what the package does in modes.

Runge and Kutta's rule of fourth order with 24 steps of the fastest order, of which the largest counts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from attack.own_loads import Table, si

if TYPE_CHECKING:
    from attack.own_problem import Designs

ORDERS = 12
STEPS = 24
MEASURES = ("run-up force", "run-up travel", "run-up twist")


def matrices(designs: Designs) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return forces of mounts (count, mounts, 3, 6) by motion and by speed, and inverse of the mass; losses of E26."""
    b = designs.blocks
    values, vectors = np.linalg.eigh(b.mass)
    root = (vectors / np.sqrt(values)) @ vectors.T
    squares, turned = np.linalg.eigh(root @ b.firmness @ root)
    # a speed's share of each mode, over its frequency
    slow = root @ (turned / np.sqrt(squares)[:, None]) @ np.swapaxes(turned, -1, -2) @ np.linalg.inv(root)
    by_motion = b.along(b.at_rest) @ b.moves
    by_speed = b.along(b.damping) @ b.moves + b.along(b.loss) @ b.moves @ slow[:, None]
    return by_motion, by_speed, np.linalg.inv(b.mass)


def run_through(designs: Designs) -> dict[str, np.ndarray]:
    """Return the largest of up and down, (count,) each."""
    run_up: Table = designs.table["run_up"]
    top, model = si(run_up["up_to"]), designs.model
    peaks = {key: np.zeros(designs.count) for key in MEASURES}
    point = min(model.points, key=lambda p: si(p["speed"]))
    if "operating_point" in run_up:
        point = next(p for p in model.points if p["name"] == run_up["operating_point"])
    orders = model.harmonics[model.harmonics <= ORDERS * model.turns]
    inertia = np.broadcast_to(model.inertia[orders], (designs.count, len(orders), 6)).copy()
    for w, (upright, aside) in zip(model.weights, model.of_weights, strict=True):
        u = designs.unbalances[w.name][:, None, None]
        inertia += u.real * upright[orders] + u.imag * aside[orders]
    both = [designs.blocks.about_centre(load) for load in (inertia, model.gas(point)[orders][None])]
    times = (si(run_up.get("time", 3.0)), si(run_up.get("shut_down_time", run_up.get("time", 3.0))))
    for first, last, duration in ((0.0, top, times[0]), (top, 0.0, times[1])):
        for key, value in _one(
            designs, both, orders / model.turns, (first, (last - first) / duration, duration)
        ).items():
            peaks[key] = np.maximum(peaks[key], value)
    return peaks


def _one(
    designs: Designs, loads: list[np.ndarray], orders: np.ndarray, run: tuple[float, float, float]
) -> dict[str, np.ndarray]:
    """Return a run from rest at a first speed that changes by so much a second, for so long."""
    by_motion, by_speed, inverse = matrices(designs)
    back = np.swapaxes(designs.blocks.moves, -1, -2)
    k, c = (inverse @ (back @ part).sum(axis=1) for part in (by_motion, by_speed))
    inertia, gas = (load @ inverse.T for load in loads)
    first, gain, duration = run
    count = int(np.ceil(duration * max(first, first + gain * duration) * ORDERS * STEPS / (2.0 * np.pi))) + 1
    dt = duration / count
    rates = np.concatenate(
        [np.concatenate([np.zeros_like(k), np.broadcast_to(np.eye(6), k.shape)], -1), np.concatenate([-k, -c], -1)], 1
    )

    def push(t: float) -> np.ndarray:
        speed, turned = first + gain * t, np.exp(1j * orders * (first * t + 0.5 * gain * t * t))
        load = (np.tensordot(turned, speed * speed * inertia + gas, (0, 1))).real
        return np.concatenate([np.zeros_like(load), load], axis=1)

    y, now = np.zeros((designs.count, 12)), push(0.0)
    maximum = {key: np.zeros(designs.count) for key in MEASURES}
    states: list[np.ndarray] = []
    for step in range(count):
        middle, after = push((step + 0.5) * dt), push((step + 1.0) * dt)
        a = (rates @ y[..., None])[..., 0] + now
        b = (rates @ (y + 0.5 * dt * a)[..., None])[..., 0] + middle
        d = (rates @ (y + 0.5 * dt * b)[..., None])[..., 0] + middle
        e = (rates @ (y + dt * d)[..., None])[..., 0] + after
        y, now = y + dt / 6.0 * (a + 2.0 * b + 2.0 * d + e), after
        states.append(y)
        if len(states) == 256 or step == count - 1:
            _read(maximum, np.array(states), by_motion, by_speed, designs)
            states = []
    return maximum


def _read(
    maximum: dict[str, np.ndarray], states: np.ndarray, by_motion: np.ndarray, by_speed: np.ndarray, designs: Designs
) -> None:
    q, v = states[..., :6, None], states[..., 6:, None]
    joined = designs.blocks.joined((by_motion @ q[:, :, None] + by_speed @ v[:, :, None])[..., 0])
    travel = (designs.blocks.moves @ q[:, :, None])[..., 0]
    sizes = (np.linalg.norm(joined, axis=-1), np.linalg.norm(travel, axis=-1), np.abs(q[..., 3, :]))
    for key, size in zip(MEASURES, sizes, strict=True):
        maximum[key] = np.maximum(maximum[key], size.max(axis=(0, 2)))
