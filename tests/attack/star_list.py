"""List of the even stars of a problem with open throws, by all ways to stand on the steps of even firing."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator

from attack.openings import is_open
from attack.plain_loads import dead_centres, machine, turns_of
from attack.plain_scene import Table


def angles_of(engine: Table) -> Iterator[tuple[float, float]]:
    """Yield bank and split pin [deg] for which cylinders of one throw can fire evenly; one of the two may be open."""
    turns = 2 if engine["cycle"] == "four-stroke" else 1
    step = 360.0 * math.gcd(turns, engine["cylinders"]) / engine["cylinders"]
    bank, split = engine["bank_angle"], engine.get("split_pin_angle", 0.0)
    if not is_open(bank) and not is_open(split):
        yield bank, split
        return
    low, high = (bank if is_open(bank) else split)["between"]
    other = split if is_open(bank) else bank
    for k in range(math.ceil((low + other - 1e-6) / step), math.floor((high + other + 1e-6) / step) + 1):
        free = min(max(k * step - other, low), high)
        yield (free, other) if is_open(bank) else (other, free)


def even_stars(engine: Table) -> Iterator[Table]:
    """Yield the keys of [engine] for all stars that fire evenly; cylinder 1 fires at 0."""
    turns, count = turns_of(engine), int(engine["cylinders"])
    if engine["layout"] == "inline" and {"single_cylinders", "row_angle"} & engine.keys():
        yield from fired_stars(engine, turns, count)
        return
    steps = count // math.gcd(turns, count)
    if engine["layout"] != "vee":
        for places in _stands(steps, count, [0], count // steps):
            yield {"throws": [360.0 * k / steps for k in places]}
        return
    for bank, split in angles_of(engine):
        steps_apart = (bank + split) * steps / 360.0
        if abs(steps_apart - round(steps_apart)) > 1e-6:
            continue
        first = 0.5 * (bank + split)
        for places in _stands(steps, count // 2, [0, round(steps_apart) % steps], count // steps):
            angles = [first + 360.0 * k / steps for k in places]
            yield {"throws": angles, "bank_angle": bank, "split_pin_angle": split}


def fired_stars(engine: Table, turns: int, count: int) -> Iterator[Table]:
    """Yield cylinders in line that differ, by their firing order, which turns every throw."""
    upright = machine({**engine, "throws": [0.0] * count, "firing_order": None}).mechanisms
    centres = [math.degrees(m.bank + top) for m, top in zip(upright, dead_centres(list(upright)), strict=True)]
    fires = [360.0 * turns * slot / count for slot in range(count)]
    seen = set()
    for rest in itertools.permutations(range(2, count + 1)):
        order = [1, *rest]
        at = tuple(fires[order.index(n)] % 360.0 for n in range(1, count + 1))
        # order counts for gas alone
        if "bore" in engine or at not in seen:
            seen.add(at)
            throws = [(c - a) % 360.0 for c, a in zip(centres, at, strict=True)]
            yield {"throws": throws, "firing_order": order}


def _stands(steps: int, throws: int, offsets: list[int], count: int) -> Iterator[tuple[int, ...]]:
    """Yield the steps of all throws, the first at 0, so that every step has as many dead centres."""
    for rest in itertools.product(range(steps), repeat=throws - 1):
        places = (0, *rest)
        fired = Counter((p + o) % steps for p in places for o in offsets)
        if all(fired[s] == count for s in range(steps)):
            yield places
