"""Claims of a result, compared with an independent model and with the best design that it finds.

The independent model reads the problem file and values of decisions. Where its value is exact (means, root mean
squares, numbers at rest) it agrees with the package's to 1e-9. A bound may exceed a design by no more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution, minimize

from attack.own_loads import Table
from attack.own_problem import OwnModel, is_open, open_numbers_of
from attack.own_runs import MEASURES as OF_RUNS
from attack.plain_scene import terms_of

EXACT = 1e-9
SAMPLED = {"peak to peak": 2e-6, "maximum": 2e-7, **dict.fromkeys(OF_RUNS, 1e-3)}
"""Relative accuracy of quantities that the own model reads from samples."""
SPARED = 1e-9
"""Share of its limits that a design must have to spare before it counts against 'infeasible'."""
EXCESS = 1.1e-6
"""Share of a limit by which a design may pass it."""
ROUNDED = 1e-13
"""Share of the value of the design as given under which a value is nought."""
LAYOUTS = ("inline", "vee", "boxer")
LINKAGES = ("crank-rocker", "rhombic")
POINTS = {"name", "speed", "weight", "imep", "motored", "gas"}


def knows(table: Table) -> bool:
    """Return True if the own model covers a file: elastic mounts, alone or with unbalances, of its layouts."""
    engine, model = table["engine"], table.get("gas", {}).get("model")
    has_throws = isinstance(engine.get("throws"), list) and all(isinstance(t, int | float) for t in engine["throws"])
    points = {key for point in table["operating_points"] for key in point}
    fluid = any("fluid_track" in place for place in table["mounts"].get("places", []))
    measured = any("dynamic_stiffness" in place for place in table["mounts"].get("places", []))
    return (
        points <= POINTS and not measured and not (fluid and "run_up" in table)
        and table["mounts"].get("kind") == "elastic" and has_throws
        and engine["layout"] in LAYOUTS and (engine.get("drive") in (None, *LINKAGES))
        and ("drive" not in engine or not (model or any(is_open(value) for value in engine.values())))
        and model in (None, "wiebe", "seiliger") and "torsion" not in table
    )  # fmt: skip


def vector(model: OwnModel, decisions: dict[str, float]) -> np.ndarray:
    """Return the values of decisions, angles in degrees as files have them."""
    turning = [".angle" in o.name or ".turned." in o.name for o in model.open]
    return np.array(
        [
            math.degrees(decisions[o.name]) if turned else decisions[o.name]
            for o, turned in zip(model.open, turning, strict=True)
        ]
    )


class Search:
    """Evolution, then sequential programs and simplexes, in shares of bounds.

    Orders that hardly count are left out on the way; every end is judged with all of them.
    """

    def __init__(self, table: Table, rng: np.random.Generator, calls: int) -> None:
        self.table, self.rng = table, rng
        costly = any(
            word in str(table["objective"]) + str(table.get("constraints")) for word in ("run-up", "peak to peak")
        )
        self.calls = max(calls // 10, 80) if costly else calls
        self.quick, self.model = (
            OwnModel(table, 256 * (2 if "four" in table["engine"]["cycle"] else 1), 1e-6),
            OwnModel(table, 8192),
        )
        self.low, self.high = self.model.box.T
        self.looked_at = 0

    @property
    def size(self) -> int:
        return len(self.low)

    def shares(self, x: np.ndarray) -> np.ndarray:
        return np.clip((x - self.low) / (self.high - self.low), 0.0, 1.0)

    def both(self, shares: np.ndarray, model: OwnModel) -> tuple[np.ndarray, np.ndarray]:
        """Return the objective (n,) and excesses (n, limits); where nothing answers, much of both."""
        shares = np.atleast_2d(shares)
        self.looked_at += len(shares)
        try:
            designs = model.designs(self.low + (self.high - self.low) * np.clip(shares, 0.0, 1.0))
            value, over = designs.objective, designs.excesses
        except np.linalg.LinAlgError:
            return np.full(len(shares), 1e9), np.full((len(shares), 1), 1e9)
        return np.where(np.isfinite(value), value, 1e9), np.where(np.isfinite(over), over, 1e9)

    def evaluate_design(self, shares: np.ndarray) -> tuple[float, float]:
        """Return the objective and largest excess with every order."""
        value, over = self.both(shares, self.model)
        return float(value[0]), float(over.max())

    def best(self, starts: list[np.ndarray], unit: float) -> tuple[float, float, np.ndarray, float]:
        """Return value (infinite if none keeps the limits), excess and shares of the best design, and least excess."""
        limits = "constraints" in self.table
        goals = [self._charged(unit), *([self._violation] if limits else [])]
        ends = list(starts)
        for goal, slope in zip(goals, (self._minimum, self._least_excess), strict=False):
            for start in [*starts, *self._evolved(goal)]:
                optimum = slope(start, unit)
                ends += [start, optimum, self._simplex(optimum, goal)]
        if limits:
            nearest = min(ends, key=lambda z: float(self._violation(z)[0]))
            ends.append(self._minimum(nearest, unit))
        scores = [(*self.evaluate_design(z), z) for z in ends]
        minimum = min(over for _, over, _ in scores)
        kept_all = [item for item in scores if item[1] <= 0.0]
        best = min(kept_all, key=lambda item: item[0]) if kept_all else (math.inf, minimum, ends[0])
        return (*best, minimum)

    def _charged(self, unit: float) -> Callable[[np.ndarray], np.ndarray]:
        def value(shares: np.ndarray) -> np.ndarray:
            optimum, over = self.both(shares, self.quick)
            over = np.maximum(over.max(axis=1), 0.0)
            return optimum / unit + 10.0 * over + np.where(over > 0.0, 0.02, 0.0)

        return value

    def _violation(self, shares: np.ndarray) -> np.ndarray:
        return self.both(shares, self.quick)[1].max(axis=1)

    def _evolved(self, goal: Callable[[np.ndarray], np.ndarray]) -> list[np.ndarray]:
        """Return the best of the last generation, and another far from it."""
        people = max(24, 8 * self.size)
        optimum = differential_evolution(
            lambda z: goal(z.T), [(0.0, 1.0)] * self.size, vectorized=True, updating="deferred", polish=False,
            rng=self.rng,
            init=self.rng.random((people, self.size)), maxiter=max(self.calls // people, 4), tol=1e-9, atol=0.0,
        )  # fmt: skip
        ranked = optimum.population[np.argsort(optimum.population_energies)]
        far = np.linalg.norm(ranked - ranked[0], axis=1) > 0.1
        return [ranked[0], *ranked[far][:1]]

    def _slopes(self, unit: float) -> Callable[[np.ndarray], tuple[Any, ...]]:
        """Return objective, its slopes, excesses and theirs, by differences of one batch, kept for the last point."""
        last: dict[bytes, tuple[Any, ...]] = {}

        def slopes_at(z: np.ndarray) -> tuple[Any, ...]:
            if z.tobytes() not in last:
                step = np.where(z + 1e-6 > 1.0, -1e-6, 1e-6)
                f, e = self.both(np.vstack([z, z + np.diag(step)]), self.quick)
                last.clear()
                last[z.tobytes()] = (
                    f[0] / unit,
                    (f[1:] - f[0]) / step / unit,
                    e[0],
                    ((e[1:] - e[0]) / step[:, None]).T,
                )
            return last[z.tobytes()]

        return slopes_at

    def _minimum(self, start: np.ndarray, unit: float) -> np.ndarray:
        slopes = self._slopes(unit)
        constraint = {"type": "ineq", "fun": lambda z: -slopes(z)[2] - 1e-12, "jac": lambda z: -slopes(z)[3]}
        optimum = minimize(
            lambda z: slopes(z)[0], start, jac=lambda z: slopes(z)[1], bounds=[(0.0, 1.0)] * self.size, method="SLSQP",
            constraints=[constraint] if "constraints" in self.table else [], options={"maxiter": 60, "ftol": 1e-13},
        )  # fmt: skip
        return np.clip(optimum.x, 0.0, 1.0)

    def _least_excess(self, start: np.ndarray, unit: float) -> np.ndarray:
        """Return the least t that no excess is over."""
        slopes, last = self._slopes(unit), np.append(np.zeros(self.size), 1.0)
        constraint = {
            "type": "ineq", "fun": lambda y: y[-1] - slopes(y[:-1])[2],
            "jac": lambda y: np.column_stack([-slopes(y[:-1])[3], np.ones(len(slopes(y[:-1])[2]))]),
        }  # fmt: skip
        optimum = minimize(
            lambda y: y[-1], np.append(start, slopes(start)[2].max()), jac=lambda y: last, method="SLSQP",
            bounds=[(0.0, 1.0)] * self.size + [(None, None)], constraints=[constraint],
            options={"maxiter": 60, "ftol": 1e-12},
        )  # fmt: skip
        return np.clip(optimum.x[:-1], 0.0, 1.0)

    def _simplex(self, start: np.ndarray, goal: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        corners = start + 0.02 * np.vstack([np.zeros(self.size), np.eye(self.size)]) * np.where(start > 0.9, -1.0, 1.0)
        values = minimize(
            lambda z: float(goal(z)[0]), start, method="Nelder-Mead",
            options={"maxfev": min(250, self.calls // 4), "xatol": 1e-10, "fatol": 1e-12, "initial_simplex": corners},
        )  # fmt: skip
        return np.clip(values.x, 0.0, 1.0)


def reading(quantities: list[str], table: Table) -> float:
    """Return the relative accuracy of these quantities in the own model."""
    # its gas has more orders than the package, of which the last count in a transmissibility
    with_gas = [1e-7] if "gas" in table and "transmissibility" in quantities else []
    return max([EXACT, *with_gas, *(SAMPLED[key] for key in SAMPLED for q in quantities if q.startswith(key))])


def judge(verdict: Any, table: Table, result: Any, rng: np.random.Generator, calls: int) -> None:
    """Add complaints about a result."""
    if not open_numbers_of(table):
        return
    search = Search(table, rng, calls)
    values = {d.name: d.value for d in result.decisions}
    if result.objective is None:
        _, _, _, minimum = search.best([search.shares(search.model.start)], 1.0)
        verdict.rivals += search.looked_at
        if verdict.status == "infeasible" and minimum < -SPARED:
            verdict.wrong.append(f"infeasible, but a design keeps every limit with {-minimum:.2e} to spare")
        elif minimum < -SPARED:
            verdict.notes.append(f"note: {verdict.status}, but a design keeps every limit with {-minimum:.2e} to spare")
        return
    x = vector(search.model, values)
    start = search.shares(x)
    value, over = search.evaluate_design(start)
    floor = ROUNDED * abs(result.objective.initial or 1.0)
    quantities = reading([term["quantity"] for term in terms_of(table)], table)
    claimed, bound = result.objective.value, result.certificate.lower_bound
    if abs(value - claimed) > max(quantities, 1.5 * result.error_estimate) * abs(claimed) + floor:
        verdict.wrong.append(f"value {claimed!r} is {value!r} by the own model")
    read = max([quantities, *(reading([limit["limit"]], table) for limit in table.get("constraints", []))])
    if over > EXCESS + (read if read > 1e-4 else 0.0):
        verdict.wrong.append(f"a limit is passed by {over:.2e} of itself by the own model")
    _judge_limits(verdict, table, result, search, start)
    best, _, shares, _ = search.best([start], abs(value) or 1.0)
    verdict.rivals += search.looked_at
    under = min(best, value) if over <= 0.0 else best
    slack = read if read > 1e-4 else EXACT
    if bound > under * (1.0 + slack) + floor:
        design = dict(
            zip(
                (o.name for o in search.model.open),
                (search.low + (search.high - search.low) * shares).tolist(),
                strict=True,
            )
        )
        verdict.wrong.append(f"bound {bound!r}, the own model has {under!r} at {design}")
    if claimed - best > result.certificate.gap * abs(claimed) + slack * abs(claimed) + floor:
        verdict.wrong.append(f"gap {result.certificate.gap:.3g}, but the own model has {best!r} instead of {claimed!r}")
    if np.isfinite(best):
        verdict.beaten = (
            max(verdict.beaten, (claimed - best) / max(abs(best), floor)) if verdict.kind != "global" else 0.0
        )


def _judge_limits(verdict: Any, table: Table, result: Any, search: Search, start: np.ndarray) -> None:
    """Check the values of the limits of the final design."""
    design = search.model.designs(search.low + (search.high - search.low) * start[None])
    limits = {limit.name: limit for limit in result.limits}
    for entry in table.get("constraints", []):
        if entry["limit"] == "natural frequencies" or entry.get("name") not in limits:
            continue
        limit, value = limits[entry["name"]], float(design.measure({**entry, "quantity": entry["limit"]})[0])
        if abs(value - limit.value) > max(reading([entry["limit"]], table), 1.5 * limit.error_estimate) * abs(
            limit.value
        ):
            verdict.wrong.append(f"limit {limit.name} is said to be {limit.value!r} and is {value!r} by the own model")
