"""Random problems of two kinds of open numbers together, and the judges of those that the others do not know."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.optimize import minimize

from attack.families import (
    SMOOTH,
    Generator,
    angle,
    balancers,
    block,
    counterweights,
    crankcase,
    elastic_mounts,
    inline,
    leads,
    mechanism,
    moving_mass,
    of_unbalances,
    opened_stiffness,
    points,
    q,
    rigid_mounts,
    sizes,
    spaced,
    star_of,
    unit_of,
    with_objective,
)
from attack.openings import Openings
from attack.own_families import objective, open_numbers, random_load, scene
from attack.own_problem import OwnModel
from attack.plain_loads import number
from attack.plain_scene import Scene, Table
from attack.rivals import EXCESS, Rival, convex_rival, local_rival, stars_of

WIDE = {"between": ["-0.2 m", "0.2 m"]}


def weights(rng: Generator, table: Table, count: int) -> list[Table]:
    """Return the counterweights of any angle that may be nothing."""
    rows = counterweights(rng, moving_mass(table["engine"]), count)
    for entry in rows:
        entry["angle"] = {"between": [0, 360]}
        entry["mass"]["between"][0] = "0.0 kg"
    return rows


def star_engine(rng: Generator) -> Table:
    return star_of({"layout": "inline", **mechanism(rng), **spaced(rng)}, int(rng.integers(3, 5)))


def elastic(rng: Generator, engine: Table) -> Table:
    return {
        "engine": engine, "operating_points": points(rng, 2, 60.0, 300.0), "block": block(rng),
        "mounts": elastic_mounts(rng),
    }  # fmt: skip


def on_mounts(rng: Generator, table: Table) -> Table:
    return with_objective(rng, table, 1, channels=("mount force", "mount travel"), norms=SMOOTH)


# --- judged by the own model of elastic mounts


def at_a_share(rng: Generator, table: Table, entry: Table) -> Table:
    """Return a limit on a measure, a little over what a random design has, or under what most have."""
    model = OwnModel(table, 256, 1e-9)
    low, high = model.box.T
    has = model.designs(low + (high - low) * rng.random((20, len(low)))).measure(entry)
    maximum = has[0] * rng.uniform(1.0, 1.1) if rng.random() < 0.6 else np.quantile(has, rng.uniform(0.05, 0.4))
    unit = {"transmissibility": "", "static sag": "m", "motion frequencies": "Hz"}[entry["quantity"]]
    rest = {key: value for key, value in entry.items() if key != "quantity"}
    return {
        "limit": entry["quantity"],
        "max": q(float(maximum), unit, 9) if unit else float(f"{maximum:.9g}"), "name": "l0",
        **rest,
    }  # fmt: skip


def transmissibility_and_weights(rng: Generator) -> Table:
    table = scene(rng, 2, True)
    table["counterweights"] = weights(rng, table, int(rng.integers(1, 3)))
    table["objective"] = objective(random_load(rng, table))
    entry = {"quantity": "transmissibility", **({"orders": [1]} if rng.random() < 0.5 else {})}
    return {**table, "constraints": [at_a_share(rng, table, entry)]}


def damper_and_weights(rng: Generator) -> Table:
    table = scene(rng, 2, True)
    open_numbers(rng, table, ["damping"])
    table["counterweights"] = weights(rng, table, 1)
    return {**table, "objective": objective(random_load(rng, table)), "search": {"boxes": 20, "starts": 5}}


def sag_and_weights(rng: Generator) -> Table:
    """Return the weights beside stiffness under a limit on static sag."""
    table = scene(rng, 2, True)
    open_numbers(rng, table, ["stiffness"] * int(rng.integers(1, 3)))
    table["counterweights"] = weights(rng, table, 1)
    table["objective"] = objective(random_load(rng, table))
    limit = at_a_share(rng, table, {"quantity": "static sag"})
    return {**table, "constraints": [limit], "search": {"boxes": 20, "starts": 5}}


def motion_frequency_and_stiffness(rng: Generator) -> Table:
    """Return the stiffness under a limit on the frequency of a motion, which no bound knows."""
    table = scene(rng, 2, True)
    open_numbers(rng, table, ["stiffness"] * int(rng.integers(1, 4)))
    table["objective"] = objective(random_load(rng, table))
    motion = str(rng.choice(["roll", "bounce", "pitch", "lateral"]))
    limit = at_a_share(rng, table, {"quantity": "motion frequencies", "motions": [motion]})
    return {**table, "constraints": [limit], "search": {"starts": 5}}


# --- judged by the plain model


def stars_on_mounts(rng: Generator) -> Table:
    table = elastic(rng, star_engine(rng))
    opened_stiffness(rng, table["mounts"], int(rng.integers(1, 3)))
    return {**on_mounts(rng, table), "search": {"boxes": 20, "starts": 4}}


def between_bounds(rng: Generator, count: int) -> list[Any]:
    angles: list[Any] = [0.0, *(round(360.0 * k / count + rng.uniform(-15.0, 15.0), 3) for k in range(1, count))]
    for k in rng.choice(count - 1, int(rng.integers(1, 3)), replace=False) + 1:
        wide = rng.uniform(5.0, 40.0)
        angles[k] = {"between": [round(angles[k] - wide, 3), round(angles[k] + wide, 3)]}
    return angles


def uneven_and_stiffness(rng: Generator) -> Table:
    table = elastic(rng, {"layout": "inline", **mechanism(rng), **spaced(rng), "throws": [0.0]})
    table["engine"]["throws"] = between_bounds(rng, int(rng.integers(3, 5)))
    opened_stiffness(rng, table["mounts"], int(rng.integers(1, 3)))
    # boxes of throws are many and take some milliseconds each
    return {**on_mounts(rng, table), "search": {"starts": 4}}


def places_and_bearings(rng: Generator) -> Table:
    """Draw open places of weights on the crank, with loads of its main bearings."""
    table = crankcase(rng)
    table.pop("constraints", None)
    table.pop("torsion", None)
    table["counterweights"] = table["counterweights"][:2]
    table["counterweights"][0]["x"] = dict(WIDE)
    return with_objective(rng, table, 1, channels=("main-bearing force", "mount force"), norms=SMOOTH)


def sizes_and_places(rng: Generator) -> Table:
    table = sizes(rng)
    if "balancer_shafts" not in table:
        table["balancer_shafts"] = balancers(rng, 1.5 * moving_mass(table["engine"]), 1)
    table["balancer_shafts"][0]["position"][int(rng.integers(0, 2))] = dict(WIDE)
    return table


def leads_and_places(rng: Generator) -> Table:
    table = leads(rng)
    while "gas" in table:
        table = leads(rng)
    table.pop("constraints", None)
    table["counterweights"] = weights(rng, table, 1)
    table["counterweights"][0] |= {"shaft": "led 0", "x": dict(WIDE)}
    return with_objective(rng, table, 1, norms=SMOOTH)


def pistons_and_stars(rng: Generator) -> Table:
    """Return an engine with open reciprocating masses and an open star, with weights given or open."""
    engine = star_engine(rng)
    mass = number(engine["reciprocating_mass"])
    table: Table = {"engine": engine, "operating_points": points(rng), "mounts": rigid_mounts(rng)}
    table["counterweights"] = weights(rng, table, 1)
    if rng.random() < 0.6:
        table["counterweights"][0] |= {"mass": table["counterweights"][0]["mass"]["between"][1], "angle": angle(rng)}
    engine["reciprocating_mass"] = {
        "between": [q(0.6 * mass, "kg"), q(1.6 * mass, "kg")], "start": q(mass, "kg")
    }  # fmt: skip
    return with_objective(rng, table, 1)


def optional_and_uneven(rng: Generator) -> Table:
    """Draw a problem of which one of two shafts may be built, with throws between bounds."""
    engine = {"layout": "inline", **mechanism(rng), **spaced(rng)}
    engine["throws"] = between_bounds(rng, int(rng.integers(3, 5)))
    shafts = balancers(rng, moving_mass(engine), 2)
    for shaft in shafts:
        shaft["optional"] = True
    table = {
        "engine": engine, "operating_points": points(rng), "mounts": rigid_mounts(rng), "balancer_shafts": shafts,
        "phasing": {"most_shafts": int(rng.integers(1, 3))},
    }  # fmt: skip
    return with_objective(rng, table, 1, norms=SMOOTH)


def ranks_with_limits(rng: Generator) -> Table:
    table = of_unbalances(inline)(rng)
    del table["objective"]
    table["objective"] = [with_objective(rng, table, 1)["objective"] for _ in range(2)]
    openings = Openings({**table, "objective": table["objective"][0]})
    scene_of = openings.scene(openings.random(rng))
    limits = []
    for name in rng.choice(["added mass", "rms rocking couple", "maximum shaking force"], 1):
        has = scene_of.measure({"quantity": str(name)}) * rng.uniform(1.0, 1.3)
        limits.append({"limit": str(name), "max": q(has, unit_of(str(name)), 9), "name": "l0"})
    return {**table, "constraints": limits}


SPREAD = 0.05
STEEP_CHARGE = 1e5
"""Share of the objective that a limit of a rank is worth per share of its excess, at most."""


def robust_and_star(rng: Generator) -> Table:
    """Return the worst case of weights that weigh more or less, beside a star."""
    engine = star_engine(rng)
    table: Table = {"engine": engine, "operating_points": points(rng), "mounts": rigid_mounts(rng)}
    table["counterweights"] = weights(rng, table, int(rng.integers(1, 3)))
    for entry in table["counterweights"]:
        entry["mass"]["tolerance"] = f"± {100.0 * SPREAD:g} %"
    return {**with_objective(rng, table, 1), "robust": {"over": "worst case"}}


PLAIN_CROSSINGS = {
    "stars on mounts": stars_on_mounts,
    "uneven throws and stiffness": uneven_and_stiffness,
    "places and bearings": places_and_bearings,
    "sizes and places": sizes_and_places,
    "leads and places": leads_and_places,
    "pistons and stars": pistons_and_stars,
    "optional shafts and uneven throws": optional_and_uneven,
    "ranks with limits": ranks_with_limits,
    "robust and star": robust_and_star,
}
OWN_CROSSINGS = {
    "transmissibility and weights": transmissibility_and_weights,
    "damper and weights": damper_and_weights,
    "sag and weights beside stiffness": sag_and_weights,
    "motion frequency and stiffness": motion_frequency_and_stiffness,
}
CROSSINGS = {**PLAIN_CROSSINGS, **OWN_CROSSINGS}


# --- rivals


def choices(table: Table) -> Iterator[Table]:
    """Yield the table with every choice of its optional shafts, as many as may be built."""
    shafts = table.get("balancer_shafts", [])
    optional = [k for k, shaft in enumerate(shafts) if shaft.get("optional")]
    maximum = min(table.get("phasing", {}).get("most_shafts", len(optional)), len(optional))
    for built in itertools.combinations(optional, maximum):
        built_shafts = [shaft for k, shaft in enumerate(shafts) if k not in optional or k in built]
        yield {**table, "balancer_shafts": built_shafts}


def best_of_choices(
    table: Table, rng: Generator, known: tuple[np.ndarray, Table], calls: int, target: float
) -> Rival | None:
    """Return the best design of all stars and choices of shafts, each by its own search; None if they are many."""
    every = [(Openings(one), star) for one in choices(table) for star in stars_of(Openings(one))]
    if not every or len(every) > calls // 60:
        return None
    rivals = []
    for openings, star in every:
        start = openings.nearest(np.zeros(openings.size))
        if openings.numbers:
            alike = np.allclose(star.get("throws", 0.0), known[1].get("throws", 0.0), atol=1e-6)
            near = [known[0]] if len(known[0]) == openings.size and alike else []
            rivals.append(local_rival(openings, rng, [start, *near], calls // len(every) + 60, star))
        else:
            rivals.append(convex_rival(openings, start, star, target))
    feasible = [rival for rival in rivals if rival.violation <= EXCESS]
    return min(feasible, key=lambda rival: rival.value) if feasible else min(rivals, key=lambda rival: rival.violation)


# --- judges of their own


def worst(openings: Openings, vector: np.ndarray, star: Table) -> float:
    """Return the most that an engine has whose weights are as much too heavy or too light as they may be."""
    scene = openings.scene(openings.nearest(vector.copy()), star)
    counterweights = [k for k, rotor in enumerate(scene.rotors) if rotor[6] == "c"]
    values = []
    for signs in itertools.product((-1.0, 1.0), repeat=len(counterweights)):
        rotors = list(scene.rotors)
        for k, sign in zip(counterweights, signs, strict=True):
            rotors[k] = (*rotors[k][:4], rotors[k][4] * (1.0 + SPREAD * sign), *rotors[k][5:])
        values.append(Scene(scene.table, rotors, scene.order).objective)
    return max(values)


def judge_robust(verdict: Any, table: Table, result: Any, maximum: int) -> None:
    openings = Openings(table)
    vector, star = openings.read(result.final.engine, {d.name: d.value for d in result.decisions})
    value, bound = result.objective.value, result.certificate.lower_bound
    recomputed = worst(openings, vector, star)
    reading, floor = 2e-5 + result.error_estimate, 1e-9 * result.objective.initial
    if abs(recomputed - value) > 1.5 * reading * value + floor:
        verdict.wrong.append(f"worst case {value:.9g} is {recomputed:.9g}")
    best = recomputed
    for choice in stars_of(openings):
        for start in (openings.nearest(np.zeros(openings.size)), vector):
            optimum = minimize(
                lambda x, choice=choice: worst(openings, x, choice), start, method="Nelder-Mead",
                options={"maxfev": 20 * maximum},
            )  # fmt: skip
            best = min(best, float(optimum.fun))
            verdict.rivals += int(optimum.nfev)
    if bound > best * (1.0 + reading) + floor:
        verdict.wrong.append(f"bound {bound:.9g}, a rival has {best:.9g}")
    if verdict.kind == "global" and value > best * (1.0 + 1e-4 + reading) + floor:
        verdict.wrong.append(f"global {value:.9g}, a rival has {best:.9g}")


def judge_ranks(verdict: Any, table: Table, result: Any) -> None:
    """Check each rank under the limits and the values that earlier ranks leave it."""
    limits = list(table.get("constraints", []))
    openings = Openings({**table, "objective": table["objective"][0]})
    vector, _ = openings.read(result.final.engine, {d.name: d.value for d in result.decisions})
    reading = 3e-5 + result.error_estimate
    for entry, rank in zip(table["objective"], result.ranks, strict=True):
        stage = Openings({**copy.deepcopy(table), "objective": entry, "constraints": list(limits)})
        scene = stage.scene(vector, {})
        floor = 1e-9 * max(rank.initial, rank.final)
        if abs(scene.objective - rank.final) > reading * max(rank.final, scene.objective) + floor:
            verdict.wrong.append(f"{rank.name} is said to be {rank.final:.9g} and is {scene.objective:.9g}")
        if scene.worst > 3e-5:
            verdict.wrong.append(f"a limit is passed by {scene.worst:.2e} of itself")
        rival = convex_rival(stage, vector, {}, rank.minimum * (1.0 - 2e-5), STEEP_CHARGE)
        verdict.rivals += rival.looked_at
        if rival.violation <= EXCESS:
            # the excess over a limit costs: near the best of an earlier rank any share has a price
            best = rival.value * (1.0 + STEEP_CHARGE * max(rival.violation, 0.0))
            if rank.lower_bound > best * (1.0 + reading) + floor:
                verdict.wrong.append(f"{rank.name}: bound {rank.lower_bound:.9g}, a rival has {best:.9g}")
            if str(rank.proof) == "global" and rank.minimum > best * (1.0 + 1e-4 + reading) + floor:
                verdict.wrong.append(f"{rank.name}: global {rank.minimum:.9g}, a rival has {best:.9g}")
        if rank.limit is not None:
            quantity = entry["minimise"]
            rest = {key: value for key, value in entry.items() if key != "minimise"}
            limits.append({"limit": quantity, "max": q(rank.limit, unit_of(quantity), 15), "name": "rank", **rest})
