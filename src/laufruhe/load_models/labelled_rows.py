"""Load rows V0 and B of every measure as labelled arrays (P1)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from laufruhe.errors import ModelError, wrong_call
from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.problem.curves import labelled
from laufruhe.problem.decision import Domain, column_bounds
from laufruhe.problem.dependence import is_affine, open_kinds
from laufruhe.problem.measure import Measure, counted_rotors, kinks_of
from laufruhe.problem.problem import Problem

if TYPE_CHECKING:
    import xarray as xr

_PLACES = {"mounts": "mount", "bearings": "bearing", "cylinders": "cylinder", "webs": "web"}
_DIRECTIONS = {3: ("x", "y", "z"), 2: ("y", "z")}


def affine_problem_of(problem: Problem) -> Problem:
    """Return a problem whose loads are affine in all its open numbers, without objectives of lower priority.

    Raises
    ------
    ModelError
        If other numbers are open, or an extension decides the problem.
    """
    others = [decision.name for decision in problem.decisions if not decision.is_affine]
    others += problem.phasing.open_names if problem.phasing is not None else ()
    if others:
        raise ModelError(
            f"loads are no affine function of {', '.join(others)}; fix {'it' if len(others) == 1 else 'them'}"
        )
    kinds = open_kinds(problem)
    measures = [m for m in problem.measures if m not in problem.known_rows]
    curved = [measure.name for measure in measures if not is_affine(measure.channel, kinds, problem)]
    if curved:
        raise ModelError(f"{curved[0]} is no norm of a load that is affine in the open numbers; remove it")
    if problem.extras:
        words = " and ".join(extra.words for extra in problem.extras)
        raise ModelError(
            f"the affine model leaves out {words}; remove the table from the problem, or use problem.drawing"
        )
    return problem.changed(ranks=()) if problem.ranks else problem


def labelled_measures(problem: Problem, angles: int | None = None) -> dict[str, xr.Dataset]:
    """Return V0 and B of every term and limit by its name (`Problem.affine`)."""
    model = AffineModel(affine_problem_of(problem), keep_all=True)
    samples = samples_of(model, angles)
    terms, limits = part_names(model.problem)
    return {name: labelled_rows(model, measure, samples) for name, measure in (terms | limits).items()}


def samples_of(model: AffineModel, angles: int | None) -> int:
    """Return the number of samples over one period of the loads, for `angles` over the cycle."""
    return (
        model.full_samples
        if angles is None
        else math.ceil(angles * float(model.problem.engine.cycle.base_order / model.base))
    )


def part_names(problem: Problem) -> tuple[dict[str, Measure], dict[str, Measure]]:
    """Return the measures of the terms by name, and those of the limits by the name of the limit.

    A name that is taken has a number after it.
    """
    parts = [(term.measure.name, term.measure) for term in problem.objective]
    parts += [(limit.name, limit.measure) for limit in problem.limits]
    named: dict[str, Measure] = {}
    for name, measure in parts:
        taken = sum(other == name or other.startswith(f"{name} (") for other in named)
        named[f"{name} ({taken + 1})" if name in named else name] = measure
    pairs, count = list(named.items()), len(problem.objective)
    return dict(pairs[:count]), dict(pairs[count:])


def column_names(domains: Sequence[Domain]) -> list[str]:
    """Return a name for each column of the decision vector; an unbalance with an open angle has two (C4)."""
    parts = {1: ("",), 2: (".real", ".imag")}
    return [domain.decision.name + part for domain in domains for part in parts[domain.width]]


def named_values(domains: Sequence[Domain], x: Array) -> dict[str, float]:
    """Return sizes and angles of decisions by the names that results use [SI, rad], from a decision vector x.

    Values are moved into their sets.
    """
    values = dict[str, float]()
    for domain in domains:
        x[domain.columns] = domain.project(x)
        size, angle = domain.set.split(domain.complex_value(x))
        values[domain.decision.name] = size
        if domain.width > 1:
            values[domain.decision.angle_name] = angle
    return values


def labelled_rows(model: AffineModel, measure: Measure, samples: int) -> xr.Dataset:
    """Return V0 and B of a measure, with weights of the rows, and labels of points, places, angles and directions.

    `samples` is the number of angles over one period of the loads.
    """
    import xarray as xr

    norm = model.norm(measure, samples)
    axes = row_axes(model, measure, norm, samples)
    shape, names = tuple(len(labels) for labels in axes.values()), tuple(axes)
    unit = measure.unit or "1"
    decided = [d.decision.unit or "1" for d in model.domains for _ in range(d.width)]
    columns = {
        "decision": column_names(model.domains),
        "decision_unit": ("decision", decided),
        "slope_unit": ("decision", [unit if per == "1" else f"{unit} per {per}" for per in decided]),
    }
    slope = {"long_name": "derivative of the rows by the decision", "unit_of": "slope_unit"}
    variables = {
        "constant": (names, norm.constant.reshape(shape), {"units": unit, "long_name": "rows at zero"}),
        "slope": ((*names, "decision"), norm.slope.reshape(*shape, -1), slope),
        "weight": (
            names[:-1],
            norm.grid.weights.reshape(shape[:-1]),
            {"units": "1", "long_name": "weight in the mean"},
        ),
    }
    data = xr.Dataset(variables, {**axes, **columns}, {"title": measure.name, "norm": norm.norm.name})
    if "angle" in data.coords:
        data["angle"].attrs["units"] = "deg"
    return labelled(data)


def row_axes(model: AffineModel, measure: Measure, norm: AffineNorm, samples: int) -> dict[str, Any]:
    """Return the labels of the rows (k, d) of a measure by dimension, in the order of their storage."""
    (k, d), engine = norm.constant.shape, model.problem.engine
    if not measure.is_load or measure in model.problem.known_rows:
        names = [rotor.name for rotor in counted_rotors(measure, engine.rotors)] if measure.is_mass else []
        return {"part": _labels(names, k), "component": list(range(d))}
    steps, points = norm.grid.steps, norm.grid.points
    counted = [
        p.name for p, share in zip(model.problem.points, measure.shares(model.problem.points), strict=True) if share
    ]
    places, part = k // (steps * points), measure.load.part
    directions = tuple("xyzxyz"[part]) if part is not None else _DIRECTIONS.get(d, tuple(map(str, range(d))))
    place = next((_PLACES[key] for key in measure.load.keys if key in _PLACES), "")
    names = list(measure.load.places(engine))
    place_names = [names[index] for index in measure.places(names)]
    return {
        "point": _labels(counted, points),
        **({place: _labels(place_names, places)} if place or places > 1 else {}),
        "angle": _angles(model, measure, samples, steps),
        "direction": list(directions),
    }


def _labels(names: Sequence[str], count: int) -> list[Any]:
    return list(names) if len(names) == count else list(range(count))


def _angles(model: AffineModel, measure: Measure, samples: int, steps: int) -> Array:
    # crank angles of the rows of one signal [deg]; a kink at other angles for each point has NaN
    regular = 360.0 / float(model.base) * np.arange(samples) / samples
    if steps == samples:
        return regular
    signals = [signal.with_base(model.base) for signal in model.bare.signals(measure.load)]
    kinks = np.array(kinks_of(measure, signals, model.problem.engine))
    same = np.ptp(kinks, axis=0) == 0.0
    return np.append(regular, np.degrees(np.where(same, kinks[0], math.nan)))


@dataclass(frozen=True, eq=False, repr=False)
class ObjectiveFunction:
    """Objective as a function of the decision vector x, for optimisers such as `scipy.optimize.minimize`.

    Attributes
    ----------
    names
        Name of each number of x: an unbalance with an open angle has a real and an imaginary part (C4).
    start
        Decision vector of the initial design, shape (n,) [SI].
    bounds
        Lower and upper bound of each number [SI]. Those of an open angle contain its disc or sector.
    """

    affine: AffineProblem
    names: Sequence[str]
    start: Array
    bounds: Sequence[tuple[float, float]]

    def __call__(self, x: ArrayLike) -> tuple[float, Array]:
        """Return the objective [SI] and its gradient, shape (n,); a subgradient where the objective has a kink."""
        vector = np.asarray(x, dtype=float)
        if vector.shape != self.start.shape or not np.all(np.isfinite(vector)):
            raise wrong_call(
                "x", x, f"is no vector of {len(self.start)} finite numbers", f"give {', '.join(self.names)}"
            )
        gradient = np.zeros_like(vector)
        for weight, norm in self.affine.terms:
            gradient += weight * norm.pullback(norm.subgradient(vector))
        return self.affine.objective(vector), gradient

    def __repr__(self) -> str:
        return f"<ObjectiveFunction of {', '.join(self.names)}>"

    @property
    def constraints(self) -> list[dict[str, Any]]:
        """Limits as `scipy.optimize.minimize` takes them: the share of each limit that is left, and its gradient.

        Bounds of numbers with an open angle are not among them; `values` moves a vector into these.
        """
        return [
            {"type": "ineq", "fun": partial(_share_left, maximum, norm), "jac": partial(_slope_left, maximum, norm)}
            for maximum, norm in self.affine.limits
        ]

    def values(self, x: ArrayLike) -> dict[str, float]:
        """Return the values of the open numbers by the names that results use [SI, rad], moved into their sets."""
        return named_values(self.affine.domains, np.array(x, dtype=float))


def _share_left(maximum: float, norm: AffineNorm, x: ArrayLike) -> float:
    return float(maximum - norm.value(np.asarray(x, dtype=float))) / (abs(maximum) or 1.0)


def _slope_left(maximum: float, norm: AffineNorm, x: ArrayLike) -> Array:
    vector = np.asarray(x, dtype=float)
    return -norm.pullback(norm.subgradient(vector)) / (abs(maximum) or 1.0)


def objective_function(problem: Problem) -> ObjectiveFunction:
    """Return the objective of a problem as a function of its unbalances (`Problem.objective_function`)."""
    model = AffineModel(affine_problem_of(problem))
    affine = model.at(model.full_samples, finer=True)
    bounds = list(zip(*(side.tolist() for side in column_bounds(affine.domains)), strict=True))
    return ObjectiveFunction(affine, column_names(affine.domains), affine.start, bounds)
