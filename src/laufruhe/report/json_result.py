"""`result.json`, the contract with scripts: SI, full precision, null where there is nothing."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.balance_factor import balance_factors
from laufruhe.physics.modes import MOTIONS
from laufruhe.physics.static_cases import settled
from laufruhe.physics.torque import torque_facts
from laufruhe.physics.wrench import WRENCH
from laufruhe.present.measures import is_met, limits_of, moment_orders, mount_orders, places_of, shaking_orders
from laufruhe.present.mounting import facts_of, is_elastic
from laufruhe.problem.channels import LoadChannel, mounting_in
from laufruhe.problem.evaluation import Evaluation, measured, over, samples_of
from laufruhe.problem.static_load import static_part
from laufruhe.prove.certificate import Proof
from laufruhe.report.section import EXTENSION_SECTIONS
from laufruhe.report.strict_json import strict
from laufruhe.report.versions import versions
from laufruhe.report.wording import why_star
from laufruhe.solvers.result import Result
from laufruhe.solvers.stars.ranking import RankedStar
from laufruhe.solvers.values import Nearest, ObjectiveValue, Reached

Record = dict[str, Any]


def as_json(result: Result, series: bool = False) -> str:
    """Strict JSON, one line feed at its end."""
    return strict(as_dict(result, series))


def as_dict(result: Result, series: bool = False) -> Record:
    """The contract as plain Python values; with loads over the cycle where `series` are wanted."""
    problem = result.problem
    points = [_point(result, k) for k in range(len(problem.points))]
    # one operating point stands at the top already
    places = {"mounts": None} | {places.key: None for places in places_of(result)}
    own = ("name", "speed", "weight", "torque", *((*places, "shaking") if len(points) > 1 else ()))
    if series:
        own += ("series",)
        points = [{**point, "series": _series(result, k)} for k, point in enumerate(points)]
    return {
        "problem": problem.name,
        **_of(problem, "title source assumptions"),
        "status": str(result.status),
        **_of(result, "message conflict"),
        "objective": _objective(result),
        "certificate": _certificate(result),
        "decisions": {
            d.name: {
                **_of(d, "value unit lower upper at_bound initial shadow_price"),
                "tightening_price": d.price.tightened,
            }
            for d in result.decisions
        },
        "constraints": _constraints(result),
        **{key: _all_points(result, [point[key] for point in points]) for key in places},
        "shaking": max((point["shaking"] for point in points), key=_hardness),
        "points": [{key: point[key] for key in own} for point in points],
        **(_on_mounts(result) if is_elastic(result) else {}),
        **{
            name: section.record(result)
            for name, section in EXTENSION_SECTIONS.items()
            if section.record and section.applies(result)
        },
        **_running(result),
        **_phasing(result),
        **_ranks(result),
        **_reached(result),
        "fidelity": {
            # the crank inertia is null where the crank turns evenly
            **asdict(problem.fidelity),
            "measured_at": result.final.samples,
            "error_estimate": result.error_estimate,
        },
        "timing": dict(result.timing),
        "versions": versions(),
    }  # fmt: skip


def _of(thing: object, names: str) -> Record:
    """Attributes by their names; `key=name` stands under another key, and arrays and tuples become lists."""
    pairs = (name.partition("=") for name in names.split())
    return {key: _plain(getattr(thing, name or key)) for key, _, name in pairs}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def _running(result: Result) -> Record:
    """What of the engine itself a reader asks for, and what of it may be a slip."""
    engine = result.final.engine
    return {
        "balance_factors": [_of(one, "cylinders factor") for one in balance_factors(engine)],
        "firing_intervals": list(engine.firing_intervals),
        "warnings": [str(doubt) for doubt in result.problem.plausibility_warnings],
    }


def _objective(result: Result) -> Record | None:
    """Null where nothing is minimised; without a design its value alone is."""
    if result.objective is not None:
        part = static_part(result.problem, result.final)
        means = {} if part is None else asdict(part)
        return {**_of(result.objective, "name value unit initial reduction"), **means}
    given = ObjectiveValue.given(result.problem, result.initial)
    return None if given is None else {**_of(given, "name value unit initial"), "value": None, "reduction": None}


def _certificate(result: Result) -> Record:
    c = result.certificate
    if c is None:
        return {"kind": str(Proof.NONE), "lower_bound": None, "gap": None, "kkt_residual": None, "method": ""}
    return {"kind": str(c.kind), **_of(c, "lower_bound gap kkt_residual method")}


def _constraints(result: Result) -> list[Record]:
    return [
        {
            **_of(limit, "name value error_estimate limit side unit active"),
            "met": is_met(limit),
            "shadow_price": None if result.certificate is None else limit.shadow_price,
            "tightening_price": None if result.certificate is None else limit.price.tightened,
        }
        for limit in limits_of(result)
    ]


def _point(result: Result, k: int) -> Record:
    """One operating point; mounts are always there."""
    point, final = result.problem.points[k], result.final
    return {
        **_of(point, "name speed weight"),
        "mounts": [],
        **{places.key: _places(result, k, places.channel) for places in places_of(result)},
        "shaking": _shaking(final.loads[k].wrench),
        "torque": asdict(torque_facts(final.engine, point, result.problem.fidelity)),
    }


def _places(result: Result, k: int, channel: LoadChannel) -> list[Record]:
    forces = channel.signal(result.final.loads[k])
    before, after = measured(result.initial, k, channel), measured(result.final, k, channel)
    amplitudes = mount_orders(forces)
    kept = np.flatnonzero(np.any(amplitudes != 0.0, axis=1))
    return [
        {
            "name": name,
            **_of(after[m], "mean max rms"),
            "orders": [{"order": float(forces.orders[j]), "amplitude": float(amplitudes[j, m])} for j in kept],
            "initial": _of(before[m], "mean max rms"),
        }
        for m, name in enumerate(channel.places(result.final.engine))
    ]


def _series(result: Result, k: int) -> Record:
    """Loads of the design at the angles that it was measured at [rad], place by place, and of the wrench (C7)."""
    final, whole = result.final, result.final.engine.cycle.angle
    angles = whole * np.arange(final.samples) / final.samples
    wrench = over(final.engine.cycle.base_order, [final.loads[k].wrench])[0].sample(final.samples)
    return {
        "angle": _plain(angles),
        "components": list(WRENCH),
        "shaking": _plain(wrench),
        **{places.key: _plain(samples_of(final, k, places.channel)) for places in places_of(result)},
    }


def _shaking(wrench: Spectrum) -> Record:
    """Orders side by side with amplitudes, and with the complex coefficients of the wrench (C8)."""
    force, moment = shaking_orders(wrench)
    roll, rocking = moment_orders(wrench)
    kept = np.flatnonzero((force != 0.0) | (moment != 0.0))
    whole = wrench.coefficients[kept]
    found = {"orders": wrench.orders[kept], "force": force[kept], "moment": moment[kept],
             "roll": roll[kept], "rocking": rocking[kept], "components": tuple(WRENCH),
             "real": whole.real, "imag": whole.imag}  # fmt: skip
    return {key: _plain(value) for key, value in found.items()}


def _all_points(result: Result, mounts: list[list[Record]]) -> list[Record]:
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
    ]


def _over_points(entries: Any, share: Array) -> dict[str, float]:
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


def _hardness(shaking: Record) -> tuple[float, float]:
    """Largest force of an operating point and, without any, moment."""
    return max(shaking["force"], default=0.0), max(shaking["moment"], default=0.0)


def _modes(design: Evaluation) -> Record:
    facts = facts_of(design)
    return {
        **_of(facts.modes, "frequencies names loss_factors=loss"),
        "excited": [j in facts.excited for j in range(6)],
        "motions": list(MOTIONS),
        "energy": facts.modes.energy.T.tolist(),
        "shapes": facts.modes.shapes.T.tolist(),
        **_of(facts, "main_orders=orders static_sag=sag mount_sag mean_torque_travel=torque_travel"),
        **_of(facts, "torque_roll_axis torque_roll_coupling torque_roll_frequency with_fluid"),
    }


def _on_mounts(result: Result) -> Record:
    """Of a block on elastic mounts; travel of every mount, and the force on it, under each load held (C2)."""
    mounting, told = mounting_in(result.final.engine), "motion travel force on_stops"
    cases = {case.name: _of(settled(mounting, case), told) for case in result.final.engine.load_cases}
    return {"modes": _modes(result.final), **({"load_cases": cases} if cases else {})}


def _phasing(result: Result) -> Record:
    """`ranking` and `phasing` where stars and firing orders were open."""
    if result.phasing is None:
        return {}
    points = [_of(p, "allowed deviation value lower_bound throws kkt_residual") for p in result.phasing.trade]
    found = {
        **_of(result.phasing, "designs looked_at method even_value"),
        "trade": points,
        "why": why_star(result),
    }
    return {"ranking": [{"rank": k, **_star(star)} for k, star in enumerate(result.phasing.ranking, 1)],
            "phasing": found}  # fmt: skip


def _star(star: RankedStar) -> Record:
    names = "throws bank_angle split_pin_angle=split_pin shafts objective=value lower_bound proven orders "
    names += "free_force=forces free_couple=couples even firing_order_count=order_count"
    orders = [_of(order, "order neighbours longest_gap roll_content intervals") for order in star.firing_orders]
    return {**_of(star, names), "firing_orders": orders}


def _ranks(result: Result) -> Record:
    """`free_decisions`, and `objectives` where several were minimised in order: what each leaves equal."""
    names = "name unit initial least lower_bound gap final limit price"
    found = [
        {
            **_of(rank, names),
            "proof": str(rank.proof),
            "equal": [_of(d, "name unit low high") for d in rank.equal],
        }
        for rank in result.ranks
    ]
    free = None if result.free is None else [_of(one, "name unit low high") for one in result.free]
    return {"free_decisions": free, **({"objectives": found} if found else {})}


def _reached(result: Result) -> Record:
    """`reached` and `nearest` without a design: what each conflicting limit can reach, and what breaks limits least."""
    if result.status.has_design:
        return {}
    names, near, told = "name side limit unit value", result.nearest, "bound why ended"
    reached = [{**_of(one, f"{names} {told}"), "proof": str(one.proof), **_values(one)} for one in result.reached]
    return {"reached": reached, "nearest": near and {**_of(near, f"{names} excess broken"), **_values(near)}}


def _values(found: Reached | Nearest) -> Record:
    return {"decisions": {d.name: _of(d, "value unit") for d in found.decisions}}
