"""The best design that a search of our own finds: planes where a problem is convex, all stars, simplex, evolution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.optimize import differential_evolution, minimize

from attack.cutting_planes import Program
from attack.openings import Openings
from attack.plain_scene import Scene, Table
from attack.star_list import even_stars

EXCESS = 1e-6
"""Share by which a rival may pass a limit."""


@dataclass(frozen=True)
class Rival:
    """A design that keeps the limits, or comes as near as was found.

    Attributes
    ----------
    bound
        No design of ours is less, by planes; zero where there is none.
    minimum_violation
        No design breaks the limits less, by planes.
    """

    value: float
    violation: float
    vector: np.ndarray
    star: Table
    looked_at: int = 1
    bound: float = 0.0
    minimum_violation: float = -1.0


def stars_of(openings: Openings) -> Iterator[Table]:
    """Yield the keys of [engine] for each star that open throws may take."""
    engine = openings.table["engine"]
    if engine.get("throws") == "open":
        yield from even_stars(engine)
    else:
        yield {}


def convex_rival(
    openings: Openings, start: np.ndarray, star: Table, target: float = np.inf, charge: float = 1e3
) -> Rival:
    """Return the best rival with open unbalances alone; the search ends if none can be below `target`."""
    program = Program(openings, star)
    optimum = program.minimum(start, target=target, charge=charge)
    if optimum.violation > EXCESS:
        minimum = program.minimum_violation(optimum.vector)
        if minimum.violation <= EXCESS:
            optimum = program.minimum(minimum.vector, charge=1e6)
        else:
            scene = openings.scene(minimum.vector, star)
            return Rival(scene.objective, minimum.violation, minimum.vector, star, minimum_violation=minimum.bound)
    scene = openings.scene(optimum.vector, star)
    return Rival(scene.objective, scene.worst, optimum.vector, star, bound=optimum.bound)


def best_star(openings: Openings, maximum: int, target: float = np.inf) -> Rival | None:
    """Return the best rival over all stars, each solved alone; None if there are none, or too many."""
    stars = list(stars_of(openings))
    if not stars or len(stars) > maximum:
        return None
    rivals = [convex_rival(openings, openings.nearest(np.zeros(openings.size)), star, target) for star in stars]
    feasible = [r for r in rivals if r.violation <= EXCESS]
    best = min(feasible, key=lambda r: r.value) if feasible else min(rivals, key=lambda r: r.violation)
    return Rival(best.value, best.violation, best.vector, best.star, len(stars), min(r.bound for r in rivals))


def least_broken(openings: Openings, maximum: int) -> Rival | None:
    """Return the design, of any star, that passes its limits least."""
    stars = list(stars_of(openings))
    if not stars or len(stars) > maximum:
        return None
    best: Rival | None = None
    for star in stars:
        optimum = Program(openings, star).minimum_violation(openings.nearest(np.zeros(openings.size)))
        if best is None or optimum.violation < best.violation:
            best = Rival(0.0, optimum.violation, optimum.vector, star, len(stars), minimum_violation=optimum.bound)
    return best


def charged(openings: Openings, unit: float, star: Table | None = None):
    """Return the objective in its unit, and much more for what limits are passed by; infinite where nothing answers."""

    def value(vector: np.ndarray) -> float:
        scene = openings.scene(openings.nearest(vector.copy()), star)
        try:
            over = max(scene.worst, 0.0)
            penalised = scene.objective / unit + (100.0 * over + 0.1 if over > EXCESS else 0.0)
        except (np.linalg.LinAlgError, ValueError):
            return 1e9
        return penalised if np.isfinite(penalised) else 1e9

    return value


def local_rival(
    openings: Openings, rng: np.random.Generator, starts: list[np.ndarray], calls: int, star: Table | None = None
) -> Rival:
    """Return the random designs and evolution, then a simplex from the best of them and from `starts`."""
    unit = openings.scene(starts[0], star).objective or 1.0
    value = charged(openings, unit, star)
    pool = [*starts, *(openings.random(rng) for _ in range(calls // 4))]
    values = [value(v) for v in pool]
    if openings.size <= 6:
        evolved = differential_evolution(
            value, openings.box.tolist(), maxiter=max(calls // (10 * openings.size) // 2, 2), popsize=10,
            init="sobol", polish=False, seed=rng,
        )  # fmt: skip
        pool.append(evolved.x)
        values.append(evolved.fun)
    best = [pool[k] for k in np.argsort(values)[:2]]
    for start in [*best, *starts[:1]]:
        simplex = start + 0.05 * np.vstack([np.zeros(openings.size), np.eye(openings.size)]) * np.where(
            start > 0.9, -1, 1
        )
        optimum = minimize(
            value, start, method="Nelder-Mead",
            options={"maxfev": calls // 4, "xatol": 1e-9, "fatol": 1e-10, "initial_simplex": simplex},
        )  # fmt: skip
        pool.append(optimum.x)
        values.append(optimum.fun)
    vector = openings.nearest(pool[int(np.argmin(values))].copy())
    scene: Scene = openings.scene(vector, star)
    return Rival(scene.objective, scene.worst, vector, star or {}, len(pool))
