"""Write `result.json`: SI units, full precision, null for missing values."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict
from itertools import chain
from typing import Any

import numpy as np

from laufruhe.files.fields import FORMAT
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.balance_factor import balance_factors
from laufruhe.physics.gas_facts import gas_facts
from laufruhe.physics.modes import MOTIONS
from laufruhe.physics.rigid_body import WRENCH
from laufruhe.physics.static_cases import settled
from laufruhe.present.measures import is_met, limits_of, moment_orders, mount_orders, places_of, shaking_orders
from laufruhe.present.mounting import facts_of, is_elastic
from laufruhe.problem.channels import LoadChannel, mounting_in
from laufruhe.problem.evaluation import channel_samples, place_measures, with_common_base
from laufruhe.problem.static_load import static_part
from laufruhe.prove.certificate import Proof
from laufruhe.report.section import EXTENSION_SECTIONS
from laufruhe.report.strict_json import strict, versions
from laufruhe.report.wording import why_star
from laufruhe.solvers.result import Result
from laufruhe.solvers.values import AttainableLimit, NearestDesign, ObjectiveValue

Record = dict[str, Any]


def as_json(result: Result, series: bool = False) -> str:
    """Return the result as strict JSON with one line feed at its end."""
    return strict(as_dict(result, series))


def as_dict(result: Result, series: bool = False) -> Record:
    """Return the result as plain Python values; `series` adds loads over the cycle."""
    objective, result = _objective(result), result.at_own_points
    problem, engine, proof = result.problem, result.final.engine, result.certificate
    points = [_point(result, k) for k in range(len(problem.points))]
    # a single operating point is at the top level
    places = {"mounts": None} | {load.key: None for load in places_of(result)}
    added = [section.point_record for section in EXTENSION_SECTIONS.values()]
    of_points = [{key: entry for fill in added for key, entry in fill(result, k).items()} for k in range(len(points))]
    keys = ("name", "speed", "weight", "gas", *((*places, "shaking") if len(points) > 1 else ()))
    if series:
        keys += ("series",)
        points = [{**point, "series": _series(result, k)} for k, point in enumerate(points)]
    no_proof = {"kind": str(Proof.NONE), "lower_bound": None, "gap": None, "kkt_residual": None, "method": ""}
    return {
        "format": FORMAT,
        "problem": problem.name,
        **_attributes(problem, "title source assumptions"),
        "status": str(result.status),
        **_attributes(result, "message conflict"),
        "objective": objective,
        "certificate": {"kind": str(proof.kind), **_attributes(proof, "lower_bound gap kkt_residual method")}
        if proof else no_proof,
        "decisions": {
            d.name: {
                **_attributes(d, "value unit lower upper at_bound initial shadow_price"),
                "tightening_price": d.price.tightened,
            }
            for d in result.decisions
        },
        "constraints": [
            {
                **_attributes(limit, "name value error_estimate limit side unit active"),
                **({"window": list(limit.window)} if limit.window else {}),
                "met": is_met(limit),
                "shadow_price": limit.shadow_price if proof else None,
                "tightening_price": limit.price.tightened if proof else None,
            }
            for limit in limits_of(result)
        ],
        **{key: _all_points(result, [point[key] for point in points]) for key in places},
        "shaking": max(
            (point["shaking"] for point in points),
            key=lambda shaking: [max(shaking[load], default=0.0) for load in ("force", "moment")],
        ),
        "points": [
            {key: point[key] for key in keys if key in point} | entries
            for point, entries in zip(points, of_points, strict=True)
        ],
        **(_on_mounts(result) if is_elastic(result) else {}),
        **{
            name: section.record(result)
            for name, section in EXTENSION_SECTIONS.items()
            if section.record and section.applies(result)
        },
        "balance_factors": [_attributes(balance, "cylinders factor") for balance in balance_factors(engine)],
        "firing_intervals": list(engine.firing_intervals),
        "warnings": [str(warning) for warning in problem.plausibility_warnings],
        **_phasing(result),
        **_ranks(result),
        **_reached(result),
        "fidelity": {
            # the crank inertia is null where the crank turns evenly
            **asdict(problem.fidelity),
            "measured_at": result.final.samples,
            **_attributes(result, "error_estimate regret_bound"),
        },
        "timing": dict(result.timing),
        "versions": versions(),
        "problem_file": None if problem.origin is None else problem.to_toml(),
    }  # fmt: skip


def _attributes(thing: object, names: str) -> Record:
    pairs = (name.partition("=") for name in names.split())
    return {key: _plain(getattr(thing, name or key)) for key, _, name in pairs}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def _objective(result: Result) -> Record | None:
    if result.objective is not None:
        part = static_part(result.problem, result.final)
        means = {} if part is None else asdict(part)
        return {**_attributes(result.objective, "name value unit initial reduction"), **means}
    initial = ObjectiveValue.of_initial(result.problem, result.initial)
    if initial is None:
        return None
    return {**_attributes(initial, "name value unit initial"), "value": None, "reduction": None}


def _point(result: Result, k: int) -> Record:
    point, final = result.problem.points[k], result.final
    gas = gas_facts(final.engine, point, result.problem.fidelity)
    return {
        **_attributes(point, "name speed weight"),
        "mounts": [],
        **{load.key: _places(result, k, load) for load in places_of(result)},
        "shaking": _shaking(final.loads[k].wrench),
        **({"gas": {**asdict(gas), "recording": list(gas.recording)}} if gas else {}),
    }


def _places(result: Result, k: int, channel: LoadChannel) -> list[Record]:
    forces = channel.signal(result.final.loads[k])
    before, after = place_measures(result.initial, k, channel), place_measures(result.final, k, channel)
    amplitudes = mount_orders(forces)
    present = np.flatnonzero(np.any(amplitudes != 0.0, axis=1))
    return [
        {
            "name": name,
            **_attributes(after[m], "mean max rms"),
            "orders": [{"order": float(forces.orders[j]), "amplitude": float(amplitudes[j, m])} for j in present],
            "initial": _attributes(before[m], "mean max rms"),
        }
        for m, name in enumerate(channel.places(result.final.engine))
    ]


def _series(result: Result, k: int) -> Record:
    # loads at the sample angles [rad], place by place, and the wrench (C7)
    final, cycle = result.final, result.final.engine.cycle.angle
    angles = cycle * np.arange(final.samples) / final.samples
    wrench = with_common_base(final.engine.cycle.base_order, [final.loads[k].wrench])[0].sample(final.samples)
    return {
        "angle": _plain(angles),
        "components": list(WRENCH),
        "shaking": _plain(wrench),
        **{load.key: _plain(channel_samples(final, k, load)) for load in places_of(result)},
    }


def _shaking(wrench: Spectrum) -> Record:
    force, moment = shaking_orders(wrench)
    roll, rocking = moment_orders(wrench)
    present = np.flatnonzero((force != 0.0) | (moment != 0.0))
    coefficients = wrench.coefficients[present]
    entry = {"orders": wrench.orders[present], "force": force[present], "moment": moment[present],
             "roll": roll[present], "rocking": rocking[present], "components": tuple(WRENCH),
             "real": coefficients.real, "imag": coefficients.imag}  # fmt: skip
    return {key: _plain(value) for key, value in entry.items()}


def _all_points(result: Result, mounts: list[list[Record]]) -> list[Record]:
    """Return mounts over all operating points: weighted mean and RMS, largest maximum and orders."""
    if len(mounts) == 1:
        return mounts[0]
    share = np.array([point.weight for point in result.problem.points])
    share = share / share.sum()
    return [
        {
            "name": entries[0]["name"],
            **_over_points(entries, share),
            "orders": _largest_orders(chain(*(entry["orders"] for entry in entries))),
            "initial": _over_points([entry["initial"] for entry in entries], share),
        }
        for entries in zip(*mounts, strict=True)
    ]


def _over_points(entries: Any, share: Array) -> dict[str, float]:
    return {
        "mean": float(share @ [entry["mean"] for entry in entries]),
        "max": max(entry["max"] for entry in entries),
        "rms": math.sqrt(float(share @ [entry["rms"] ** 2 for entry in entries])),
    }


def _largest_orders(entries: Iterable[dict[str, float]]) -> list[dict[str, float]]:
    largest: dict[float, float] = {}
    for entry in entries:
        largest[entry["order"]] = max(largest.get(entry["order"], 0.0), entry["amplitude"])
    return [{"order": order, "amplitude": largest[order]} for order in sorted(largest)]


def _on_mounts(result: Result) -> Record:
    facts, mounting = facts_of(result.final), mounting_in(result.final.engine)
    modes = {
        **_attributes(facts.modes, "frequencies names loss_factors=loss"),
        "excited": [j in facts.excited for j in range(6)],
        "motions": list(MOTIONS),
        "energy": facts.modes.energy.T.tolist(),
        "shapes": facts.modes.shapes.T.tolist(),
        **_attributes(facts, "main_orders=orders static_sag=sag mount_sag mean_torque_travel=torque_travel"),
        **_attributes(facts, "torque_roll_axis torque_roll_coupling torque_roll_frequency with_fluid"),
    }
    names = "motion travel force on_stops"
    cases = {case.name: _attributes(settled(mounting, case), names) for case in result.final.engine.load_cases}
    return {"modes": modes, **({"load_cases": cases} if cases else {})}


def _phasing(result: Result) -> Record:
    if result.phasing is None:
        return {}
    trade = [_attributes(p, "allowed deviation value lower_bound throws kkt_residual") for p in result.phasing.trade]
    names = "throws bank_angle split_pin_angle=split_pin shafts objective=value lower_bound proven orders "
    names += "free_force=forces free_couple=couples even firing_order_count=order_count"
    of_order = "order neighbours longest_gap roll_content intervals"
    ranking = [
        {
            "rank": rank,
            **_attributes(star, names),
            "firing_orders": [_attributes(order, of_order) for order in star.firing_orders],
        }
        for rank, star in enumerate(result.phasing.ranking, 1)
    ]
    summary = _attributes(result.phasing, "designs looked_at method even_value")
    return {"ranking": ranking, "phasing": {**summary, "trade": trade, "why": why_star(result)}}


def _ranks(result: Result) -> Record:
    ranges = "name unit low high"
    entries = [
        {
            **_attributes(rank, "name unit initial least=minimum lower_bound gap final limit price"),
            "proof": str(rank.proof),
            "equal": [_attributes(decision, ranges) for decision in rank.equal],
        }
        for rank in result.ranks
    ]
    free = None if result.free is None else [_attributes(decision, ranges) for decision in result.free]
    return {"free_decisions": free, **({"objectives": entries} if entries else {})}


def _reached(result: Result) -> Record:
    if result.status.has_design:
        return {}
    names, nearest = "name side limit unit value", result.nearest
    reached = [
        {**_attributes(limit, f"{names} bound why ended"), "proof": str(limit.proof), **_values(limit)}
        for limit in result.reached
    ]
    return {
        "reached": reached,
        "nearest": nearest and {**_attributes(nearest, f"{names} excess=violation broken"), **_values(nearest)},
    }


def _values(design: AttainableLimit | NearestDesign) -> Record:
    return {"decisions": {d.name: _attributes(d, "value unit") for d in design.decisions}}
