"""`result.json`, the contract with scripts: SI, full precision, null where there is nothing."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from laufruhe.machine import OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.metrics import CycleMeasures
from laufruhe.physics.shaking_loads import WRENCH
from laufruhe.present.measures import (
    PRESENT,
    is_met,
    limits_of,
    mount_orders,
    shaking_orders,
)
from laufruhe.present.mounting import is_elastic, modes_as_dict
from laufruhe.problem.evaluation import measured
from laufruhe.prove.certificate import Proof
from laufruhe.report.ranking import phasing_record
from laufruhe.report.strict_json import strict
from laufruhe.report.versions import versions
from laufruhe.solvers.mount_result import objective_of
from laufruhe.solvers.result import Result


def as_json(result: Result) -> str:
    """Strict JSON, one line feed at its end."""
    return strict(as_dict(result))


def as_dict(result: Result) -> dict[str, Any]:
    """The contract as plain Python values."""
    problem, engine = result.problem, result.final.engine
    points = [_point(result, k, point) for k, point in enumerate(problem.points)]
    # one operating point stands at the top already
    own = ("name", "speed", "weight") if len(points) == 1 else ("name", "speed", "weight", "mounts", "shaking")
    return {
        "problem": problem.name,
        "title": problem.title,
        "source": problem.source,
        "assumptions": list(problem.assumptions),
        "status": str(result.status),
        "message": result.message,
        "conflict": list(result.conflict),
        "objective": _objective(result),
        "certificate": _certificate(result),
        "decisions": _decisions(result),
        "constraints": _constraints(result),
        "mounts": _all_points(result, [point["mounts"] for point in points]),
        "shaking": _largest([point["shaking"] for point in points]),
        "points": [{key: point[key] for key in own} for point in points],
        **({"modes": modes_as_dict(result.final)} if is_elastic(result) else {}),
        "firing_intervals": list(engine.firing_intervals),
        **phasing_record(result),
        "fidelity": {
            # the crank inertia is null where the crank turns evenly
            **asdict(problem.fidelity),
            "measured_at": result.final.samples,
            "error_estimate": result.error_estimate,
        },
        "timing": dict(result.timing),
        "versions": versions(),
    }


def _objective(result: Result) -> dict[str, Any] | None:
    """Null where nothing is minimised; without a design its value alone is."""
    o = result.objective
    if o is not None:
        return {"name": o.name, "value": o.value, "unit": o.unit, "initial": o.initial, "reduction": o.reduction}
    given = objective_of(result.problem, result.initial, result.initial)
    if given is None:
        return None
    return {"name": given.name, "value": None, "unit": given.unit, "initial": given.initial, "reduction": None}


def _certificate(result: Result) -> dict[str, Any]:
    c = result.certificate
    if c is None:
        return {"kind": str(Proof.NONE), "lower_bound": None, "gap": None, "kkt_residual": None, "method": ""}
    return {
        "kind": str(c.kind),
        "lower_bound": c.lower_bound,
        "gap": c.gap,
        "kkt_residual": c.kkt_residual,
        "method": c.method,
    }


def _decisions(result: Result) -> dict[str, Any]:
    return {
        d.name: {
            "value": d.value,
            "unit": d.unit,
            "lower": d.lower,
            "upper": d.upper,
            "at_bound": d.at_bound,
            "initial": d.initial,
            "shadow_price": d.shadow_price,
        }
        for d in result.decisions
    }


def _constraints(result: Result) -> list[dict[str, Any]]:
    priced = result.certificate is not None
    return [
        {
            "name": limit.name,
            "value": limit.value,
            "limit": limit.limit,
            "side": limit.side,
            "unit": limit.unit,
            "active": limit.active,
            "met": is_met(limit),
            "shadow_price": limit.shadow_price if priced else None,
        }
        for limit in limits_of(result)
    ]


def _point(result: Result, k: int, point: OperatingPoint) -> dict[str, Any]:
    return {
        "name": point.name,
        "speed": point.speed,
        "weight": point.weight,
        "mounts": _mounts(result, k),
        "shaking": _shaking(result.final.loads[k].wrench),
    }


def _mounts(result: Result, k: int) -> list[dict[str, Any]]:
    forces = result.final.loads[k].mount_forces
    if forces is None:
        return []
    before, after = measured(result.initial, k), measured(result.final, k)
    amplitudes = mount_orders(forces)
    kept = np.flatnonzero(np.any(amplitudes > PRESENT * amplitudes.max(initial=0.0), axis=1))
    return [
        {
            "name": name,
            **_measures(after[m]),
            "orders": [
                {"order": float(forces.orders[j]), "amplitude": float(amplitudes[j, m])} for j in kept
            ],
            "initial": _measures(before[m]),
        }
        for m, name in enumerate(result.final.mount_names)
    ]  # fmt: skip


def _measures(measures: CycleMeasures) -> dict[str, float]:
    return {"mean": measures.mean, "max": measures.max, "rms": measures.rms}


def _shaking(wrench: Spectrum) -> dict[str, Any]:
    """Orders side by side with amplitudes, and with the complex coefficients of the wrench (C8)."""
    force, moment = shaking_orders(wrench)
    present = (force > PRESENT * force.max(initial=0.0)) | (moment > PRESENT * moment.max(initial=0.0))
    kept = np.flatnonzero(present)
    return {
        "orders": wrench.orders[kept].tolist(),
        "force": force[kept].tolist(),
        "moment": moment[kept].tolist(),
        "components": list(WRENCH),
        "real": wrench.coefficients[kept].real.tolist(),
        "imag": wrench.coefficients[kept].imag.tolist(),
    }


def _all_points(result: Result, mounts: list[list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Mounts over all operating points: weighted mean and RMS, largest maximum and orders."""
    if len(mounts) == 1:
        return mounts[0]
    share = np.array([point.weight for point in result.problem.points])
    share = share / share.sum()
    return [
        {
            "name": same[0]["name"],
            **_over_points(same, share),
            "orders": _largest_orders([entry["orders"] for entry in same]),
            "initial": _over_points([entry["initial"] for entry in same], share),
        }
        for same in zip(*mounts, strict=True)
    ]  # fmt: skip


def _over_points(entries: Any, share: Any) -> dict[str, float]:
    return {
        "mean": float(share @ [entry["mean"] for entry in entries]),
        "max": max(entry["max"] for entry in entries),
        "rms": math.sqrt(float(share @ [entry["rms"] ** 2 for entry in entries])),
    }


def _largest_orders(lists: list[list[dict[str, float]]]) -> list[dict[str, float]]:
    found: dict[float, float] = {}
    for entry in (entry for orders in lists for entry in orders):
        found[entry["order"]] = max(found.get(entry["order"], 0.0), entry["amplitude"])
    return [{"order": order, "amplitude": found[order]} for order in sorted(found)]


def _largest(shaking: list[dict[str, Any]]) -> dict[str, Any]:
    """Shaking loads of the operating point with the largest force or, without any, moment."""
    return max(shaking, key=lambda s: (max(s["force"], default=0.0), max(s["moment"], default=0.0)))
