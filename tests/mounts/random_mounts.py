"""Random problems on elastic mounts, and a search by the exact model that judges claims about them."""

from __future__ import annotations

import cmath
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution, minimize

from laufruhe.files.reader import load
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers import solve
from laufruhe.solvers.result import Result, Status

FAMILIES = ("one", "two", "four", "convex", "tied", "lossy", "placed", "joint", "gas")
THROWS = {
    1: [0],
    2: [0, 180],
    3: [0, 120, 240],
    4: [0, 180, 180, 0],
    5: [0, 144, 216, 288, 72],
    6: [0, 120, 240, 240, 120, 0],
}
NORMS = ("mean", "rms", "maximum", "peak to peak")
LOADS = ("mount force", "mount force", "mount travel", "rocking couple")
# a design that keeps its limits by less is not held against a claim
CLEAR = 1e-7


class Drawn:
    """Random problem as the text of a file."""

    def __init__(self, family: str, seed: int, folder: Path) -> None:
        self.folder, self.family, self.rng = folder, family, np.random.default_rng([FAMILIES.index(family), seed])
        self.points = ["p1"] if self.rng.random() < 0.6 else ["p1", "p2"]
        self.lines = [f'title = "{family} {seed}"', *self._engine(), *self._block(), *self._mounts()]
        self.lines += self._rotors() if family == "joint" else []
        self.objective = self._objective()
        self.limited_quantities = [self._measure(limit=True) for _ in range(int(self.rng.integers(0, 3)))]
        self.room = [float(self.rng.choice([0.7, 0.9, 1.0, 1.02, 1.3])) for _ in self.limited_quantities]

    def text(self, limits: list[str]) -> str:
        """Return the text of the file with these limits and a short search."""
        return "\n".join([*self.lines, *self.objective, *limits, "[search]", "starts = 3", "boxes = 300", ""])

    def _between(self, low: float, high: float) -> float:
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def _engine(self) -> list[str]:
        rng = self.rng
        count = int(rng.choice([1, 2, 3, 4, 5, 6]))
        throws = (
            THROWS[count]
            if rng.random() < 0.6
            else [0, *(float(np.round(a, 1)) for a in rng.uniform(0, 360, count - 1))]
        )
        cycle = "two-stroke" if rng.random() < 0.4 else "four-stroke"
        lines = [
            "[engine]",
            'layout = "inline"',
            f'cycle = "{cycle}"',
            f'stroke = "{self._between(60, 160):.4f} mm"',
            f"rod_ratio = {rng.uniform(0.2, 0.33):.5f}",
            f'reciprocating_mass = "{self._between(0.2, 3):.5f} kg"',
            'bore = "80 mm"',
            f'cylinder_spacing = "{rng.uniform(80, 130):.3f} mm"',
            f"throws = {throws}",
        ]
        for name in self.points:
            lines += [
                "[[operating_points]]",
                f'name = "{name}"',
                f'speed = "{self._between(400, 4000):.3f} rpm"',
                f"weight = {rng.uniform(0.5, 2):.4f}",
            ]
        if self.family == "gas":
            lines += ["[gas]", 'model = "seiliger"', 'peak_pressure = "60 bar"', 'imep = "6 bar"']
        return lines

    def _block(self) -> list[str]:
        mass = self.mass = self._between(40, 600)
        inertia = [mass * self.rng.uniform(a, b) for a, b in ((0.03, 0.05), (0.05, 0.07), (0.05, 0.075))]
        centre = self.rng.uniform(-80, 80, 3)
        lines = [
            "[block]",
            f'mass = "{mass:.5f} kg"',
            "inertia = [" + ", ".join(f'"{i:.6f} kg m^2"' for i in inertia) + "]",
            "centre_of_gravity = [" + ", ".join(f'"{c:.4f} mm"' for c in centre) + "]",
        ]
        if self.rng.random() < 0.3:
            lines.append(f'inertia_products = ["0 kg m^2", "{-0.05 * inertia[0]:.6f} kg m^2", "0 kg m^2"]')
        return lines

    def _stiffness(self, opened: int) -> str:
        parts, chosen = [], self.rng.permutation(3)[:opened]
        for axis in range(3):
            given = self.mass * self._between(300, 20000)
            wide = float(self.rng.choice([1.5, 3.0, 20.0, 300.0]))
            low = given / wide ** self.rng.uniform(0, 1)
            start = f', start = "{given:.6f} N/m"' if self.rng.random() < 0.7 else ""
            number = f'{{ between = ["{low:.6f} N/m", "{low * wide:.6f} N/m"]{start} }}'
            parts.append(number if axis in chosen else f'"{given:.6f} N/m"')
        return f"stiffness = [{', '.join(parts)}]"

    def _mounts(self) -> list[str]:
        rng, family = self.rng, self.family
        opened = {"one": [1, 0, 0], "two": [1, 0, 1], "four": [2, 1, 1], "convex": [2, 1, 1], "tied": [2, 1, 0]}
        counts = opened.get(family, [int(rng.integers(0, 3)), int(rng.integers(0, 2)), 1])
        loss = float(rng.choice([0.0, 1e-6, 0.02, 0.1, 0.3]))
        lines = ["[mounts]", 'kind = "elastic"', f"loss_factor = {loss:g}"]
        places = ((300, 200), (280, -180), (-350, 10))
        for k, (name, (x, y), count) in enumerate(zip("abc", places, counts, strict=True)):
            at = np.array([x, y, -40.0]) + rng.uniform(-60, 60, 3)
            first = f'"{at[0]:.4f} mm"'
            if family == "placed" and rng.random() < 0.6:
                first = f'{{ between = ["{at[0] - 100:.4f} mm", "{at[0] + 50:.4f} mm"], start = "{at[0]:.4f} mm" }}'
            lines += [
                "[[mounts.places]]",
                f'name = "{name}"',
                f'position = [{first}, "{at[1]:.4f} mm", "{at[2]:.4f} mm"]',
            ]
            tied = family == "tied" and k == 1
            lines.append('like = "a"' if tied else self._stiffness(count))
            if rng.random() < 0.3:
                angle = f"{rng.uniform(-40, 40):.4f}"
                angle = "{ between = [0, 60] }" if family == "placed" and rng.random() < 0.5 else angle
                lines.append(f"turned = [{angle}, 0, 0]")
            if family == "lossy" and not tied:
                lines.append("loss_factor = { between = [0.02, 0.3] }")
                if rng.random() < 0.5:
                    lines.append('damping = ["0 N s/m", "0 N s/m", { between = ["0 N s/m", "2000 N s/m"] }]')
        if family == "tied":
            lines += ["[[mounts.places]]", 'name = "d"', 'mirror_of = "a"']
        return lines

    def _rotors(self) -> list[str]:
        lines = []
        for k in range(int(self.rng.integers(1, 3))):
            lines += [
                "[[counterweights]]",
                f'name = "w{k}"',
                f'x = "{self.rng.uniform(-200, 200):.3f} mm"',
                'radius = "50 mm"',
                f'mass = {{ between = ["0 kg", "{self._between(0.1, 3):.4f} kg"] }}',
                "angle = "
                + ("{ between = [0, 360] }" if self.rng.random() < 0.6 else f"{self.rng.uniform(0, 360):.3f}"),
            ]
        if self.rng.random() < 0.6:
            lines += [
                "[[balancer_shafts]]",
                'name = "s"',
                f"ratio = {self.rng.choice([-1, 2, -2])}",
                'position = ["80 mm", "-60 mm"]',
                "[[balancer_shafts.unbalances]]",
                'radius = "20 mm"',
                'unbalance = { between = ["0 kg m", "0.02 kg m"] }',
                "angle = { between = [0, 360] }",
            ]
        return lines

    def _measure(self, limit: bool) -> list[str]:
        """Return a quantity and its keys; which side it is limited on comes last."""
        rng = self.rng
        numbers = ["static sag", "torque-roll residual", "total stiffness", "transmissibility"]
        if self.family == "convex":
            numbers = numbers[:3]
        if limit:
            numbers += ["natural frequencies", "natural frequencies"]
            numbers += [] if self.family == "convex" else ["kinetic-energy decoupling", "natural frequencies outside"]
        loads = [f"{rng.choice(NORMS)} {rng.choice(LOADS)}"]
        name = str(rng.choice(numbers if self.family == "convex" or rng.random() < (0.6 if limit else 0.3) else loads))
        keys = [name]
        if name == "torque-roll residual":
            keys.append(f'frequency = "{rng.uniform(5, 25):.4f} Hz"')
        if name == "kinetic-energy decoupling":
            keys.append('motions = ["bounce"]')
        if name.endswith(("force", "travel")):
            if rng.random() < 0.25:
                keys.append('mounts = ["a"]')
            if rng.random() < 0.25:
                keys.append("direction_weights = [1, 2, 0.5]")
            if rng.random() < 0.25 and len(self.points) > 1:
                keys.append('operating_points = ["p2"]')
        return keys

    def _objective(self) -> list[str]:
        name, *keys = self._measure(limit=False)
        if self.rng.random() < 0.8:
            return ["[objective]", f'minimise = "{name}"', *keys]
        other, *more = self._measure(limit=False)
        lines = ["[[objective.terms]]", f'quantity = "{name}"', *keys, f"weight = {self._between(0.5, 2):.4f}"]
        return [*lines, "[[objective.terms]]", f'quantity = "{other}"', *more, f"weight = {self._between(0.5, 2):.4f}"]


def limits_of(drawn: Drawn, problem: Problem) -> list[str]:
    """Return the limits about what the design as given has."""
    evaluation, lines = evaluate(problem), []
    for k, ((name, *keys), room) in enumerate(zip(drawn.limited_quantities, drawn.room, strict=True)):
        probe = load_text(drawn, [*_limit(name, keys, k), 'min = "1 Hz"' if "frequencies" in name else _probe(name)])
        values = list(evaluation.values(probe.limits[0].measure))
        value, side = values[0] * room, "max"
        unit = probe.limits[0].measure.unit
        if name == "natural frequencies outside":
            middle = float(values[int(drawn.rng.integers(6))])
            lines += [
                *_limit(name, keys, k),
                f'outside = ["{0.95 * middle * room:.6f} Hz", "{1.06 * middle * room:.6f} Hz"]',
            ]
            continue
        if name == "natural frequencies":
            side = "min" if drawn.rng.random() < 0.5 else "max"
            value = min(values) / room if side == "min" else max(values) * room
        if name == "kinetic-energy decoupling":
            value, side = min(values[0] / room, 0.999), "min"
        lines += [*_limit(name, keys, k), f'{side} = "{value:.9g} {unit}"' if unit else f"{side} = {value:.9g}"]
    return lines


def _limit(name: str, keys: list[str], k: int) -> list[str]:
    return ["[[constraints]]", f'name = "l{k}"', f'limit = "{name.removesuffix(" outside")}"', *keys]


def _probe(name: str) -> str:
    units = {"sag": "m", "force": "N", "travel": "m", "couple": "N m", "stiffness": "N/m"}
    unit = next((u for part, u in units.items() if name.endswith(part)), "")
    side = "min" if name == "kinetic-energy decoupling" else "max"
    return f'{side} = "1 {unit}"' if unit else f"{side} = 0.5"


def load_text(drawn: Drawn, limits: list[str]) -> Problem:
    """Return the problem with these limits."""
    path = drawn.folder / "drawn.toml"
    path.write_text(drawn.text(limits))
    return load(path)


@dataclass(frozen=True)
class AttainableLimit:
    """Best outcome of a search over the exact model: the least objective within all limits, and the least excess."""

    value: float
    violation: float


def values_at(problem: Problem, y: np.ndarray) -> list[Value]:
    """Return the decisions from numbers between 0 and 1."""
    out: list[Value] = []
    numbers = iter(np.clip(y, 0.0, 1.0))
    for decision in problem.decisions:
        own = decision.set
        size = own.lower + next(numbers) * (own.upper - own.lower)
        if own.width == 1:
            out.append(size * own.directions[0] if decision.is_affine else float(size))
        else:
            low, high = own.angles
            out.append(cmath.rect(size, low + next(numbers) * (high - low)))
    return out


def searched(problem: Problem, result: Result, seed: int, budget: int = 250) -> AttainableLimit:
    """Return the best of differential evolution and of Nelder-Mead from there, by the exact model alone."""
    width = sum(decision.set.width for decision in problem.decisions)
    best = [np.inf, np.inf]

    def worth(y: np.ndarray) -> float:
        try:
            at = evaluate(problem, problem.design(values_at(problem, y)))
        except Exception:
            return 1e12
        value, violation = objective_value(problem, at), at.violation(problem.limits)
        best[1] = min(best[1], violation)
        if violation <= 0.0:
            best[0] = min(best[0], value)
        return value / scale + 100.0 * max(violation, 0.0)

    scale = result.objective.value if result.objective is not None and result.objective.value > 0.0 else 1.0
    steps = max(budget // (8 * width), 2)
    differential_evolution(worth, [(0.0, 1.0)] * width, popsize=8, maxiter=steps, seed=seed, polish=False, tol=1e-12)
    start = place_of(problem, result)
    if start is not None:
        simplex = np.vstack(
            [start, *(start + 0.01 * e * (1 if s < 0.5 else -1) for s, e in zip(start, np.eye(width), strict=True))]
        )
        minimize(worth, start, method="Nelder-Mead", options={"maxfev": budget, "initial_simplex": simplex})
    return AttainableLimit(best[0], best[1])


def place_of(problem: Problem, result: Result) -> np.ndarray | None:
    """Return the design of a result in numbers between 0 and 1."""
    if not result.decisions:
        return None
    return np.array([(d.value - d.lower) / ((d.upper - d.lower) or 1.0) for d in result.decisions])


def complaints(problem: Problem, seed: int, budget: int = 250) -> list[str]:
    """Return the claims of a solve that are wrong; none if all hold."""
    result = solve(problem)
    initial = _initial_evaluation(problem)
    out = []
    met = initial is not None and initial.violation(problem.limits) <= 0.0
    if met and result.status in (Status.INFEASIBLE, Status.FAILED):
        out.append(f"{result.status}, and the design as given keeps all limits")
    actual = searched(problem, result, seed, budget)
    if result.status is Status.FAILED and actual.violation <= 0.0:
        out.append(f"{result.message}, and a design keeps all limits with {actual.violation:.2e}")
    if result.status is Status.INFEASIBLE:
        if not result.conflict:
            out.append("infeasible, and no limit is named")
        if actual.violation <= -CLEAR:
            out.append(f"infeasible, and a design keeps all limits with {actual.violation:.2e}")
        return out
    if result.objective is None or result.certificate is None:
        return out
    value, bound = result.objective.value, result.certificate.lower_bound
    if met and initial is not None and value > objective_value(problem, initial) * (1.0 + 1e-9):
        out.append(f"worse than the design as given: {value} > {objective_value(problem, initial)}")
    if actual.value < bound * (1.0 - 1e-9):
        out.append(f"false bound: {bound}, {actual.value} is reached")
    if result.status is Status.OPTIMAL and actual.value < value * (1.0 - 1.5e-4):
        out.append(f"false optimum: {value}, {actual.value} is reached")
    if result.final.violation(problem.limits) > 1.1e-5 and result.status is not Status.FAILED:
        out.append(f"breaks a limit by {result.final.violation(problem.limits):.2e}")
    return out


def drawn_problem(family: str, seed: int, folder: Path) -> Problem:
    """Return a random problem with limits about what the design as given has."""
    drawn = Drawn(family, seed, folder)
    return load_text(drawn, limits_of(drawn, load_text(drawn, [])))


def _initial_evaluation(problem: Problem) -> Evaluation | None:
    try:
        return evaluate(problem)
    except Exception:
        return None
