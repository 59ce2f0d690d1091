"""The fidelities that a trade sets side by side, those that differ on a problem (F1, F13)."""

from __future__ import annotations

from dataclasses import replace

from laufruhe.fidelity.automatic import choose
from laufruhe.fidelity.error_bounds import reference
from laufruhe.fidelity.left_out import Scale, has_deficit, has_gas
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.problem import Problem

AUTO = (1e-2, 1e-3, 1e-4)
TIME_ORDERS, TIME_SAMPLES = 12, 360
"""Of a row in the time domain: more orders cost minutes."""


def ladder(problem: Problem) -> list[tuple[str, Problem]]:
    """Every fidelity that differs on this problem, cheap ones first."""
    found = [("mounts alone, no loads", replace(problem, points=()))] if not problem.objective else []
    found += [(name, problem.at(fidelity)) for name, fidelity in _by_hand(problem)]
    if problem.objective:
        found += [(f"auto {tolerance:g}", problem.at(choose(problem, tolerance).fidelity)) for tolerance in AUTO]
    return found


def _by_hand(problem: Problem) -> list[tuple[str, Fidelity]]:
    gas = 1440 if has_gas(problem) else None
    found = [("two-order, 48 steps", Fidelity("two-order", 48, gas_samples=gas))]
    if has_gas(problem):
        found.append(("exact without gas, 720 steps", Fidelity(samples=720, gas=False)))
    if has_deficit(problem):
        found.append(("exact, rod of two masses, 720 steps", Fidelity(samples=720, rod="mass-only")))
    found.append(("two-order, 720 steps", Fidelity("two-order", 720)))
    found += [
        (f"orders to {orders}, {samples} steps", Fidelity(samples=samples, orders=orders, gas_samples=gas))
        for orders, samples in ((4, 96), (8, 192), (24, 360))
    ]
    if problem.engine.block is not None and problem.objective:
        found += _of_elastic_mounts(problem)
    return found + [(f"exact, {samples} steps", Fidelity(samples=samples)) for samples in (720, 1440, 2880)]


def _of_elastic_mounts(problem: Problem) -> list[tuple[str, Fidelity]]:
    """Mounts that give no way, the modes that answer most, and the block in time."""
    found = [("rigid mounts, 720 steps", Fidelity(samples=720, mounts="rigid"))]
    scale = Scale(problem, reference(problem))
    by_strength = sorted(scale.strengths, key=lambda mode: -scale.strengths[mode])
    for count in (1, 3):
        if count < len(by_strength):
            modes = tuple(sorted(by_strength[:count]))
            names = ", ".join(map(str, modes))
            found.append((f"mode(s) {names}, 720 steps", Fidelity(samples=720, modes=modes)))
    every = f"orders to {TIME_ORDERS}"
    found.append((f"{every}, {TIME_SAMPLES} steps", Fidelity(samples=TIME_SAMPLES, orders=TIME_ORDERS)))
    found.append((f"in time, {every}", Fidelity(samples=TIME_SAMPLES, orders=TIME_ORDERS, mounts="time")))
    return found
